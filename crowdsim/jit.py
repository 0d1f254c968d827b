"""The one door to numba: every compiler option of the engine stands here once.

Kernels are compiled on first call and kept in a cache folder. numba's own cache notices an edit in
the file that holds a kernel but not one in a module that the kernel calls, so the folder's name is a hash
of all kernel sources, the numba version and the options: an edit anywhere starts a new folder.
"""

from __future__ import annotations

import hashlib
import os
import tempfile
import weakref
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba
from numba import njit, types
from numba.core import cgutils
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.extending import intrinsic
from numba.np.arrayobj import populate_array

__all__ = ["array_at", "cache_folder", "helper", "is_cold", "kernel", "unowned"]

_OPTIONS = {
    "fastmath": False,
    "error_model": "numpy",
    "boundscheck": False,
    "no_cfunc_wrapper": True,  # no kernel is called from C
}

# Most of the time of a first run goes into compiling. LLVM's first level without vectorizing takes half the time
# of the third, and branchy geometry like ours runs no slower.
numba.config.OPT = type(numba.config.OPT)(1)
numba.config.LOOP_VECTORIZE = 0


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


kernel = njit(nogil=True, cache=True, **_OPTIONS)
"""Decorator of a serial kernel: releases the GIL, callable from worker threads."""


class _LinkedCodegen:
    """numba's code generator, for functions that have no machine code of their own."""

    def __init__(self, codegen: Any) -> None:
        self._codegen = codegen

    def __getattr__(self, name: str) -> Any:
        return getattr(self._codegen, name)

    def set_env(self, *_: object) -> None:
        """Nothing: an environment holds Python objects for code that calls Python, which helpers do not."""


class _LinkedLibrary(JITCodeLibrary):
    """The code of a helper, only ever linked into kernels, which optimize it and make machine code of it there.

    Doing either for every helper once more took a fifth of the time of a first run.
    """

    @property
    def codegen(self) -> _LinkedCodegen:
        return _LinkedCodegen(self._codegen)

    def get_pointer_to_function(self, name: str) -> int:
        return 0

    def _optimize_final_module(self) -> None:
        pass

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._verify_declare_only_symbols()
        self._final_module.__library = weakref.proxy(self)
        self._finalized = True


class _HelperCompiler(CompilerBase):
    def define_pipelines(self) -> list[Any]:
        self.state.library = _LinkedLibrary(self.state.targetctx.codegen(), self.state.func_id.func_qualname)
        return [DefaultPassBuilder.define_nopython_pipeline(self.state)]


def helper(function: Callable[..., Any]) -> Any:
    """Decorator of a function that kernels alone call.

    It has no entry from Python, which for arguments of many arrays takes longer to compile than the function itself,
    and is kept in the cache as a part of its kernels only. TypeError where Python calls it all the same.
    """

    def refuse(*_: object, **__: object) -> None:
        raise TypeError(f"{function.__name__} is a helper of kernels; to call it from Python, make it a kernel")

    dispatcher = njit(nogil=True, no_cpython_wrapper=True, pipeline_class=_HelperCompiler, **_OPTIONS)(function)
    # What is compiled for a kernel is not entered for Python: numba would jump to the entry that is not there.
    dispatcher._insert = lambda *_: None
    dispatcher._compile_for_args = refuse
    return dispatcher


@intrinsic
def array_at(_: Any, address: Any, shape: Any, dtype: Any) -> Any:
    """In kernels: the C-contiguous array at an integer ``address``, which somebody else keeps alive.

    As numba's `carray` from a pointer, but in a tenth of the time to compile.
    """
    kind = types.Array(dtype.dtype, len(shape), "C")

    def generate(context: Any, builder: Any, _: Any, values: Any) -> Any:
        array = context.make_array(kind)(context, builder)
        itemsize = context.get_abi_sizeof(context.get_data_type(kind.dtype))
        lengths = cgutils.unpack_tuple(builder, values[1])
        strides = [context.get_constant(types.intp, itemsize)]
        for length in lengths[:0:-1]:
            strides.insert(0, builder.mul(strides[0], length))
        data = builder.inttoptr(values[0], array.data.type)
        size = context.get_constant(types.intp, itemsize)
        populate_array(array, data=data, shape=lengths, strides=strides, itemsize=size, meminfo=None)
        return array._getvalue()

    return kind(address, shape, dtype), generate


@intrinsic
def unowned(_: Any, value: Any) -> Any:
    """In kernels: the same arrays, or tuples of them, without a count of who refers to them.

    Every helper that is handed arrays counts up and down, atomically: two fifths of the time of a search. A kernel's
    caller keeps its arguments alive, so they need no counting; what comes out must not be returned to Python.
    """

    def stripped(context: Any, builder: Any, kind: Any, content: Any) -> Any:
        if isinstance(kind, types.Array):
            array = context.make_array(kind)(context, builder, value=content)
            array.meminfo = cgutils.get_null_value(array.meminfo.type)
            return array._getvalue()
        if isinstance(kind, types.BaseTuple):
            parts = [stripped(context, builder, part, builder.extract_value(content, i)) for i, part in enumerate(kind)]
            return context.make_tuple(builder, kind, parts)
        return content

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        return stripped(context, builder, signature.args[0], values[0])

    return value(value), generate
