"""Solids of triangles: what is filled, what is a strip, and what counts in a band."""

import numpy as np
import pytest
import shapely
import trimesh

from crowdsim.environment import footprints
from crowdsim.environment.footprints import STRIP
from crowdsim.environment.layers import LEGS, TORSO
from crowdsim.environment.mesh_solid import MeshSolid, footprints_between
from crowdsim.errors import GeometryError
from tests.support.meshes import box, inverted, joined, sheet, solid

WARDROBE = box((0.0, 0.0, 0.0), (1.2, 0.6, 2.2))
ROOM = box((0.0, 0.0, 0.0), (5.0, 4.0, 2.6))


def legs(mesh):
    return solid(mesh).footprint_in(LEGS.low, LEGS.high)


def test_a_closed_box_is_solid_inside_with_four_corners():
    found = legs(WARDROBE)
    assert found.equals(shapely.box(0.0, 0.0, 1.2, 0.6))
    assert shapely.get_num_coordinates(found) == 5


def test_heights_and_footprint_are_those_of_all_triangles():
    table = solid(joined(box((0, 0, 0.7), (2, 1, 0.75)), box((0.9, 0.4, 0.0), (1.1, 0.6, 0.7))))
    assert (table.bottom, table.top) == (0.0, 0.75)
    assert table.footprint.equals(shapely.box(0, 0, 2, 1))
    assert table.lifted(1.5).bottom == pytest.approx(1.5)


def test_a_part_counts_in_a_band_with_what_is_strictly_inside():
    table = solid(joined(box((0, 0, 0.7), (2, 1, 0.8)), box((0.9, 0.4, 0.0), (1.1, 0.6, 0.7))))
    assert table.footprint_in(0.1, 0.7).equals(shapely.box(0.9, 0.4, 1.1, 0.6))  # what a crawler meets
    assert table.footprint_in(0.1, 0.71).equals(shapely.box(0, 0, 2, 1))
    assert table.footprint_in(0.8, 1.5).is_empty
    assert not table.overlaps(0.8, 1.5)
    assert table.overlaps(0.79, 1.5)


def test_nothing_is_in_a_gap_between_two_pieces_of_one_part():
    shelf = solid(joined(box((0, 0, 0.0), (1, 1, 0.1)), box((0, 0, 2.0), (1, 1, 2.1))))
    assert not shelf.overlaps(0.1, 2.0)
    assert shelf.footprint_in(0.1, 2.0).is_empty


def test_a_horizontal_sheet_counts_inside_a_band_and_not_at_its_ends():
    sail = MeshSolid("sail", np.array([(0, 0, 1.0), (1, 0, 1.0), (0, 1, 1.0)]), np.array([(0, 1, 2)]))
    assert sail.footprint_in(0.5, 1.5).area == pytest.approx(0.5)
    assert sail.footprint_in(1.0, 1.5).is_empty
    assert sail.footprint_in(0.5, 1.0).is_empty


def test_an_upright_sheet_is_a_strip():
    found = legs(sheet([(0, 0), (3, 0)], 0.0, 2.5))
    assert found.area == pytest.approx(3.0 * STRIP, rel=0.01)
    assert found.covers(shapely.LineString([(0, 0), (3, 0)]))


def test_an_open_section_path_never_vanishes():
    found = legs(sheet([(0, 0), (3, 0), (3, 2), (0, 2)], 0.0, 2.5))
    line = shapely.LineString([(0, 0), (3, 0), (3, 2), (0, 2)])
    assert found.covers(line)
    assert found.area == pytest.approx(line.length * STRIP, rel=0.02)


def test_thick_walls_around_a_room_are_solid_and_the_room_is_free():
    walls = joined(ROOM, inverted(box((0.2, 0.2, 0.0), (4.8, 3.8, 2.6))))
    assert legs(walls).area == pytest.approx(5.0 * 4.0 - 4.6 * 3.6, abs=1e-3)


def test_walls_with_one_side_missing_have_strips_and_leave_the_room_free():
    inner = inverted(sheet([(0.2, 0.2), (4.8, 0.2), (4.8, 3.8), (0.2, 3.8)], 0.0, 2.6))  # no fourth side
    found = legs(joined(ROOM, inner))
    assert not found.intersects(shapely.box(1.0, 1.0, 4.0, 3.0))
    assert found.covers(shapely.LineString([(0.2, 0.2), (4.8, 0.2)]))


def test_a_room_modelled_from_inside_is_free_and_a_wardrobe_turned_inside_out_is_solid():
    assert legs(inverted(ROOM)).area == pytest.approx(18.0 * STRIP, rel=0.02)
    assert legs(inverted(WARDROBE)).equals(shapely.box(0.0, 0.0, 1.2, 0.6))


