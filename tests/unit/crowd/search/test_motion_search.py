"""Searches in slices: the same motion in the end, nothing played ever changed, a way on where it would have to be."""

from __future__ import annotations

import gc
import weakref
from pathlib import Path

import numpy as np
import pytest

from crowdsim.constants import CAPTURE_RATE
from crowdsim.crowd.captured_crowd import CapturedCrowd
from crowdsim.crowd.search.motion_search import SLICE_BRANCHES, MotionSearch
from crowdsim.crowd.simulation import Simulation
from crowdsim.crowd.state.assets import Assets, prepare
from crowdsim.crowd.state.environment import Edit, EnvironmentState
from crowdsim.crowd.state.motion_plan import MotionPlan, Request
from crowdsim.errors import PathNotFound
from crowdsim.following.follower import path_follower
from crowdsim.following.follower.follow_options import SLOW
from crowdsim.following.follower.path_follower import FollowResult, FollowStatus, PathFollower
from crowdsim.geometry.planar import compose
from crowdsim.scenario.loader import parse_scenario
from crowdsim.scenario.scenario import Scenario
from tests.support.motion_search import search_motion
from tests.support.two_rooms import WALKERS, two_rooms

TO_THE_OTHER_ROOM = Request(np.array([1.0, 1.5]), np.array([11.0, 3.0]), stays=True)
TINY = 24
"""Branches that are one map query of a quick search."""


@pytest.fixture(scope="module")
def scenario() -> Scenario:
    return parse_scenario(two_rooms(WALKERS, events=("at: 1, close: door_a",), duration=60.0))


@pytest.fixture(scope="module")
def assets(scenario: Scenario) -> Assets:
    return prepare(scenario)


@pytest.fixture
def environment(scenario: Scenario, assets: Assets) -> EnvironmentState:
    return EnvironmentState(assets)


def plan_of(found: MotionPlan | PathNotFound) -> MotionPlan:
    assert isinstance(found, MotionPlan)
    return found


def check_chain(assets: Assets, plan: MotionPlan) -> None:
    """Every node begins where the one before ends, but for its blend offset."""
    nodes = np.concatenate([[plan.departure_node], plan.nodes[:-1]])
    starts = np.concatenate([plan.departure[None], plan.origins[:-1]])
    gaps = compose(starts, assets.graph.node_motion[nodes]) - plan.origins - plan.blend_offsets
    gaps[:, 2] = (gaps[:, 2] + np.pi) % (2.0 * np.pi) - np.pi
    np.testing.assert_allclose(gaps, 0.0, atol=1e-9)


def test_a_search_that_is_given_up_is_let_go_without_a_search_for_cycles(
    assets: Assets, environment: EnvironmentState
) -> None:
    def given_up() -> weakref.ref[MotionSearch]:
        search = MotionSearch(assets, environment, TO_THE_OTHER_ROOM)
        search.advance(0, TINY)
        search.close()
        return weakref.ref(search)

    # What compiles kernels for the first time leaves references to its callers.
    search_motion(assets, environment, TO_THE_OTHER_ROOM)
    gc.collect()
    gc.disable()
    try:
        left = given_up()()
    finally:
        gc.enable()
    assert left is None


