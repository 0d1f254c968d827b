"""Where compiled kernels, motion maps and what else takes long to make are kept."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path


def cache_base() -> Path:
    """The folder that CROWDSIM_CACHE names, else ``crowdsim`` in the user's folder of caches, else of temporary files.

    XDG_CACHE_HOME counts only if it is absolute, as its specification says: what is empty or relative would be a folder
    of wherever a command happens to run.
    """
    asked = os.environ.get("CROWDSIM_CACHE")
    if asked:
        return Path(asked).absolute()
    caches = os.environ.get("XDG_CACHE_HOME", "")
    if os.path.isabs(caches):
        return Path(caches) / "crowdsim"
    home = os.path.expanduser("~")
    if os.path.isabs(home):
        return Path(home) / ".cache" / "crowdsim"
    return temporary_base()  # a user without a home, whom the system may not even know


def temporary_base() -> Path:
    """A folder of this user among temporary files."""
    return Path(tempfile.gettempdir()) / f"crowdsim-{os.getuid()}"
