"""A thousand characters that search and play at 30 frames a second (2012 paper, section 6: ten on four cores).

Played alone, as in the paper, characters walk through each other: every frame hands out what searches found, begins the
next slices, enters and advances nodes and poses every joint of everybody. The run beside it has all that a run has but
the recording: the same characters in the same place, none of whom ever meets another.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from crowdsim.bench.motions.map_trials import LENGTHS
from crowdsim.bench.registry import Measurement
from crowdsim.constants import NONE, TRACKING_MARGIN
from crowdsim.crowd.captured_crowd import CapturedCrowd
from crowdsim.crowd.search.motion_search import MotionSearch
from crowdsim.crowd.search.scheduler import Ongoing, Searches
from crowdsim.crowd.search.worker_pool import WorkerPool
from crowdsim.crowd.simulation import Simulation
from crowdsim.crowd.state.assets import Assets, prepare
from crowdsim.crowd.state.environment import EnvironmentState
from crowdsim.crowd.state.motion_plan import MotionPlan, Request
from crowdsim.crowd.state.reservation_kernels import append_stop
from crowdsim.crowd.state.timelines import Chain
from crowdsim.crowd.systems.animate import Playing
from crowdsim.crowd.systems.animate_kernels import advance
from crowdsim.errors import PathNotFound
from crowdsim.motion.graph.pose_kernels import pose_joints
from crowdsim.motion.graph.track_kernels import node_end
from crowdsim.scenario.loader import parse_scenario
from crowdsim.scenario.placement import Placement, place_agents

FRAME_SECONDS = 1.0 / 30.0

BURST_FRAMES = 300
"""Frames that are told of by themselves: in the first of them all characters ask for their way at once."""

AREA = 4.0
"""Square meters of floor for each character."""

_SCENARIO = """\
crowdsim: 1
name: many
seed: 5
duration: 600.0
steps_per_second: 30
floor: {{rectangle: [0, 0, {side}, {side}]}}
obstacles: [{obstacles}]
agents:
  - {{name: all, count: {count}, start: {{rectangle: [0, 0, {side}, {side}]}}, interval: {interval}, repeat: forever,
      goals: [{goals}]}}
