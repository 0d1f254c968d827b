import numpy as np
import pytest
import shapely

from crowdsim.constants import TRACKING_MARGIN
from crowdsim.errors import BehaviorError, PathNotFound
from crowdsim.navmesh.navmesh import NavMesh
from crowdsim.planning import planner as planner_module
from crowdsim.planning.planner import Planner
from crowdsim.planning.query.behavior_areas import area_polygons

ROOM = shapely.box(0, -1.2, 22, 1.2)


def gap(x0, x1, half_width):
    """Obstacles that leave a gap in the middle of the corridor."""
    return shapely.box(x0, -1.2, x1, 1.2).difference(shapely.box(x0, -half_width, x1, half_width))


def layers(room, tall, low=()):
    above = room.difference(shapely.union_all(list(tall)))
    return above.difference(shapely.union_all(list(low))), above


def meshes(room, tall, low=()):
    return [NavMesh(polygon) for polygon in layers(room, tall, low)]


def swept(path, section):
    arc = np.unique(np.concatenate([[section.start, section.end], np.clip(path.arc, section.start, section.end)]))
    return shapely.LineString(path.at(arc)) if len(arc) > 1 else shapely.Point(path.at(arc)[0])


def assert_sound(path, behaviors, polygons, start, goal):
    """Sections cover the path, and the disc of each section's behavior sweeps nothing on any layer."""
    assert path.points[0] == pytest.approx(start)
    assert path.points[-1] == pytest.approx(goal)
    assert path.sections[0].start == 0.0
    assert path.sections[-1].end == pytest.approx(path.length, abs=1e-12)
    legs = max(behavior.radii[0] for behavior in behaviors) + TRACKING_MARGIN
    for before, after in zip(path.sections, path.sections[1:], strict=False):
        assert before.end == after.start
        assert before.behavior != after.behavior
    for section in path.sections:
        line = swept(path, section)
        torso = behaviors[section.behavior].radii[1] + TRACKING_MARGIN
        for polygon, radius in zip(polygons, (legs, torso), strict=True):
            assert polygon.covers(line)
            assert shapely.distance(polygon.boundary, line) >= radius - 2e-5


def test_corridor_is_walked_as_the_paper_shows(behaviors):
    polygons = layers(ROOM, [gap(4, 6, 0.34), gap(16, 17.5, 0.26)], [gap(10, 12, 0.30)])
    path = Planner([NavMesh(p) for p in polygons], behaviors).plan((1.0, 0.8), (21.0, -0.8))
    assert [behaviors[s.behavior].name for s in path.sections] == [
        "frontal", "arm_constrained", "frontal", "lateral", "frontal",
    ]  # fmt: skip
    assert_sound(path, behaviors, polygons, (1.0, 0.8), (21.0, -0.8))
    x = [path.at(np.array([edge]))[0, 0] for s in path.sections for edge in s[1:]]
    assert x[2] < 4.0 < 6.0 < x[3] < 10.0
    assert 12.0 < x[6] < 16.0 < 17.5 < x[7]
    assert path.cost < 1.03 * (20.0 + 0.1 * 2.6 + 2.0 * 2.2 + 4 * 0.15)


def test_path_runs_through_the_middle_of_gaps(behaviors):
    above = meshes(ROOM, [gap(4, 6, 0.34), gap(16, 17.5, 0.26)])
    path = Planner(above, behaviors).plan((1.0, 0.8), (21.0, -0.8))
    inside = path.at(np.linspace(0, path.length, 400))
    middle = inside[((inside[:, 0] > 4.0) & (inside[:, 0] < 6.0)) | ((inside[:, 0] > 16.0) & (inside[:, 0] < 17.5))]
    assert np.abs(middle[:, 1]).max() < 0.03


def test_cheaper_detour_is_taken(behaviors):
    """A lateral gap on the straight way, an open door 1.5 m beside it: walking around is cheaper than side-stepping."""
    room = shapely.box(0, 0, 12, 6)
    wall = shapely.box(5, 0, 7, 6).difference(shapely.box(5, 1.74, 7, 2.26)).difference(shapely.box(5, 3.2, 7, 4.4))
    polygons = layers(room, [wall])
    path = Planner([NavMesh(p) for p in polygons], behaviors).plan((1.0, 2.0), (11.0, 2.0))
    assert [s.behavior for s in path.sections] == [2]
    assert_sound(path, behaviors, polygons, (1.0, 2.0), (11.0, 2.0))


def test_two_blockers_are_combined(behaviors):
    """Two walls, each with a side-stepping gap ahead and a way between benches beside it that only blockers lead to."""
    room = shapely.box(0, 0, 20, 6)
    walls, benches = [], []
    for x in (5.0, 13.0):
        wall = shapely.box(x, 0, x + 3.0, 6)
        walls.append(wall.difference(shapely.box(x, 1.76, x + 3, 2.24)).difference(shapely.box(x, 2.6, x + 3, 3.8)))
        benches += [shapely.box(x, 2.6, x + 3, 2.95), shapely.box(x, 3.45, x + 3, 3.8)]
    polygons = layers(room, walls, benches)
    path = Planner([NavMesh(p) for p in polygons], behaviors).plan((1.0, 2.0), (19.0, 2.0))
    assert [s.behavior for s in path.sections] == [2]
    assert_sound(path, behaviors, polygons, (1.0, 2.0), (19.0, 2.0))


