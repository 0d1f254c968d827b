"""A string beside single corners, where it is plain which of them it winds around."""

import numpy as np
import pytest

from crowdsim.jit import kernel
from crowdsim.navmesh.paths.tangent_kernels import STRING_NODE
from crowdsim.planning.roadmap import funnel_kernels, gate_kernels
from crowdsim.planning.roadmap.gate_kernels import GATE

REACH = 0.3


@kernel
def keep_off(nodes, size, corners, filled, low, high):
    return funnel_kernels.keep_off(nodes, size, corners, filled, low, high)


@kernel
def pinned_path(nodes, size, corners, filled, around, gates, found, taut):
    return gate_kernels.pinned_path(nodes, size, corners, filled, around, gates, found, taut)


def string_beside(*corners: tuple[float, float, float]) -> np.ndarray:
    """Nodes of the string from (0, 0) to (4, 0) past corners x, y, side."""
    nodes = np.zeros(20, STRING_NODE)
    nodes["x"][1] = 4.0
    nodes["vertex"][:2] = -1
    rows = np.zeros(len(corners), funnel_kernels.CORNER)
    for row, (x, y, side) in enumerate(corners):
        rows[row] = (x, y, side, REACH, REACH, REACH, row, 0, 0)
    size = keep_off(nodes, np.int64(2), rows, len(rows), 0, 0)
    return nodes[:size]


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_string_winds_around_a_corner_that_is_too_close(side):
    nodes = string_beside((2.0, 0.1 * side, side))
    assert nodes["vertex"].tolist() == [-1, 0, -1]
    assert nodes["q"].tolist() == [0.0, REACH * side, 0.0]


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_string_passes_straight_by_corners_that_are_far(side):
    assert len(string_beside((1.0, 0.31 * side, side), (3.0, 0.31 * side, side))) == 2


def test_corners_come_in_the_order_in_which_they_are_passed():
    nodes = string_beside((3.0, 0.1, 1.0), (1.0, -0.1, -1.0))
    assert nodes["vertex"].tolist() == [-1, 1, 0, -1]


@pytest.mark.parametrize(("room", "vertices"), [(20, [-1, 4, -1]), (6, None)])
def test_a_pinned_path_leaves_no_corner_out(room, vertices):
    """The last of five corners is the only one that it winds around, and has no room beside the other four."""
    xy = [(0.5, 1.0), (1.0, 1.0), (1.5, 1.0), (2.0, 1.0), (2.5, -1.0)]
    corners = np.zeros(len(xy), funnel_kernels.CORNER)
    nodes, taut = np.zeros(len(xy) + 2, STRING_NODE), np.zeros(room, STRING_NODE)
    nodes["x"][-1] = 4.0
    nodes["vertex"][[0, -1]] = -1
    for row, (x, y) in enumerate(xy):
        corners[row] = (x, y, 1.0, REACH, REACH, REACH, row, 0, 0)
        nodes["vertex"][row + 1] = row
    around, gates = np.full((len(xy), 1), REACH), np.zeros(1, GATE)
    size = pinned_path(nodes, len(nodes), corners, len(corners), around, gates, 0, taut)
    assert (size < 0) if vertices is None else (taut["vertex"][:size].tolist() == vertices)
