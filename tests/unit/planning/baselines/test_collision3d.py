"""Bodies in 3D against obstacles in 3D, and plans made with them."""

import numpy as np
import pytest
import shapely

from crowdsim.behaviors.library import load_behavior_set
from crowdsim.crowd.state.assets import prepare
from crowdsim.crowd.state.environment import EnvironmentState
from crowdsim.environment.layers import LEGS, TORSO, clearance_layers
from crowdsim.environment.solids import box, cylinder
from crowdsim.errors import PathNotFound
from crowdsim.library import library_folder
from crowdsim.motion.captures.reader import read_clip
from crowdsim.motion.clips.body_capsules import Capsules, body_capsules
from crowdsim.navmesh.navmesh import NavMesh
from crowdsim.planning.baselines.collision3d import annotated_in_3d, make_bodies, plan_collision3d
from crowdsim.planning.baselines.collision_scene import CollisionScene, Stride
from crowdsim.planning.planner import Planner
from crowdsim.scenario.check import check_scenario
from crowdsim.scenario.loader import parse_scenario
from tests.unit.motion.walker import walk

pytest.importorskip("fcl")

FLOOR = shapely.box(0.0, -3.0, 12.0, 3.0)

OVER_A_THRESHOLD = """\
crowdsim: 1
name: over a threshold
seed: 1
duration: 10.0
planner: collision3d
floor: {rectangle: [0.0, -3.0, 12.0, 3.0]}
obstacles:
  - {name: threshold, box: {min: [5.0, -3.0], max: [5.2, 3.0]}, top: 0.05}
agents:
  - {name: walkers, count: 1, start: {rectangle: [0.6, -0.6, 1.4, 0.6]}, goal: {rectangle: [10.0, -0.6, 11.4, 0.6]}}
"""


@pytest.fixture(scope="module")
def behaviors():
    bands = [(LEGS.low, LEGS.high), (TORSO.low, TORSO.high)]
    return load_behavior_set(("lateral", "arm_constrained", "frontal"), bands).behaviors


@pytest.fixture(scope="module")
def bodies(behaviors):
    """Bodies in an empty place: the surfaces of a cycle take seconds to make, and scenes are put around them."""
    return make_bodies(CollisionScene([]), behaviors)


def post(x: float, y: float, radius: float = 0.2, bottom: float = 0.0, top: float = 2.0):
    return cylinder("post", (x, y), radius, bottom, top)


def test_capsules_follow_the_track_and_keep_to_the_body():
    clip = walk(steps=4, turn=0.7)
    capsules = body_capsules(clip, 20, 60)
    assert capsules.ends.shape == (40, len(capsules.radii), 2, 3)
    assert np.abs(capsules.ends[..., :2]).max() < 1.1
    assert 1.4 < capsules.ends[..., 2].max() < 2.0
    moved = type(clip)("moved", clip.skeleton, clip.root_positions + [5.0, -3.0, 0.0], clip.rotations)
    np.testing.assert_allclose(body_capsules(moved, 20, 60).ends, capsules.ends, atol=1e-9)


@pytest.mark.parametrize(
    ("solid", "meets"),
    [
        (post(2.0, 1.25), True),  # 0.05 m into the ball of 0.3 m about (2, 1)
        (post(2.0, 1.55), False),
        (post(2.0, 1.0, bottom=1.4, top=2.0), False),  # above its top at 1.3 m
        (post(2.0, 1.0, bottom=1.25, top=2.0), True),
    ],
)
def test_a_ball_meets_what_it_reaches_into(solid, meets):
    ball = Capsules(np.array([[[[1.0, 0.0, 1.0], [1.0, 0.0, 1.0]]]]), np.array([0.3]), np.array([False]))
    stride = Stride(ball, 1.0)
    assert CollisionScene([solid]).collides(stride.body(0.0), 2.0, 0.0, np.pi / 2) is meets


def plan_through(behaviors, bodies, solids, ends):
    layers = clearance_layers(FLOOR, solids, [LEGS, TORSO])
    meshes = [NavMesh(layer.free) for layer in layers]
    return Planner(meshes, behaviors).query(*ends), bodies._replace(scene=CollisionScene(solids))


def gap(width: float, top: float):
    return [
        box("below", (5.0, -3.0), (7.0, -width / 2), 0.0, top),
        box("above", (5.0, width / 2), (7.0, 3.0), 0.0, top),
    ]


@pytest.mark.parametrize(("width", "top", "needed"), [(0.46, 2.0, 0), (0.52, 2.0, 1), (0.8, 2.0, 2), (0.5, 0.45, 2)])
def test_gaps_ask_for_the_behavior_that_passes(behaviors, bodies, width, top, needed):
    query, among = plan_through(behaviors, bodies, gap(width, top), ((1.0, 0.0), (11.0, 0.0)))
    path = annotated_in_3d(query, among, np.array([[1.0, 0.0], [11.0, 0.0]]))
    inside = {section.behavior for section in path.sections if section.start < 5.5 and section.end > 4.5}
    assert min(inside) == needed, (path.sections, needed)


def test_nothing_fits_through_a_wall(behaviors, bodies):
    wall = [box("wall", (5.0, -3.0), (5.2, 3.0), 0.0, 2.0)]
    query, among = plan_through(behaviors, bodies, [*wall], ((1.0, 0.0), (3.0, 0.0)))
    assert annotated_in_3d(query, among, np.array([[1.0, 0.0], [11.0, 0.0]])).sections == ()
    assert plan_collision3d(query, among) is not None


def test_plans_keep_the_sections_of_bodies_in_3d_and_prove_no_bound(behaviors, bodies):
    query, among = plan_through(behaviors, bodies, gap(0.6, 2.0), ((1.0, 1.0), (11.0, -1.0)))
    planner = Planner(query.meshes, behaviors, planner="collision3d", bodies=among)
    path = planner.plan((1.0, 1.0), (11.0, -1.0))
    assert path.sections == annotated_in_3d(query, among, path.points).sections
    assert path.bound == 0.0


def test_a_solid_below_the_layers_is_named_as_the_reason(behaviors, bodies):
    threshold = box("threshold", (5.0, -3.0), (5.2, 3.0), 0.0, 0.05)
    query, among = plan_through(behaviors, bodies, [threshold], ((1.0, 0.0), (11.0, 0.0)))
    planner = Planner(query.meshes, behaviors, planner="collision3d", bodies=among)
    with pytest.raises(PathNotFound, match="in 3D the body of every behavior touches a solid"):
        planner.plan((1.0, 0.0), (11.0, 0.0))


def test_a_threshold_below_the_layers_has_no_effect(behaviors):
    scenario = parse_scenario(OVER_A_THRESHOLD)
    assert ["'threshold' (0 to 0.05 m) meets no layer" in warning for warning in check_scenario(scenario)] == [True]
    assert EnvironmentState(prepare(scenario)).route((1.0, 0.0), (11.0, 0.0)).length == pytest.approx(10.0)


def test_strides_are_cycles_of_the_library(behaviors):
    bodies = make_bodies(CollisionScene([post(1.0, 0.0)]), behaviors)
    assert all(0.3 < stride.length < 10.0 for stride in bodies.strides)
    clip = read_clip(library_folder("behaviors") / "frontal" / "clips" / "walk.bvh")
    assert len(clip.root_positions) > 100
