"""What a place lets bodies do, made once for a place and a set of behaviors and shared by all fields."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from crowdsim.errors import GeometryError
from crowdsim.planning.labels.labelling_kernels import SWITCH_COST
from crowdsim.planning.query.requirements import Requirements
from crowdsim.steering.guidance.ground_kernels import (
    BOX,
    CORNER,
    SPARE,
    bound_distances,
    list_segments,
)
from crowdsim.steering.guidance.pin_kernels import mend_pins, set_pins, set_ways

Frame = tuple[float, float, int, int]

EDGE = 2 * BOX
"""Free boxes around the walls of a place [m]."""

_ROUNDING = 1e-6
"""Share by which a clearance may be too small and still count: paths touch corners at exactly theirs."""


class Crowding(NamedTuple):
    """By how much the crowd makes a meter dearer in cells of a grid, as kernels take it."""

    load: NDArray[np.float32]
    """float32[rows, columns], 1 for not at all."""
    quiet: NDArray[np.uint8]
    """uint8[rows, columns]: cells to the next one that is dearer, in the maximum norm."""
    left: float
    bottom: float
    cell: float
    """Side of a cell [m]."""
    crowded: bool
    """Whether anything counts at all."""


NOBODY = Crowding(np.ones((1, 1), np.float32), np.ones((1, 1), np.uint8), 0.0, 0.0, 0.5, False)
"""An empty place."""


class Ground(NamedTuple):
    """Boxes of a place, row by row, as kernels take them; see :mod:`crowdsim.steering.guidance.ground_kernels`.

    n behaviors, narrowest first; m classes of walls, by the layers that they stand in.
    """

    segments: NDArray[np.float64]
    """float64[k, 4]: both ends of the walls of all layers, each once [m]."""
    layers: NDArray[np.int64]
    """int64[k]: the class of each."""
    radii: NDArray[np.float64]
    """float64[n, m]: clearance that a behavior needs of a class [m]."""
    costs: NDArray[np.float64]
    """float64[n]: cost of a meter."""
    change: float
    """Cost of a change of behavior."""
    reach: float
    """Largest of the clearances [m]."""
    least: float
    """Smallest of them [m]."""
    left: float
    bottom: float
    columns: int
    rows: int
    starts: NDArray[np.int32]
    """int32[boxes + 1]: where the list of a box begins."""
    lists: NDArray[np.int32]
    """Segments near the boxes."""
    far: NDArray[np.uint8]
    """uint8[rows, columns]: lower bound of the distance from a center to the nearest wall."""
    pins: NDArray[np.int8]
    """int8[boxes, 2]: from the center of a box to its pin."""
    widest: NDArray[np.int8]
    """int8[boxes]: widest behavior that fits at the pin, -1 for none."""
    ways: NDArray[np.uint8]
    """uint8[boxes]: bits of the eight directions in which something fits all along the line to the next pin."""
    pure: NDArray[np.uint8]
    """uint8[boxes]: bits of those in which the widest behavior does."""

    @property
    def frame(self) -> Frame:
        """Left, bottom [m], columns and rows."""
        return self.left, self.bottom, self.columns, self.rows


def build_ground(
    segments: Sequence[Any],
    need: Requirements,
    *,
    bounds: tuple[float, float, float, float] | None = None,
    wider: float = 0.0,
) -> Ground:
    """Ground of a place with these walls.

    Parameters
    ----------
    segments: for each layer, the legs' first, float64[k, 4], both ends of its walls [m].
    need: what the behaviors ask for on these layers.
    bounds: x and y of the lower left and upper right corner of what is looked at [m]; that of the walls if None.
    wider: by how much the bodies of this width class need more clearance than the behaviors' [m].

    Raises
    ------
    GeometryError: if there are not as many layers as behaviors were measured on, or neither walls nor bounds.
    """
    every, layers, radii = _merged(segments, need, wider)
    frame = _frame_of(every, bounds)
    reach = float(need.radii.max() + wider)
    starts, lists, far = _near(every, reach, frame)
    boxes = frame[2] * frame[3]
    ground = Ground(
        every,
        layers,
        radii,
        need.costs.astype(np.float64),
        SWITCH_COST * float(need.costs[-1]),
        reach,
        float(need.radii.min() + wider),
        *frame,
        starts,
        lists,
        far,
        np.zeros((boxes, 2), np.int8),
        np.zeros(boxes, np.int8),
        np.zeros(boxes, np.uint8),
        np.zeros(boxes, np.uint8),
    )
    everywhere = (0, frame[3], 0, frame[2])
    set_pins(ground, *everywhere)
    mend_pins(ground, NOBODY, ground.pins.copy(), ground.widest.copy(), *everywhere)
    set_ways(ground, NOBODY, *everywhere)
    return ground


def update_ground(
    ground: Ground,
    segments: Sequence[Any],
    need: Requirements,
    window: tuple[float, float, float, float],
    *,
    wider: float = 0.0,
) -> Ground:
    """Ground of a place whose walls changed within a window (x and y of its corners): as build_ground makes it.

    The old one stays as it is. Fields of the old one do not hold for the new one.
    """
    every, layers, radii = _merged(segments, need, wider)
    starts, lists, far = _near(every, ground.reach, ground.frame)
    changed = ground._replace(
        segments=every,
        layers=layers,
        radii=radii,
        starts=starts,
        lists=lists,
        far=far,
        pins=ground.pins.copy(),
        widest=ground.widest.copy(),
        ways=ground.ways.copy(),
        pure=ground.pure.copy(),
    )
    # Pins change as far as a wall tells what fits, and where lines to such pins, or past such walls, change ways.
    raw = changed._replace(pins=ground.pins.copy(), widest=ground.widest.copy())
    set_pins(raw, *_boxes_within(ground, window, ground.reach + 8.0 * BOX))
    mend_pins(changed, NOBODY, raw.pins, raw.widest, *_boxes_within(ground, window, ground.reach + 6.0 * BOX))
    set_ways(changed, NOBODY, *_boxes_within(ground, window, ground.reach + 8.0 * BOX))
    return changed


def _boxes_within(
    ground: Ground, window: tuple[float, float, float, float], margin: float
) -> tuple[int, int, int, int]:
    """First and last row and column (exclusive) of the boxes within ``margin`` of a window."""
    return (
        max(math.floor((window[1] - margin - ground.bottom) / BOX), 0),
        min(math.ceil((window[3] + margin - ground.bottom) / BOX), ground.rows),
        max(math.floor((window[0] - margin - ground.left) / BOX), 0),
        min(math.ceil((window[2] + margin - ground.left) / BOX), ground.columns),
    )


def _merged(
    segments: Sequence[Any], need: Requirements, wider: float
) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.float64]]:
    """Each wall once, though it stands in several layers, with the class of layers that it stands in.

    Returns walls (k, 4), their classes (k,), and the clearances (n, classes): the largest of the layers of a class.
    """
    if len(segments) != need.radii.shape[1]:
        raise GeometryError(f"walls of {len(segments)} layers do not go with behaviors of {need.radii.shape[1]}")
    walls = [np.ascontiguousarray(each, np.float64).reshape(-1, 4) for each in segments]
    radii = (need.radii + wider) * (1.0 - _ROUNDING)
    every = np.concatenate(walls)
    layers = np.repeat(np.arange(len(walls)), [len(each) for each in walls])
    swap = (every[:, 0] > every[:, 2]) | ((every[:, 0] == every[:, 2]) & (every[:, 1] > every[:, 3]))
    every = np.where(swap[:, None], every[:, [2, 3, 0, 1]], every)
    found, number = np.unique(every, axis=0, return_inverse=True)
    stands = np.zeros((len(found), len(walls)), np.bool_)
    stands[number.ravel(), layers] = True
    kinds, kind = np.unique(stands, axis=0, return_inverse=True)
    needed = np.zeros((len(radii), max(len(kinds), 1)))
    for column, each in enumerate(kinds):
        needed[:, column] = radii[:, each].max(axis=1)
    if not len(kinds):
        needed[:, 0] = radii.max(axis=1)
    return np.ascontiguousarray(found), kind.ravel().astype(np.int64), needed


def _frame_of(segments: NDArray[np.float64], bounds: tuple[float, float, float, float] | None) -> Frame:
    """The boxes that hold ``bounds``, or the walls, on one lattice for all places."""
    if bounds is None:
        if not len(segments):
            raise GeometryError("a place without walls needs bounds")
        corners = segments.reshape(-1, 2)
        low, high = corners.min(axis=0).tolist(), corners.max(axis=0).tolist()
    else:
        low, high = list(bounds[:2]), list(bounds[2:])
    if not all(math.isfinite(each) for each in low + high):
        raise GeometryError("walls and bounds need finite coordinates")
    first = [math.floor((each - EDGE) / BOX) for each in low]
    last = [math.ceil((each + EDGE) / BOX) for each in high]
    return first[0] * BOX, first[1] * BOX, last[0] - first[0], last[1] - first[1]


def _near(
    segments: NDArray[np.float64], reach: float, frame: Frame
) -> tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.uint8]]:
    """Lists of segments near boxes, and lower bounds of distances."""
    listed = reach + CORNER + SPARE
    starts = np.zeros(frame[2] * frame[3] + 1, np.int32)
    count = list_segments(segments, listed, frame, starts, np.zeros(0, np.int32))
    lists = np.zeros(count, np.int32)
    if count:
        list_segments(segments, listed, frame, starts, lists)
    far = np.zeros((frame[3], frame[2]), np.uint8)
    bound_distances(segments, starts, lists, listed, frame, far)
    return starts, lists, far
