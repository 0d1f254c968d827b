"""The edited environment against one built as it should be, and whom an edit affects against what the meshes say."""

from dataclasses import replace

import numpy as np
import pytest
import shapely

from crowdsim.crowd.search.affected import could_shorten, first_taken, outdated, route_taken, way_left
from crowdsim.crowd.state.assets import Assets, prepare
from crowdsim.crowd.state.environment import Edit, EnvironmentState
from crowdsim.crowd.state.motion_plan import Request
from crowdsim.environment.layers import Band, clearance_layers
from crowdsim.navmesh.navmesh import NavMesh
from crowdsim.planning.query.behavior_areas import area_polygons
from crowdsim.planning.query.requirements import CONTACT_TOLERANCE
from crowdsim.scenario.loader import parse_scenario
from crowdsim.scenario.scenario import Scenario
from crowdsim.scenario.timetable import AS_DRAWN
from tests.support.motion_search import search_motion
from tests.support.two_rooms import WALKERS, two_rooms

EVENTS = (
    "at: 1, move: {name: crate, by: [0, 3], rotation: 30}",
    "at: 2, close: door_a",
    "at: 3, insert: {name: shelf, box: {min: [7, 2], max: [8, 2.3]}, bottom: 0.9, top: 1.4}",
    "at: 4, open: door_a",
    "at: 5, remove: crate",
)


@pytest.fixture(scope="module")
def scenario() -> Scenario:
    return parse_scenario(two_rooms(WALKERS, events=EVENTS, door_b="closed"))


@pytest.fixture(scope="module")
def assets(scenario: Scenario) -> Assets:
    return prepare(scenario)


def test_after_every_edit_the_meshes_are_those_of_the_place_as_it_is(scenario: Scenario, assets: Assets) -> None:
    environment = EnvironmentState(assets)
    points = np.random.default_rng(1).uniform((0, 0), (12, 6), (600, 2))
    for change in (None, *assets.timetable.events):
        if change is not None:
            environment.put(change.movable, change.placing, 7)
        free = [layer.free for layer in assets.layers]
        for number in range(len(assets.timetable.movables)):
            placing = environment.placing(number)
            for row, shape in enumerate(() if placing is None else environment.footprints(number, placing)):
                free[row] = free[row] if shape is None else free[row].difference(shape)
        wanted = [*free, *area_polygons(free, assets.behaviors)]
        for mesh, area in zip((*environment.meshes, *environment.areas), wanted, strict=True):
            assert mesh.clearances(points, 1.0) == pytest.approx(NavMesh(area).clearances(points, 1.0), abs=2e-3)
    assert environment.revision == len(EVENTS)
    assert environment.last_edit_step == 7


def test_the_lowest_layer_takes_what_any_layer_does(scenario: Scenario, assets: Assets) -> None:
    environment = EnvironmentState(assets)
    names = [movable.name for movable in assets.timetable.movables]
    assert [shape is None for shape in environment.footprints(names.index("shelf"), AS_DRAWN)] == [False, False]
    assert [shape is None for shape in environment.footprints(names.index("crate"), AS_DRAWN)] == [False, False]
    bands = [Band(layer.name, layer.low, layer.high) for layer in assets.layers]
    for name, number in zip(names, range(len(names)), strict=True):
        solid = assets.timetable.movables[number].solids[0]
        for shape, layer in zip(
            environment.footprints(number, AS_DRAWN),
            clearance_layers(shapely.box(0, 0, 12, 6), [solid], bands),
            strict=True,
        ):
            taken = shapely.Polygon() if shape is None else shape
            assert taken.symmetric_difference(layer.obstacles).area < 1e-9, name


def test_the_state_tells_places_apart(scenario: Scenario, assets: Assets) -> None:
    environment = EnvironmentState(assets)
    states = [environment.state()]
    for change in assets.timetable.events:
        environment.put(change.movable, change.placing, 0)
        states.append(environment.state())
    assert len(set(states)) == len(states)
    still = parse_scenario(two_rooms(WALKERS))
    assert EnvironmentState(replace(assets, timetable=still.environment.timetable)).state() == b""


