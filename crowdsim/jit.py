"""The one door to numba: every compiler option of the engine stands here once.

Kernels are compiled on first call and kept in a cache folder. numba's own cache notices an edit in
the file that holds a kernel but not one in a module that the kernel calls, so the folder's name is a hash
of all kernel sources, the numba version and the options: an edit anywhere starts a new folder.
"""

from __future__ import annotations

import hashlib
import os
import tempfile
from pathlib import Path

import numba
from numba import njit, prange

__all__ = ["cache_folder", "is_cold", "kernel", "parallel_kernel", "prange"]

_OPTIONS = {"cache": True, "fastmath": False, "error_model": "numpy", "boundscheck": False}


def _sources_key() -> str:
    digest = hashlib.sha256(f"{numba.__version__} {sorted(_OPTIONS.items())}".encode())
    package = Path(__file__).parent
    for path in sorted(package.rglob("*_kernels.py")) + [Path(__file__)]:
        digest.update(str(path.relative_to(package)).encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def _choose_cache_folder() -> Path:
    asked = os.environ.get("CROWDSIM_CACHE")
    base = Path(asked) if asked else Path(os.environ.get("XDG_CACHE_HOME", "~/.cache")).expanduser() / "crowdsim"
    folder = base / "kernels" / _sources_key()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        probe = folder / f".probe-{os.getpid()}"
        probe.touch()
        probe.unlink()
    except OSError:
        folder = Path(tempfile.gettempdir()) / f"crowdsim-{os.getuid()}" / "kernels" / _sources_key()
        folder.mkdir(parents=True, exist_ok=True)
    return folder


_FOLDER = _choose_cache_folder()
numba.config.CACHE_DIR = str(_FOLDER)


def cache_folder() -> Path:
    """Folder that holds the compiled kernels of exactly these sources."""
    return _FOLDER


def is_cold() -> bool:
    """Whether no kernel of these sources was compiled on this machine yet."""
    return not any(_FOLDER.rglob("*.nbi"))


kernel = njit(nogil=True, **_OPTIONS)
"""Decorator of a serial kernel: releases the GIL, callable from worker threads."""

parallel_kernel = njit(parallel=True, **_OPTIONS)
"""Decorator of a kernel with ``prange`` loops: called on the simulation's own thread only."""
