"""The one door to numba: every compiler option of the engine stands here once.

Kernels are compiled on first call and kept in a cache folder. numba's own cache notices an edit in
the file that holds a kernel but not one in a module that the kernel calls, so the folder's name is a hash
of all kernel sources, the numba version and the options: an edit anywhere starts a new folder.
"""

from __future__ import annotations

import hashlib
import os
import warnings
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import numba
from numba import njit, types
from numba.extending import intrinsic

from crowdsim.cache_place import cache_base, temporary_base

__all__ = ["array_at", "cache_folder", "compiled_kernels", "helper", "is_cold", "kernel", "kernel_name"]

_OPTIONS = {
    "nogil": True,
    "fastmath": False,
    "error_model": "numpy",
    "boundscheck": False,
    "no_cfunc_wrapper": True,  # no kernel is called from C
}

# Most of the time of a first run goes into compiling. LLVM's first level without vectorizing takes half the time
# of the third, and branchy geometry like ours runs no slower.
numba.config.OPT = type(numba.config.OPT)(1)
numba.config.LOOP_VECTORIZE = 0


def _sources_key(kind: str) -> str:
    digest = hashlib.sha256(f"{numba.__version__} {sorted(_OPTIONS.items())} {kind}".encode())
    package = Path(__file__).parent
    for path in [*sorted(package.rglob("*_kernels.py")), Path(__file__), package / "numba_internals.py"]:
        digest.update(str(path.relative_to(package)).encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def _choose_cache_folder(kind: str) -> Path:
    folder = cache_base() / "kernels" / _sources_key(kind)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        probe = folder / f".probe-{os.getpid()}"
        probe.touch()
        probe.unlink()
    except OSError:
        folder = temporary_base() / "kernels" / folder.name
        folder.mkdir(parents=True, exist_ok=True)
    return folder


def _choose_internals() -> tuple[ModuleType | None, Path]:
    """numba's private parts, or None if it is to be taken as it comes, and the folder of kernels that are compiled so.

    They are tried out once for each folder. If numba is built otherwise, a warning says so.
    """
    if not os.environ.get("CROWDSIM_PLAIN_NUMBA"):
        folder = _choose_cache_folder("internals")
        try:
            from crowdsim import numba_internals

            if not (folder / "tried").exists():
                numba_internals.try_out(**_OPTIONS)
                (folder / "tried").touch()
        except Exception as error:
            message = f"kernels are slower with numba {numba.__version__}, which is not built as expected: {error!r}"
            warnings.warn(message, RuntimeWarning, stacklevel=2)
        else:
            return numba_internals, folder
    return None, _choose_cache_folder("plain")


_INTERNALS, _FOLDER = _choose_internals()
numba.config.CACHE_DIR = str(_FOLDER)


def cache_folder() -> Path:
    """Folder that holds the compiled kernels of exactly these sources."""
    return _FOLDER


def is_cold() -> bool:
    """Whether no kernel of these sources was compiled on this machine yet."""
    return not compiled_kernels()


def compiled_kernels() -> set[str]:
    """Names of the kernels that were compiled on this machine, as :func:`kernel_name` gives them."""
    return {f"{file.parent.name.rpartition('_')[0]}/{file.name.partition('-')[0]}" for file in _FOLDER.rglob("*.nbi")}


def kernel_name(dispatcher: Any) -> str | None:
    """Folder, file and name of a kernel; None for a helper, which becomes a part of kernels."""
    kept = getattr(dispatcher._cache, "cache_path", None)
    if not kept:
        return None
    function = dispatcher.py_func
    folder, _, file = function.__module__.rpartition(".")
    return f"{folder.rpartition('.')[2]}/{file}.{function.__qualname__}"


kernel = (njit if _INTERNALS is None else _INTERNALS.borrowing_kernel)(cache=True, **_OPTIONS)
"""Decorator of a serial kernel: releases the GIL, callable from worker threads."""


def helper(function: Callable[..., Any]) -> Any:
    """Decorator of a function that kernels alone call: it is kept in the cache as a part of its kernels only.

    TypeError if Python calls it all the same, unless numba is taken as it comes.
    """
    if _INTERNALS is None:
        return njit(**_OPTIONS)(function)
    return _INTERNALS.linked_helper(function, **_OPTIONS)


def inlined(function: Callable[..., Any]) -> Any:
    """Decorator of a helper whose code becomes part of every function that calls it.

    For large helpers of inner loops, which the compiler would rather call: `see_corners` takes 7 % less with them.
    Where there are several calls the code grows, which can cost more than it saves: measure.
    """
    return njit(inline="always", **_OPTIONS)(function)


if _INTERNALS is None:

    @intrinsic
    def _pointer(_: Any, address: Any) -> Any:
        def generate(context: Any, builder: Any, _: Any, values: Any) -> Any:
            return builder.inttoptr(values[0], context.get_value_type(types.voidptr))

        return types.voidptr(address), generate

    @helper
    def array_at(address: Any, shape: Any, dtype: Any) -> Any:
        """In kernels: view memory at ``address`` as a C-contiguous array. The caller keeps the memory alive."""
        return numba.carray(_pointer(address), shape, dtype)

else:
    array_at = _INTERNALS.array_at
