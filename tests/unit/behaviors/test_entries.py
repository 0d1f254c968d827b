"""Phases of nodes, and frames at which steered bodies enter the motion graph."""

from dataclasses import replace

import numpy as np
import pytest

from crowdsim.behaviors.entries import _movement, entry_origins, find_entries, find_exits, node_phases
from crowdsim.behaviors.gaits import gait_clips
from crowdsim.behaviors.library import load_behavior_set
from crowdsim.constants import CAPTURE_RATE, NONE
from crowdsim.errors import MotionError
from crowdsim.geometry.planar import wrap_angle
from crowdsim.motion.deformed.phase_kernels import STAND
from crowdsim.motion.graph.track_kernels import track_pose
from crowdsim.motion.synthesis.styles import MANNERS
from tests.support.steered_recording import behavior_set

CAPTURES = (("16_15*", "16_31*", "16_33*"), ("16_1*.bvh", "16_31*", "16_33*", "16_47*", "16_58*"))


def found(behaviors):
    phases = node_phases(behaviors)
    return phases, find_entries(behaviors, gait_clips(behaviors), phases)


def captured(shared, patterns):
    names = ("frontal", "arm_constrained")
    return load_behavior_set(names, ((0.0, 2.0),), captures=shared / "mocap", capture_patterns=patterns)


def assert_sound(behaviors):
    phases, entries = found(behaviors)
    arrays = behaviors.graph.arrays
    assert phases.shape == (len(arrays.tracks),)
    assert ((phases >= 0.0) & (phases < 1.0)).all()
    rows = arrays.node_track[entries.node] + entries.frame
    np.testing.assert_array_equal(entries.phase, phases[rows])
    np.testing.assert_array_equal(entries.track, arrays.tracks[rows])
    # Enough is left of the node, which leads on, and to a stand.
    assert (arrays.node_frames[entries.node] - entries.frame >= 9).all()
    assert (np.diff(arrays.edge_start)[entries.node] > 0).all()
    assert (arrays.node_ends_standing | (arrays.stop_edge != NONE))[entries.node].all()
    assert not arrays.node_idle[entries.node].any()
    behavior = np.repeat(np.arange(len(behaviors.behaviors)), np.diff(entries.first))
    np.testing.assert_array_equal(arrays.node_behavior[entries.node], behavior)
    np.testing.assert_allclose(entries.speed, entries.natural_speed[behavior], rtol=0.1501)
    for number, each in enumerate(behaviors.behaviors):
        own = entries.phase[entries.first[number] : entries.first[number + 1]]
        assert (len(own) == 0) == each.turned
        if len(own):
            assert (np.diff(own) >= 0.0).all()
            # Whoever walks meets one within a fifth of a second.
            assert np.diff(np.append(own, own[0] + 1.0)).max() < 0.18
    # A foot that stands falls behind: it is ahead when it lands, behind when the other one does.
    u = np.mod(entries.phase, 0.5)
    assert entries.foot[u < 0.05, 0].min() > 0.2
    assert entries.foot[u > 0.45, 0].max() < 0.0
    assert (entries.foot[entries.phase < 0.4, 1] > -0.02).all()
    assert (entries.foot[(entries.phase > 0.5) & (entries.phase < 0.9), 1] < 0.02).all()
    # Bodies of every behavior can stand, in nodes that are one phase throughout.
    idle = np.flatnonzero(arrays.node_idle)
    assert set(arrays.node_behavior[idle].tolist()) == set(range(len(behaviors.behaviors)))
    for node in idle:
        row = arrays.node_track[node]
        np.testing.assert_array_equal(phases[row : row + arrays.node_frames[node] + 1], STAND)


def assert_exits(behaviors):
    phases, entries = found(behaviors)
    exits = find_exits(behaviors, entries, phases)
    arrays, names = behaviors.graph.arrays, behaviors.graph.node_names
    assert exits.shape == phases.shape
    assert exits[arrays.node_track[entries.node] + entries.frame].all()
    for node, name in enumerate(names):
        own = exits[arrays.node_track[node] :][: arrays.node_frames[node] + 1]
        if arrays.node_idle[node]:
            assert own.all(), name
        if "turn_left_90" in name or "side_left:" in name:
            assert own.mean() < 0.5, name
    # The default set has many kinds of turns and short steps, which are none.
    assert 0.25 < exits.mean() < 0.7


@pytest.mark.parametrize("name", MANNERS)
def test_bodies_leave_nodes_where_they_walk_or_stand(name):
    assert_exits(behavior_set(name))


@pytest.mark.parametrize("name", MANNERS)
def test_built_in_sets_have_entries(name):
    assert_sound(behavior_set(name))


@pytest.mark.parametrize("patterns", CAPTURES)
def test_captured_walks_have_entries(shared, patterns):
    assert_sound(captured(shared, patterns))


def test_a_node_goes_on_from_the_track_that_enters_it():
    _, entries = found(behavior_set())
    generator = np.random.default_rng(3)
    rows = generator.integers(len(entries.node), size=50)
    poses = generator.uniform(-4.0, 4.0, (50, 3))
    origins = entry_origins(entries, rows, poses)
    graph = behavior_set().graph.arrays
    for row, origin, pose in zip(rows, origins, poses, strict=True):
        at = track_pose(graph, int(entries.node[row]), int(entries.frame[row]), *origin, 0.0, 0.0, 0.0)
        np.testing.assert_allclose(at[:2], pose[:2], atol=1e-12)
        assert abs(wrap_angle(at[2] - pose[2])) < 1e-12


def test_a_body_that_turns_past_south_turns_at_the_same_rate():
    # Headings are in [-pi, pi]: a straight difference across the ends would be 63 rad/s here.
    headings = np.pi - 0.1 + 0.02 * np.arange(12)
    tracks = np.column_stack((np.zeros(12), np.zeros(12), wrap_angle(headings)))
    frames = np.arange(12)
    assert _movement(tracks, frames, frames[::-1])[1] == pytest.approx(0.02 * CAPTURE_RATE)


def test_a_graph_without_a_way_to_stand_has_no_entries():
    behaviors = behavior_set()
    graph = behaviors.graph
    arrays = graph.arrays._replace(
        stop_edge=np.full_like(graph.arrays.stop_edge, NONE),
        node_ends_standing=np.zeros_like(graph.arrays.node_ends_standing),
    )
    lost = replace(behaviors, graph=replace(graph, arrays=arrays))
    with pytest.raises(MotionError, match="no node of behavior 'frontal' walks straight on"):
        found(lost)


def test_clips_of_one_name_are_told_by_their_poses():
    """As transitions from several behaviors to one may have it."""
    behaviors = behavior_set()
    frontal = behaviors.clips[-1]
    walk = frontal.clips[0]
    other = replace(walk, rotations=walk.rotations[::-1].copy())
    for both in ((other, *frontal.clips), (*frontal.clips, other)):
        twice = replace(frontal, clips=both)
        found = node_phases(replace(behaviors, clips=(*behaviors.clips[:-1], twice)))
        np.testing.assert_array_equal(found, node_phases(behaviors))
