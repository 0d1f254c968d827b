"""Changes to numba's private parts that make kernels faster or compile sooner; none changes a result.

Only `crowdsim/jit.py` imports this module. It calls :func:`try_out` first and uses plain numba if that fails.
`crowdsim/numba_tuples.py` holds those that concern tuples. docs/design.md lists what each part gains, and the command
that measures it.
"""

from __future__ import annotations

import hashlib
import os
import pickle
import warnings
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

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

from crowdsim import numba_tuples
from crowdsim.errors import CacheWarning
from crowdsim.numba_tuples import value_at

_OVERRIDDEN = (
    (Lower, ("pre_lower", "lower_assign", "storevar", "loadvar", "delvar", "_alloca_var")),
    (NativeLowering, ("lowering_class",)),
    (CompilerBase, ("define_pipelines",)),
    (IndexDataCacheFile, ("save", "load", "_open_for_write", "_dump")),
    (JITCodeLibrary, ("codegen", "get_pointer_to_function", "_optimize_final_module", "_finalize_final_module")),
    *numba_tuples.OVERRIDDEN,
)
"""Methods that the classes below override, by class. If numba no longer has one of them, its override has no effect."""


class _BorrowingLower(Lower):
    """Lowering that does not count references to arguments which the function never reassigns, nor to their fields.

    numba increments the reference count of every array argument at the start of a function and decrements it at the
    end, both atomically. The caller holds a reference during the call, so both are unnecessary. Fields of arguments
    that are NamedTuples are read once, as the function begins.
    """

    def pre_lower(self) -> None:
        """Find the variables that are borrowed: assigned once, from an argument or a field of one."""
        super().pre_lower()
        assigned = [each for block in self.func_ir.blocks.values() for each in block.find_insts(ir.Assign)]
        times = Counter(each.target.name for each in assigned)
        self._once = {each.target.name: each.value for each in assigned if times[each.target.name] == 1}
        self._paths: dict[str, tuple[int, ...] | None] = {}
        self._read: dict[tuple[int, ...], Any] = {}
        self._first_block = self.builder.basic_block  # the arguments are unpacked up to here

    def _path(self, name: str) -> tuple[int, ...] | None:
        """Return the argument's number and the numbers of fields that lead to a variable's value; None if none do."""
        if name not in self._paths:
            value: Any = self._once.get(name)
            path: tuple[int, ...] | None = None
            if isinstance(value, ir.Arg):
                if self.typeof("arg." + value.name) == self.typeof(name):
                    path = (value.index,)
            elif isinstance(value, ir.Var):
                if self.typeof(value.name) == self.typeof(name):
                    path = self._path(value.name)
            elif isinstance(value, ir.Expr) and value.op == "getattr":
                owner = self.typeof(value.value.name)
                above = self._path(value.value.name) if isinstance(owner, types.BaseNamedTuple) else None
                if above is not None and value.attr in owner.fields:  # else a method, as `index`
                    field = owner.fields.index(value.attr)
                    if owner.types[field] == self.typeof(name):
                        path = (*above, field)
            self._paths[name] = path
        return self._paths[name]

    def _value_at(self, path: tuple[int, ...]) -> Any:
        """Return the value of an argument or of a field of one, read in the first block of the function."""
        argument = self.fnargs[path[0]]
        if len(path) == 1:
            return argument
        if path not in self._read:
            with self.builder.goto_block(self._first_block):
                place = getattr(argument, "place", None)
                self._read[path] = (
                    self.builder.extract_value(argument, path[1:])
                    if place is None
                    else value_at(self.builder, cgutils.gep_inbounds(self.builder, place, 0, *path[1:]))
                )
        return self._read[path]

    def _alloca_var(self, name: str, fetype: Any) -> None:
        """Give a variable a place on the stack; a borrowed one needs none."""
        if self._path(name) is None:
            super()._alloca_var(name, fetype)

    def lower_assign(self, ty: Any, inst: Any) -> Any:
        """Assign a borrowed value without incrementing its reference count."""
        path = self._path(inst.target.name)
        return super().lower_assign(ty, inst) if path is None else self._value_at(path)

    def storevar(self, value: Any, name: str, argidx: int | None = None) -> None:
        """Store a value in a variable; a borrowed one is not stored."""
        if self._path(name) is None:
            super().storevar(value, name, argidx)

    def loadvar(self, name: str) -> Any:
        """Return the value of a variable."""
        path = self._path(name)
        return super().loadvar(name) if path is None else self._value_at(path)

    def delvar(self, name: str) -> None:
        """Delete a variable; a borrowed one stays, because its count was not incremented."""
        if self._path(name) is None:
            super().delvar(name)


@register_pass(mutates_CFG=True, analysis_only=False)
class _BorrowingLowering(NativeLowering):
    """Compiler pass that uses :class:`_BorrowingLower`."""

    _name = "borrowing_lowering"

    @property
    def lowering_class(self) -> type[Lower]:
        """Return the class that lowers functions."""
        return _BorrowingLower


