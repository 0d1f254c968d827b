"""The door to PedPy, which is optional: importing this module without it says how to install it."""

from __future__ import annotations

from crowdsim.errors import CrowdSimError

try:
    import pandas
    import pedpy
except ImportError:
    raise CrowdSimError("analyses need PedPy; install it with: pip install 'crowdsim[analysis]'") from None

__all__ = ["pandas", "pedpy"]
