"""The only module that configures numba: decorators for kernels, compiler options, cache folder.

Kernels are compiled at their first call and cached on disk. numba's own cache notices an edit of the file that holds a
kernel, but not an edit of another file whose functions the kernel calls or whose constants it uses. The cache folder is
therefore named by a hash of all kernel sources and what they import, the numba version and the options: any edit starts
a new folder.
"""

from __future__ import annotations

import gc
import hashlib
import os
import re
import warnings
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import numba
from numba import njit, types
from numba.core import event
from numba.extending import intrinsic

from crowdsim.cache_place import cache_base, temporary_base

__all__ = [
    "array_at",
    "cache_folder",
    "compiled_kernels",
    "helper",
    "inlined",
    "is_cold",
    "kernel",
    "kernel_name",
    "kernel_sources",
    "shares_cache",
    "short_name",
]

_OPTIONS = {
    "nogil": True,
    "fastmath": False,
    "error_model": "numpy",
    "boundscheck": False,
    "no_cfunc_wrapper": True,  # no C code calls a kernel
}

# Compilation takes most of a first run. LLVM's level 1 without vectorization compiles twice as fast as level 3, and
# geometry code with many branches runs no slower.
numba.config.OPT = type(numba.config.OPT)(1)
numba.config.LOOP_VECTORIZE = 0


_IMPORTED = re.compile(rb"^from crowdsim\.([\w.]+) import", re.MULTILINE)
"""Line of a source that imports a module of this package; the group is its name."""


def kernel_sources(package: Path) -> dict[Path, bytes]:
    """Return the content of all files of ``package`` that compiled kernels depend on, by path, in order.

    These are the kernels, and the modules that they name in lines ``from crowdsim.MODULE import`` without indentation,
    directly or not: numba compiles constants of other files into them. Names that are no module files are left out.
    """
    waiting = [*package.rglob("*_kernels.py"), package / "jit.py", package / "numba_internals.py"]
    sources: dict[Path, bytes] = {}
    while waiting:
        path = waiting.pop()
        if path not in sources and path.is_file():
            sources[path] = path.read_bytes()
            names = _IMPORTED.findall(sources[path])
            waiting += [package.joinpath(*name.decode().split(".")).with_suffix(".py") for name in names]
    return dict(sorted(sources.items()))


def _sources_key(kind: str) -> str:
    """Return a hash of all kernel sources, numba's version and ``kind``, and the options: 16 hexadecimal digits."""
    digest = hashlib.sha256(f"{numba.__version__} {sorted(_OPTIONS.items())} {kind}".encode())
    package = Path(__file__).parent
    for path, content in kernel_sources(package).items():
        digest.update(str(path.relative_to(package)).encode())
        digest.update(content)
    return digest.hexdigest()[:16]


def _choose_cache_folder(kind: str) -> Path:
    """Return a folder that can be written to, for kernels of a ``kind`` of numba: "plain", or "internals" if changed.

    It is made below the usual cache folder, or below that of temporary files if the usual one cannot be written to.
    """
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
    """Return the module of numba internals, None for plain numba, and the cache folder of that choice.

    The internals are tested once per cache folder. If this numba version is built differently, a warning says so and
    plain numba is used. CROWDSIM_PLAIN_NUMBA=1 forces plain numba.
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


class _NoCollection(event.Listener):
    """Keep Python's garbage collector off while numba compiles: it would look through all of numba's data in vain."""

    def __init__(self) -> None:
        self._depth = 0
        self._was_on = False

    def on_start(self, event: Any) -> None:
        """Turn the collector off at the outermost compilation; numba's lock lets one thread compile at a time."""
        if self._depth == 0:
            self._was_on = gc.isenabled()
            gc.disable()
        self._depth += 1

    def on_end(self, event: Any) -> None:
        """Turn it on again, if it was."""
        self._depth -= 1
        if self._depth == 0 and self._was_on:
            gc.enable()


event.register("numba:compile", _NoCollection())

_INTERNALS, _FOLDER = _choose_internals()
numba.config.CACHE_DIR = str(_FOLDER)


def cache_folder() -> Path:
    """Return the folder that holds the compiled kernels of exactly these sources."""
    return _FOLDER


def is_cold() -> bool:
    """Return whether this machine has no compiled kernel of these sources yet."""
    return not compiled_kernels()


def compiled_kernels() -> set[str]:
    """Return the names of the kernels that are compiled on this machine, as :func:`kernel_name` gives them.

    They are taken from the names of cache files: ``folder_HASH/file.name-...``.
    """
    return {f"{file.parent.name.rpartition('_')[0]}/{file.name.partition('-')[0]}" for file in _FOLDER.rglob("*.nbc")}


def kernel_name(dispatcher: Any) -> str | None:
    """Return ``folder/file.name`` of a kernel; None for a helper, which has no cache entry of its own."""
    kept = getattr(dispatcher._cache, "cache_path", None)
    if not kept:
        return None
    return short_name(dispatcher.py_func.__module__, dispatcher.py_func.__qualname__)


def short_name(module: str, function: str) -> str:
    """Return ``folder/file.name`` of a function of a module."""
    folder, _, file = module.rpartition(".")
    return f"{folder.rpartition('.')[2]}/{file}.{function}"


def shares_cache() -> bool:
    """Return whether several processes may compile into the same cache at once; plain numba mixes up its entries."""
    return _INTERNALS is not None


kernel = (njit if _INTERNALS is None else _INTERNALS.borrowing_kernel)(cache=True, **_OPTIONS)
"""Decorator for serial kernels: cached on disk, releases the GIL, callable from worker threads."""


def helper(function: Callable[..., Any]) -> Any:
    """Decorate a function that only kernels call; it is compiled into them and has no cache entry of its own.

    A call from Python raises TypeError, unless plain numba is used.
    """
    if _INTERNALS is None:
        return njit(**_OPTIONS)(function)
    return _INTERNALS.linked_helper(function, **_OPTIONS)


def inlined(function: Callable[..., Any]) -> Any:
    """Decorate a helper whose code is copied into every function that calls it.

    Use it for large helpers in inner loops that the compiler would otherwise call. With several call sites the code
    grows, which can cost more than it saves: measure.
    """
    return njit(inline="always", **_OPTIONS)(function)


if _INTERNALS is None:

    @intrinsic
    def _pointer(_: Any, address: Any) -> Any:
        """Return an integer ``address`` as a pointer."""

        def generate(context: Any, builder: Any, _: Any, values: Any) -> Any:
            return builder.inttoptr(values[0], context.get_value_type(types.voidptr))

        return types.voidptr(address), generate

    @helper
    def array_at(address: Any, shape: Any, dtype: Any) -> Any:
        """View memory at ``address`` as a C-contiguous array (in kernels). The caller keeps the memory alive."""
        return numba.carray(_pointer(address), shape, dtype)

else:
    array_at = _INTERNALS.array_at