class _KernelCompiler(CompilerBase):
    """numba's compiler pipeline with :class:`_BorrowingLowering` instead of the usual lowering pass."""

    def define_pipelines(self) -> list[Any]:
        """Return the usual passes, with the lowering pass replaced."""
        usual = DefaultPassBuilder.define_nopython_pipeline(self.state)
        passes = PassManager("crowdsim")
        passes.passes = [(_BorrowingLowering if each is NativeLowering else each, why) for each, why in usual.passes]
        passes.finalize()
        return [passes]


class _LinkedCodegen:
    """numba's code generator, for functions without machine code of their own."""

    def __init__(self, codegen: Any) -> None:
        self._codegen = codegen

    def __getattr__(self, name: str) -> Any:
        return getattr(self._codegen, name)

    def set_env(self, *_: object) -> None:
        """Do nothing: an environment holds Python objects for code that calls Python, which helpers never do."""


class _LinkedLibrary(JITCodeLibrary):
    """The code of a helper: it is linked into kernels, which optimize it and turn it into machine code there."""

    @property
    def codegen(self) -> _LinkedCodegen:
        """Return the code generator."""
        return _LinkedCodegen(self._codegen)

    def get_pointer_to_function(self, name: str) -> int:
        """Return 0: there is no machine code to point to."""
        return 0

    def _optimize_final_module(self) -> None:
        """Do nothing: the kernel that links this code optimizes it."""

    def _finalize_final_module(self) -> None:
        """Finish the library as numba does, but generate no machine code."""
        self._finalize_dynamic_globals()
        self._verify_declare_only_symbols()
        self._finalized = True


class _HelperCompiler(_KernelCompiler):
    """Compiler pipeline of helpers: as for kernels, with a :class:`_LinkedLibrary`."""

    def define_pipelines(self) -> list[Any]:
        """Replace the code library, then return the passes of kernels."""
        self.state.library = _LinkedLibrary(self.state.targetctx.codegen(), self.state.func_id.func_qualname)
        return super().define_pipelines()


def _key_text(part: Any) -> str:
    """Return a text for the key of a cache entry, with the modules and fields of NamedTuples.

    numba prints two classes of one name alike, and one would run the code of the other.
    """
    classes = []
    waiting = [part]
    while waiting:
        each = waiting.pop()
        if isinstance(each, types.BaseNamedTuple):
            classes.append((each.instance_class.__module__, each.instance_class.__qualname__, each.fields))
        if isinstance(each, (tuple, types.BaseTuple)):
            waiting += each
        elif isinstance(each, types.Type) and isinstance(inner := getattr(each, "dtype", None), types.Type):
            waiting.append(inner)
    return f"{part!r} {classes!r}"


class _CheckedCacheFile(IndexDataCacheFile):
    """Cache files of a compiled kernel, one for each signature, named by it, with its key and a checksum inside.

    numba numbers these files instead, and keeps an index. Two processes that compile two signatures at the same time
    choose the same number, and then each may run the other's code. A damaged entry is compiled again, with a warning.
    """

    def save(self, key: Any, data: Any) -> None:
        """Save a compiled function; without effect, but for a warning, if it cannot be written, as on a full disk."""
        content = self._dump((self._version, self._source_stamp, _key_text(key), data))
        try:
            os.makedirs(self._cache_path, exist_ok=True)
            with self._open_for_write(self._entry_path(key)) as file:
                file.write(hashlib.sha256(content).digest() + content)
        except OSError as error:
            folder = Path(self._cache_path).parent
            message = f"compiled kernels are not stored in {folder} ({error.strerror or error}), so that the next run "
            warnings.warn(message + "compiles them again; make room on its disk", CacheWarning, stacklevel=2)

    def load(self, key: Any) -> Any:
        """Return the compiled function of a key, None if there is none, or if it is damaged or out of date."""
        path = self._entry_path(key)
        try:
            with open(path, "rb") as file:
                content = file.read()
        except OSError:
            return None
        if hashlib.sha256(content[32:]).digest() == content[:32]:
            version, stamp, name, data = pickle.loads(content[32:])
            # An entry of another key under the same name counts as damaged.
            if name == _key_text(key):
                return data if version == self._version and stamp == self._source_stamp else None
        warnings.warn(f"a cached kernel is damaged and compiled again: {path}", CacheWarning, stacklevel=2)
        return None

    def _entry_path(self, key: Any) -> str:
        """Return the path of the file for a key: its name has a hash of the key."""
        name = hashlib.sha256(_key_text(key).encode()).hexdigest()[:16]
        return os.path.join(self._cache_path, f"{self._index_name.removesuffix('.nbi')}.{name}.nbc")


