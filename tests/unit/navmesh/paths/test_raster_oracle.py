"""Paths exist wherever a flood fill of a raster, which is right on its own, finds a way."""

import numpy as np
import pytest
from scipy import ndimage

from crowdsim.navmesh.navmesh import NavMesh
from tests.support.oracle_maps import MAPS, load_map

CELL = 0.02
"""Meters. Between the centers of two neighbors no place is more than half of this off one of them."""


@pytest.mark.parametrize("name", MAPS)
def test_a_path_is_found_wherever_a_flood_fill_finds_one(shared, name):
    world = load_map(shared, name)
    mesh = NavMesh(world.area)
    radius = world.radius
    x0, y0, x1, y1 = world.area.bounds
    x, y = np.arange(x0, x1, CELL), np.arange(y0, y1, CELL)
    wide = np.empty((len(y), len(x)), bool)
    for row, height in zip(wide, y, strict=True):
        # Half a cell more: between the centers of neighbors, the disc is free as well.
        row[:] = mesh.clearances(np.column_stack([x, np.full(len(x), height)]), 2.0 * radius) >= radius + 0.5 * CELL
    labels, _ = ndimage.label(wide)

    def cell_of(points):
        return np.rint((points[:, ::-1] - (y0, x0)) / CELL).astype(int).T

    starts, goals = cell_of(world.starts), cell_of(world.goals)
    together = (labels[*starts] == labels[*goals]) & (labels[*starts] > 0)
    assert together.sum() > 300
    starts = np.column_stack([x[starts[1]], y[starts[0]]])[together]
    goals = np.column_stack([x[goals[1]], y[goals[0]]])[together]
    numbers = mesh.components(np.concatenate([starts, goals]), radius)
    assert (numbers[: len(starts)] == numbers[len(starts) :]).all()
    for optimality in ("fast", "best"):
        assert (mesh.find_paths(starts, goals, radius, optimality).status == 0).all()
