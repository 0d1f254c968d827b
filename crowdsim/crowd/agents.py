"""All agents of a simulation as they are now, as columns."""

from __future__ import annotations

from collections.abc import Mapping
from copy import copy
from functools import cached_property
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from crowdsim.errors import ColumnError, CrowdSimError
from crowdsim.recording.header import AgentState, RecordedFrame
from crowdsim.recording.levels import levels_of
from crowdsim.recording.track_rows import TABLES_NEED
from crowdsim.yamlfile.messages import nearest

if TYPE_CHECKING:
    from pandas import DataFrame


COLUMNS = ("x", "y", "heading", "behavior", "state", "level")
"""Names of the columns that every simulation has."""

_INSTEAD = {
    **dict.fromkeys(("x", "y"), "send agents elsewhere with simulation.set_goal(agents, goal)"),
    "heading": "agents face where they walk; simulation.set_goal(agents, goal) sends them elsewhere",
    **dict.fromkeys(("behavior", "level"), "it follows from the room that an agent has"),
    "state": "simulation.add(group), set_goal(agents, goal) and remove(agents) change it",
}
"""What to do instead of writing a column, by its name, as the end of an error message."""

_OWN_INSTEAD = "a system writes own columns; see simulation.add_column and add_system"


class Agents:
    """Agents of a scenario in one step: columns (N,) in the order of their numbers, read-only.

    Attributes
    ----------
    x, y : (N,) float64
        Position [m], nan outside of the world.
    heading : (N,) float64
        Heading [rad], nan outside of the world.
    behavior : (N,) int64
        Number of the behavior, in the order of ``behaviors``; -1 for none.
    state : (N,) int64
        :class:`~crowdsim.recording.header.AgentState`.
    level : (N,) int64
        :class:`~crowdsim.recording.levels.Level`.
    behaviors : tuple of str
        Names of the behaviors.
    groups : (N,) tuple of str
        Name of the group of each agent.
    own : mapping of str to array
        Columns (N, ...) that :meth:`Simulation.add_column` added; ``agents["name"]`` is one, or one of the above.

    Raises
    ------
    ColumnError
        If an attribute or a column is assigned; it names the command to give instead.
    """

    x: NDArray[np.float64]
    y: NDArray[np.float64]
    heading: NDArray[np.float64]
    behavior: NDArray[np.int64]
    state: NDArray[np.int64]
    level: NDArray[np.int64]
    groups: tuple[str, ...]
    behaviors: tuple[str, ...]
    own: Mapping[str, NDArray[Any]]

    def __init__(
        self,
        frame: RecordedFrame,
        groups: tuple[str, ...],
        behaviors: tuple[str, ...],
        own: Mapping[str, NDArray[Any]] = MappingProxyType({}),
    ) -> None:
        given = {
            "x": _column(frame.x, np.float64),
            "y": _column(frame.y, np.float64),
            "heading": _column(frame.heading, np.float64),
            "behavior": _column(frame.behavior, np.int64),
            "state": _column(frame.state, np.int64),
            "level": _column(levels_of(frame.state, frame.node, frame.phase), np.int64),
            "groups": groups,
            "behaviors": behaviors,
            "own": own,
        }
        for name, value in given.items():
            object.__setattr__(self, name, value)  # as __setattr__ refuses

    def __setattr__(self, name: str, value: Any) -> NoReturn:
        self._refuse(name)

    def __setitem__(self, name: str, values: Any) -> NoReturn:
        self._refuse(name)

    def _refuse(self, name: str) -> NoReturn:
        raise ColumnError(f"agents are only read, so '{name}' cannot be set; {_INSTEAD.get(name, _OWN_INSTEAD)}")

    def __getitem__(self, name: str) -> NDArray[Any]:
        if name in COLUMNS:
            column: NDArray[Any] = getattr(self, name)
            return column
        if name not in self.own:
            raise ColumnError(f"there is no column '{name}'; {nearest(name, [*COLUMNS, *self.own], 'there are')}")
        return self.own[name]

    def with_own(self, own: Mapping[str, NDArray[Any]]) -> Agents:
        """Return the same agents with other own columns."""
        agents = copy(self)
        object.__setattr__(agents, "own", own)
        return agents

    def __len__(self) -> int:
        return len(self.x)

    @cached_property
    def present(self) -> NDArray[np.int64]:
        """Return the numbers (n,) of the agents in the world."""
        return _column(np.flatnonzero(self.state != AgentState.ABSENT), np.int64)

    def table(self) -> DataFrame:
        """Return the agents in the world as a pandas frame, one row each; own columns of several values are left out.

        Raises
        ------
        CrowdSimError
            Without pandas, which the extra ``table`` installs.
        """
        try:
            import pandas
        except ImportError:
            raise CrowdSimError(TABLES_NEED) from None
        here = self.present
        return pandas.DataFrame(
            {
                "agent": here,
                "x": self.x[here],
                "y": self.y[here],
                "heading": self.heading[here],
                # No behavior is -1, which finds the last, empty name.
                "behavior": np.array([*self.behaviors, ""])[self.behavior[here]],
                "state": [AgentState(state).name.lower() for state in self.state[here].tolist()],
                "group": np.array(self.groups)[here],
                **{name: values[here] for name, values in self.own.items() if values.ndim == 1},
            }
        )


def _column(values: Any, dtype: Any) -> NDArray[Any]:
    """Return a copy of values as a read-only array."""
    column = np.array(values, dtype)
    column.flags.writeable = False
    return column