def test_slow_motions_are_quickened_in_the_slice_that_finds_them(
    assets: Assets, environment: EnvironmentState, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The work is bounded and told; all that is found arrives, and nothing takes longer than without."""
    before = after = 0.0
    rng = np.random.default_rng(6)
    for _ in range(20):
        request = Request(rng.uniform((0.5, 0.5), (4.4, 5.5)), rng.uniform((9.0, 0.5), (11.5, 5.5)), stays=True)
        seconds = []
        for slow in (np.inf, SLOW):
            monkeypatch.setattr(path_follower, "SLOW", slow)
            search = MotionSearch(assets, environment, request)
            plan = plan_of(search.advance(0, SLICE_BRANCHES))
            assert search.over
            assert plan.arrives
            check_chain(assets, plan)
            assert search.excess <= (0 if slow == np.inf else 2 * SLICE_BRANCHES)
            seconds.append(float(assets.graph.node_frames[plan.nodes].sum()) / CAPTURE_RATE)
        assert seconds[1] <= seconds[0]
        before, after = before + seconds[0], after + seconds[1]
    assert after < 0.97 * before


def test_slices_come_to_what_one_search_finds_and_only_grow_what_is_played(
    assets: Assets, environment: EnvironmentState
) -> None:
    whole = plan_of(search_motion(assets, environment, TO_THE_OTHER_ROOM))
    assert whole.arrives
    search = MotionSearch(assets, environment, TO_THE_OTHER_ROOM)
    kept, before = 0, None
    counts = []
    while not search.over:
        plan = plan_of(search.advance(kept, TINY))
        if before is not None:
            np.testing.assert_array_equal(plan.nodes[:kept], before.nodes[:kept])
            np.testing.assert_array_equal(plan.origins[:kept], before.origins[:kept])
        counts.append(plan.count)
        check_chain(assets, plan)
        kept, before = min(kept + 1, plan.count), plan
    assert search.slices > 3
    assert max(counts[:-1]) > 0
    np.testing.assert_array_equal(plan.nodes, whole.nodes)
    np.testing.assert_array_equal(plan.origins, whole.origins)
    assert plan.arrives
    assert search.backtracks == search.recoveries == 0


def test_who_has_walked_past_where_a_search_turns_back_goes_on_from_there(
    assets: Assets, environment: EnvironmentState, monkeypatch: pytest.MonkeyPatch
) -> None:
    search = MotionSearch(assets, environment, TO_THE_OTHER_ROOM)
    plan = plan_of(search.advance(0, TINY))
    while plan.count < 3:
        plan = plan_of(search.advance(0, TINY))
    advance, calls = PathFollower.advance, []

    def turned_back(self: PathFollower, queries: int, kept: int = 0) -> FollowResult | None:
        calls.append(kept)
        if len(calls) > 1:
            return advance(self, queries, kept)
        # All that it has is spoilt, as if a later stage had found no way on.
        self._search.state[0] = 0
        self._search.stage[0, 4] = self._search.stage[0, 3]
        return advance(self, queries, kept)

    monkeypatch.setattr(PathFollower, "advance", turned_back)
    kept = 2
    played = plan.until(kept - 1)
    while not search.over:
        plan = plan_of(search.advance(kept, TINY))
        np.testing.assert_array_equal(plan.nodes[:kept], played.nodes)
        np.testing.assert_array_equal(plan.origins[:kept], played.origins)
    assert search.backtracks == search.recoveries == 1
    assert plan.arrives
    check_chain(assets, plan)
    assert np.hypot(*(plan.origins[-1, :2] - TO_THE_OTHER_ROOM.goal)) < 2.0


def test_a_change_of_the_place_is_taken_in_with_the_next_slice(
    scenario: Scenario, assets: Assets, environment: EnvironmentState
) -> None:
    search = MotionSearch(assets, environment, TO_THE_OTHER_ROOM)
    plan = plan_of(search.advance(0, TINY))
    while plan.count < 1:
        plan = plan_of(search.advance(0, TINY))
    assert not search.over
    assert plan.route.at(np.array([plan.route.length / 2]))[0, 1] < 3.0, "by the lower door"
    change = scenario.environment.timetable.events[0]
    environment.put(change.movable, change.placing, 1)
    played = plan.until(0)
    while not search.over:
        plan = plan_of(search.advance(1, TINY))
    np.testing.assert_array_equal(plan.nodes[:1], played.nodes)
    assert plan.arrives
    assert search.recoveries >= 1
    at_the_wall = plan.origins[np.argmin(np.abs(plan.origins[:, 0] - 5.1)), 1]
    assert at_the_wall > 3.0, "by the upper door"


def test_edits_that_come_before_any_node_begin_a_search_anew_however_many_they_are(
    assets: Assets, environment: EnvironmentState
) -> None:
    search = MotionSearch(assets, environment, TO_THE_OTHER_ROOM)
    for _ in range(1200):
        search.advance(0, TINY)  # nothing of what is found so far is played
        assert not search.over
        environment.edits.append(Edit(None, None))
    while not search.over:
        plan = plan_of(search.advance(0))
    assert plan.arrives


def test_a_path_search_that_may_not_change_anything_says_so(assets: Assets, environment: EnvironmentState) -> None:
    route = environment.route(TO_THE_OTHER_ROOM.position, TO_THE_OTHER_ROOM.goal)
    samples = route.sample()
    arguments = assets.character, samples, tuple(mesh.arrays for mesh in environment.meshes)
    start = np.array([*TO_THE_OTHER_ROOM.position, samples.pose[0, 2]])
    search = PathFollower(*arguments, start, int(assets.idle_nodes[-1]))
    assert search.advance(2) is None
    count = len(search.present.nodes)
    assert count > 1
    found = search.advance(0, kept=count + 1)
    assert found is not None
    assert found.status == FollowStatus.PAST_KEPT


def test_runs_in_the_shortest_slices_arrive_and_are_the_same_for_any_number_of_workers(tmp_path: Path) -> None:
    hashes = set()
    for workers in (1, 3):
        simulation = Simulation(
            parse_scenario(two_rooms(f"locomotion: captured, {WALKERS}", events=("at: 3, close: door_a",))), workers
        )
        assert isinstance(simulation.crowd, CapturedCrowd)
        simulation.crowd.searches.first_slice = simulation.crowd.searches.longest_slice = TINY
        with simulation.run(tmp_path / f"{workers}.h5") as recording:
            summary = recording.summary
        assert summary["arrived"] == summary["characters"] == 4
        assert summary["searches"]["sliced"] >= 4
        assert min(summary["obstacle_margin"].values()) > -0.01
        hashes.add(summary["state_hash"])
    assert len(hashes) == 1


def test_ways_of_any_length_past_a_corner_are_found(environment: EnvironmentState) -> None:
    for length in np.linspace(0.2, 2.0, 19):
        route = environment.route((7.4 - length / 2, 0.7), (7.4 + length / 2, 0.7))
        assert length - 1e-9 <= route.length < length + 0.5
