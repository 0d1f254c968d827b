"""What is remembered of checks of pieces, beside a dictionary."""

import math

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from crowdsim.jit import kernel
from crowdsim.navmesh.mesh.mesh_arrays import VERTEX
from crowdsim.navmesh.paths.checked_kernels import CHECK, Checked, add_dot, drop_dot, recall, remember

LEAST = 0.2


@kernel
def _remember(checked, vertices, piece, distance, vertex):
    remember(checked, vertices, piece[0], piece[1], piece[2], piece[3], LEAST, distance, vertex)


@kernel
def _recall(checked, vertices, piece):
    return recall(checked, vertices, piece[0], piece[1], piece[2], piece[3], LEAST)


@kernel
def _dot(checked, x, y, comes):
    if comes:
        return add_dot(checked, x, y)
    drop_dot(checked)
    return True


def _empty(rows, dots=4):
    return Checked(np.zeros(rows, CHECK), np.array([1, 0, 0]), np.empty((dots, 2)))


def _vertices(count):
    vertices = np.zeros(count, VERTEX)
    vertices["x"] = np.arange(count)
    return vertices


@settings(max_examples=60, deadline=None, derandomize=True)
@given(
    st.lists(st.tuples(st.tuples(*[st.integers(0, 2)] * 4), st.sampled_from([-1, 0, 1]), st.booleans()), max_size=60),
    st.sampled_from([4, 16, 256]),
)
def test_only_what_was_found_is_recalled(steps, rows):
    checked, vertices, known = _empty(rows), _vertices(2), {}
    for corners, vertex, writes in steps:
        piece = np.array(corners, float)
        if writes:
            distance, vertex = known.setdefault(corners, (math.inf if vertex < 0 else 0.1, vertex))
            _remember(checked, vertices, piece, distance, np.int64(vertex))
        was, *found = _recall(checked, vertices, piece)
        if was:
            assert tuple(found) == known[corners]
        else:
            assert corners not in known or checked.numbers[1] * 4 >= 3 * rows  # there is no room for it
    assert checked.numbers[1] <= rows


def test_nothing_is_recalled_or_remembered_next_to_a_dot():
    checked, vertices = _empty(64), _vertices(1)
    near, far = np.array([0.0, 0.0, 1.0, 0.0]), np.array([0.0, 1.0, 1.0, 1.0])
    _remember(checked, vertices, near, math.inf, np.int64(-1))
    assert _dot(checked, 0.5, 0.2, True)
    assert not _recall(checked, vertices, near)[0]
    _remember(checked, vertices, far, math.inf, np.int64(-1))
    assert _recall(checked, vertices, far)[0]
    other = np.array([0.0, 0.0, 1.0, 0.1])
    _remember(checked, vertices, other, math.inf, np.int64(-1))
    _dot(checked, 0.0, 0.0, False)
    assert _recall(checked, vertices, near)[0]
    assert not _recall(checked, vertices, other)[0]


def test_there_is_room_for_so_many_dots():
    checked = _empty(4, dots=2)
    assert [bool(_dot(checked, 0.0, 0.0, True)) for _ in range(3)] == [True, True, False]


def test_a_vertex_that_is_gone_or_elsewhere_is_not_recalled():
    checked, vertices, piece = _empty(64), _vertices(2), np.array([0.0, 0.0, 1.0, 0.0])
    _remember(checked, vertices, piece, 0.1, np.int64(1))
    assert _recall(checked, vertices, piece) == (True, 0.1, 1)
    vertices["vhe"][1] = -1
    assert not _recall(checked, vertices, piece)[0]
    vertices["vhe"][1], vertices["x"][1] = 0, 7.0
    assert not _recall(checked, vertices, piece)[0]


def test_another_stamp_forgets_all():
    checked, vertices, piece = _empty(64), _vertices(1), np.array([0.0, 0.0, 1.0, 0.0])
    _remember(checked, vertices, piece, math.inf, np.int64(-1))
    checked.numbers[:] = 2, 0, 0
    assert not _recall(checked, vertices, piece)[0]
