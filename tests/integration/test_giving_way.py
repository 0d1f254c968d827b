"""Captured agents who meet give way to each other, and nobody ever comes nearer than reserved."""

import numpy as np
import pytest

from crowdsim.crowd.captured_crowd import CapturedCrowd
from crowdsim.crowd.simulation import Simulation
from crowdsim.crowd.state.components import CORE, RADIUS
from crowdsim.crowd.state.reservation_kernels import pair_meets
from crowdsim.recording.header import AgentState
from crowdsim.scenario.loader import parse_scenario
from tests.reference.crowd import discs_along, discs_at

HEAD = "crowdsim: 1\nname: giving_way\nseed: {seed}\nduration: {duration}\nfloor: {floor}\n"
GROUP = (
    "  - {{locomotion: captured, name: {name}, count: {count}, start: {{rectangle: {start}}}, "
    "goal: {{rectangle: {goal}}}{rest}}}\n"
)


def corridor(width: float, seed: int) -> str:
    half, off = width / 2, width / 2 - 0.36
    west, east = [0.8, -off, 1.2, off], [10.8, -off, 11.2, off]
    text = HEAD.format(seed=seed, duration=60, floor=f"{{rectangle: [0.0, {-half}, 12.0, {half}]}}") + "agents:\n"
    text += GROUP.format(name="a", count=1, start=west, goal=east, rest="")
    return text + GROUP.format(name="b", count=1, start=east, goal=west, rest="")


def door(count: int, seed: int, rest: str = "") -> str:
    west, east = [0.6, 0.6, 3.6, 4.4], [6.6, 0.6, 9.6, 4.4]
    text = HEAD.format(seed=seed, duration=60, floor="{rectangle: [0.0, 0.0, 10.2, 5.0]}") + "obstacles:\n"
    text += "  - {name: below, box: {min: [5.0, 0.0], max: [5.2, 2.0]}, top: 2.5}\n"
    text += "  - {name: above, box: {min: [5.0, 3.0], max: [5.2, 5.0]}, top: 2.5}\nagents:\n"
    text += GROUP.format(name="a", count=count, start=west, goal=east, rest=rest)
    return text + GROUP.format(name="b", count=count, start=east, goal=west, rest=rest)


def gap(each: int, seed: int) -> str:
    """Two rooms with a gap of 0.7 m between them, 3 m long: nobody can pass, or turn about, in it."""
    text = HEAD.format(seed=seed, duration=100, floor="{rectangle: [0.0, 0.0, 11.0, 6.0]}") + "obstacles:\n"
    text += "  - {name: below, box: {min: [4.0, 0.0], max: [7.0, 2.65]}, top: 2.2}\n"
    text += "  - {name: above, box: {min: [4.0, 3.35], max: [7.0, 6.0]}, top: 2.2}\nagents:\n"
    west, east = [0.4, 0.4, 3.2, 5.6], [7.8, 0.4, 10.6, 5.6]
    text += GROUP.format(name="a", count=each, start=west, goal=[9.4, 0.4, 10.6, 5.6], rest="")
    return text + GROUP.format(name="b", count=each, start=east, goal=[0.4, 0.4, 1.6, 5.6], rest="")


def assert_nobody_meets(crowd: CapturedCrowd) -> None:
    """Assert that no two reserved timelines meet since the later one began, and that no two bodies touch now.

    Two who are nearer than those at rest should be may part and come to rest as near as they were: from the present
    slot on, they would seem to come nearer.
    """
    view, breadths = crowd.world.view(), crowd.assets.breadths
    bodies = discs_along(view.pose[:, :2], 0.0)
    bodies[:, RADIUS], half = breadths[view.behavior].T
    bodies[:, CORE], bodies[:, CORE + 1] = -half * np.sin(view.pose[:, 2]), half * np.cos(view.pose[:, 2])
    for a in range(len(view.agent)):
        for b in range(a):
            distance = float(view.body_radius[a] + view.body_radius[b])
            mine = view.timeline[a], view.timeline_start[a], view.gone_slot[a]
            its = view.timeline[b], view.timeline_start[b], view.gone_slot[b]
            assert not pair_meets(*mine, *its, max(mine[1], its[1]), distance, True)
            # Between two slots timelines are taken as linear, so bodies come a little nearer.
            mine_now, my_radius = discs_at((bodies[a : a + 1], 0, 0), 0)
            its_now, its_radius = discs_at((bodies[b : b + 1], 0, 0), 0)
            gap = np.linalg.norm(mine_now[:, None] - its_now, axis=-1).min() - my_radius - its_radius
            assert gap > -0.03


