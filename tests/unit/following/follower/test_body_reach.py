"""Every joint in its section: against the joints of every frame, placed one by one as a recording shows them."""

import numpy as np
import pytest
import shapely
from numpy.typing import NDArray

from crowdsim.errors import MotionError
from crowdsim.following.follower.body_reach import BodyReach, body_reach
from crowdsim.following.follower.character import Character
from crowdsim.following.follower.follow_options import FollowOptions
from crowdsim.following.follower.path_follower import FollowResult, FollowStatus, follow_path
from crowdsim.following.follower.reach_kernels import WINDOW
from crowdsim.following.maps.motion_maps import MotionMaps
from crowdsim.geometry.elementary import hypot
from crowdsim.geometry.planar import compose
from crowdsim.motion.graph.pose_kernels import pose_joints
from crowdsim.motion.graph.pose_table import PoseTable
from tests.reference.follow_maps import track_of
from tests.unit.following.follower.test_path_follower import GRAPH, IDLE, OPEN_GROUND, Samples, sample, scene
from tests.unit.following.walking_graph import FACINGS, LATERAL, RADII

MAPS = MotionMaps.build(GRAPH)
WORLD = scene(OPEN_GROUND)
ARMS = np.array([[0.0, 0.3], [0.0, -0.3]])


def swinging_arms() -> PoseTable:
    """Two hands 0.3 m to the sides of a root over the track; the whole body sways about it, node by node."""
    rows = len(GRAPH.tracks)
    sway = 0.4 * np.sin(0.1 * np.arange(rows))
    rotations = np.zeros((rows, 3, 4), np.float32)
    rotations[:, :, 0] = 1.0
    rotations[:, 0, 0], rotations[:, 0, 3] = np.cos(0.5 * sway), np.sin(0.5 * sway)
    root = np.tile(np.float32([0.02, 0.0, 1.0]), (rows, 1))
    offsets = np.zeros((3, 3), np.float32)
    offsets[1:, :2] = ARMS
    return PoseTable(np.array([-1, 0, 0], np.int32), offsets, GRAPH.node_track, GRAPH.node_frames, root, rotations)


POSES = swinging_arms()


def joints_of(result: FollowResult) -> NDArray[np.float64]:
    """(F, 3, 2) every joint in every frame, seams faded, up to where the end of the path is passed."""
    track, _ = track_of(GRAPH, result)
    frames = np.concatenate([np.arange(GRAPH.node_frames[n] + 1) for n in result.nodes])
    node = np.repeat(result.nodes, GRAPH.node_frames[result.nodes] + 1)
    before = np.repeat([-1, *result.nodes[:-1]], GRAPH.node_frames[result.nodes] + 1)
    positions = np.empty((len(node), 3, 3), np.float32)
    columns = (column.astype(np.int32) for column in (node, before, frames))
    pose_joints(POSES, *columns, track, positions, np.empty((len(node), 3, 4), np.float32))
    return positions[:, :, :2].astype(np.float64)


def most_off(result: FollowResult, path: Samples) -> float:
    """Meters of the joint that is farthest from the path."""
    places = joints_of(result)[int(GRAPH.node_frames[result.nodes[0]]) + 1 :]
    last = int(GRAPH.node_frames[result.nodes[-1]]) + 1
    track = track_of(GRAPH, result)[0][-last:, :2]
    places = places[: len(places) - last + 1 + int(np.argmin(np.hypot(*(track - path.pose[-1, :2]).T)))]
    return float(shapely.distance(shapely.LineString(path.pose[:, :2]), shapely.points(places.reshape(-1, 2))).max())


def follow(path: Samples, reach: BodyReach | None) -> FollowResult:
    options = FollowOptions(goal_tolerance=0.1)
    return follow_path(Character(GRAPH, MAPS, RADII, FACINGS, reach), path, WORLD.meshes, np.zeros(3), IDLE, options)


