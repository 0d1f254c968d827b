from dataclasses import replace

import numpy as np
import pytest
import shapely

from crowdsim.constants import TRACKING_MARGIN
from crowdsim.errors import GeometryError
from crowdsim.jit import kernel
from crowdsim.planning.query.requirements import Requirements
from crowdsim.steering.guidance.field import solve_field, ways
from crowdsim.steering.guidance.ground import NOBODY, build_ground, update_ground
from crowdsim.steering.guidance.ground_kernels import BOX, SPARE, STEPS, box_at, line_cost, margin_at, pin_of, widest_at
from crowdsim.steering.guidance.place_walls import outline_segments
from tests.reference import guidance_reference
from tests.support.guided import NEED, behavior, ground_of
from tests.support.small_scenes import scene


@kernel
def labels_at(ground, places, out):
    for n in range(len(places)):
        box = box_at(ground, places[n, 0], places[n, 1])
        out[n] = widest_at(ground, box, places[n, 0], places[n, 1])


@kernel
def pins_of(ground, out):
    for box in range(len(out)):
        out[box, 0], out[box, 1] = pin_of(ground, box)


@kernel
def costs_of(ground, crowding, lines, out):
    for n in range(len(lines)):
        out[n] = line_cost(ground, crowding, lines[n, 0], lines[n, 1], lines[n, 2], lines[n, 3], np.inf)


@kernel
def margins_of(ground, places, behavior, out):
    for n in range(len(places)):
        out[n] = margin_at(ground, box_at(ground, places[n, 0], places[n, 1]), places[n, 0], places[n, 1], behavior)


@pytest.mark.parametrize("seed", [0, 1])
def test_what_fits_is_what_shapely_says(seed):
    areas = scene(seed)
    ground = ground_of(areas)
    places = np.random.default_rng(seed).uniform(0.0, 10.0, (3000, 2))
    found = np.empty(len(places), np.int64)
    labels_at(ground, places, found)
    least = guidance_reference.widest(areas, NEED.radii + 1e-5, places)
    most = guidance_reference.widest(areas, NEED.radii - 1e-5, places)
    assert ((least <= found) & (found <= most)).all()
    assert len(np.unique(found)) == 4


@pytest.mark.parametrize("seed", [0, 1])
def test_lines_cost_what_fine_steps_cost(seed):
    areas = scene(seed)
    ground = ground_of(areas)
    rng = np.random.default_rng(seed)
    starts = rng.uniform(0.5, 9.5, (300, 2))
    lines = np.concatenate([starts, starts + rng.uniform(-2.0, 2.0, (300, 2))], axis=1)
    # As between pins: something fits at both ends.
    fits = [guidance_reference.widest(areas, NEED.radii, ends) >= 0 for ends in (lines[:, :2], lines[:, 2:])]
    lines = lines[fits[0] & fits[1]]
    found = np.empty(len(lines))
    costs_of(ground, NOBODY, lines, found)
    for line, cost in zip(lines, found, strict=True):
        ends = line[:2], line[2:]
        twin = [
            guidance_reference.line_cost(areas, NEED.radii + more, NEED.costs, ground.change, *ends)
            for more in (-0.004, 0.004)
        ]
        # A sweep by steps of 6 cm may pass a corner that is a little nearer than asked, by less than 4 mm.
        if np.isinf(cost):
            assert np.isinf(twin[1])
        else:
            assert twin[0] - 0.45 <= cost
            assert np.isinf(twin[1]) or cost <= twin[1] + 0.45
    assert 20 < np.isfinite(found).sum() < len(found) - 20