def test_a_path_is_moved_off_obstacles_before_it_is_judged(behaviors):
    """Held arms pass the gap ahead, though the shortest path through it is too close to its side for them."""
    room = shapely.box(0, 0, 16, 8)
    wall = shapely.box(5, 0, 7, 8).difference(shapely.box(5, 1.66, 7, 2.34)).difference(shapely.box(5, 4.2, 7, 6.6))
    bench = shapely.box(12, 0, 12.5, 8).difference(shapely.box(12, 1.75, 12.5, 2.25))
    polygons = layers(room, [wall], [bench])
    start, goal = (1.0, 2.2), (15.0, 2.2)
    path = Planner([NavMesh(p) for p in polygons], behaviors).plan(start, goal)
    assert [s.behavior for s in path.sections] == [2, 1, 2]
    assert path.length < 14.2
    assert_sound(path, behaviors, polygons, start, goal)


def test_long_detour_is_not_taken(behaviors):
    room = shapely.box(0, 0, 12, 30)
    wall = shapely.box(5, 0, 6, 30).difference(shapely.box(5, 1.74, 6, 2.26)).difference(shapely.box(5, 27, 6, 29))
    path = Planner(meshes(room, [wall]), behaviors).plan((1.0, 2.0), (11.0, 2.0))
    assert 0 in {s.behavior for s in path.sections}
    assert path.length < 10.5


def test_low_obstacles_leave_the_preferred_behavior(behaviors):
    path = Planner(meshes(ROOM, [shapely.box(30, 0, 31, 1)], [gap(8, 12, 0.25)]), behaviors).plan((1, 0), (21, 0))
    assert [s.behavior for s in path.sections] == [2]


def rooms(polygons, behaviors):
    return [None if p.is_empty else NavMesh(p) for p in area_polygons(polygons, behaviors)]


def test_rooms_pass_close_to_low_obstacles_where_high_ones_ask_for_it(behaviors):
    """0.62 m between a bench and a cabinet: enough to walk beside the bench, not in the middle."""
    polygons = layers(ROOM, [shapely.box(8, 0.31, 12, 1.2)], [shapely.box(8, -1.2, 12, -0.31)])
    layered = [NavMesh(p) for p in polygons]
    path = Planner(layered, behaviors, areas=rooms(polygons, behaviors)).plan((1, 0), (21, 0))
    assert [s.behavior for s in path.sections] == [2]
    assert_sound(path, behaviors, polygons, (1, 0), (21, 0))
    without = Planner(layered, behaviors).plan((1, 0), (21, 0))
    assert [s.behavior for s in without.sections] == [2]
    assert_sound(without, behaviors, polygons, (1, 0), (21, 0))


def test_rooms_in_the_corridor(behaviors):
    polygons = layers(ROOM, [gap(4, 6, 0.34), gap(16, 17.5, 0.26)], [gap(10, 12, 0.30)])
    layered = [NavMesh(p) for p in polygons]
    path = Planner(layered, behaviors, areas=rooms(polygons, behaviors)).plan((1.0, 0.8), (21.0, -0.8))
    assert [s.behavior for s in path.sections] == [2, 1, 2, 0, 2]
    assert_sound(path, behaviors, polygons, (1.0, 0.8), (21.0, -0.8))


@pytest.mark.parametrize("given", [False, True])
def test_torso_too_narrow_names_the_layer(behaviors, given):
    wide = [b for b in behaviors if b.name != "lateral"]
    polygons = layers(ROOM, [gap(4, 6, 0.27)])
    layered = [NavMesh(p) for p in polygons]
    with pytest.raises(PathNotFound, match=r"layer 1 is too narrow.*\([3-6]\.\d\d, .*radius 0\.31 m"):
        Planner(layered, wide, areas=rooms(polygons, wide) if given else None).plan((1, 0), (21, 0))


def test_gap_too_narrow_says_where_and_by_how_much(behaviors):
    with pytest.raises(PathNotFound, match=r"legs layer is too narrow.*\(\d+\.\d+, -?\d+\.\d+\).*0\.22 m.*by 0\.05 m"):
        Planner(meshes(ROOM, [gap(4, 6, 0.2)]), behaviors).plan((1, 0), (21, 0))


@pytest.mark.parametrize("y", [10.04, 10.07, 10.18])
def test_a_gap_as_wide_as_the_body_is_passed_in_a_place_of_400_m(behaviors, y):
    wall = shapely.box(95, 0, 96, 20).difference(shapely.box(94, y - 0.22, 97, y + 0.22))
    path = Planner(meshes(shapely.box(0, 0, 400, 20), [wall]), behaviors).plan((90, 10), (101, 10))
    assert 0 in [section.behavior for section in path.sections]


