"""Doors close and open, things come, move and go while agents walk; they go round, wait, and come from sources.

What is asserted holds for any seed: who is where at some second is relied on only where no walk could be otherwise.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import shapely

from crowdsim.crowd.captured_crowd import CapturedCrowd
from crowdsim.crowd.simulation import Simulation
from crowdsim.following.follower.follow_options import FollowOptions
from crowdsim.recording.header import AgentState
from crowdsim.recording.reader import Recording
from crowdsim.scenario.loader import parse_scenario
from tests.support.two_rooms import WALKERS, two_rooms

SEEDS = (3, 4, 5)
WALL = 5.075
BUSY = (
    "at: 3, move: {name: crate, by: [0, 3]}",
    "at: 5, close: door_a",
    "at: 8, insert: {name: barrel, cylinder: {center: [9, 3], radius: 0.3}, top: 1.1}",
    "at: 20, remove: barrel",
    "at: 35, open: door_a",
)
LATE = WALKERS.replace("name: walkers, count: 4", "name: late, count: 2, start_time: 35")
"""Two more of them, who start when door a has opened again."""
GUARD = """\
name: guards, count: 1, start: {point: [7, 5]}, repeat: 2,
     goals: [{point: [7, 3]}, {point: [10, 3]}, {point: [10, 5]}, {point: [7, 5]}]"""


def run(text: str, file: Path, workers: int = 2) -> Recording:
    return Simulation(parse_scenario(text), workers).run(file)


def busy_text(seed: int) -> str:
    return two_rooms(WALKERS, LATE, GUARD, events=BUSY, seed=seed)


def crossings(recording: Recording) -> dict[int, tuple[float, float]]:
    """Second and y at which each agent crosses the wall from left to right."""
    x, y = recording.x[:], recording.y[:]
    there = recording.state[:] != AgentState.ABSENT
    found = {}
    for agent in range(recording.agent_count):
        over = np.flatnonzero((x[:-1, agent] < WALL) & (x[1:, agent] >= WALL) & there[:-1, agent] & there[1:, agent])
        if len(over):
            found[agent] = float(over[0]) / recording.steps_per_second, float(y[over[0], agent])
    return found


def crossings_of(recording: Recording, group: str) -> list[tuple[float, float]]:
    groups = recording.header.agents.groups
    return [crossing for agent, crossing in crossings(recording).items() if groups[agent] == group]


def happened(recording: Recording) -> dict[str, float]:
    """Second at which each event came about."""
    return {event["event"]: event["at"] + event["late"] for event in recording.summary["events"]}


def least_margin(recording: Recording) -> float:
    """Smallest distance of any body to a thing that is there at the time, by the shapes in the recording."""
    layers, behaviors = recording.header.layers, recording.header.behaviors
    least = np.inf
    for step in range(recording.steps):
        frame = recording.at_step(step)
        # Steered bodies are no discs; their gaps to walls are told by the summary.
        there = np.flatnonzero((frame.state != AgentState.ABSENT) & ~frame.steered)
        places = shapely.points(frame.x[there], frame.y[there])
        for solid in recording.movables_at(step / recording.steps_per_second):
            shape = shapely.from_wkt(solid.footprint)
            for row, layer in enumerate(layers):
                if row == 0 or (solid.bottom < layer.high and solid.top > layer.low):
                    radii = np.array([behavior.radii[row] for behavior in behaviors])[frame.behavior[there]]
                    least = min(least, float((shapely.distance(places, shape) - radii).min(initial=np.inf)))
    return least


@pytest.fixture(scope="module", params=SEEDS)
def busy(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Recording:
    return run(busy_text(request.param), tmp_path_factory.mktemp("busy") / "busy.h5")


def test_everyone_arrives_by_the_door_that_is_open(busy: Recording) -> None:
    """The door closes at 5 s, or when those have passed who are in it then: never the last one, who starts at 6 s."""
    assert busy.summary["arrived"] == busy.summary["characters"] == 7
    times = happened(busy)
    closed, opened = times["close 'door_a'"], times["open 'door_a'"]
    first, late = crossings_of(busy, "walkers"), crossings_of(busy, "late")
    assert len(first) == 4
    assert len(late) == 2
    assert first[-1][0] >= closed
    assert 4.0 < first[-1][1] < 5.0
    assert all(4.0 < y < 5.0 for second, y in first if closed <= second < opened)
    assert all(second > opened and 1.0 < y < 2.0 for second, y in late), "open, it is taken again"


def test_all_events_happen_and_make_some_plan_anew(busy: Recording) -> None:
    assert [event["event"] for event in busy.summary["events"]] == [
        "move 'crate'", "close 'door_a'", "insert 'barrel'", "remove 'barrel'", "open 'door_a'",
    ]  # fmt: skip
    assert all(event["outcome"] == "happened" for event in busy.summary["events"])
    assert busy.summary["replans"] > 0
    assert busy.summary["laps"] == {"guards": 2}


def test_nobody_touches_what_is_there_at_the_time(busy: Recording) -> None:
    assert min(busy.summary["obstacle_margin"].values()) >= 0.0
    assert least_margin(busy) >= -1e-4


def test_the_recording_shows_what_is_there_at_each_time(busy: Recording) -> None:
    def names(time: float) -> set[str]:
        return {solid.name for solid in busy.movables_at(time)}

    times, begin = happened(busy), {"crate": 0.0}
    begin |= {name: times[f"{verb} '{name}'"] for name, verb in (("door_a", "close"), ("barrel", "insert"))}
    end = {"crate": np.inf, "door_a": times["open 'door_a'"], "barrel": times["remove 'barrel'"]}
    apart = 1.0 / busy.steps_per_second
    for time in sorted({0.0, 36.0, *(t + off for t in times.values() for off in (-apart, apart))}):
        assert names(time) == {name for name in begin if begin[name] <= time < end[name]}, time
    moved = times["move 'crate'"]
    before, after = (
        shapely.from_wkt(next(s for s in busy.movables_at(moved + off) if s.name == "crate").footprint).centroid
        for off in (-1.0, 1.0)
    )
    assert (before.x, before.y, after.x, after.y) == pytest.approx((8.0, 1.5, 8.0, 4.5))


def test_the_number_of_workers_does_not_change_the_run(tmp_path: Path) -> None:
    text = busy_text(SEEDS[0])
    with run(text, tmp_path / "1.h5", workers=1) as one, run(text, tmp_path / "4.h5", workers=4) as four:
        assert four.summary["state_hash"] == one.summary["state_hash"]
        np.testing.assert_array_equal(four.x[:], one.x[:])


@pytest.mark.parametrize("seed", SEEDS)
def test_only_affected_agents_plan_anew(seed: int, request: pytest.FixtureRequest) -> None:
    """At 1 s nobody is near the door, which closes in time, and none of those behind it is at its goal."""
    far = """\
