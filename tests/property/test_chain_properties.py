"""Properties of bending a chain, of what may be within its reach, and of channels, degenerate ones among them."""

from typing import NamedTuple

import numpy as np
import pytest
import shapely
from hypothesis import example, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from crowdsim.following.graph_search import channel_kernels, graph_search_kernels
from crowdsim.following.graph_search.channel import CELL, make_channel
from crowdsim.following.kinematics import chain_kernels
from crowdsim.geometry.planar import wrap_angle
from crowdsim.jit import kernel
from tests.reference.graph_search_reference import chain_with, slow_bend

Floats = NDArray[np.float64]

few = settings(max_examples=150, derandomize=True, deadline=None)
ANY_HEADING = np.nan

places = st.tuples(st.floats(-3.0, 3.0), st.floats(-3.0, 3.0))
limits = st.tuples(st.floats(-0.6, 0.0), st.floats(0.0, 0.6))
chains = st.lists(st.tuples(places, limits), min_size=1, max_size=8)
coarse = st.tuples(st.integers(0, 12), st.integers(0, 12)).map(lambda place: (0.5 * place[0], 0.5 * place[1]))


class Chain(NamedTuple):
    joint: Floats
    limit: Floats
    turn: Floats
    end: Floats


@kernel
def within_reach(chain, count, goal):
    return graph_search_kernels._within_reach(chain, count, goal)


@kernel
def gaps(channel, points, out):
    for i in range(len(points)):
        out[i] = channel_kernels.channel_gap(channel, points[i, 0], points[i, 1])


def bend(joints, limits, end, goal, enough=5e-4, lever=0.4):
    """Bent joints, turns, end and miss; the arguments stay."""
    joint, tip, turn = np.array(joints), np.array(end), np.zeros(len(joints))
    miss = chain_kernels.bend_chain(joint, np.array(limits), turn, len(joint), tip, np.array(goal), lever, enough)
    return joint, turn, tip, miss


def walk(rng: np.random.Generator, count: int) -> tuple[Floats, Floats]:
    """Joints (count, 2) and end (3,) of a branch as walks make them: strides of a meter that wander."""
    heading = np.cumsum(rng.uniform(-0.4, 0.4, count + 1))
    steps = rng.uniform(0.6, 1.4, count + 1)[:, None] * np.column_stack([np.cos(heading), np.sin(heading)])
    points = np.cumsum(steps, axis=0)
    return points[:-1], np.array([*points[-1], heading[-1]])


@few
@example([((0.0, 0.0), (0.0, 0.0))], (1.0, 0.0), 0.3, (2.0, 0.0), False)  # a joint that does not turn
@example([((0.0, 0.0), (-0.5, 0.5))], (0.0, 0.0), 0.0, (1.0, 0.0), False)  # the end is on the joint
@example([((1.0, 0.0), (-0.5, 0.5)), ((1.0, 0.0), (-0.5, 0.5))], (1.0, 0.0), 0.0, (1.0, 0.0), True)  # all in one place
@given(chains, places, st.floats(-3.0, 3.0), places, st.booleans())
def test_a_bent_chain_keeps_its_limits_and_lengths_and_is_no_farther(parts, tip, heading, goal, aimed):
    joints, ranges = np.array([part[0] for part in parts]), np.array([part[1] for part in parts])
    end = np.array([*tip, heading])
    target = np.array([*goal, 0.5 if aimed else ANY_HEADING])
    bent, turn, after, miss = bend(joints, ranges, end, target)
    assert np.all(turn >= ranges[:, 0])
    assert np.all(turn <= ranges[:, 1])

    def lengths(points: Floats, last: Floats) -> Floats:
        return np.hypot(*np.diff([*points, last[:2]], axis=0).T)

    np.testing.assert_allclose(lengths(bent, after), lengths(joints, end), atol=1e-9)
    expected, expected_end = chain_with(joints, end, turn)
    np.testing.assert_allclose(bent, expected, atol=1e-9)
    np.testing.assert_allclose(after[:2], expected_end[:2], atol=1e-9)
    assert abs(wrap_angle(after[2] - expected_end[2])) < 1e-9
    gap = float(np.hypot(*(target[:2] - after[:2])))
    if aimed:
        assert miss == pytest.approx(np.hypot(gap, 0.4 * wrap_angle(target[2] - after[2])), abs=1e-9)
    else:
        assert miss == pytest.approx(gap, abs=1e-9)
        assert gap <= np.hypot(*(target[:2] - end[:2])) + 1e-9