def test_walled_off_goal(behaviors):
    polygons = layers(ROOM, [shapely.box(8, -1.2, 9, 1.2)])
    with pytest.raises(PathNotFound, match=r"no way wider than 0\.02 m leads there"):
        Planner([NavMesh(polygon) for polygon in polygons], behaviors).plan((1, 0), (21, 0))


@pytest.mark.parametrize(("start", "goal", "what"), [((5, 0.5), (9, 0), "start"), ((1, 0), (5, -0.8), "goal")])
def test_place_within_an_obstacle_is_named(behaviors, start, goal, what):
    room = [NavMesh(polygon) for polygon in layers(ROOM, [gap(4, 6, 0.34)])]
    with pytest.raises(
        PathNotFound, match=rf"{what} blocked: .* is not in free space.*; choose a place with more room"
    ):
        Planner(room, behaviors).plan(start, goal)


def test_no_more_reasons_are_kept_than_planned(behaviors, monkeypatch):
    monkeypatch.setattr(planner_module, "_REASONS", 2)
    planner = Planner(meshes(ROOM, [gap(4, 6, 0.2)]), behaviors)
    for x in (20.0, 20.5, 21.0):
        with pytest.raises(PathNotFound, match="too narrow"):
            planner.plan((1.0, 0.0), (x, 0.0))
    assert len(planner._reasons) == 2


def test_start_is_goal(behaviors):
    path = Planner(meshes(ROOM, [gap(4, 6, 0.34)]), behaviors).plan((1, 0), (1, 0))
    assert path.length == 0.0
    assert [tuple(s) for s in path.sections] == [(2, 0.0, 0.0)]
    samples = path.sample()
    assert samples.pose.shape == (2, 3)
    assert np.isfinite(samples.pose).all()


def test_layers_and_bodies_must_agree(behaviors):
    with pytest.raises(BehaviorError, match="measured on 2 layers, the scene has 1"):
        Planner(meshes(ROOM, [gap(4, 6, 0.34)])[:1], behaviors).plan((1, 0), (21, 0))


def test_samples(behaviors):
    path = Planner(meshes(ROOM, [gap(4, 6, 0.34)]), behaviors).plan((1.0, 0.8), (21.0, -0.8))
    samples = path.sample(0.1)
    assert samples.arc[0] == 0.0
    assert samples.arc[-1] == path.length
    assert np.diff(samples.arc).max() <= 0.1 + 1e-12
    assert samples.behavior.dtype == np.int32
    assert samples.pose.flags.c_contiguous
    for section in path.sections:
        inside = (samples.arc > section.start) & (samples.arc < section.end)
        assert (samples.behavior[inside] == section.behavior).all()
    steps = np.diff(samples.pose[:, :2], axis=0)
    assert np.hypot(*steps.T).max() <= 0.1 + 1e-9
    assert np.abs(samples.pose[:, 2]).max() < 0.6


@pytest.mark.parametrize("y", [0.06, -0.07])
def test_held_arms_stay_held_after_straying_in_the_gap(behaviors, y):
    """0.68 m: held arms have 0.34 - 0.07 = 0.27 m, more than their body's own 0.26 m but not the planned 0.31 m."""
    path = Planner(meshes(ROOM, [gap(4, 6, 0.34)]), behaviors).plan((5.0, y), (9.0, 0.0))
    assert [s.behavior for s in path.sections] == [1, 2]
    assert path.points[0] == pytest.approx((5.0, y))
    inside = path.at(np.linspace(0.1, path.length, 200))
    assert np.abs(inside[inside[:, 0] < 6.0][:, 1]).max() < 0.04
    assert path.arc[-1] == path.sections[-1].end == pytest.approx(np.hypot(*np.diff(path.points, axis=0).T).sum())


def test_who_strayed_toward_a_bench_still_finds_its_way(behaviors):
    """0.60 m for the legs: at 0.12 m off the middle they have 0.18 m of the planned 0.22 m."""
    above = meshes(ROOM, [shapely.box(30, 0, 31, 1)], [gap(4, 6, 0.30)])
    there = Planner(above, behaviors).plan((1.0, 0.0), (5.0, -0.12))
    back = Planner(above, behaviors).plan((5.0, 0.12), (1.0, 0.0))
    assert there.points[-1] == pytest.approx((5.0, -0.12))
    assert back.points[0] == pytest.approx((5.0, 0.12))
    assert {s.behavior for s in (*there.sections, *back.sections)} == {2}
    assert back.cost == pytest.approx(back.length)


def test_narrow_start_is_left_where_a_planned_behavior_fits(behaviors):
    path = Planner(meshes(ROOM, [gap(4, 6, 0.34)]), behaviors).plan((5.95, 0.0), (9.0, 0.0))
    assert [s.behavior for s in path.sections] == [1, 2]
    assert (np.diff(path.points[:, 0]) > 0.0).all()
