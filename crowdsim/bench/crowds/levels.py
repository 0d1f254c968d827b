"""Time of a step of captured crowds by stage, from thirty to ten thousand agents, and of a mixed crowd.

Captured agents walk to and fro on an open square between a place of their own and another 6 to 12 m away,
endlessly, at 30 steps per second. Stages are timed one after another, with searches awaited, since they would share the
processor. Their times are milliseconds of processor time per step, means over STEPS steps, because searches come in
bursts; those of the mixed crowd are of the clock.
"""

from __future__ import annotations

import math
import time
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from crowdsim.bench.crowds.whole_runs import square_scenario
from crowdsim.constants import NONE
from crowdsim.crowd.captured_crowd import CapturedCrowd
from crowdsim.crowd.mixed.mixed_crowd import MixedCrowd
from crowdsim.crowd.state.state_hash import state_hash
from crowdsim.crowd.systems.animate import animate
from crowdsim.recording.writer import RecordingWriter
from crowdsim.scenario.loader import parse_scenario
from crowdsim.scenario.people.placement import Placement
from crowdsim.scenario.scenario import Scenario

DENSITY = 0.1
"""Agents per area [1/m2]."""

STEPS = 60
"""Steps that are timed by stage, and as many again that are timed as a whole."""

SETTLING = 360
"""Largest number of steps before, until nearly all agents have appeared and two seconds have passed."""

STAGES = (
    *("react", "spawn", "choose", "animate", "despawn", "hash", "record", "measure", "submit"),
    "search",
)
"""Stages of a step; ``react`` hands out plans, ``submit`` starts searches. A crowd starts them before it records and
measures; here that comes behind both, as their processor time would contain that of searches."""

_SCENARIO = """\
crowdsim: 1
name: open
seed: 1
duration: 1000
steps_per_second: 30
floor: {{rectangle: [0, 0, {side}, {side}]}}
agents:
  - name: all
    locomotion: captured
    count: 1
    start: {{rectangle: [0.5, 0.5, 2, 2]}}
    goal: {{rectangle: [3, 3, 5, 5]}}
"""
_OFF_EDGE = 0.6  # meters
_LEGS = (6.0, 12.0)  # meters


def captured_square(agents: int, seed: int = 1) -> tuple[Scenario, Placement]:
    """Return an open square, and the cast of ``agents`` captured agents who walk to and fro on it endlessly."""
    rng = np.random.default_rng(seed)
    side = math.sqrt(agents / DENSITY)
    across = math.ceil(math.sqrt(agents))
    row, column = np.divmod(np.arange(agents), across)
    starts = (np.column_stack((column, row)) + 0.5 + rng.uniform(-0.25, 0.25, (agents, 2))) * side / across
    starts = np.clip(starts, _OFF_EDGE, side - _OFF_EDGE)
    goals = tuple(np.array([_place_off(rng, start, side), start]) for start in starts)
    cast = Placement(
        starts=starts,
        goals=goals,
        rounds=np.full(agents, NONE, np.int64),
        waits=np.zeros(agents),
        start_steps=np.zeros(agents, np.int64),
        stays=np.zeros(agents, np.bool_),
        headings=tuple(np.full(2, np.nan) for _ in range(agents)),
        stand_within=np.full(agents, 0.1),
        groups=("all",) * agents,
        speeds=np.full(agents, np.nan),
        only_goals=np.full(agents, NONE),
        regions=(),
    )
    return parse_scenario(_SCENARIO.format(side=side)), cast


def _place_off(rng: np.random.Generator, start: NDArray[np.float64], side: float) -> NDArray[np.float64]:
    """Return a random place (2,) on a square of ``side`` [m], 6 to 12 m from ``start`` and not near the edge."""
    while True:
        angle, leg = rng.uniform(-math.pi, math.pi), rng.uniform(*_LEGS)
        place: NDArray[np.float64] = start + leg * np.array([math.cos(angle), math.sin(angle)])
        if (place > _OFF_EDGE).all() and (place < side - _OFF_EDGE).all():
            return place