name: far, count: 3, interval: 0.5, start: {rectangle: [6, 0.5, 7, 5.5]},
     goal: {rectangle: [11, 3, 11.5, 5.5]}"""
    walkers = WALKERS.replace("interval: 2", "interval: 0.3, locomotion: captured")
    text = two_rooms(walkers, f"{far}, locomotion: captured", events=("at: 1, close: door_a",), seed=seed)
    simulation = Simulation(parse_scenario(text))
    request.addfinalizer(simulation.close)
    crowd = simulation.crowd
    assert isinstance(crowd, CapturedCrowd)
    while not crowd.environment.revision:
        plans, routes = dict(crowd.plans.motions), dict(crowd.plans.routes)
        agents = crowd.world.column("agent").tolist()
        digests = dict(zip(agents, crowd.world.column("plan_digest").tolist(), strict=True))
        places = dict(zip(agents, crowd.world.column("pose")[:, 0].tolist(), strict=True))
        simulation.step()
    leaf = shapely.box(5, 1, 5.15, 2)
    going_through = {
        agent
        for agent in plans
        if shapely.LineString(routes[agent].points).intersects(leaf) and places.get(agent, 0.0) < 5.0
    }
    assert simulation.step_count == 31
    assert going_through == {0, 1, 2, 3}
    assert len(going_through) < len(plans)
    for _ in range(8):
        simulation.step()
    assert crowd.plans.replans == len(going_through)
    for row, agent in enumerate(crowd.world.column("agent").tolist()):
        if agent in going_through:
            assert crowd.plans.routes[agent] is not routes[agent]
        elif agent in digests and agent in plans:
            assert crowd.plans.motions[agent] is plans[agent]
            assert crowd.plans.routes[agent] is routes[agent]
            assert crowd.world.column("plan_digest")[row] == digests[agent]


@pytest.mark.parametrize("seed", SEEDS[:2])
def test_those_without_a_way_wait_until_a_door_opens(tmp_path: Path, seed: int) -> None:
    shut = {"door_a": "closed", "door_b": "closed", "seed": seed}
    with run(two_rooms(WALKERS, events=("at: 9, open: door_b",), **shut), tmp_path / "run.h5") as recording:
        assert recording.summary["arrived"] == 4
        assert recording.summary["unreachable"] == {}
        assert all(second > 9.0 and 4.0 < y < 5.0 for second, y in crossings(recording).values())
    with run(two_rooms(WALKERS, **shut), tmp_path / "shut.h5") as recording:
        assert recording.summary["arrived"] == 0
        assert len(recording.summary["unreachable"]) == 4
        assert recording.duration < 10.0, "where nothing will change nobody waits"


@pytest.mark.parametrize("seed", SEEDS[:2])
def test_what_is_removed_opens_the_only_way_for_those_who_wait(tmp_path: Path, seed: int) -> None:
    block = "at: 0, insert: {name: block, box: {min: [4.6, 4], max: [5.6, 5]}, top: 1.6}"
    text = two_rooms(WALKERS, events=(block, "at: 10, remove: block"), door_a="closed", seed=seed)
    with run(text, tmp_path / "run.h5") as recording:
        assert recording.summary["arrived"] == 4
        assert all(second > 10.0 for second, _ in crossings(recording).values())
        assert least_margin(recording) >= -1e-4


@pytest.mark.parametrize("shift", [0.0, 3e-3])
def test_a_crate_put_in_the_way_is_walked_around(tmp_path: Path, shift: float) -> None:
    """Nobody is 3 m on after 1.5 s: the crate comes when it is due. Its corners are 0.7 m off the straight way."""
    one = f"name: one, count: 1, start: {{point: [6, {3 + shift}]}}, goal: {{point: [11.4, 3]}}"
    crate = "at: 1.5, insert: {name: block, box: {center: [9.5, 3], size: [0.6, 1.4]}, top: 1}"
    with (
        run(two_rooms(one), tmp_path / "free.h5") as free,
        run(two_rooms(one, events=(crate,)), tmp_path / "run.h5") as recording,
    ):
        assert recording.summary["arrived"] == 1
        assert recording.summary["replans"] == 1
        assert np.abs(free.y[:, 0] - 3.0)[free.x[:, 0] > 8.0].max() < 0.35
        there = recording.state[:, 0] != AgentState.ABSENT
        assert 0.85 < np.abs(recording.y[:, 0] - 3.0)[there].max() < 2.0
        assert least_margin(recording) >= -1e-4


@pytest.mark.parametrize("shift", [0.0, 1e-9, 3e-3])
@pytest.mark.parametrize("second", [0.5, 1.0])
def test_who_has_room_to_turn_walks_on_while_it_plans_anew(tmp_path: Path, second: float, shift: float) -> None:
    one = f"name: one, count: 1, start: {{point: [6, {3 + shift}]}}, goal: {{point: [11.4, 3]}}"
    crate = f"at: {second}, insert: {{name: block, box: {{center: [10, 2.7], size: [0.6, 0.6]}}, top: 1}}"
    with run(two_rooms(one, events=(crate,)), tmp_path / "run.h5") as recording:
        assert recording.summary["arrived"] == recording.summary["replans"] == 1
        state = recording.state[:, 0]
        walking = state[np.argmax(state == AgentState.MOVING) :]
        assert (walking[walking != AgentState.ABSENT] == AgentState.MOVING).all()
        assert least_margin(recording) >= -1e-4


@pytest.mark.parametrize("seed", SEEDS)
def test_a_door_waits_for_those_in_it_and_lets_nobody_else_in(tmp_path: Path, seed: int) -> None:
    """One stands in the doorway for twelve seconds, in which the door is to close; others come up and must not go in.

    The doorway is a meter wide: while somebody stands in its middle there is no way past.
    """
    porter = (
        "name: porter, count: 1, start: {point: [4, 1.5]}, goals: [{point: [5.07, 1.5]}, {point: [9, 5]}], wait: 12"
    )
    others = WALKERS.replace("interval: 2", "interval: 1").replace("count: 4", "count: 4, start_time: 3")
    text = two_rooms(porter, others, events=("at: 9, close: door_a",), seed=seed)
    with run(text, tmp_path / "run.h5") as recording:
        (event,) = recording.summary["events"]
        assert event["outcome"] == "happened"
        assert recording.summary["arrived"] == 5
        came, closed = crossings(recording), 9.0 + event["late"]
        stood = (recording.state[:, 0] == AgentState.WAITING) & (np.abs(recording.x[:, 0] - WALL) < 0.35)
        first, last = np.flatnonzero(stood)[[0, -1]] / recording.steps_per_second
        assert first < 9.0 < first + 12.0 <= last + 0.1 <= closed, "somebody stands in the doorway when it is to close"
        assert came[0][0] < closed
        assert all(4.0 < y < 5.0 for agent, (_, y) in came.items() if agent)
        assert least_margin(recording) >= -1e-4


def test_what_cannot_come_to_the_end_is_reported(tmp_path: Path) -> None:
    stays = "name: sitter, count: 1, start: {point: [8, 4]}, goal: {point: [9, 4]}, on_arrival: stay"
    walks = "name: walker, count: 1, start: {point: [1, 1.5]}, goal: {point: [11, 1]}"
    crate = "at: 6, insert: {name: block, box: {center: [9, 4], size: [1, 1]}, top: 1}"
    with run(two_rooms(stays, walks, events=(crate,)), tmp_path / "run.h5") as recording:
        assert recording.summary["arrived"] == 2
        assert recording.summary["events"] == [
            {"event": "insert 'block'", "at": 6.0, "outcome": "waiting", "late": None}
        ]
        assert [solid.name for solid in recording.movables_at(recording.duration)] == []


def test_a_thing_of_several_parts_waits_as_one(tmp_path: Path) -> None:
    stays = "name: sitter, count: 1, start: {point: [8, 4]}, goal: {point: [9, 4]}, on_arrival: stay"
    walks = "name: walker, count: 1, start: {point: [1, 1.5]}, goal: {point: [11, 1]}"
    line = "wall: {points: [[9, 0.3], [9, 5.5]], openings: [{at: 1.2, width: 1.2}]}"
    events = f"at: 6, insert: {{name: fence, {line}, top: 2.5}}", "at: 20, remove: fence"
    with run(two_rooms(stays, walks, events=events), tmp_path / "run.h5") as recording:
        assert recording.summary["arrived"] == 2
        assert recording.summary["events"][0]["outcome"] in ("waiting", "overtaken")


@pytest.mark.parametrize("seed", SEEDS)
def test_a_source_lets_in_so_many_at_their_times(tmp_path: Path, seed: int) -> None:
    """One every five seconds, when the one before has long left the region: nobody waits for a free place in it."""
    source = """\
