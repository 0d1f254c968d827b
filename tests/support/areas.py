"""Areas for hypothesis whose obstacles touch, align, coincide and meet in T's: corners lie on a coarse grid."""

import shapely
from hypothesis import strategies as st


def boxes(first: int, last: int, most: int):
    """Return a strategy of boxes with integer sides up to ``most``, lower left corners from ``first`` to ``last``."""
    corner, side = st.integers(first, last), st.integers(1, most)
    return st.tuples(corner, corner, side, side).map(
        lambda box: shapely.box(box[0], box[1], box[0] + box[2], box[1] + box[3])
    )


def areas(size: int, most: int, obstacles: int):
    """Return a strategy of square rooms minus up to ``obstacles`` boxes with sides up to ``most``; may be empty."""
    return st.lists(boxes(0, size - 1, most), min_size=1, max_size=obstacles).map(
        lambda taken: shapely.box(0, 0, size, size).difference(shapely.union_all(taken))
    )