def test_a_route_is_taken_exactly_where_the_meshes_find_a_violation(scenario: Scenario, assets: Assets) -> None:
    environment = EnvironmentState(assets)
    route = environment.route((1, 3), (11, 1))
    rng = np.random.default_rng(2)
    found = []
    for _ in range(60):
        shape = shapely.Point(route.at(rng.uniform(0.5, route.length - 0.5, 1))[0]).buffer(rng.uniform(0.05, 0.3))
        shape = shapely.affinity.translate(shape, *rng.uniform(-0.9, 0.9, 2))
        if min(shape.distance(shapely.Point(end)) for end in (route.points[0], route.points[-1])) < 0.5:
            continue
        taken = (shape, shape if rng.random() < 0.5 else None)
        hit = False
        for row, (layer, part) in enumerate(zip(assets.layers, taken, strict=True)):
            if part is None:
                continue
            mesh = NavMesh(shapely.box(0, 0, 12, 6).difference(part))
            for section in route.sections:
                inner = route.arc[(route.arc > section.start) & (route.arc < section.end)]
                points = route.at(np.concatenate([[section.start], inner, [section.end]]))
                near = mesh.violations(points, assets.need.radii[section.behavior, row] - CONTACT_TOLERANCE)
                # The floor's edge is no affair of the obstacle.
                hit |= bool(len(near)) and shapely.LineString(points).distance(part) < 0.5
            assert layer.low < layer.high
        assert route_taken(assets, route, route.points[0], taken) == hit
        found.append(hit)
    assert 0.2 < np.mean(found) < 0.9


def test_a_motion_is_taken_where_its_body_is_and_not_behind(scenario: Scenario, assets: Assets) -> None:
    environment = EnvironmentState(assets)
    plan = search_motion(assets, environment, Request(np.array([1.0, 1.5]), np.array([11.0, 3.0]), True))
    assert plan.count > 5
    middle = plan.count // 2
    post = shapely.Point(plan.origins[middle, :2]).buffer(0.05)
    first = first_taken(assets, plan, 0, (post, post))
    assert first <= middle
    graph = assets.graph
    for node in range(plan.count):
        # The end of a node is where the next one starts, but for the blend offset.
        ends = [plan.origins[node, :2], plan.origins[min(node + 1, plan.count - 1), :2]]
        if node < first - 1:
            assert min(np.hypot(*(end - plan.origins[middle, :2])) for end in ends) > 0.1
    assert first_taken(assets, plan, middle + 3, (post, post)) == plan.count
    away = shapely.Point(3.0, 5.5).buffer(0.1)
    assert first_taken(assets, plan, 0, (away, away)) == plan.count
    assert first_taken(assets, plan, 0, (None, None)) == plan.count
    assert graph.node_idle[plan.departure_node]
    assert outdated(assets, plan, plan.departure[:2], [Edit((post, None), None)])
    assert not outdated(assets, plan, plan.departure[:2], [Edit((away, None), None), Edit(None, post)])
    assert outdated(assets, None, plan.departure[:2], [Edit(None, post)])
    assert not outdated(assets, None, plan.departure[:2], [Edit((post, None), None)])


def test_only_a_much_shorter_straight_way_is_worth_a_new_plan(scenario: Scenario, assets: Assets) -> None:
    environment = EnvironmentState(assets)
    # Door b is closed, so that the way leads through door a.
    route = environment.route((1, 4.5), (11, 4.5))
    start = np.array([1.0, 4.5])
    assert way_left(route, start) == pytest.approx(route.length)
    assert way_left(route, route.at(np.array([3.0]))[0]) == pytest.approx(route.length - 3.0)
    assert could_shorten(route, start, shapely.box(5, 4, 5.15, 5))
    assert not could_shorten(route, start, shapely.box(5, 0, 5.15, 0.5))
    assert not could_shorten(route, np.array([10.0, 4.5]), shapely.box(5, 4, 5.15, 5))
