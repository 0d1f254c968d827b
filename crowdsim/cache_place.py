"""The folder of cached files that take long to make: compiled kernels and motion maps."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path


def cache_base() -> Path:
    """Return the cache folder: ``CROWDSIM_CACHE``, else the user's cache folder, else one for temporary files.

    The user's cache folder is ``$XDG_CACHE_HOME/crowdsim``, else ``~/.cache/crowdsim``. XDG_CACHE_HOME counts only if
    it is absolute, as its specification requires: a relative path would depend on the working directory.
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
    return temporary_base()  # no home folder: some containers run as a user id without an account


def temporary_base() -> Path:
    """Return a folder for this user in the system's folder of temporary files."""
    return Path(tempfile.gettempdir()) / f"crowdsim-{os.getuid()}"
