"""What a first run compiles, and processes that compile it ahead.

``first_run.json`` lists the kernels that a run of the corridor compiles, in their order, with the CPU seconds that each
takes and the types of its arguments; ``tools/time_kernels.py`` writes it. While a run compiles them from the first one
on, other processes compile them from the last one on (``python -m crowdsim.first_run``). The run reads from the cache
what they have compiled; it never waits for them, and they end with it.
"""

from __future__ import annotations

import importlib
import json
import os
import subprocess
import sys
import threading
from collections.abc import Iterable, Sequence
from importlib.resources import files
from pathlib import Path
from typing import Any, NamedTuple, Self, TypeAlias

import numba
import numpy as np
from numba import types

from crowdsim.jit import compiled_kernels, shares_cache, short_name
from crowdsim.processors import usable_processors

_FILE = "first_run.json"

_MOST_PROCESSES = 3
"""Most processes that compile ahead: each takes 250 MB, and with more of them the run itself is what takes longest."""

_WORTHWHILE = 10.0
"""CPU time of the kernels still to be compiled above which other processes help [s]; each takes 2 s to start."""

_Signature: TypeAlias = tuple[Any, ...]


class FirstKernel(NamedTuple):
    """A kernel that a first run compiles: dotted path of its function, CPU time [s], numba types of its arguments.

    ``arguments`` are None if it is compiled together with a kernel that calls it. A kernel that Python calls, too, is
    listed twice, once with and once without arguments.
    """

    function: str
    seconds: float
    arguments: _Signature | None

    @property
    def name(self) -> str:
        """Return the name in the cache."""
        return _name_of(self.function)


def read_seconds() -> dict[str, float]:
    """Return the CPU time [s] of each kernel that a first run compiles, by its name in the cache, in their order."""
    taken: dict[str, float] = {}
    for function, seconds, _ in _content()["kernels"]:
        taken[_name_of(function)] = taken.get(_name_of(function), 0.0) + seconds
    return taken


def read_kernels() -> list[FirstKernel]:
    """Return the kernels that a first run compiles, in their order; this imports the modules of their arguments."""
    content = _content()
    known: list[Any] = []
    for each in content["types"]:
        known.append(_type(each, known))
    return [
        FirstKernel(function, seconds, None if arguments is None else tuple(known[each] for each in arguments))
        for function, seconds, arguments in content["kernels"]
    ]


def _content() -> dict[str, Any]:
    """Return the content of the file: ``types``, and ``kernels`` as (function, seconds, indices of types or None)."""
    content: dict[str, Any] = json.loads(files("crowdsim").joinpath(_FILE).read_text(encoding="utf-8"))
    return content


def _name_of(function: str) -> str:
    """Return the name in the cache of a function, as :func:`crowdsim.jit.kernel_name` gives it."""
    module, _, name = function.rpartition(".")
    return short_name(module, name)


def write_kernels(file: Path, kernels: Iterable[FirstKernel]) -> None:
    """Write what :func:`read_kernels` reads: one line a type, one line a kernel."""
    known: dict[Any, int] = {}
    described: list[Any] = []
    lines = []
    for each in kernels:
        arguments = each.arguments
        numbers = None if arguments is None else [_number(kind, known, described) for kind in arguments]
        lines.append([each.function, round(each.seconds, 2), numbers])
    parts = [",\n".join(json.dumps(line) for line in part) for part in (described, lines)]
    file.write_text('{{"types": [\n{}\n], "kernels": [\n{}\n]}}\n'.format(*parts), encoding="utf-8")


def _number(kind: Any, known: dict[Any, int], described: list[Any]) -> int:
    """Return the place of a type in the list ``described``; add it there if it is new, after those that it is made of.

    ``known`` has the place of each type that is described already.
    """
    if kind not in known:
        if isinstance(kind, types.Record):
            dtype = numba.np.numpy_support.as_dtype(kind)
            fields = [[name, dtype[name].str, dtype.fields[name][1]] for name in dtype.names]
            made_of = ["record", fields, dtype.itemsize, kind.aligned]
        elif isinstance(kind, types.Array):
            made_of = ["array", _number(kind.dtype, known, described), kind.ndim, kind.layout]
        elif isinstance(kind, types.BaseTuple):
            named = getattr(kind, "instance_class", None)
            where = None if named is None else f"{named.__module__}.{named.__qualname__}"
            made_of = ["tuple", where, [_number(each, known, described) for each in kind]]
        else:
            made_of = ["plain", str(kind)]
        known[kind] = len(described)
        described.append(made_of)
    return known[kind]


def _type(made_of: Sequence[Any], known: Sequence[Any]) -> Any:
    """Return the numba type that :func:`_number` has described; ``known`` are the types described before it."""
    match made_of:
        case ["record", fields, size, is_aligned]:
            names, formats, offsets = zip(*fields, strict=True)
            content: Any = {"names": names, "formats": formats, "offsets": offsets, "itemsize": size}
            return numba.from_dtype(np.dtype(content, align=is_aligned))
        case ["array", dtype, dimensions, layout]:
            return types.Array(known[dtype], dimensions, layout)
        case ["tuple", where, parts]:
            return types.BaseTuple.from_types([known[each] for each in parts], where and _imported(where))
        case [_, name]:  # numba prints its type boolean as bool
            return getattr(types, "boolean" if name == "bool" else name)
    raise ValueError(f"{_FILE}: no type is described by {made_of}")


def _imported(path: str) -> Any:
    """Return a function or class by the dotted path of its module and its name."""
    module, _, name = path.rpartition(".")
    return getattr(importlib.import_module(module), name)


class CompilingAhead:
    """Processes that compile a first run's kernels from the last one on, as long as this object is open.

    ``missing`` is the CPU time of the kernels that are not compiled yet [s]. ``count`` is the number of processes: none
    if little is left to compile, if there is but one processor, or with plain numba, whose cache two processes must not
    fill at once.
    """

    def __init__(self, missing: float) -> None:
        worthwhile = missing > _WORTHWHILE and shares_cache()
        self.count = min(_MOST_PROCESSES, usable_processors() - 1) if worthwhile else 0
        paths = [str(Path(__file__).parents[1]), os.environ.get("PYTHONPATH", "")]
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, paths))}
        self._processes = [
            subprocess.Popen(
                [sys.executable, "-m", "crowdsim.first_run", str(part), str(self.count)],
                stdin=subprocess.PIPE,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                env=environment,
            )
            for part in range(self.count)
        ]

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        for process in self._processes:
            process.kill()
        for process in self._processes:
            process.communicate()


def compile_last_first(part: int, parts: int) -> None:
    """Compile a part of the kernels, from the last one on, but for those in the cache.

    The last kernel is number 0, the one before it number 1. The part is number ``part`` and every ``parts``-th one from
    there on. Kernels that are compiled with others (without ``arguments``) are not counted.
    """
    kernels = [each for each in reversed(read_kernels()) if each.arguments is not None]
    for each in kernels[part::parts]:
        if each.name not in compiled_kernels():
            _imported(each.function).compile(each.arguments)


def main() -> None:
    """Compile the part given on the command line; end as soon as the run that started this process ends."""
    threading.Thread(target=_end_with_parent, daemon=True).start()
    compile_last_first(*map(int, sys.argv[1:]))


def _end_with_parent() -> None:
    """Wait until the parent process ends, then end this process at once."""
    # The other end of this pipe is closed as its process ends, killed or not. Nothing is ever written to it.
    os.read(sys.stdin.fileno(), 1)
    os._exit(0)


if __name__ == "__main__":
    main()