@pytest.mark.parametrize("seed", range(5))
def test_furniture_whose_faces_are_doubled_or_turned_at_random_is_solid(seed):
    doubled = joined(WARDROBE, inverted(WARDROBE))
    vertices, triangles = WARDROBE
    turned = np.random.default_rng(seed).random(len(triangles)) < 0.5
    mixed = vertices, np.where(turned[:, None], triangles[:, ::-1], triangles)
    for mesh in (doubled, mixed):
        assert legs(mesh).equals(shapely.box(0.0, 0.0, 1.2, 0.6))


def test_a_wardrobe_without_top_and_bottom_is_solid():
    tube = sheet([(0, 0), (1.2, 0), (1.2, 0.6), (0, 0.6), (0, 0)], 0.0, 1.0)
    assert legs(tube).area == pytest.approx(0.72, abs=1e-3)


def test_the_inside_of_a_bucket_is_filled_and_a_courtyard_is_not():
    def hollow(side):
        return joined(box((0, 0, 0), (side + 0.1, side + 0.1, 3)), inverted(box((0.05, 0.05, 0.0), (side, side, 3))))

    assert legs(hollow(0.3)).area == pytest.approx(0.16)
    assert legs(hollow(3.0)).area == pytest.approx(3.1**2 - 2.95**2)


def test_a_slanted_beam_counts_where_it_is_in_the_band():
    low, high = np.array([(0, 0), (0.1, 0), (0.1, 0.1), (0, 0.1)]), np.array([(4, 0), (4.1, 0), (4.1, 0.1), (4, 0.1)])
    vertices, triangles = box((0, 0, 0), (1, 1, 4))
    vertices[:, :2] = np.concatenate([low, high])
    found = solid((vertices, triangles)).footprint_in(1.0, 2.0)
    assert (
        found.equals_exact(shapely.box(1.0, 0.0, 2.1, 0.1).normalize(), 1e-4)
        or found.symmetric_difference(shapely.box(1.0, 0.0, 2.1, 0.1)).area < 1e-4
    )


def test_a_plane_cuts_what_reaches_above_its_height():
    cupboard = solid(box((0, 0, 0.5), (1, 1, 1.5)))
    assert cupboard.section(1.0).equals(shapely.box(0, 0, 1, 1))
    assert cupboard.section(0.5).equals(shapely.box(0, 0, 1, 1))
    assert cupboard.section(1.5).is_empty
    assert cupboard.section(0.4).is_empty
    assert solid(sheet([(0, 0), (3, 0)], 0, 2)).section(1.0).area == pytest.approx(3.0 * STRIP, rel=0.01)


def test_degenerate_triangles_are_wires_or_nothing():
    wire = MeshSolid("wire", np.array([(0, 0, 1.0), (1, 0, 1.0), (2, 0, 1.0)]), np.array([(0, 1, 2), (0, 0, 1)]))
    assert legs((wire.vertices, wire.triangles)).covers(shapely.LineString([(0, 0), (2, 0)]))
    pole = MeshSolid("pole", np.array([(0, 0, 0.0), (0, 0, 1.0), (0, 0, 2.0)]), np.array([(0, 1, 2)]))
    assert pole.footprint_in(0.1, 2.0).covers(shapely.Point(0, 0))


def test_many_triangles_give_what_few_do():
    x, y = (grid.ravel() for grid in np.meshgrid(np.linspace(0, 2, 41), np.linspace(0, 1, 21)))
    vertices = np.column_stack([x, y, 0.5 + 0.2 * np.sin(3 * x)])
    first = (np.arange(20)[:, None] * 41 + np.arange(40)).ravel()
    triangles = np.concatenate(
        [np.column_stack([first, first + 1, first + 42]), np.column_stack([first, first + 42, first + 41])]
    )
    found = MeshSolid("hills", vertices, triangles).footprint_in(0.1, 2.0)
    assert found.equals(shapely.box(0, 0, 2, 1)) or found.symmetric_difference(shapely.box(0, 0, 2, 1)).area < 1e-5


def test_meshes_far_from_the_origin_keep_their_shape():
    vertices, triangles = WARDROBE
    found = legs((vertices + np.array([5e5, -3e5, 0.0]), triangles))
    assert found.area == pytest.approx(0.72, abs=1e-4)


