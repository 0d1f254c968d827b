"""A quicker motion than the one that was found: what is taken is quicker, valid, and ends as requested."""

from __future__ import annotations

import numpy as np
import pytest

from crowdsim.constants import CAPTURE_RATE
from crowdsim.following.follower import beam_kernels
from crowdsim.following.follower.character import Character
from crowdsim.following.follower.follow_options import QUICKEN_BUDGET, QUICKER, SLOW, FollowOptions
from crowdsim.following.follower.follow_workspace import make_beam
from crowdsim.following.follower.path_follower import FollowResult, FollowStatus, PathFollower, follow_path
from crowdsim.following.maps.motion_maps import MotionMaps
from crowdsim.geometry.planar import compose, wrap_angle
from crowdsim.jit import kernel
from tests.reference.follow_maps import track_of
from tests.unit.following.follower.test_path_follower import (
    FACINGS,
    GRAPH,
    IDLE,
    OPEN_GROUND,
    RADII,
    Samples,
    Scene,
    check,
    corridor,
    sample,
    scene,
)


@pytest.fixture(scope="module")
def character() -> Character:
    return Character(GRAPH, MotionMaps.build(GRAPH), RADII, FACINGS)


@pytest.fixture(scope="module")
def places() -> list[tuple[Scene, Samples]]:
    """A corridor that is walked from several places on, where it is wide, and a zigzag in the open."""
    world, whole = corridor()
    parts = []
    for first in (0, 10, 20, 70, 75, 120):
        rest = whole.arc[first:] - whole.arc[first]
        parts.append((world, Samples(whole.pose[first:].copy(), rest, whole.behavior[first:].copy())))
    return [*parts, (scene(OPEN_GROUND), sample([(0.0, 0.0), (1.5, 0.0), (1.5, 1.5), (3.0, 1.5), (3.0, 0.0)]))]


def seconds(found: FollowResult) -> float:
    """Return the time of all nodes behind the first, which is being played [s]."""
    return sum(int(GRAPH.node_frames[node]) for node in found.nodes[1:]) / CAPTURE_RATE


def searched(
    character: Character, place: tuple[Scene, Samples], heading: float, options: FollowOptions
) -> tuple[PathFollower, FollowResult]:
    """Return a search from a stand in any heading, and the motion that it finds."""
    world, path = place
    start = np.array([*path.pose[0, :2], path.pose[0, 2] + heading])
    search = PathFollower(character, path, world.meshes, start, IDLE, options)
    found = search.next()
    assert found.status is FollowStatus.FOUND
    return search, found


@pytest.mark.parametrize("standing", [False, True])
def test_motions_are_quicker_valid_and_end_as_requested(
    character: Character, places: list[tuple[Scene, Samples]], standing: bool
) -> None:
    before, after, quicker = 0.0, 0.0, 0
    for place in places:
        world, path = place
        for heading in np.linspace(-3.0, 3.0, 8):
            search, found = searched(character, place, heading, FollowOptions(end_standing=standing))
            other = search.quicken(found)
            before += seconds(found)
            after += seconds(other or found)
            if other is None:
                continue
            quicker += 1
            assert seconds(other) < QUICKER * seconds(found)
            assert found.expansions < other.expansions <= found.expansions + QUICKEN_BUDGET
            track = check(other, world)
            assert other.nodes[0] == IDLE
            np.testing.assert_array_equal(other.origins[0], found.origins[0])
            off = np.hypot(*(track[:, :2] - path.pose[-1, :2]).T)
            assert (off[-1] if standing else off.min()) <= FollowOptions.goal_tolerance + 1e-9
            if standing:
                assert GRAPH.node_ends_standing[other.nodes[-1]]
            # Again, to the bit.
            again = searched(character, place, heading, FollowOptions(end_standing=standing))
            repeated = again[0].quicken(again[1])
            assert repeated is not None
            np.testing.assert_array_equal(repeated.origins, other.origins)
    assert quicker >= 10
    assert after < 0.95 * before