"""


def scenario_text(characters: int, interval: float) -> str:
    """A cluttered square where everybody goes from one random place to another, for ever."""
    side = round(max((AREA * characters) ** 0.5, LENGTHS[0] + 5.0), 1)
    goals = ", ".join([f"{{rectangle: [0, 0, {side}, {side}]}}"] * 4)
    rng = np.random.default_rng(5)
    obstacles = [
        f"{{name: box_{x}_{y}, box: {{center: [{x + rng.uniform(-1, 1):.2f}, {y + rng.uniform(-1, 1):.2f}],"
        f" size: [{rng.uniform(0.5, 2.5):.2f}, {rng.uniform(0.5, 2.5):.2f}], rotation: {rng.uniform(0, 90):.0f}}},"
        f" top: {rng.uniform(0.3, 2.2):.2f}}}"
        for x in range(3, round(side) - 1, 6)
        for y in range(3, round(side) - 1, 6)
    ]
    return _SCENARIO.format(side=side, obstacles=", ".join(obstacles), count=characters, interval=interval, goals=goals)


@dataclass
class Players:
    """Characters that play what is found for them and ask for the next way where it ends; nobody avoids anybody.

    stops: how often a search was not far enough when its nodes were played.
    """

    assets: Assets
    environment: EnvironmentState
    cast: Placement
    searches: Searches
    step: int = 0
    stops: int = 0
    reached: NDArray[np.int64] = field(init=False)

    def __post_init__(self) -> None:
        count = len(self.cast.starts)
        self.plans: list[MotionPlan | None] = [None] * count
        self.reached = np.zeros(count, np.int64)
        idle = int(self.assets.idle_nodes[-1])
        self.node = np.full(count, idle, np.int32)
        self.previous = np.full(count, NONE, np.int32)
        # Not all in step with each other.
        self.frame = (7 * np.arange(count) % int(self.assets.graph.node_frames[idle])).astype(np.int32)
        self.origin = np.column_stack([self.cast.starts, np.zeros(count)])
        self.blend_offset = np.zeros((count, 3))
        self.next_node = np.full(count, NONE, np.int32)
        self.next_origin, self.next_blend_offset = np.zeros((count, 3)), np.zeros((count, 3))
        self.next_cursor, self.cursor = np.full(count, NONE, np.int32), np.full(count, NONE, np.int32)
        self.behavior, self.pose = np.zeros(count, np.int32), np.zeros((count, 3))
        joints = len(self.assets.motion.poses.parents)
        self.joints = np.empty((count, joints, 3), np.float32)
        self.turns = np.empty((count, joints, 4), np.float32)
        self._chain = Chain.room(16)
        for agent in range(count):
            self._ask(agent)

    def frame_on(self) -> None:
        """All that happens between two frames that are shown."""
        graph = self.assets.graph
        for agent, search, found in self.searches.collect(self.step):
            self._hand_out(agent, search, found)
        frames = self.assets.frames_per_step
        for agent in np.flatnonzero(self.frame + frames >= graph.node_frames[self.node]).tolist():
            self._choose(agent)
        advance(graph, frames, Playing(*(getattr(self, name) for name in Playing._fields)))
        self.searches.submit(self.step, 0, self._played)
        pose_joints(self.assets.motion.poses, self.node, self.previous, self.frame, self.pose, self.joints, self.turns)
        self.step += 1

    @property
    def arrivals(self) -> int:
        return int(self.reached.sum())

    def _played(self, agent: int, search: Ongoing) -> int | None:
        plan = self.plans[agent]
        if search.handed is None:
            return 0
        return None if plan is None or plan.nodes is not search.handed else int(self.cursor[agent]) + 1

    def _ask(self, agent: int) -> None:
        node, origin = int(self.node[agent]), self.origin[agent].copy()
        position = np.array(node_end(self.assets.graph, node, *origin)[:2])
        goal = self.cast.goal(agent, int(self.reached[agent]))
        self.searches.begin(
            agent, MotionSearch(self.assets, self.environment, Request(position, goal, True, departure=(node, origin)))
        )

    def _hand_out(self, agent: int, search: Ongoing, found: MotionPlan | PathNotFound) -> None:
        if search.handed is not None and (self.plans[agent] is None or self.cursor[agent] == NONE):
            self.searches.drop(agent)
            return
        if isinstance(found, PathNotFound) or found.count == 0:
            if search.search.over:  # no way: it goes elsewhere
                self.reached[agent] += 1
                self.plans[agent] = None
                self._ask(agent)
            return
        self.plans[agent] = found
        self.searches.handed(agent, found.nodes, 0)

    def _choose(self, agent: int) -> None:
        """The next node of a plan, of a stop, or of waiting."""
        graph, plan = self.assets.graph, self.plans[agent]
        following = int(self.cursor[agent]) + 1
        if plan is not None and following < plan.count:
            self._enter(
                agent, int(plan.nodes[following]), plan.origins[following], plan.blend_offsets[following], following
            )
            return
        if plan is not None:
            self.stops += not plan.arrives
            self.reached[agent] += plan.arrives
            self.plans[agent] = None
        node = int(self.node[agent])
        if graph.stop_edge[node] != NONE:
            nodes, origins, blend_offsets = self._chain
            nodes[0], origins[0], blend_offsets[0] = node, self.origin[agent], self.blend_offset[agent]
            append_stop(graph, self._chain, 1)
            self._enter(agent, int(nodes[1]), origins[1], blend_offsets[1])
            return
        if not graph.node_idle[node]:
            end = np.array(node_end(graph, node, *self.origin[agent]))
            self._enter(agent, self.assets.idle_after(node), end, np.zeros(3))
        else:
            self._enter(agent, node, self.origin[agent], np.zeros(3))
            if not self.searches.is_under_way(agent):
                self._ask(agent)

    def _enter(
        self,
        agent: int,
        node: int,
        origin: NDArray[np.float64],
        blend_offset: NDArray[np.float64],
        cursor: int = NONE,
    ) -> None:
        self.next_node[agent], self.next_cursor[agent] = node, cursor
        self.next_origin[agent], self.next_blend_offset[agent] = origin, blend_offset


def measure(
    characters: int = 1000, seconds: float = 60.0, run_seconds: float = 30.0, workers: int = 2, requests: int = 200
) -> Measurement:
    """Frame times of characters that play alone, and steps of a run with as many; both in real time, as if shown.

    And what passes from a request to the first movement where nothing else is to be done.
    """
    frames = round(seconds / FRAME_SECONDS)
    scenario = parse_scenario(scenario_text(characters, interval=0.0))
    assets = prepare(scenario)
    cast = place_agents(scenario, assets.personal_radius + TRACKING_MARGIN)
    environment = EnvironmentState(assets)
    _warm_up(assets, environment, cast)
    rows = []
    with WorkerPool[tuple[Ongoing, MotionPlan | PathNotFound]](workers, latency=1) as pool:
        players = Players(assets, environment, cast, Searches(pool))
        times = _paced(players.frame_on, BURST_FRAMES)
        rows.append(_row("playing, after all asked at once", characters, times, players.searches, players.arrivals))
        players.searches.waits.clear()
        times = _paced(players.frame_on, frames)
        rows.append(_row("playing", characters, times, players.searches, players.arrivals))
        walking = int((players.cursor >= 0).sum())
    scenario = parse_scenario(scenario_text(characters, interval=0.02))
    with Simulation(scenario, workers) as simulation:
        for _ in range(30):
            simulation.step()
        crowd = simulation.crowd
        assert isinstance(crowd, CapturedCrowd)
        steps = _paced(simulation.step, round(run_seconds / FRAME_SECONDS))
        reached = int(crowd.itineraries.reached.sum())
        rows.append(_row("run", crowd.world.count, steps, crowd.searches, reached))
    figures = {
        f"{name}_{key}": float(row[key])
        for name, row in zip(("at_once", "playing", "run"), rows, strict=True)
        for key in _FIGURES
        if row[key] is not None
    }
    figures |= {"playing_stops": float(players.stops), "playing_walking_at_the_end": float(walking)}
    first = _first_movements(assets, environment, cast, requests)
    figures |= {
        "first_movement_ms_median": float(np.median(first)),
        "first_movement_ms_p95": float(np.quantile(first, 0.95)),
    }
    return Measurement(rows, figures)


_FIGURES = tuple(
    (
        "frame_ms_median frame_ms_p95 frame_ms_p99 frame_ms_most late_percent cpu_ms_mean "
        "first_movement_ms_median first_movement_ms_p95 first_movement_ms_most sliced backtracked recovered"
    ).split()
)


def _first_movements(assets: Assets, environment: EnvironmentState, cast: Placement, count: int) -> list[float]:
    """Milliseconds from a request to the first nodes to walk, path and all, while nothing else goes on; best of three.

    The ways are 10 to 18 m long as the crow flies, the length of the paths of :mod:`crowdsim.bench.motions.map_trials`.
    """
    ends = [
        (start, goal)
        for start in cast.starts
        for goal in cast.starts
        if LENGTHS[0] < np.hypot(*(goal - start)) < LENGTHS[1]
    ]
    times = []
    for k in range(count):
        start, goal = ends[k * len(ends) // count]
        tries = []
        for _ in range(3):
            begin = time.perf_counter()
            MotionSearch(assets, environment, Request(start, goal, stays=True)).advance()
            tries.append(time.perf_counter() - begin)
        times.append(min(tries) * 1e3)
    return times


def _warm_up(assets: Assets, environment: EnvironmentState, cast: Placement) -> None:
    """Load all kernels, and make what is made once for the place."""
    with WorkerPool[tuple[Ongoing, MotionPlan | PathNotFound]](1, latency=1) as pool:
        few = Players(assets, environment, cast, Searches(pool))
        for _ in range(40):
            few.frame_on()


class _Times(NamedTuple):
    """Seconds of each frame (n,), and seconds a frame of all threads on processors, whatever else these do."""

    frames: NDArray[np.float64]
    busy: float


def _paced(work: Any, count: int) -> _Times:
    """What ``work`` takes each time, begun at every thirtieth of a second; searches have the time between."""
    times = np.empty(count)
    busy = time.process_time()
    due = time.perf_counter()
    for k in range(count):
        begin = time.perf_counter()
        work()
        times[k] = time.perf_counter() - begin
        due = max(due + FRAME_SECONDS, begin + times[k])
        time.sleep(max(due - time.perf_counter(), 0.0))
    return _Times(times, (time.process_time() - busy) / count)


def _row(what: str, characters: int, times: _Times, searches: Searches, arrivals: int) -> dict[str, Any]:
    ms = times.frames * 1e3
    return {
        "what": what,
        "characters": characters,
        "frames": len(ms),
        "frame_ms_median": round(float(np.median(ms)), 2),
        "frame_ms_p95": round(float(np.quantile(ms, 0.95)), 2),
        "frame_ms_p99": round(float(np.quantile(ms, 0.99)), 2),
        "frame_ms_most": round(float(ms.max()), 1),
        "late_percent": round(100.0 * float((times.frames > FRAME_SECONDS).mean()), 2),
        "cpu_ms_mean": round(times.busy * 1e3, 2),
        "arrivals": arrivals,
        **searches.summary(),
    }
