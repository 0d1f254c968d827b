"""Import PedPy and pandas for all of the analysis: they are optional; without them this says how to install them."""

from __future__ import annotations

from crowdsim.errors import CrowdSimError

try:
    import pandas
    import pedpy
except ImportError:
    raise CrowdSimError("analyses need PedPy; install it with: pip install 'crowdsim[analysis]'") from None

__all__ = ["pandas", "pedpy"]