def test_the_end_has_the_heading_that_is_asked_for_and_can_be_bent_to_the_goal(
    character: Character, places: list[tuple[Scene, Samples]]
) -> None:
    bent = quicker = 0
    for place in places:
        for heading in (-2.0, 0.0, 2.0):
            asked = float(place[1].pose[-1, 2] + heading)
            options = FollowOptions(end_standing=True, goal_heading=asked)
            search, found = searched(character, place, 0.5, options)
            other = search.quicken(found)
            if other is None:
                continue
            quicker += 1
            end = compose(other.origins[-1], GRAPH.node_motion[other.nodes[-1]])
            assert abs(wrap_angle(end[2] - asked)) <= np.radians(15.0)
            exact = search.arrive(0.01)
            if exact is not None:
                bent += 1
                np.testing.assert_array_equal(exact.nodes, other.nodes)
                assert np.hypot(*(check(exact, place[0])[-1, :2] - place[1].pose[-1, :2])) <= 0.01
    assert bent >= 2
    assert quicker > bent


def test_what_is_not_slow_stays(character: Character) -> None:
    world, path = scene(OPEN_GROUND), sample([(0.0, 0.0), (12.0, 0.0)])
    search, found = searched(character, (world, path), 0.0, FollowOptions())
    planned = 12.0 / character.maps.arrays.speeds[2]
    assert abs(seconds(found) - planned) < SLOW
    assert not search.is_slow(found)
    whole = follow_path(character, path, world.meshes, np.zeros(3), IDLE)
    np.testing.assert_array_equal(whole.origins, found.origins)
    # No motion can take a tenth of that time: none is found, and the best solution is what it was, to be bent.
    other, same = searched(character, (world, path), 0.0, FollowOptions(end_standing=True))
    tenth = FollowResult(same.status, same.nodes[:2], same.edges, same.twists, same.origins, 12.0, 0)
    assert other.quicken(tenth) is None
    bent = other.arrive(0.3)
    assert bent is not None
    np.testing.assert_array_equal(bent.nodes, same.nodes)


def test_slow_motions_are_quickened_by_follow_path(character: Character, places: list[tuple[Scene, Samples]]) -> None:
    quicker = 0
    for world, path in places:
        start = np.array([*path.pose[0, :2], path.pose[0, 2] + 2.0])
        alone = PathFollower(character, path, world.meshes, start, IDLE, FollowOptions(budget=1000, most_still=1))
        first = alone.next()
        taken = follow_path(character, path, world.meshes, start, IDLE)
        other = alone.quicken(first) if alone.is_slow(first) else None
        np.testing.assert_array_equal(taken.origins, (other or first).origins)
        quicker += other is not None
        track, _ = track_of(GRAPH, taken)
        assert np.hypot(*(track[:, :2] - path.pose[-1, :2]).T).min() <= 0.35
    assert quicker > 1


@kernel
def next_stage(guide, beam, count, width, least, limit):
    return beam_kernels._next_stage(guide, beam, count, width, least, limit)


def test_the_next_stage_is_the_least_costly_of_the_first_stretch_with_room(character: Character) -> None:
    world, path = scene(OPEN_GROUND), sample([(0.0, 0.0), (6.0, 0.0)])
    search = PathFollower(character, path, world.meshes, np.zeros(3), IDLE)
    guide, rules, arrays, laid = (search._arguments[i] for i in (2, 3, 8, 9))
    beam = make_beam(guide, rules, arrays, laid, 20)
    rng, none = np.random.default_rng(4), 0
    for _ in range(200):
        count = int(rng.integers(1, 40))
        beam.link[:count, beam_kernels.STATE] = rng.integers(0, 3, count)
        beam.measure[:count] = rng.uniform(0.0, 6.0, (count, beam_kernels.MEASURE_COLUMNS))
        beam.gone_on[:] = rng.integers(0, 4, len(beam.gone_on))
        width, least, limit = int(rng.integers(1, 4)), rng.uniform(1.0, 7.0), rng.uniform(4.0, 9.0)
        expected: list[tuple[int, float, int]] = []
        left = False
        for i in range(count):
            arc, time, _, bound = beam.measure[i]
            remaining = guide.remaining[min(round(arc / 0.1), len(guide.remaining) - 1)]
            if beam.link[i, beam_kernels.STATE] or bound >= least or time + remaining >= limit:
                continue
            left = True
            stretch = int(arc / beam_kernels.STRETCH)
            if beam.gone_on[stretch] < width:
                expected.append((stretch, bound, i))
        found = next_stage(guide, beam, count, width, least, limit)
        assert found == (min(expected)[2] if expected else -1, left)
        none += not expected
    assert 10 < none < 190
