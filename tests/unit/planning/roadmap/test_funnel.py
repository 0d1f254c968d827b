"""A string beside single corners, where it is plain which of them it winds around."""

import numpy as np
import pytest

from crowdsim.jit import kernel
from crowdsim.navmesh.paths.tangent_kernels import STRING_NODE
from crowdsim.planning.roadmap import funnel_kernels

REACH = 0.3


@kernel
def keep_off(nodes, size, corners, filled, low, high):
    return funnel_kernels.keep_off(nodes, size, corners, filled, low, high)


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