def staged_step(crowd: CapturedCrowd, writer: RecordingWriter | None = None) -> list[float]:
    """Take a step to the same state as the crowd itself does; return the processor time of each of STAGES [s].

    Each call of ``mark`` ends a stage, in their order. The step is recorded if there is a ``writer``.
    """
    marks = [time.process_time()]

    def mark() -> None:
        """Note the end of a stage."""
        marks.append(time.process_time())

    view = crowd.world.view()
    crowd.react(view)
    mark()
    crowd.spawning.spawn(view)
    crowd.world.apply_changes()
    mark()
    view = crowd.world.view()
    crowd.choosing.choose(view)
    mark()
    animate(crowd.assets, view)
    mark()
    crowd.despawning.despawn(view)
    crowd.world.apply_changes()
    mark()
    crowd.hash = state_hash(crowd.world, crowd.environment.state(), crowd.step_count, crowd.hash)
    mark()
    frame = crowd.frame()
    for route in crowd.new_routes():
        if writer is not None:
            writer.add_path(*route)
    if writer is not None:
        writer.append(frame, crowd.hash)
    mark()
    crowd.measure(frame)
    mark()
    crowd.begin_work()
    crowd.end_step()
    mark()
    crowd.searches.pool.settle()
    mark()
    return np.diff(marks).tolist()


def captured_row(agents: int, folder: Path) -> dict[str, Any]:
    """Return milliseconds per step by stage, and rates, of ``agents`` captured agents.

    admitted_in_second: number of agents present after the first simulated second. steps_a_second: whole
    steps per second of wall-clock time with two search threads.
    """
    scenario, cast = captured_square(agents)
    crowd = CapturedCrowd(scenario, 2, None, cast)  # two threads search
    rate = scenario.steps_per_second
    admitted = 0
    with RecordingWriter(folder / "level.h5", crowd.header(scenario)) as writer:
        for step in range(SETTLING):
            staged_step(crowd)
            if step + 1 == rate:
                admitted = crowd.world.count
            if step > 2 * rate and crowd.world.count >= 0.99 * agents:
                break
        stages = np.mean([staged_step(crowd, writer) for _ in range(STEPS)], axis=0) * 1e3
        begin = time.perf_counter()
        for _ in range(STEPS):
            crowd.advance()
            crowd.begin_work()
            frame = crowd.frame()
            for route in crowd.new_routes():
                writer.add_path(*route)
            writer.append(frame, crowd.hash)
            crowd.measure(frame)
            crowd.end_step()
        crowd.searches.pool.settle()
        pace = STEPS / (time.perf_counter() - begin)
        writer.finish(crowd.summary())
    present = crowd.world.count
    crowd.close()
    row: dict[str, Any] = {"agents": agents, "present": present, "admitted_in_second": admitted}
    row |= {f"{name}_ms": round(float(ms), 3) for name, ms in zip(STAGES, stages, strict=True)}
    return row | {"whole_ms": round(float(stages.sum()), 3), "steps_a_second": round(pace, 1)}


def mixed_row(agents: int) -> dict[str, Any]:
    """Return wall-clock milliseconds per step of ``agents`` auto agents on a square, and the share captured at the end.

    The first STEPS steps are not timed.
    """
    scenario = parse_scenario(square_scenario(agents, DENSITY).replace("steered", "auto"))
    crowd = MixedCrowd(scenario, 2, None)
    times = []
    for _ in range(2 * STEPS):
        begin = time.perf_counter()
        crowd.advance()
        crowd.begin_work()
        crowd.measure(crowd.frame())
        crowd.new_routes()
        crowd.end_step()
        times.append(time.perf_counter() - begin)
    captured, steered = crowd.captured.world.count, crowd.steered.world.count
    crowd.close()
    return {
        "agents": agents,
        "present": captured + steered,
        "captured_share": round(captured / max(captured + steered, 1), 3),
        "whole_ms": round(float(np.mean(times[STEPS:])) * 1e3, 3),
    }


def level_figures(levels: tuple[int, ...], mixed: int, folder: Path) -> dict[str, float]:
    """Return figures by name, such as ``captured_3000_choose_ms`` and ``mixed_3000_whole_ms``.

    ``times_a_tenfold`` is the factor by which a step's time grows with ten times as many agents, derived from two
    successive numbers of ``levels``, which ascend.
    """
    figures: dict[str, float] = {}
    rows = [captured_row(agents, folder) for agents in levels]
    for row in rows:
        figures |= {f"captured_{row['agents']}_{key}": float(row[key]) for key in row if key != "agents"}
    for small, large in pairwise(rows):
        grown = math.log10(large["present"] / small["present"])
        ratio = math.pow(large["whole_ms"] / small["whole_ms"], 1.0 / grown)
        figures[f"captured_{small['agents']}_to_{large['agents']}_times_a_tenfold"] = round(ratio, 2)
    row = mixed_row(mixed)
    return figures | {f"mixed_{mixed}_{key}": float(row[key]) for key in row if key != "agents"}
