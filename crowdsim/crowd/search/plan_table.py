"""Plans of all captured agents, and the table by which kernels find them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, MutableMapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from crowdsim.constants import NONE
from crowdsim.crowd.state.motion_plan import MotionPlan

NO_PASS = np.iinfo(np.int32).max
"""Value of ``first_pass`` for a plan that passes no earlier goal."""


class PlanTable(NamedTuple):
    """One row for each of n agents, whether in the world or not."""

    places: NDArray[np.int64]
    """(n, 4) addresses of the nodes, origins, blend offsets and rates of its plan, out of date without a plan.
    :class:`Motions` keeps these arrays alive."""
    nodes: NDArray[np.int32]
    """(n,) number of nodes of the plan, NONE without one."""
    first_pass: NDArray[np.int32]
    """(n,) index of the first node of the plan at whose end an earlier goal is reached, NO_PASS if there is none."""
    passes: NDArray[np.int32]
    """(n,) number of such nodes."""
    arrives: NDArray[np.bool_]
    """(n,) True if the plan reaches its goal."""
    rates: NDArray[np.int64]
    """(n,) rate of its first node while nothing is in the way [ticks/step]; without a plan, that of the last plan,
    or the natural rate."""


class Motions(MutableMapping[int, MotionPlan]):
    """Plan of each agent that has one, also kept in a row of ``table``, where kernels find it.

    Parameters
    ----------
    count : int
        Number of agents.
    natural_rate : int
        Rate in the table for agents without a plan [ticks/step].
    rates_of : callable
        Returns the rates (P,) int64 at which an agent plays the nodes of a plan while nothing is in its way
        [ticks/step].
    """

    def __init__(self, count: int, natural_rate: int, rates_of: Callable[[int, MotionPlan], NDArray[np.int64]]) -> None:
        self._rates_of = rates_of
        self._rates: dict[int, NDArray[np.int64]] = {}
        self._plans: dict[int, MotionPlan] = {}
        self.table = PlanTable(
            np.zeros((count, 4), np.int64),
            np.full(count, NONE, np.int32),
            np.full(count, NO_PASS, np.int32),
            np.zeros(count, np.int32),
            np.zeros(count, np.bool_),
            np.full(count, natural_rate, np.int64),
        )

    def __getitem__(self, agent: int) -> MotionPlan:
        return self._plans[agent]

    def __iter__(self) -> Iterator[int]:
        return iter(self._plans)

    def __len__(self) -> int:
        return len(self._plans)

    def __setitem__(self, agent: int, plan: MotionPlan) -> None:
        table = self.table
        arrays: list[NDArray[Any]] = [plan.nodes, plan.origins, plan.blend_offsets]
        for array, dtype in zip(arrays, (np.int32, np.float64, np.float64), strict=True):
            if array.dtype != dtype or not array.flags.c_contiguous:
                kind = array.dtype if array.flags.c_contiguous else f"a strided view of {array.dtype}"
                raise TypeError(f"kernels read plans of contiguous arrays of int32 and float64, not {kind}")
        self._plans[agent], self._rates[agent] = plan, self._rates_of(agent, plan)
        arrays.append(self._rates[agent])
        # Kernels read the arrays at their addresses, without a copy.
        table.places[agent] = [array.__array_interface__["data"][0] for array in arrays]
        table.nodes[agent] = plan.count
        table.first_pass[agent] = min(plan.passes, default=NO_PASS)
        table.passes[agent] = len(plan.passes)
        table.arrives[agent] = plan.arrives
        table.rates[agent] = self._rates[agent][0] if plan.count else table.rates[agent]

    def rate(self, agent: int, node: int) -> int:
        """Return the rate at which an agent plays node ``node`` of its plan if nothing is in its way [ticks/step]."""
        return int(self._rates[agent][node])

    def replay(self, agent: int) -> None:
        """Compute the rates of an agent's plan again, if it has one, after its speed has changed."""
        if agent in self._plans:
            self[agent] = self._plans[agent]

    def __delitem__(self, agent: int) -> None:
        del self._plans[agent], self._rates[agent]
        self.table.nodes[agent] = NONE
