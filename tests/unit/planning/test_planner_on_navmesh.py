"""The planner on real meshes: rooms of random boxes, judged by shapely."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
import shapely

from crowdsim.constants import TRACKING_MARGIN
from crowdsim.errors import PathNotFound
from crowdsim.navmesh.navmesh import NavMesh
from crowdsim.planning.planner import Planner
from crowdsim.planning.query.behavior_areas import area_polygons
from crowdsim.planning.query.clear_ends import REACH


def cluttered_layers(seed, size=12.0, count=40):
    """Legs and torso layers of a square room with random boxes, three of five of them tall."""
    rng = np.random.default_rng(seed)
    corner = rng.uniform(0.0, size, (count, 2))
    boxes = shapely.box(*corner.T, *(corner + rng.uniform(0.3, 1.5, (count, 2))).T)
    tall = rng.random(count) < 0.6
    torso = shapely.box(0, 0, size, size).difference(shapely.union_all(boxes[tall]))
    return torso.difference(shapely.union_all(boxes[~tall])), torso


def free_points(area, count, seed):
    rng = np.random.default_rng(seed)
    places = rng.uniform(0.0, 12.0, (2000, 2))
    return places[shapely.contains(area, shapely.points(places))][:count]


def intrusion(path, behaviors, polygons):
    """Meters by which the disc of any section's behavior reaches into an obstacle of any layer.

    Near the ends, which may be given with less, only the body's own disc counts.
    """
    legs = max(behavior.radii[0] for behavior in behaviors) + TRACKING_MARGIN
    worst = -np.inf
    for section in path.sections:
        inner = path.arc[(path.arc > section.start) & (path.arc < section.end)]
        torso = behaviors[section.behavior].radii[1] + TRACKING_MARGIN
        line = shapely.LineString(path.at(np.concatenate([[section.start], inner, [section.end]])))
        bounds = np.clip([REACH, path.length - REACH], section.start, section.end)
        middle = path.at(np.concatenate([bounds[:1], inner[(inner > bounds[0]) & (inner < bounds[1])], bounds[1:]]))
        for polygon, radius in zip(polygons, (legs, torso), strict=True):
            assert polygon.covers(line)
            worst = max(worst, radius - TRACKING_MARGIN - polygon.boundary.distance(line))
            if bounds[0] < bounds[1]:
                worst = max(worst, radius - polygon.boundary.distance(shapely.LineString(middle)))
    return worst


def lack_at(end, path, behaviors, polygons):
    """Meters that the first (``end`` 0) or last REACH of a path lack of what is planned for the section there."""
    legs = max(behavior.radii[0] for behavior in behaviors) + TRACKING_MARGIN
    section = path.sections[-end]
    low, high = (
        (section.start, min(section.end, REACH)) if end == 0 else (max(section.start, path.length - REACH), section.end)
    )
    inner = path.arc[(path.arc > low) & (path.arc < high)]
    line = shapely.LineString(path.at(np.concatenate([[low], inner, [high]])))
    torso = behaviors[section.behavior].radii[1] + TRACKING_MARGIN
    return max(r - polygon.boundary.distance(line) for polygon, r in zip(polygons, (legs, torso), strict=True))


def test_a_plan_says_what_its_ends_lack_of_the_clearance(behaviors):
    polygons = cluttered_layers(4)
    planner = Planner([NavMesh(polygon) for polygon in polygons], behaviors)
    points = free_points(polygons[0], 60, 7)
    lacks = 0
    for start, goal in zip(points[:30], points[30:], strict=True):
        try:
            path = planner.plan(start, goal)
        except PathNotFound:
            continue
        for end, missing in enumerate(path.missing):
            lack = lack_at(end, path, behaviors, polygons)
            assert lack <= missing + 0.003
            assert missing <= max(lack, 0.0) + 1e-6
            lacks += missing > 0.0
    assert lacks > 2


@pytest.mark.parametrize("seed", range(6))
def test_every_section_keeps_its_clearance(behaviors, seed):
    polygons = cluttered_layers(seed)
    meshes = [NavMesh(polygon) for polygon in polygons]
    rooms = [None if p.is_empty else NavMesh(p) for p in area_polygons(polygons, behaviors)]
    walkable = polygons[0].buffer(-(behaviors[0].radii[0] + TRACKING_MARGIN + 0.002), quad_segs=32)
    parts = shapely.get_parts(walkable)
    points = free_points(walkable, 12, seed)
    planners = [Planner(meshes, behaviors, areas=given) for given in (None, rooms)]
    found = 0
    for start, goal in zip(points[::2], points[1::2], strict=True):
        joined = any(part.contains(shapely.Point(start)) and part.contains(shapely.Point(goal)) for part in parts)
        for planner in planners:
            try:
                path = planner.plan(start, goal)
            except PathNotFound:
                assert not joined
                continue
            found += 1
            assert path.points[0] == pytest.approx(start)
            assert path.points[-1] == pytest.approx(goal)
            assert path.sections[0].start == 0.0
            assert path.sections[-1].end == path.length
            assert intrusion(path, behaviors, polygons) <= 2e-5
            assert path.cost >= path.length * behaviors[-1].cost_per_meter - 1e-9
    assert found > 0


def test_room_areas_are_where_the_behaviors_fit(behaviors):
    polygons = cluttered_layers(1)
    legs = behaviors[0].radii[0] + TRACKING_MARGIN
    for behavior, room in zip(behaviors, area_polygons(polygons, behaviors), strict=True):
        torso = behavior.radii[1] + TRACKING_MARGIN
        points = free_points(room.buffer(-legs, quad_segs=32), 200, 5)
        places = shapely.points(points)
        assert (shapely.distance(polygons[0].boundary, places) >= legs - 1e-3).all()
        assert (shapely.distance(polygons[1].boundary, places) >= torso - 1e-3).all()


@pytest.mark.parametrize("name", ["layered", "greedy_literal"])
def test_threads_plan_the_same(behaviors, name):
    polygons = cluttered_layers(2)
    meshes = [NavMesh(polygon) for polygon in polygons]
    points = free_points(polygons[0].buffer(-0.4), 16, 3)
    shared = Planner(meshes, behaviors, planner=name)

    def plan(k, planner=shared):
        try:
            path = planner.plan(points[k], points[k + 1])
        except PathNotFound as error:
            return str(error)
        return path.points.tobytes(), path.sections, path.cost

    with ThreadPoolExecutor(4) as pool:
        together = list(pool.map(plan, range(15)))  # the first to ask make what all share
    assert together == [plan(k) for k in range(15)]
    assert together == [plan(k, Planner(meshes, behaviors, planner=name)) for k in range(15)]


def test_threads_make_one_roadmap(behaviors):
    planner = Planner([NavMesh(polygon) for polygon in cluttered_layers(2)], behaviors)
    with ThreadPoolExecutor(4) as pool:
        made = list(pool.map(lambda _: planner.roadmap(), range(8)))
    assert all(roadmap is made[0] for roadmap in made)
