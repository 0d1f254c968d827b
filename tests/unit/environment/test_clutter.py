"""Random obstacles: as dense as asked for, apart from one another, and never between a start and its goal."""

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from crowdsim.environment.clutter import draw_clutter, open_ways
from crowdsim.environment.solids import Solid
from crowdsim.errors import GeometryError

FLOOR = shapely.box(0.0, 0.0, 12.0, 8.0)
SIZES = (0.3, 1.2)


def draw(density: float, seed: int = 0, region: shapely.Polygon = FLOOR):
    return draw_clutter("clutter", region, density, SIZES, np.random.default_rng(seed))


def joined(solids, free, regions, radius) -> bool:
    """Whether all places of ``regions`` where the disc fits lie in one room, by a plain buffer of everything."""
    room = free.difference(shapely.union_all([solid.footprint for solid in solids])).buffer(-radius)
    return sum(any(part.intersects(region) for region in regions) for part in shapely.get_parts(room)) <= 1


@settings(deadline=None, max_examples=30)
@given(density=st.floats(0.01, 0.3), seed=st.integers(0, 10_000))
def test_outlines_cover_what_is_asked_for_apart_and_inside_of_the_region(density, seed):
    region = FLOOR.difference(shapely.Point(6.0, 4.0).buffer(1.5))
    outlines = [solid.footprint for solid in draw(density, seed, region)]
    covered = shapely.union_all(outlines).area
    assert covered == pytest.approx(sum(outline.area for outline in outlines))
    assert density * region.area <= covered <= density * region.area + SIZES[1] ** 2
    assert all(region.contains(outline) for outline in outlines)
    bounds = shapely.bounds(np.array(outlines, dtype=object))
    assert (bounds[:, 2:] - bounds[:, :2]).max() <= SIZES[1] * np.sqrt(2.0) + 0.01


def test_outlines_and_heights_vary():
    solids = draw(0.25)
    corners = {len(solid.footprint.exterior.coords) - 1 for solid in solids}
    assert {4, 6} < corners
    assert max(corners) > 12
    tops = np.array([solid.top for solid in solids])
    assert (tops < 0.65).any()
    assert ((tops > 0.8) & (tops < 1.1)).any()
    assert (tops > 1.5).any()


def test_the_same_seed_draws_the_same_and_another_seed_does_not():
    assert [s.footprint.wkt for s in draw(0.1, 3)] == [s.footprint.wkt for s in draw(0.1, 3)]
    assert draw(0.1, 3)[0].footprint.wkt != draw(0.1, 4)[0].footprint.wkt


def test_a_full_floor_is_refused_with_the_density_it_came_to():
    with pytest.raises(
        GeometryError, match=r"full at a density of 0\.[4-7]\d, but 0\.9 was requested; give a lower density"
    ):
        draw(0.9)


@settings(deadline=None, max_examples=60)
@given(density=st.floats(0.2, 0.4), seed=st.integers(0, 10_000))
def test_ways_are_opened_where_clutter_bars_them(density, seed):
    regions = [shapely.box(0.0, 0.0, 1.0, 8.0), shapely.box(11.0, 0.0, 12.0, 8.0)]
    solids = draw(density, seed, shapely.box(1.5, 0.0, 10.5, 8.0))
    kept = open_ways(solids, FLOOR, [regions], 0.25)
    assert joined(kept, FLOOR, regions, 0.25)
    assert set(kept) <= set(solids)
    if joined(solids, FLOOR, regions, 0.25):
        assert kept == solids


def fence(gap: float) -> tuple[Solid, ...]:
    """Boxes in a column across the floor, ``gap`` meters between them, and one that stands apart."""
    step = 1.0 + gap
    boxes = [shapely.box(6.0, y, 7.0, y + 1.0) for y in np.arange(-0.2, 8.0, step)]
    return tuple(Solid(f"box {k}", box, 0.0, 1.0) for k, box in enumerate([*boxes, shapely.box(2.0, 2.0, 3.0, 3.0)]))


@pytest.mark.parametrize("gap", [0.0, 0.3, 0.49])
def test_no_more_is_removed_than_it_takes(gap):
    regions = [shapely.box(0.0, 0.0, 1.0, 8.0), shapely.box(11.0, 0.0, 12.0, 8.0)]
    kept = open_ways(fence(gap), FLOOR, [regions], 0.25)
    assert len(kept) == len(fence(gap)) - 1
    assert kept[-1].footprint.bounds == (2.0, 2.0, 3.0, 3.0)


def test_two_rows_too_close_for_a_room_between_them_are_opened_both():
    rows = [shapely.box(x, y, x + 0.5, y + 1.0) for x in (5.0, 5.6) for y in np.arange(-0.2, 8.0, 1.3)]
    solids = tuple(Solid(f"box {k}", box, 0.0, 1.0) for k, box in enumerate(rows))
    regions = [shapely.box(0.0, 0.0, 1.0, 8.0), shapely.box(11.0, 0.0, 12.0, 8.0)]
    kept = open_ways(solids, FLOOR, [regions], 0.25)
    assert joined(kept, FLOOR, regions, 0.25)
    assert len(solids) - len(kept) == 2


def test_wide_gaps_keep_everything():
    regions = [shapely.box(0.0, 0.0, 1.0, 8.0), shapely.box(11.0, 0.0, 12.0, 8.0)]
    assert len(open_ways(fence(0.52), FLOOR, [regions], 0.25)) == len(fence(0.52))


def test_what_fixed_walls_part_is_refused():
    regions = [shapely.box(0.0, 0.0, 1.0, 8.0), shapely.box(11.0, 0.0, 12.0, 8.0)]
    free = FLOOR.difference(shapely.box(5.0, 0.0, 5.2, 8.0))
    with pytest.raises(GeometryError, match=r"no way of 0\.5 m leads to .* even without the clutter"):
        open_ways(draw(0.1), free, [regions], 0.25)
