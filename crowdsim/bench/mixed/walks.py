"""Drills of steered crowds, walked by auto agents: the same people at the same places."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
import shapely
from numpy.typing import NDArray

from crowdsim.bench.crowds.drills import Drill, State
from crowdsim.constants import STEERING_RATE
from crowdsim.crowd.mixed.mixed_crowd import MixedCrowd
from crowdsim.crowd.report.steered_statistics import CENTER_LIMIT
from crowdsim.recording.header import AgentState
from crowdsim.scenario.cast import place_crowd
from crowdsim.scenario.loader import parse_scenario
from crowdsim.scenario.people.crowd_placement import CrowdPlacement
from crowdsim.scenario.people.walkers import Walkers
from crowdsim.scenario.scenario import Scenario

Watch: TypeAlias = Callable[[float, MixedCrowd], None]
"""Function that is called with the time [s] and the crowd after each step."""

_SCENARIO = """\
crowdsim: 1
name: drill
seed: {seed}
duration: {seconds}
steps_per_second: 10
floor: {{polygon: {floor}}}
agents:
{groups}
"""
_GROUP = "  - {{name: g{number}, count: {count}, start: {{rectangle: {start}}}, goal: {goal}}}\n"


@dataclass(frozen=True)
class MixedResult:
    """Results of a walk of n agents.

    Attributes
    ----------
    arrived : (n,) float64
        Arrival times [s]; nan for those that did not arrive.
    times : (n,) float64
        The same, counted from the appearance of the agent [s].
    captured : float
        Share of the way that was walked captured.
    stood : float
        Share of their time in the place in which agents were on their way, but slower than 0.1 m/s.
    gap : float
        Smallest gap between bodies [m], at most CENTER_LIMIT.
    agent_steps : int
        Number of steps, summed over agents.
    """

    arrived: NDArray[np.float64]
    times: NDArray[np.float64]
    captured: float
    stood: float
    gap: float
    agent_steps: int


def scenario_of(drill: Drill, seed: int = 1, goals: list[str] | None = None) -> Scenario:
    """Return a drill as a scenario of auto agents.

    ``goals`` are the goals of its groups as YAML, by default the polygons of the groups.
    """
    texts = [_polygon(group.goal) for group in drill.groups] if goals is None else goals
    groups = "".join(
        _GROUP.format(number=number, count=group.count, start=list(group.start), goal=text)
        for number, (group, text) in enumerate(zip(drill.groups, texts, strict=True))
    )
    ring = shapely.get_coordinates(drill.area.exterior)[:-1].tolist()
    return parse_scenario(_SCENARIO.format(seed=seed, seconds=drill.seconds, floor=ring, groups=groups))


def _polygon(region: Any) -> str:
    """Return the outline of a polygon as the text of a goal."""
    return f"{{polygon: {shapely.get_coordinates(region.exterior)[:-1].tolist()}}}"


def cast_of(scenario: Scenario, state: State) -> CrowdPlacement:
    """Return the cast of a scenario, with starts, headings, speeds, breadths and shares from ``state`` (ROW[n]).

    Rows of ``state`` must be in the order of the scenario's groups. Places in the goals are drawn as for any run.
    """
    drawn = place_crowd(scenario)
    # Breadths are those of the capsules, from side to side. Nobody waits before the first step; shares break ties.
    walkers = Walkers(
        speeds=state["speed"].copy(),
        breadths=2.0 * (state["half"] + state["radius"]),
        delays=np.zeros(len(state)),
        shares=state["share"].copy(),
    )
    places = np.column_stack((state["x"], state["y"]))
    return drawn._replace(starts=places, headings=state["heading"].copy(), walkers=walkers)


def walk_mixed(
    scenario: Scenario, cast: CrowdPlacement | None = None, watch: Watch | None = None, seconds: float | None = None
) -> MixedResult:
    """Run a scenario to its end, or for ``seconds``; call ``watch`` after each step with the time [s] and the crowd.

    ``cast`` is by default the one that the scenario draws.
    """
    crowd = MixedCrowd(scenario, 2, None, cast)  # two threads search motions
    slow = present = 0
    try:
        for step in range(round((scenario.duration if seconds is None else seconds) * STEERING_RATE)):
            crowd.advance()
            crowd.begin_work()
            frame = crowd.frame()
            crowd.measure(frame)
            crowd.new_routes()
            rows = crowd.everybody()
            going = rows["goal"] >= 0  # those that stay have none
            slow += int((np.hypot(rows["vx"], rows["vy"])[going] < 0.1).sum())
            present += int((np.asarray(frame.state) != AgentState.ABSENT).sum())
            crowd.end_step()
            if watch is not None:
                watch((step + 1) / STEERING_RATE, crowd)
            if crowd.finished:
                break
        summary = crowd.summary()
    finally:
        crowd.close()
    arrivals = crowd.arrivals
    times = (arrivals - crowd.entered) / STEERING_RATE
    gap = summary["closest_bodies"]  # None if no two bodies came within CENTER_LIMIT
    return MixedResult(
        np.where(arrivals >= 0, (arrivals + 1) / STEERING_RATE, np.nan),
        np.where(arrivals >= 0, times, np.nan),
        summary["level_share"]["captured"],
        slow / max(present, 1),
        CENTER_LIMIT if gap is None else gap,
        present,
    )