def run(text: str, workers: int = 1) -> tuple[int, float, int, int]:
    """How many arrived, when the last did [s], how often somebody gave way, and the state hash."""
    with Simulation(parse_scenario(text), workers) as simulation:
        crowd = simulation.crowd
        assert isinstance(crowd, CapturedCrowd)
        while not simulation.finished:
            simulation.step()
            if simulation.step_count % 3 == 0:
                assert_nobody_meets(crowd)
        seconds = simulation.step_count / crowd.assets.steps_per_second
        return simulation.arrived, seconds, crowd.plans.moved, crowd.hash


@pytest.mark.parametrize("width", [1.6, 2.0, 3.0])
@pytest.mark.parametrize("seed", [1, 2])
def test_two_who_meet_in_a_corridor_pass(width: float, seed: int) -> None:
    arrived, seconds, _, _ = run(corridor(width, seed))
    assert arrived == 2
    assert seconds < 25


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_two_who_meet_where_only_one_can_walk_ahead_step_to_the_walls_and_pass(seed: int) -> None:
    arrived, seconds, moved, _ = run(corridor(1.2, seed))
    assert arrived == 2
    assert moved > 0
    assert seconds < 50


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_three_and_three_pass_a_door(seed: int) -> None:
    arrived, seconds, moved, _ = run(door(3, seed))
    assert arrived == 6
    assert seconds < 40
    assert moved > 0


@pytest.mark.parametrize(("each", "seed"), [(1, 11), (1, 16), (1, 35), (1, 38), (2, 7), (2, 15), (2, 41)])
def test_those_who_meet_at_a_gap_go_through_it_in_turn(each: int, seed: int) -> None:
    arrived, seconds, _, _ = run(gap(each, seed))
    assert arrived == 2 * each
    assert seconds < 90


def test_who_gives_way_does_not_depend_on_the_number_of_workers() -> None:
    assert run(door(3, 1)) == run(door(3, 1), workers=2)


def test_who_had_arrived_gives_way_and_comes_back() -> None:
    text = HEAD.format(seed=1, duration=40, floor="{rectangle: [0.0, -1.0, 12.0, 1.0]}") + "agents:\n"
    text += "  - {locomotion: captured, name: a, count: 1, on_arrival: stay, "
    text += "start: {point: [1.0, 0.0]}, goal: {point: [4.0, 0.0]}}\n"
    text += "  - {locomotion: captured, name: b, count: 1, start_time: 8.0, "
    text += "start: {point: [11.0, 0.0]}, goal: {point: [1.0, 0.0]}}\n"
    with Simulation(parse_scenario(text), 1) as simulation:
        crowd = simulation.crowd
        assert isinstance(crowd, CapturedCrowd)
        while simulation.step_count < simulation.step_limit and (crowd.arrived < 2 or crowd.plans.away):
            simulation.step()
        assert crowd.arrived == 2
        assert crowd.plans.moved > 0
        view = crowd.world.view()
        assert view.state.tolist() == [AgentState.ARRIVED]
        assert view.pose[0, :2] == pytest.approx([4.0, 0.0], abs=0.36)


@pytest.mark.parametrize("width", [1.2, 2.0])
def test_who_has_no_way_any_more_gives_way_to_those_who_come_later(width: float) -> None:
    half = width / 2
    text = HEAD.format(seed=1, duration=40, floor=f"{{rectangle: [0.0, {-half}, 16.0, {half}]}}") + "obstacles:\n"
    text += f"  - {{name: end, box: {{min: [12.9, {-half}], max: [13.1, {half}]}}, top: 2.5}}\nagents:\n"
    text += "  - {locomotion: captured, name: a, count: 1, on_arrival: stay, "
    text += "start: {point: [1.0, 0.0]}, goal: {point: [4.0, 0.0]}}\n"
    text += "  - {locomotion: captured, name: b, count: 1, start_time: 8.0, "
    text += "start: {point: [11.0, 0.0]}, goal: {point: [1.0, 0.0]}}\n"
    with Simulation(parse_scenario(text), 1) as simulation:
        crowd = simulation.crowd
        assert isinstance(crowd, CapturedCrowd)
        while simulation.time < 7.0:
            simulation.step()
        simulation.set_goal([0], (15.0, 0.0))
        while not simulation.finished:
            simulation.step()
        assert list(crowd.plans.unreachable) == [0]
        assert crowd.plans.moved > 0
        assert simulation.arrived == 1