@pytest.mark.parametrize(
    ("vertices", "triangles", "word"),
    [
        (np.zeros((3, 3)), np.empty((0, 3), np.int64), "no triangles"),
        (np.zeros((3, 2)), np.array([(0, 1, 2)]), r"\(n, 3\)"),
        (np.zeros((3, 3)), np.array([(0, 1, 3)]), "not among its vertices"),
        (np.zeros((3, 3)), np.array([(0, 1, -1)]), "not among its vertices"),
        (np.array([(0, 0, 0), (1, 0, 0), (0, np.nan, 1)]), np.array([(0, 1, 2)]), "finite"),
        (np.array([(0, 0, 0), (1, 0, 0), (0, 1e308, 1)]), np.array([(0, 1, 2)]), "finite"),
        (np.array([(0, 0, 0), (1, 0, 0), (0, 1e9, 1)]), np.array([(0, 1, 2)]), "from the origin"),
    ],
)
def test_bad_meshes_name_the_part(vertices, triangles, word):
    with pytest.raises(GeometryError, match=f"'sofa'.*{word}"):
        MeshSolid("sofa", vertices, triangles)


def test_a_bad_number_that_no_triangle_uses_does_not_matter():
    vertices = np.array([(0, 0, 1.0), (1, 0, 1.0), (0, 1, 1.0), (np.nan, 0, 0)])
    assert MeshSolid("a", vertices, np.array([(0, 1, 2)])).footprint_in(0.1, 2.0).area == pytest.approx(0.5)


def test_torso_and_legs_of_a_chair():
    chair = solid(joined(box((0, 0, 0.4), (0.5, 0.5, 0.45)), box((0, 0.45, 0.45), (0.5, 0.5, 0.95))))
    assert chair.footprint_in(TORSO.low, TORSO.high).equals(shapely.box(0, 0.45, 0.5, 0.5))
    assert chair.footprint_in(LEGS.low, LEGS.high).equals(shapely.box(0, 0, 0.5, 0.5))


def test_footprints_of_many_are_those_of_each(monkeypatch):
    """Also across blocks, in several threads, with parts beside the band and without triangles in it."""
    monkeypatch.setattr(footprints, "_TRIANGLES_AT_ONCE", 30)
    rng = np.random.default_rng(3)
    solids = []
    for number in range(40):
        corners = rng.uniform(0.0, 2.0, (int(rng.integers(1, 25)), 3, 3)) + [number % 7, number // 7, 0.0]
        box = trimesh.creation.box((0.4, 0.3, rng.uniform(0.1, 2.5)))
        loose = MeshSolid(f"loose {number}", corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3))
        closed = MeshSolid(f"box {number}", box.vertices + [number % 7, number // 7, rng.uniform(0.0, 3.0)], box.faces)
        solids += [loose, closed]
    told = []
    together = footprints_between(solids, 0.65, 1.5, told.append)
    assert shapely.equals_exact(together, [solid.footprint_in(0.65, 1.5) for solid in solids]).all()
    assert shapely.is_empty(together).any()
    assert len(told) > 10
    assert told == sorted(told)
    assert told[-1] == sum(solid.bottom < 1.5 and solid.top > 0.65 for solid in solids)


def test_copies_of_a_solid_are_computed_once(monkeypatch):
    """Ten chairs moved along the floor, one lifted, one turned and one a millimeter broader; others between them."""
    rng = np.random.default_rng(8)
    vertices, triangles = joined(box((0, 0, 0), (0.5, 0.45, 0.8)), box((0, 0.45, 0.7), (0.5, 0.5, 0.95)))
    places = np.column_stack([rng.uniform(-50.0, 50.0, (10, 2)), np.zeros(10)])
    chairs = [solid((vertices + place, triangles)) for place in places]
    others = [
        solid((vertices + (0.0, 0.0, 0.01), triangles)),
        solid((vertices[:, [1, 0, 2]] * (-1, 1, 1), triangles)),
        solid((vertices * (1.002, 1.0, 1.0), triangles)),
    ]
    solids = [*chairs[:5], *others, *chairs[5:]]
    computed = []
    compute = footprints._block
    monkeypatch.setattr(
        footprints, "_block", lambda block, low, high: computed.extend(block) or compute(block, low, high)
    )
    together = footprints_between(solids, 0.65, 1.5)
    assert len(computed) == 1 + len(others)
    alone = np.array([each.footprint_in(0.65, 1.5) for each in solids])
    # Both are rounded to the same grid, one of them in another place.
    assert shapely.is_valid(together).all()
    assert shapely.hausdorff_distance(together, alone).max() < 3 * footprints.GRID
    assert shapely.equals_exact(together[[0, 5, 6, 7]], alone[[0, 5, 6, 7]]).all()
