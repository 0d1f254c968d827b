"""What agents do in the kernel is what they do in Python, to the bit."""

import numpy as np
import pytest

from crowdsim.crowd.captured_crowd import CapturedCrowd
from crowdsim.crowd.search.plan_table import NO_PASS, Motions
from crowdsim.crowd.state.motion_plan import MotionPlan
from crowdsim.crowd.systems import choose_kernels, choose_motion
from crowdsim.planning.labels.annotated_path import AnnotatedPath, Section
from crowdsim.scenario.loader import parse_scenario
from tests.reference.going_on import ask_in_python, go_on_in_python

CROSSING = """\
crowdsim: 1
name: crossing
seed: 4
duration: 60
steps_per_second: 30
floor: {rectangle: [0, 0, 9, 9]}
agents:
  - name: east
    count: 7
    locomotion: captured
    start: {rectangle: [0.5, 3, 3, 6]}
    goals: [{rectangle: [7, 3, 8.5, 6]}, {rectangle: [0.5, 3, 2, 6]}]
    repeat: forever
  - name: north
    count: 6
    locomotion: captured
    start: {rectangle: [3.5, 0.5, 6, 3]}
    goal: {rectangle: [3, 7, 6, 8.5]}
  - name: south
    count: 5
    locomotion: captured
    start: {rectangle: [3.5, 6.5, 6, 8.5]}
    goal: {rectangle: [3, 0.5, 6, 2]}
    on_arrival: stay
"""
STEPS = 450


def hashes() -> tuple[list[int], dict[str, int]]:
    crowd = CapturedCrowd(parse_scenario(CROSSING), 1, None)
    found = []
    for _ in range(STEPS):
        crowd.advance()
        found.append(crowd.hash)
        crowd.begin_work()
        crowd.end_step()
    crowd.close()
    return found, {"moved": crowd.plans.moved, "arrived": crowd.arrived}


def test_a_crowd_goes_on_as_it_does_in_python(monkeypatch: pytest.MonkeyPatch) -> None:
    wanted: set[int] = set()
    behind: set[bool] = set()
    asked: set[tuple[int, bool]] = set()

    def noting(*arguments: object) -> tuple[int, int]:
        number, what = choose_kernels.go_on(*arguments)
        wanted.add(what)
        behind.add(int(arguments[-2].counts[choose_kernels.BEHIND]) > 0)
        return number, what

    def noting_asks(*arguments: object) -> tuple[int, int, int]:
        number, what, count = choose_kernels.ask_in_turn(*arguments)
        asked.add((what, count > 0))
        return number, what, count

    monkeypatch.setattr(choose_motion, "go_on", noting)
    monkeypatch.setattr(choose_motion, "ask_in_turn", noting_asks)
    found, events = hashes()
    assert min(events.values()) > 0, "some are asked to give way, and some arrive"
    assert behind == {True, False}, "searches end or begin with nodes that are entered"
    assert wanted == {choose_kernels.ALL_DONE, choose_kernels.OTHERWISE, choose_kernels.MAKE_ROOM}
    assert asked == {
        (choose_kernels.ALL_DONE, False),
        (choose_kernels.OTHERWISE, False),
        (choose_kernels.OTHERWISE, True),
        (choose_kernels.STAYS_REFUSED, False),
    }
    monkeypatch.setattr(choose_motion, "ask_in_turn", ask_in_python)
    assert (found, events) == hashes()
    monkeypatch.setattr(choose_motion, "go_on", go_on_in_python)
    assert (found, events) == hashes()


def plan(count: int, passes: tuple[int, ...] = (), arrives: bool = True) -> MotionPlan:
    points = np.array([[0.0, 0.0], [1.0, 0.0]])
    route = AnnotatedPath(points, np.array([0.0, 1.0]), (Section(0, 0.0, 1.0),), 1.0)
    nodes = np.arange(count, dtype=np.int32)
    return MotionPlan(route, 0, np.zeros(3), nodes, np.zeros((count, 3)), np.zeros((count, 3)), arrives, passes)


def test_the_table_follows_what_becomes_of_plans() -> None:
    motions = Motions(3, 128, lambda agent, plan: np.full(plan.count, 100 + 10 * agent + plan.count))
    table = motions.table
    assert table.rates.tolist() == [128, 128, 128]
    assert table.nodes.tolist() == [-1, -1, -1]
    motions[1] = plan(5, passes=(2, 4))
    motions[2] = plan(3, arrives=False)
    assert table.nodes.tolist() == [-1, 5, 3]
    assert table.first_pass.tolist() == [NO_PASS, 2, NO_PASS]
    assert table.passes.tolist() == [0, 2, 0]
    assert table.arrives.tolist() == [False, True, False]
    assert table.rates.tolist() == [128, 115, 123]
    assert table.places[1, 0] == motions[1].nodes.ctypes.data
    motions[1] = motions[1].until(1)
    assert table.nodes[1] == 2
    assert motions.pop(1, None) is not None
    del motions[2]
    assert motions.pop(0, None) is None
    assert table.nodes.tolist() == [-1, -1, -1]


def test_a_table_takes_no_plan_that_kernels_cannot_read() -> None:
    wrong = plan(4)
    motions = Motions(1, 128, lambda agent, plan: np.full(plan.count, 128))
    wide, strided = wrong.nodes.astype(np.int64), np.arange(8, dtype=np.int32)[::2]
    for nodes, kind in ((wide, "int64"), (strided, "a strided view of int32")):
        with pytest.raises(TypeError, match=f"contiguous arrays of int32 and float64, not {kind}"):
            motions[0] = MotionPlan(wrong.route, 0, wrong.departure, nodes, wrong.origins, wrong.blend_offsets, True)
        assert 0 not in motions
        assert motions.table.nodes[0] == -1


def test_a_step_without_its_work_is_refused() -> None:
    crowd = CapturedCrowd(parse_scenario(CROSSING), 1, None)
    crowd.advance()
    with pytest.raises(RuntimeError, match="was not called"):
        crowd.end_step()
    crowd.begin_work()
    with pytest.raises(RuntimeError, match="called twice"):
        crowd.begin_work()
    crowd.end_step()
    crowd.close()
