"""Following a path to its very end."""

import numpy as np
import shapely

from crowdsim.following.exact_following import follow_exactly
from crowdsim.following.motion_maps import MotionMaps
from crowdsim.following.path_follower import FollowOptions, FollowStatus
from crowdsim.following.probes import body_probes
from tests.unit.following.test_path_follower import GRAPH, IDLE, OPEN_GROUND, check, sample, scene
from tests.unit.following.walking_graph import FACINGS, RADII

PROBES = body_probes(GRAPH, RADII)
MAPS = MotionMaps.build(GRAPH)


def test_most_paths_are_walked_to_their_end_within_a_centimeter():
    world = scene(OPEN_GROUND)
    exact = 0
    goals = [(4.0 + 0.37 * k, 0.9 * np.sin(k)) for k in range(12)]
    for goal in goals:
        path = sample([(0.0, 0.0), (2.0, 0.0), goal])
        found, off = follow_exactly(GRAPH, MAPS, PROBES, path, world.meshes, RADII, FACINGS, np.zeros(3), IDLE)
        assert found.status is FollowStatus.FOUND
        assert GRAPH.node_ends_standing[found.nodes[-1]]
        track = check(found, world)
        assert np.isclose(np.hypot(*(track[-1, :2] - goal)), off, atol=1e-6)
        assert off <= 0.1
        exact += off <= 0.01
    assert exact >= 7


def test_a_closed_way_gives_what_came_farthest():
    world = scene(shapely.box(-2.0, -1.2, 6.0, 1.2))
    path = sample([(0.0, 0.0), (9.0, 0.0)])
    options = FollowOptions(goal_tolerance=0.1, budget=200)
    found, off = follow_exactly(GRAPH, MAPS, PROBES, path, world.meshes, RADII, FACINGS, np.zeros(3), IDLE, options)
    assert found.status is not FollowStatus.FOUND
    assert off > 2.0