@pytest.mark.parametrize("seed", [0, 1])
def test_pins_and_ways(seed):
    areas = scene(seed)
    ground = ground_of(areas)
    boxes = ground.columns * ground.rows
    pins = np.empty((boxes, 2))
    pins_of(ground, pins)
    number = np.arange(boxes)
    x = ground.left + (number % ground.columns + 0.5) * BOX
    y = ground.bottom + (number // ground.columns + 0.5) * BOX
    centers = np.stack([x, y], axis=1)
    assert np.abs(pins - centers).max() < 0.5 * BOX
    at_center = guidance_reference.widest(areas, NEED.radii, centers)
    # But for pins that were mended, none is narrower than its center.
    assert (ground.widest >= at_center).mean() > 0.98
    assert (ground.widest > at_center).any()
    # What leads there leads back, and only to where something fits.
    for k, (column, row) in enumerate(STEPS.tolist()):
        leads = np.flatnonzero(ground.ways >> k & 1)
        other = leads + row * ground.columns + column
        assert (ground.ways[other] >> ((k + 4) % 8) & 1).all()
        assert (ground.pure[leads] >> k & 1 == ground.pure[other] >> ((k + 4) % 8) & 1).all()
        assert (ground.widest[other] >= 0).all()
    assert (ground.pure & ~ground.ways == 0).all()


@pytest.mark.parametrize("angle", [0.0, 11.0, 26.565, 37.0, 45.0, 80.0])
@pytest.mark.parametrize("shift", [0.0, 0.07, 0.125])
@pytest.mark.parametrize("width", [0.52, 0.5])
def test_a_narrow_gap_stays_open_however_it_lies(angle, shift, width):
    room = shapely.box(-4.0, -4.0, 4.0, 4.0)
    wall = shapely.box(-8.0, -0.5, -0.5 * width, 0.5).union(shapely.box(0.5 * width, -0.5, 8.0, 0.5))
    wall = shapely.affinity.translate(shapely.affinity.rotate(wall, angle, origin=(0.0, 0.0)), shift, shift)
    area = room.difference(wall)
    ground = ground_of([area, area])
    out = shapely.affinity.rotate(shapely.LineString([(0.0, -2.0), (0.0, 2.0)]), angle, origin=(0.0, 0.0))
    start, goal = np.array(out.coords)
    told = ways(ground, solve_field(ground, goal), [start])
    assert told.length[0] == pytest.approx(4.0, abs=0.15)


def test_a_gap_that_is_too_narrow_is_closed():
    room = shapely.box(-4.0, -4.0, 4.0, 4.0)
    wall = shapely.box(-8.0, -0.5, -0.229, 0.5).union(shapely.box(0.229, -0.5, 8.0, 0.5))
    area = room.difference(wall)
    ground = ground_of([area, area])
    assert np.isinf(ways(ground, solve_field(ground, [0.0, 2.0]), [[0.0, -2.0]]).cost[0])


def test_an_edit_gives_what_a_new_ground_is():
    areas = scene(0)
    thing = shapely.box(4.3, 4.1, 5.2, 4.6)
    before = [outline_segments(area) for area in areas]
    after = [np.concatenate([each, outline_segments(thing)]) for each in before]
    old = build_ground(before, NEED)
    ways_before = old.ways.copy()
    edited = update_ground(old, after, NEED, thing.bounds)
    anew = build_ground(after, NEED)
    for name in ("far", "pins", "widest", "ways", "pure", "starts"):
        assert np.array_equal(getattr(edited, name), getattr(anew, name)), name
    assert np.array_equal(old.ways, ways_before)
    assert not np.array_equal(edited.ways, old.ways)
    back = update_ground(edited, before, NEED, thing.bounds)
    for name in ("far", "pins", "widest", "ways", "pure", "starts"):
        assert np.array_equal(getattr(back, name), getattr(old, name)), name


def test_a_place_without_walls_is_open():
    ground = build_ground([np.empty((0, 4)), np.empty((0, 4))], NEED, bounds=(0.0, 0.0, 5.0, 5.0))
    told = ways(ground, solve_field(ground, [4.0, 4.0]), [[1.0, 0.0], [4.0, 4.0]])
    assert told.length == pytest.approx([5.0, 0.0], abs=1e-5)


def test_arguments():
    with pytest.raises(GeometryError, match="without walls"):
        build_ground([np.empty((0, 4)), np.empty((0, 4))], NEED)
    with pytest.raises(GeometryError, match="layers"):
        build_ground([np.empty((0, 4))], NEED, bounds=(0.0, 0.0, 1.0, 1.0))
    with pytest.raises(GeometryError, match="finite"):
        build_ground([[[0.0, 0.0, np.nan, 1.0]], []], NEED)


def test_three_layers_are_all_asked():
    room = shapely.box(0.0, 0.0, 8.0, 6.0)
    bench = shapely.box(1.0, 1.0, 3.0, 2.0)
    shelf = shapely.box(4.0, 1.0, 5.0, 4.0)
    lamp = shapely.box(6.0, 3.0, 7.0, 4.0)
    areas = [room.difference(shapely.union_all([bench, shelf, lamp])), room.difference(shelf), room.difference(lamp)]
    radii = np.array([[0.23, 0.2, 0.15], [0.23, 0.3, 0.15], [0.23, 0.35, 0.4]])
    need = replace(NEED, radii=radii, bodies=radii - 0.05)
    ground = build_ground([outline_segments(area) for area in areas], need)
    places = np.random.default_rng(3).uniform([0.0, 0.0], [8.0, 6.0], (2000, 2))
    found = np.empty(len(places), np.int64)
    labels_at(ground, places, found)
    assert (found >= guidance_reference.widest(areas, radii + 1e-5, places)).all()
    assert (found <= guidance_reference.widest(areas, radii - 1e-5, places)).all()


@pytest.mark.parametrize("seed", [0, 1])
def test_margins_are_the_least_over_all_walls_however_deep_in_them(seed):
    areas = scene(seed)
    ground = ground_of(areas)
    places = np.random.default_rng(seed).uniform(0.0, 10.0, (2000, 2))
    points = shapely.points(places)
    found = np.empty(len(places))
    for wide in range(len(NEED.costs)):
        margins_of(ground, places, wide, found)
        walls = np.stack([shapely.distance(points, area.boundary) for area in areas], axis=1)
        twin = np.minimum((walls - NEED.radii[wide]).min(axis=1), SPARE)
        np.testing.assert_allclose(found, twin, atol=1e-5)
        assert (twin < -0.1).any()


def test_a_margin_does_not_depend_on_the_order_of_the_walls():
    # At a wall of the legs, 0.18 m from one of the other layer.
    areas, radii = [shapely.box(0.0, 0.0, 8.0, 8.0), shapely.box(-0.18, -4.0, 12.0, 12.0)], [0.31, 0.12]
    for first in 0, 1:
        order = [first, 1 - first]
        need = Requirements.of([behavior("wide", *(radii[k] for k in order), 1.0)], 2, TRACKING_MARGIN)
        ground = build_ground([outline_segments(areas[k]) for k in order], need)
        found = np.empty(1)
        margins_of(ground, np.array([[0.0, 4.0]]), 0, found)
        assert found[0] == pytest.approx(-0.31 - TRACKING_MARGIN, abs=1e-5)
