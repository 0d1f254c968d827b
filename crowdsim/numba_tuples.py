"""NamedTuples of this package as numba hands them on: by address, without counting what they hold more than once.

Kernels hand on NamedTuples of tens of arrays. numba hands over each number and pointer of one as an argument of its
own: hundreds of them from kernel to kernel, each taken out of the tuple for the call, and put into it again in the
function. That is half of the code that LLVM then has to compile.

Only `crowdsim/numba_internals.py` imports this module, which changes numba for the whole process: functions get
NamedTuples of crowdsim by address, others get all tuples as before. :func:`undo` takes the changes back.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, partial
from typing import Any

from llvmlite import ir as llvm
from numba import types
from numba.core import cgutils
from numba.core.boxing import unbox_tuple
from numba.core.datamodel.manager import DataModelManager
from numba.core.datamodel.models import DataModel, TupleModel, UniTupleModel
from numba.core.datamodel.packer import _flatten
from numba.core.datamodel.registry import default_manager
from numba.core.pythonapi import _unboxers
from numba.core.runtime.context import NRTContext
from numba.core.types.functions import BaseFunction
from numba.extending import NativeValue, register_model, unbox

__all__ = ["OVERRIDDEN", "undo", "value_at"]

OVERRIDDEN = (
    (DataModel, ("as_argument", "from_argument", "get_argument_type", "traverse", "contains_nrt_meminfo")),
    (DataModelManager, ("register",)),
    (NRTContext, ("get_meminfos",)),
    (BaseFunction, ("get_call_type",)),
)
"""Methods that this module overrides, by class. If numba no longer has one of them, its override has no effect."""

_FEW = 8
"""Most numbers and pointers of a NamedTuple that is handed to a function one by one."""


def value_at(builder: Any, place: Any) -> Any:
    """Read a value from a place in memory that does not change while the function runs; keep the place with it."""
    value = builder.load(place)
    value.place = place
    return value


class _ByAddress(DataModel):
    """How NamedTuples of this package are handed to functions: by address, if they are large."""

    def is_by_address(self) -> bool:
        """Return whether functions get the address of the tuple."""
        is_own = self.fe_type.instance_class.__module__.partition(".")[0] == __package__
        return is_own and len(list(_flatten([super().get_argument_type()]))) > _FEW

    def get_argument_type(self) -> Any:
        """Return the LLVM type of the argument, or a nested tuple of the types of several."""
        return self.get_value_type().as_pointer() if self.is_by_address() else super().get_argument_type()

    def as_argument(self, builder: Any, value: Any) -> Any:
        """Return the argument for a tuple: the place that it was read from, else a new one on the stack."""
        if not self.is_by_address():
            return super().as_argument(builder, value)
        place = getattr(value, "place", None)
        if place is None:
            with builder.goto_entry_block():
                place = builder.alloca(value.type)
            builder.store(value, place)
        return place

    def from_argument(self, builder: Any, value: Any) -> Any:
        """Return the tuple of an argument."""
        return value_at(builder, value) if self.is_by_address() else super().from_argument(builder, value)

    def traverse(self, builder: Any) -> list[tuple[Any, Callable[[Any], Any]]]:
        """Return the type of each field, with a function that returns the field of a tuple."""

        def field_of(value: Any, field: int) -> Any:
            if not hasattr(value, "place"):
                return builder.extract_value(value, field)
            return value_at(builder, cgutils.gep_inbounds(builder, value.place, 0, field))

        return [(kind, partial(field_of, field=field)) for field, kind in enumerate(self.fe_type)]


@register_model(types.NamedTuple)
class _NamedTupleModel(_ByAddress, TupleModel):
    """A NamedTuple whose fields have several types."""


@register_model(types.NamedUniTuple)
class _NamedUniTupleModel(_ByAddress, UniTupleModel):
    """A NamedTuple whose fields have one type."""


@unbox(types.BaseNamedTuple)
def _unbox_named_tuple(kind: Any, given: Any, c: Any) -> NativeValue:
    """Take a NamedTuple from Python; into memory, with one call for each array, if it is handed on by address."""
    model = c.context.data_model_manager[kind]
    # Types that were compiled for before this module was imported keep numba's model.
    if not isinstance(model, _ByAddress) or not model.is_by_address():
        return unbox_tuple(kind, given, c)
    with c.builder.goto_entry_block():
        place = c.builder.alloca(c.context.get_value_type(kind))
    cleanups: list[Callable[[], None]] = []
    failed = _fill_tuple(kind, given, place, cleanups, c)

    def clean_up() -> None:
        for each in reversed(cleanups):
            each()

    return NativeValue(value_at(c.builder, place), is_error=failed, cleanup=clean_up if cleanups else None)


def _fill_tuple(kind: Any, given: Any, place: Any, cleanups: list[Callable[[], None]], c: Any) -> Any:
    """Generate code that fills a tuple at a place from one of Python, and return whether it fails, with an error set.

    The dispatcher has chosen the code by the types of all fields. What is to be done after the call is added to
    ``cleanups``; references to arrays are given back by numba's wrapper.
    """
    failed = cgutils.false_bit
    for field, part in enumerate(kind):
        at = cgutils.gep_inbounds(c.builder, place, 0, field)
        if isinstance(part, types.Array):
            itemsize = cgutils.intp_t(c.context.get_abi_sizeof(c.context.get_data_type(part.dtype)))
            numbers = (cgutils.intp_t(field), c.builder.bitcast(at, cgutils.voidptr_t), itemsize)
            wrong = c.builder.call(_array_from_python(c), (given, *numbers))
        elif isinstance(part, types.BaseTuple):
            wrong = _fill_tuple(part, c.pyapi.tuple_getitem(given, field), at, cleanups, c)
        else:
            native = c.unbox(part, c.pyapi.tuple_getitem(given, field))
            c.builder.store(native.value, at)
            wrong = native.is_error
            if native.cleanup is not None:
                cleanups.append(native.cleanup)
        failed = c.builder.or_(failed, wrong)
    return failed


def _array_from_python(c: Any) -> Any:
    """Return an LLVM function that fills an array at a place from an item of a tuple, and returns whether it fails.

    Its arguments are the tuple, the number of the item, the place, and the size of an element [byte].
    """
    name = "crowdsim.array_from_python"
    if name in c.builder.module.globals:
        return c.builder.module.globals[name]
    parameters = (c.pyapi.pyobj, cgutils.intp_t, cgutils.voidptr_t, cgutils.intp_t)
    function = llvm.Function(c.builder.module, llvm.FunctionType(cgutils.bool_t, parameters), name)
    function.linkage = "internal"
    given, item, place, itemsize = function.args
    builder = llvm.IRBuilder(function.append_basic_block("entry"))
    python = c.context.get_python_api(builder)
    get_item_type = llvm.FunctionType(python.pyobj, (python.pyobj, python.py_ssize_t))
    get_item = cgutils.get_or_insert_function(c.builder.module, get_item_type, "PyTuple_GetItem")
    status = python.nrt_adapt_ndarray_from_python(builder.call(get_item, (given, item)), place)  # 0: it is an array
    # An array begins with the addresses of its memory block and its owner; its count of elements and their size follow.
    sizes = builder.bitcast(place, cgutils.intp_t.as_pointer())
    held = builder.load(builder.gep(sizes, [cgutils.intp_t(3)]))
    failed = builder.or_(cgutils.is_not_null(builder, status), builder.icmp_signed("!=", held, itemsize))
    with builder.if_then(failed, likely=False):
        python.err_set_string("PyExc_TypeError", "a field of a NamedTuple is not the array that a kernel expects")
    builder.ret(failed)
    return function


@cache
def _is_counted(model: Any) -> bool:
    """Return whether values of a data model hold memory whose references are counted."""
    return bool(model.contains_nrt_meminfo())


def _counted_parts(self: NRTContext, builder: Any, kind: Any, value: Any) -> list[tuple[Any, Any]]:
    """Return the memory blocks in a value, with the type of each, as ``NRTContext.get_meminfos`` does.

    It takes out of the value what holds a block, and no more. numba takes out each number, too.
    """
    model = self._context.data_model_manager[kind]
    found = [(kind, model.get_nrt_meminfo(builder, value))] if model.has_nrt_meminfo() else []
    for part, part_of in model.traverse(builder):
        if _is_counted(self._context.data_model_manager[part]):
            found += self.get_meminfos(builder, part, part_of(value))
    return found


_resolve_call: Any = BaseFunction.get_call_type


@cache
def _resolve_numbers(function: BaseFunction, context: Any, kinds: tuple[Any, ...]) -> Any:
    """Return the signature of a call with plain numbers."""
    return _resolve_call(function, context, kinds, {})


def _get_call_type(self: BaseFunction, context: Any, args: tuple[Any, ...], kws: dict[str, Any]) -> Any:
    """Return the signature of a call of one of numba's functions; with plain numbers, it is found once and kept.

    For `a < b`, numba tries tens of definitions each time, most of them for arrays.
    """
    if kws or not all(isinstance(each, (types.Number, types.Boolean)) for each in args):
        return _resolve_call(self, context, args, kws)
    return _resolve_numbers(self, context, args)


_CHANGED = ((NRTContext, "get_meminfos", _counted_parts), (BaseFunction, "get_call_type", _get_call_type))
_USUAL = [(owner, name, getattr(owner, name)) for owner, name, _ in _CHANGED]

for _owner, _name, _method in _CHANGED:
    setattr(_owner, _name, _method)


def undo() -> None:
    """Take back what this module has changed in numba."""
    for owner, name, method in _USUAL:
        setattr(owner, name, method)
    default_manager.register(types.NamedTuple, TupleModel)
    default_manager.register(types.NamedUniTuple, UniTupleModel)
    default_manager._cache.clear()
    _unboxers.functions[types.BaseNamedTuple] = unbox_tuple
