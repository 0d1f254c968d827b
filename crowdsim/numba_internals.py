"""Private parts of numba: each makes kernels faster or their compilation shorter, none changes a result.

`crowdsim/jit.py` alone imports this module, tries it out, and takes numba as it comes if that fails.
docs/design.md gives what each part gains, and the command that measures it.
"""

from __future__ import annotations

import hashlib
import pickle
import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
from numba import njit, types
from numba.core import cgutils, ir
from numba.core.caching import IndexDataCacheFile
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import PassManager, register_pass
from numba.core.lowering import Lower
from numba.core.typed_passes import NativeLowering
from numba.extending import intrinsic
from numba.np.arrayobj import populate_array

from crowdsim.errors import CacheWarning

_OVERRIDDEN = (
    (Lower, ("pre_lower", "lower_assign", "delvar")),
    (NativeLowering, ("lowering_class",)),
    (CompilerBase, ("define_pipelines",)),
    (IndexDataCacheFile, ("_load_index", "_save_index", "_load_data", "_save_data", "_open_for_write", "_dump")),
    (JITCodeLibrary, ("codegen", "get_pointer_to_function", "_optimize_final_module", "_finalize_final_module")),
)
"""What the classes below replace; where numba lacks one of them, it would be replaced in vain."""


class _BorrowingLower(Lower):
    """Code that counts no references to arguments which keep their names: the caller holds them meanwhile.

    numba counts every array of every argument up at the start of a function and down at its end, atomically.
    """

    def pre_lower(self) -> None:
        super().pre_lower()
        assigned = [each for block in self.func_ir.blocks.values() for each in block.find_insts(ir.Assign)]
        names = [each.target.name for each in assigned]
        self._borrowed = {
            each.target.name
            for each in assigned
            if isinstance(each.value, ir.Arg)
            and names.count(each.target.name) == 1
            and self.typeof("arg." + each.value.name) == self.typeof(each.target.name)
        }

    def lower_assign(self, ty: Any, inst: Any) -> Any:
        if inst.target.name in self._borrowed:
            return self.fnargs[inst.value.index]
        return super().lower_assign(ty, inst)

    def delvar(self, name: str) -> None:
        if name not in self._borrowed:
            super().delvar(name)


@register_pass(mutates_CFG=True, analysis_only=False)
class _BorrowingLowering(NativeLowering):
    _name = "borrowing_lowering"

    @property
    def lowering_class(self) -> type[Lower]:
        return _BorrowingLower


class _KernelCompiler(CompilerBase):
    def define_pipelines(self) -> list[Any]:
        usual = DefaultPassBuilder.define_nopython_pipeline(self.state)
        passes = PassManager("crowdsim")
        passes.passes = [(_BorrowingLowering if each is NativeLowering else each, why) for each, why in usual.passes]
        passes.finalize()
        return [passes]


class _LinkedCodegen:
    """numba's code generator, for functions that have no machine code of their own."""

    def __init__(self, codegen: Any) -> None:
        self._codegen = codegen

    def __getattr__(self, name: str) -> Any:
        return getattr(self._codegen, name)

    def set_env(self, *_: object) -> None:
        """Nothing: an environment holds Python objects for code that calls Python, which helpers do not."""


class _LinkedLibrary(JITCodeLibrary):
    """The code of a helper, only linked into kernels, which optimize it and make machine code of it there."""

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
        self._finalized = True


class _HelperCompiler(_KernelCompiler):
    def define_pipelines(self) -> list[Any]:
        self.state.library = _LinkedLibrary(self.state.targetctx.codegen(), self.state.func_id.func_qualname)
        return super().define_pipelines()


class _CheckedCacheFile(IndexDataCacheFile):
    """Compiled kernels with checksums: what is damaged is compiled anew, with a warning, instead of run."""

    def _load_index(self) -> Any:
        try:
            data = self._checked(self._index_path)
            if data is None:
                return {}
            version, stamp, overloads = pickle.loads(data)
        except FileNotFoundError:
            return {}
        return overloads if version == self._version and stamp == self._source_stamp else {}

    def _save_index(self, overloads: Any) -> None:
        self._write(self._index_path, self._dump((self._version, self._source_stamp, overloads)))

    def _load_data(self, name: str) -> Any:
        data = self._checked(self._data_path(name))
        if data is None:
            raise OSError("damaged")  # numba compiles anew then
        return pickle.loads(data)

    def _save_data(self, name: str, data: Any) -> None:
        self._write(self._data_path(name), self._dump(data))

    def _write(self, path: str, data: bytes) -> None:
        with self._open_for_write(path) as file:
            file.write(hashlib.sha256(data).digest() + data)

    def _checked(self, path: str) -> bytes | None:
        """What was written, or None if that is not what the file holds."""
        with open(path, "rb") as file:
            content = file.read()
        if hashlib.sha256(content[32:]).digest() == content[:32]:
            return content[32:]
        warnings.warn(f"a compiled kernel that was kept is damaged and made anew: {path}", CacheWarning, stacklevel=2)
        return None


def borrowing_kernel(**options: Any) -> Callable[..., Any]:
    """`njit` with ``options``, of a kernel that counts no references to its arguments."""
    decorator: Callable[..., Any] = njit(pipeline_class=_KernelCompiler, **options)

    def decorated(function: Callable[..., Any]) -> Any:
        dispatcher = decorator(function)
        if options.get("cache"):
            kept = dispatcher._cache
            stamp = kept._impl.locator.get_source_stamp()
            kept._cache_file = _CheckedCacheFile(kept._cache_path, kept._impl.filename_base, stamp)
        return dispatcher

    return decorated


def linked_helper(function: Callable[..., Any], **options: Any) -> Any:
    """`njit` with ``options``, of a function that becomes machine code within its kernels only.

    It has no entry from Python, which for arguments of many arrays takes longer to compile than the function itself.
    """

    def refuse(*_: object, **__: object) -> None:
        raise TypeError(f"{function.__name__} is a helper of kernels; to call it from Python, make it a kernel")

    dispatcher = njit(no_cpython_wrapper=True, pipeline_class=_HelperCompiler, **options)(function)
    # What is compiled for a kernel is not entered for Python: numba would jump to the entry that is not there.
    dispatcher._insert = lambda *_: None
    dispatcher._compile_for_args = refuse
    return dispatcher


@intrinsic
def array_at(_: Any, address: Any, shape: Any, dtype: Any) -> Any:
    """In kernels: view memory at an integer ``address`` as a C-contiguous array. The caller keeps the memory alive.

    As `numba.carray` from a pointer, but sooner compiled.
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


def try_out(**options: Any) -> None:
    """Compile and run a kernel with a helper; raise whatever shows that numba is not built as this module expects."""
    for owner, names in _OVERRIDDEN:
        for name in names:
            getattr(owner, name)

    helper = linked_helper(lambda values, more: values[0] + more, **options)

    def kernel(values: Any, address: int) -> Any:
        return helper(values, 1.0) + array_at(address, (1,), np.float64)[0]

    values = np.ones(1)
    if borrowing_kernel(**options)(kernel)(values, values.ctypes.data) != 3.0:
        raise RuntimeError("a kernel with a helper gives a wrong sum")
    try:
        helper(values, 1.0)
    except TypeError:
        return
    raise RuntimeError("a helper can be called from Python")
