"""Systems and columns that a program adds to a simulation."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any, Protocol

import numpy as np
from numpy.typing import DTypeLike, NDArray

from crowdsim.crowd.agents import COLUMNS, Agents
from crowdsim.crowd.commandable import Commandable
from crowdsim.errors import ColumnError, StageError, SystemFailed
from crowdsim.yamlfile.messages import nearest

STAGES = ("commands", "move", "record")
"""Stages of a step: commands that are due are carried out, all agents move, the state is recorded and read."""

_NAME = re.compile(r"[a-z][a-z0-9_]{0,39}")
_TAKEN = (*COLUMNS, "agent", "group")


class System(Protocol):
    """Code that a simulation runs once a step, as a class with these attributes.

    Attributes
    ----------
    reads, writes : tuple of str
        Names of the columns it reads, and of own columns it writes. What it writes it may read, too.

    Examples
    --------
    >>> class Odometer:
    ...     reads, writes = ("x", "y"), ("last", "walked")
    ...     def run(self, columns, simulation):
    ...         here = np.column_stack([columns["x"], columns["y"]])
    ...         step = np.hypot(*(here - columns["last"]).T)
    ...         columns["last"], columns["walked"] = here, columns["walked"] + np.nan_to_num(step)
    >>> with Simulation(load_scenario("doorway")) as simulation:
    ...     simulation.add_column("last", float, default=np.nan, shape=(2,))
    ...     simulation.add_column("walked", float)
    ...     simulation.add_system(Odometer(), before="record")
    ...     for _ in range(50):
    ...         simulation.step()
    ...     simulation.agents["walked"].round(1)
    array([5.4, 3.1, 0. , 0. ])
    """

    reads: tuple[str, ...]
    writes: tuple[str, ...]

    def run(self, columns: Columns, simulation: Commandable) -> None:
        """Read and write columns, and give commands; these are carried out with the next step.

        Parameters
        ----------
        columns : Columns
            The declared columns.
        simulation : Commandable
            The simulation, for commands.
        """


class Columns:
    """The columns that a system declares, (N, ...) in the order of the agents' numbers.

    ``columns["x"]`` is a column, read-only; ``columns["infected"] = values`` replaces one. What is written counts when
    the system returns, and is dropped if it raises.

    Parameters
    ----------
    system : System
        What declares the columns.
    agents : Agents
        The agents as the last step left them.
    own : mapping of str to array
        Own columns of all systems by name, (N, ...).

    Examples
    --------
    >>> class Careless:
    ...     reads, writes = ("x",), ()
    ...     def run(self, columns, simulation):
    ...         columns["x"] = 0.0
    >>> with Simulation(load_scenario("doorway")) as simulation:
    ...     simulation.add_system(Careless(), before="move")
    ...     try:
    ...         simulation.step()
    ...     except SystemFailed as error:
    ...         print(error.__cause__)
    Careless does not declare that it writes 'x'; add it to 'writes'
    """

    def __init__(self, system: System, agents: Agents, own: Mapping[str, NDArray[Any]]) -> None:
        self._name = name_of(system)
        self._reads, self._writes = (*system.reads, *system.writes), system.writes
        self._agents, self._own = agents, own
        self.written: dict[str, NDArray[Any]] = {}

    def __len__(self) -> int:
        return len(self._agents)

    @property
    def present(self) -> NDArray[np.int64]:
        """Return the numbers (n,) of the agents in the world."""
        return self._agents.present

    def __getitem__(self, name: str) -> NDArray[Any]:
        if name not in self._reads:
            raise ColumnError(f"{self._name} does not declare that it reads '{name}'; add it to 'reads'")
        return self.written[name] if name in self.written else self._agents[name]

    def __setitem__(self, name: str, values: Any) -> None:
        if name not in self._writes:
            raise ColumnError(f"{self._name} does not declare that it writes '{name}'; add it to 'writes'")
        before, given = self._own[name], np.asarray(values)
        if given.shape != before.shape:
            raise ColumnError(f"column '{name}' has shape {before.shape}; {self._name} writes shape {given.shape}")
        if not np.can_cast(given.dtype, before.dtype, "same_kind"):
            raise ColumnError(f"column '{name}' holds {before.dtype}; {self._name} writes {given.dtype}")
        self.written[name] = _frozen(given.astype(before.dtype))


class Systems:
    """The systems of a simulation in the order in which a step runs them, and the columns they own.

    Attributes
    ----------
    columns : mapping of str to array
        Own columns (N, ...) by name; another mapping whenever one changes.
    running : str
        Name of the system that runs now, '' if none does.
    """

    def __init__(self, count: int) -> None:
        self.columns: Mapping[str, NDArray[Any]] = MappingProxyType({})
        self.running = ""
        self._count = count
        # Names of stages and systems, in the order of a step.
        self._order: list[str] = list(STAGES)
        self._systems: dict[str, System] = {}
        self._failed: SystemFailed | None = None

    def add_column(self, name: str, dtype: DTypeLike, default: Any, shape: tuple[int, ...]) -> None:
        """Add a column; see :meth:`Extensible.add_column`."""
        if not isinstance(name, str) or not _NAME.fullmatch(name):
            raise ColumnError(
                f"{name!r} is no name of a column; take up to 40 small letters, digits and _, a letter first"
            )
        if name in _TAKEN or name in self.columns:
            raise ColumnError(f"there is a column '{name}' already; give another name")
        kind = np.dtype(dtype)
        if kind.kind not in "biuf":
            raise ColumnError(f"column '{name}' cannot hold {kind}; take numbers or bool")
        fill = np.asarray(default)
        if fill.dtype.kind not in "biuf" or not _holds(kind, fill):
            raise ColumnError(f"column '{name}' holds {kind}, which {default!r} is not")
        try:
            values = np.full((self._count, *shape), np.broadcast_to(fill, shape), kind)
        except ValueError as error:
            raise ColumnError(f"column '{name}': {error}") from None
        self.columns = MappingProxyType({**self.columns, name: _frozen(values)})

    def add_system(self, system: System, before: str) -> None:
        """Add a system; see :meth:`Extensible.add_system`."""
        name = name_of(system)
        if name in self._order:
            raise StageError(f"there is a system '{name}' already; give this one another 'name'")
        if before not in self._order:
            raise StageError(f"there is no stage or system '{before}'; {nearest(before, self._order, 'there are')}")
        if not callable(getattr(system, "run", None)):
            raise StageError(f"{name} has no method 'run(columns, simulation)'")
        known = [*COLUMNS, *self.columns]
        for key in ("reads", "writes"):
            declared = getattr(system, key, None)
            if not isinstance(declared, tuple) or not all(isinstance(each, str) for each in declared):
                raise ColumnError(f"{name}.{key} must be a tuple of names of columns, got {declared!r}")
            for column in declared:
                if column not in known:
                    hint = nearest(column, known, "there are")
                    raise ColumnError(f"{name}.{key}: there is no column '{column}'; {hint}; own ones: add_column")
        for column in system.writes:
            if column in COLUMNS:
                raise ColumnError(f"{name}.writes: '{column}' is read-only; give commands to move agents")
        self._order.insert(self._order.index(before), name)
        self._systems[name] = system

    def run(self, stage: str, simulation: Commandable) -> None:
        """Run the systems that stand between the previous stage and ``stage``, in order; take over what they write.

        Raises
        ------
        SystemFailed
            If one of them raises; the simulation takes no more steps then.
        """
        end = self._order.index(stage)
        first = max((self._order.index(each) for each in STAGES if self._order.index(each) < end), default=-1) + 1
        for name in self._order[first:end]:
            system = self._systems[name]
            columns = Columns(system, simulation.agents, self.columns)
            self.running = name
            try:
                system.run(columns, simulation)
            except Exception as error:
                what = f"{type(error).__name__}: {error}"
                self._failed = SystemFailed(f"system '{name}' failed in step {simulation.step_count}: {what}")
                raise self._failed from error
            finally:
                self.running = ""
            if columns.written:
                self.columns = MappingProxyType({**self.columns, **columns.written})

    def require_sound(self) -> None:
        """Raise SystemFailed if a system failed."""
        if self._failed is not None:
            raise SystemFailed(f"{self._failed}; make a new Simulation")

    def require_outside(self) -> None:
        """Raise StageError while a system runs: it must not take steps, or add columns or systems."""
        if self.running:
            raise StageError(f"system '{self.running}' runs within a step, and can neither take steps nor add to them")


class Extensible:
    """The part of a simulation to which programs add own columns and systems."""

    def __init__(self, count: int) -> None:
        self._systems = Systems(count)

    def add_column(self, name: str, dtype: DTypeLike, default: Any = 0, shape: Sequence[int] = ()) -> None:
        """Add an own column, which systems write, and which is read as ``simulation.agents[name]``.

        Parameters
        ----------
        name : str
            Small letters, digits and _.
        dtype : dtype
            Type of its values: numbers, or bool.
        default : value, or array of ``shape``
            What it holds for every agent, in the world or not, until a system writes it.
        shape : sequence of int
            Shape of its value for one agent; () for a single number.

        Raises
        ------
        ColumnError
            If the name is malformed or taken, the dtype is another one, or the default does not fit dtype and shape.
        StageError
            If a system calls this.
        """
        self._systems.require_outside()
        self._systems.add_column(name, dtype, default, tuple(shape))

    def add_system(self, system: System, before: str = "move") -> None:
        """Run a system in every step from the next one on.

        Parameters
        ----------
        system : System
            An object with ``reads``, ``writes`` and ``run(columns, simulation)``. Its name is its attribute ``name``,
            or the name of its class if it has none.
        before : str
            Stage of the step, or name of another system, before which it runs, after systems that were added there
            earlier. Stages are "commands" (commands that are due are carried out), "move" (all agents take a step) and
            "record" (the state is recorded and read).

        Raises
        ------
        StageError
            If there is no such stage, there is a system of this name already, it has no method ``run``, or a system
            calls this.
        ColumnError
            If ``reads`` or ``writes`` is no tuple of names, names a column that does not exist, or if ``writes`` names
            one that is read-only.
        """
        self._systems.require_outside()
        self._systems.add_system(system, before)


def name_of(system: System) -> str:
    """Return the name that a system is called by."""
    return str(getattr(system, "name", type(system).__name__))


def _holds(kind: np.dtype[Any], fill: NDArray[Any]) -> bool:
    """Return True if a column of ``kind`` can hold the values ``fill`` (numbers or bool).

    Columns of floats may round them, but not to infinity; others must hold them exactly.
    """
    if kind.kind == "f":
        with np.errstate(over="ignore"):
            return bool(np.array_equal(np.isfinite(fill.astype(kind)), np.isfinite(fill)))
    return np.array_equal(fill.astype(kind), fill, equal_nan=True)


def _frozen(values: NDArray[Any]) -> NDArray[Any]:
    """Return the array itself, made read-only."""
    values.flags.writeable = False
    return values