name: visitors, rate: 0.2, arrivals: regular, until: 40, start: {rectangle: [0.5, 0.5, 1.5, 5.5]},
     goal: {rectangle: [10.5, 3.5, 11.5, 5.5]}"""
    with run(two_rooms(source, seed=seed), tmp_path / "run.h5") as recording:
        assert recording.summary["characters"] == recording.summary["arrived"] == 8
        there = recording.state[:] != AgentState.ABSENT
        late = there.argmax(axis=0) / recording.steps_per_second - 5.0 * np.arange(8)
        assert (late >= -1e-9).all()
        assert late.max() < 0.1 + 1e-9


def test_those_who_go_round_walk_through_their_goals_and_wait_where_asked(tmp_path: Path) -> None:
    square = "goals: [{point: [6.5, 1]}, {point: [6.5, 5]}, {point: [11, 5]}, {point: [11, 1]}]"
    forever = f"name: forever, count: 1, start: {{point: [10.5, 1]}}, {square}, repeat: forever"
    with run(two_rooms(forever, duration=70), tmp_path / "run.h5") as recording:
        assert recording.summary["arrived"] == 0
        assert recording.steps == 70 * recording.steps_per_second
        assert recording.summary["laps"]["forever"] >= 2
        x, y = recording.x[:, 0], recording.y[:, 0]
        for goal in ((6.5, 1), (6.5, 5), (11, 5), (11, 1)):
            assert np.nanmin(np.hypot(x - goal[0], y - goal[1])) <= FollowOptions.goal_tolerance
    waits = f"name: waits, count: 1, start: {{point: [10.5, 1]}}, {square}, wait: 3, on_arrival: stay"
    with run(two_rooms(waits, duration=70), tmp_path / "waits.h5") as recording:
        assert recording.summary["arrived"] == 1
        x, y, state = recording.x[:, 0], recording.y[:, 0], recording.state[:, 0]
        for goal in ((6.5, 1), (6.5, 5), (11, 5)):
            stood = (state == AgentState.WAITING) & (np.hypot(x - goal[0], y - goal[1]) < 0.5)
            assert stood.sum() >= 3 * recording.steps_per_second
        assert state[-1] == AgentState.ARRIVED
        assert np.hypot(x[-1] - 11, y[-1] - 1) < 0.5


def test_whoever_starts_at_its_first_goal_goes_to_the_second(tmp_path: Path) -> None:
    pair = "name: pair, count: 1, start: {point: [7, 3]}, goals: [{point: [7, 3]}, {point: [10, 3]}], repeat: 2"
    with run(two_rooms(pair), tmp_path / "run.h5") as recording:
        assert recording.summary["arrived"] == 1
        assert recording.summary["laps"] == {"pair": 2}
        assert np.nanmax(recording.x[:, 0]) >= 10.0 - FollowOptions.goal_tolerance