BENDS = [[(0.0, 0.0), (4.0, 0.0), (4.0 + 3.0 * np.cos(a), 3.0 * np.sin(a)), (11.0, 2.0)] for a in (0.5, 0.9, -1.2, 1.5)]


def test_every_joint_keeps_in_its_section_where_that_is_asked() -> None:
    kept = []
    for line in BENDS:
        path = sample(line)
        for room in (0.42, 0.5):
            found = follow(path, body_reach(GRAPH, POSES, np.full(3, room)))
            if found.status is FollowStatus.FOUND:
                kept.append((most_off(found, path), room))
    assert len(kept) >= 4
    assert all(off <= room + 1e-6 for off, room in kept)
    freely = [most_off(follow(sample(line), None), sample(line)) for line in BENDS]
    assert max(freely) > 0.5


def test_more_room_than_anybody_needs_changes_nothing() -> None:
    path = sample(BENDS[1])
    free, kept = follow(path, None), follow(path, body_reach(GRAPH, POSES, np.full(3, 2.0)))
    np.testing.assert_array_equal(free.nodes, kept.nodes)
    np.testing.assert_array_equal(free.origins, kept.origins)


def test_each_section_has_the_room_of_its_own_behavior() -> None:
    """Hands that need 0.32 m fit where the path is planned for a wide behavior, and not where for one without room."""
    line = [(0.0, 0.0), (12.0, 0.0)]
    room = np.array([0.05, 0.45, 0.45])
    assert follow(sample(line), body_reach(GRAPH, POSES, room)).status is FollowStatus.FOUND
    narrow = follow(sample(line, [(6.0, 12.0, LATERAL)]), body_reach(GRAPH, POSES, room))
    assert narrow.status is not FollowStatus.FOUND
    assert narrow.reached < 6.5


def test_rows_are_the_joints_of_frames_the_farthest_first() -> None:
    reach = body_reach(GRAPH, POSES, np.full(3, 0.5))
    rng = np.random.default_rng(0)
    source = np.repeat(np.arange(len(GRAPH.node_frames)), np.diff(GRAPH.edge_start))
    for edge in rng.integers(0, len(GRAPH.edge_target), 30):
        target = int(GRAPH.edge_target[edge])
        for frame in rng.integers(0, 12, 3):
            positions, rotations = np.empty((1, 3, 3), np.float32), np.empty((1, 3, 4), np.float32)
            columns = (np.array([value], np.int32) for value in (target, source[edge], frame))
            pose_joints(POSES, *columns, np.zeros((1, 3)), positions, rotations)
            row = reach.edge_first[edge] + frame
            assert sorted(map(tuple, reach.joint[row].tolist())) == sorted(map(tuple, positions[0, :, :2].tolist()))
            away = hypot(*reach.joint[row].T)
            assert (np.diff(away) <= 0.0).all()
            assert away[0] <= reach.far[row] <= max(reach.edge_most[edge], reach.node_most[target])
    node = int(np.argmax(GRAPH.node_frames))
    frames = int(GRAPH.node_frames[node])
    rows = reach.joint[reach.node_first[node] : reach.node_first[node] + frames + 1]
    assert reach.node_most[node] == hypot(rows[:, :, 0], rows[:, :, 1]).max()
    away = hypot(rows[:, :, 0], rows[:, :, 1]).max(axis=1)
    for frame in range(frames + 1):
        assert reach.far[reach.node_first[node] + frame] == away[frame : frame + WINDOW].max()
    hands = compose(np.array([0.02, 0.0, 0.4 * np.sin(0.1 * GRAPH.node_track[node])]), np.column_stack([ARMS, [0, 0]]))
    assert np.hypot(*hands[:, :2].T).max() == pytest.approx(float(away[0]), abs=1e-6)


@pytest.mark.parametrize("room", [np.full(2, 0.5), np.zeros(3), np.full((3, 1), 0.5)])
def test_room_that_does_not_fit_is_refused(room: NDArray[np.float64]) -> None:
    with pytest.raises(MotionError, match="each of the 3 behaviors needs a clearance"):
        body_reach(GRAPH, POSES, room)