def _cache_path(function: Callable[..., Any], usual: str) -> str:
    """Return the folder of a kernel's cache entries, named by the kernel's folder within the package.

    numba names it by the full path of the source (``usual``), so that a second checkout or environment would compile
    anew. Kernels outside of the package keep numba's folder.
    """
    package = Path(__file__).parent
    file = Path(function.__code__.co_filename)
    if not file.is_relative_to(package):
        return usual
    folder = file.parent.relative_to(package).as_posix()
    return str(Path(usual).parent / f"{file.parent.name}_{hashlib.sha256(folder.encode()).hexdigest()[:12]}")


def borrowing_kernel(**options: Any) -> Callable[..., Any]:
    """Return ``njit`` with ``options`` for kernels that count no references to their arguments."""
    decorator: Callable[..., Any] = njit(pipeline_class=_KernelCompiler, **options)

    def decorated(function: Callable[..., Any]) -> Any:
        dispatcher = decorator(function)
        if options.get("cache"):
            kept = dispatcher._cache
            usual = kept._cache_path
            kept._cache_path = _cache_path(function, usual)
            # Entries of the package need no stamp: `crowdsim.jit` names the folder above by a hash of all kernel
            # sources. For kernels of other files, the stamp is numba's, from their file.
            stamp = kept._impl.locator.get_source_stamp() if kept._cache_path == usual else None
            kept._cache_file = _CheckedCacheFile(kept._cache_path, kept._impl.filename_base, stamp)
        return dispatcher

    return decorated


def linked_helper(function: Callable[..., Any], **options: Any) -> Any:
    """Apply ``njit`` with ``options`` to a function that becomes machine code only inside the kernels that call it.

    It has no entry point for Python, which for many array arguments takes longer to compile than the function itself.
    """

    def refuse(*_: object, **__: object) -> None:
        raise TypeError(f"{function.__name__} is a helper of kernels; to call it from Python, make it a kernel")

    dispatcher = njit(no_cpython_wrapper=True, pipeline_class=_HelperCompiler, **options)(function)
    # Do not register compiled versions for calls from Python: numba would jump to an entry point that does not exist.
    dispatcher._insert = lambda *_: None
    dispatcher._compile_for_args = refuse
    return dispatcher


@intrinsic
def array_at(_: Any, address: Any, shape: Any, dtype: Any) -> Any:
    """View memory at an integer ``address`` as a C-contiguous array (in kernels). The caller keeps the memory alive.

    The same as `numba.carray` of a pointer, but it compiles sooner.
    """
    kind = types.Array(dtype.dtype, len(shape), "C")

    def generate(context: Any, builder: Any, _: Any, values: Any) -> Any:
        """Generate code that fills numba's array structure; ``values`` are those of the address and the shape."""
        array = context.make_array(kind)(context, builder)
        itemsize = context.get_abi_sizeof(context.get_data_type(kind.dtype))
        lengths = cgutils.unpack_tuple(builder, values[1])
        # C order: the last stride is one item, each one before it is the next stride times the next length.
        strides = [context.get_constant(types.intp, itemsize)]
        for length in lengths[:0:-1]:
            strides.insert(0, builder.mul(strides[0], length))
        data = builder.inttoptr(values[0], array.data.type)
        size = context.get_constant(types.intp, itemsize)
        populate_array(array, data=data, shape=lengths, strides=strides, itemsize=size, meminfo=None)
        return array._getvalue()

    return kind(address, shape, dtype), generate


class _Tried(NamedTuple):
    """What :func:`try_out` hands to a kernel: enough to be handed on by address, the smaller tuple within it not."""

    numbers: Any
    counts: Any
    within: Any


def try_out(**options: Any) -> None:
    """Compile and run a kernel with a helper; if numba is not built as expected, take the changes back and raise.

    Raises
    ------
    Exception
        Of any type: numba has other private parts.
    """
    try:
        _try_out(**options)
    except Exception:
        numba_tuples.undo()
        raise


def _try_out(**options: Any) -> None:
    """Compile and run a kernel with a helper and a large tuple; raise any exception if numba is built otherwise."""
    for owner, names in _OVERRIDDEN:
        for name in names:
            getattr(owner, name)

    helper = linked_helper(lambda tried, more: tried.numbers[0] + tried.within[1][0] + more, **options)

    def kernel(tried: Any, address: int) -> Any:
        changed = _Tried(tried.numbers[1:], tried.counts, tried.within)
        return helper(tried, 1.0) + helper(changed, 1.0) + array_at(address, (1,), np.float64)[0]

    numbers, counts = np.array([1.0, 2.0]), np.array([3])
    tried = _Tried(numbers, counts, (counts, counts))
    if borrowing_kernel(**options)(kernel)(tried, numbers.ctypes.data) != 12.0:
        raise RuntimeError("a kernel with a helper gives a wrong sum")
    try:
        helper(tried, 1.0)
    except TypeError:
        return
    raise RuntimeError("a helper can be called from Python")