@few
@example([((1.0, 0.0), (0.0, 0.21875)), ((0.0, 1.0), (-0.5, 0.0)), ((0.0, -1.0), (-0.5, 0.0))], (0.0, 0.0), (0.0, -3.0))
@given(chains, places, places)
def test_the_first_sweep_is_that_of_the_slow_twin(parts, tip, goal):
    joints, ranges = np.array([part[0] for part in parts]), np.array([part[1] for part in parts])
    points = np.array([*joints, tip, goal])
    if np.hypot(*(points[:, None] - points[None]).transpose(2, 0, 1))[~np.eye(len(points), dtype=bool)].min() < 0.05:
        return  # the direction from a point to itself is anybody's
    end = np.array([*tip, 0.0])
    turns, slow_end, from_half_turn = slow_bend(joints, ranges, end, np.array(goal))
    if from_half_turn < 1e-6:
        return  # to the left or to the right is anybody's choice
    miss = float(np.hypot(*(np.array(goal) - slow_end[:2])))
    _, turn, after, found = bend(joints, ranges, end, (*goal, ANY_HEADING), enough=miss + 1e-9)
    if np.hypot(*(np.array(goal) - end[:2])) > miss + 1e-9:  # else it did not begin
        np.testing.assert_allclose(turn, turns, atol=1e-7)
        np.testing.assert_allclose(after[:2], slow_end[:2], atol=1e-7)
        assert found <= miss + 1e-9


def test_most_goals_in_reach_are_reached_within_a_millimeter():
    rng = np.random.default_rng(5)
    for count, share in ((2, 0.9), (4, 0.97), (8, 0.97)):
        reached = 0
        for _ in range(200):
            joints, end = walk(rng, count)
            ranges = np.tile([-0.25, 0.25], (count, 1))
            goal = chain_with(joints, end, rng.uniform(-0.12, 0.12, count))[1]
            reached += bend(joints, ranges, end, (*goal[:2], ANY_HEADING))[3] <= 1e-3
        assert reached >= share * 200, (count, reached)


def test_a_heading_is_reached_with_the_place():
    rng = np.random.default_rng(6)
    reached = 0
    for _ in range(100):
        joints, end = walk(rng, 6)
        ranges = np.tile([-0.4, 0.4], (6, 1))
        goal = chain_with(joints, end, rng.uniform(-0.1, 0.1, 6))[1]
        _, _, after, miss = bend(joints, ranges, end, goal)
        if miss <= 5e-3:
            reached += 1
            assert abs(wrap_angle(after[2] - goal[2])) <= 5e-3 / 0.4
    assert reached >= 90


@few
@given(chains, places, st.lists(st.floats(0.0, 1.0), min_size=8, max_size=8))
def test_what_a_chain_reaches_is_said_to_be_within_its_reach(parts, tip, shares):
    joints, ranges = np.array([part[0] for part in parts]), np.array([part[1] for part in parts])
    end = np.array([*tip, 0.0])
    turns = ranges[:, 0] + np.array(shares[: len(parts)]) * (ranges[:, 1] - ranges[:, 0])
    goal = chain_with(joints, end, turns)[1]
    length = np.hypot(*np.diff([*joints, tip], axis=0).T).sum()
    if np.hypot(*(goal[:2] - end[:2])) < 1e-6 or length - np.hypot(*(goal[:2] - joints[0])) < 1e-9:
        return  # the end is there, or the chain is straight: rounding decides
    assert within_reach(Chain(joints, ranges, np.zeros(len(parts)), end), len(parts), goal)


def test_goals_out_of_reach_are_told_from_those_within():
    joints, ranges = np.array([[0.0, 0.0], [1.0, 0.0]]), np.array([[-0.1, 0.1], [-0.1, 0.1]])
    chain = Chain(joints, ranges, np.zeros(2), np.array([2.0, 0.0, 0.0]))
    assert within_reach(chain, 2, np.array([1.98, 0.2, np.nan]))
    assert not within_reach(chain, 2, np.array([2.1, 0.0, np.nan]))  # longer than the chain
    assert not within_reach(chain, 2, np.array([1.9, 0.4, np.nan]))  # 0.3 m aside at the most
    assert not within_reach(chain, 2, np.array([1.5, 0.0, np.nan]))  # shorter than it can be bent


@few
@example([(0.0, 0.0), (0.0, 0.0)], 0.5)  # no length
@example([(0.0, 0.0), (3.0, 0.0), (1.0, 0.0)], 0.3)  # there and back
@example([(0.0, 0.0), (6.0, 6.0), (6.0, 0.0), (0.0, 6.0)], 1.0)  # across itself
@given(st.lists(coarse, min_size=2, max_size=6), st.sampled_from([0.2, 0.5, 1.0]))
def test_a_channel_never_makes_the_path_nearer_than_it_is(points, radius):
    channel = make_channel(points, radius)
    rng = np.random.default_rng(7)
    somewhere = rng.uniform(-1.5, 7.5, (400, 2))
    found = np.empty(len(somewhere))
    gaps(channel, somewhere, found)
    true = shapely.distance(shapely.LineString(points), shapely.points(somewhere))
    known = np.isfinite(found)
    assert np.all(found[known] >= true[known] - 1e-12)
    assert np.all(found[known] <= true[known] + CELL * np.sqrt(2.0) + 1e-12)
    assert np.all(known[true <= radius])
