"""Ground of a place: built once from walls and behaviors, and shared by the fields of all goals."""

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
"""Left and bottom edge of the boxes [m], columns and rows of boxes."""

EDGE = 2 * BOX
"""Width of the rim of free boxes around the walls of a place [m]."""

_ROUNDING = 1e-6
"""Share of a clearance by which a path may come too close, since paths touch corners at exactly the clearance."""


class Crowding(NamedTuple):
    """Factor of the crowd on the cost of a meter, in cells of a grid; kernels take it as it is."""

    load: NDArray[np.float32]
    """float32[rows, columns]: the factor, 1 without a crowd."""
    quiet: NDArray[np.uint8]
    """uint8[rows, columns]: number of cells to the next one with a factor above 1, in the maximum norm; 255 at most."""
    left: float
    """Left edge of the grid [m]."""
    bottom: float
    """Bottom edge of the grid [m]."""
    cell: float
    """Side of a cell [m]."""
    crowded: bool
    """True if any factor is above 1."""


NOBODY = Crowding(np.ones((1, 1), np.float32), np.ones((1, 1), np.uint8), 0.0, 0.0, 0.5, False)
"""No crowd: all factors are 1."""


class Ground(NamedTuple):
    """Boxes of a place, row by row, as kernels take them; see :mod:`crowdsim.steering.guidance.ground_kernels`.

    There are n behaviors, the narrowest first, and m classes of walls: walls that stand in the same layers are one
    class.
    """

    segments: NDArray[np.float64]
    """float64[k, 4]: both ends of the walls of all layers, each wall once [m]."""
    layers: NDArray[np.int64]
    """int64[k]: class of each wall."""
    radii: NDArray[np.float64]
    """float64[n, m]: clearance that a behavior needs from a class of walls [m]."""
    costs: NDArray[np.float64]
    """float64[n]: cost of a meter with each behavior."""
    change: float
    """Cost of a change of behavior, in the unit of costs: that of SWITCH_COST meters with the widest one."""
    reach: float
    """Largest clearance of all behaviors in ``prescribed``, so also in ``radii`` [m]."""
    least: float
    """Smallest clearance of all behaviors in ``radii`` [m]."""
    left: float
    """Left edge of the boxes [m]."""
    bottom: float
    """Bottom edge of the boxes [m]."""
    columns: int
    """Columns of boxes."""
    rows: int
    """Rows of boxes."""
    starts: NDArray[np.int32]
    """int32[boxes + 1]: index in ``lists`` at which each box begins."""
    lists: NDArray[np.int32]
    """int32[j]: numbers of the segments near each box."""
    far: NDArray[np.uint8]
    """uint8[rows, columns]: lower bound of the distance from a box's center to the nearest wall, in units of FAR_UNIT;
    255 also stands for more."""
    pins: NDArray[np.int8]
    """int8[boxes, 2]: offset of the pin from the center of the box, in units of PIN_UNIT."""
    widest: NDArray[np.int8]
    """int8[boxes]: widest behavior that fits at the pin, -1 for none."""
    ways: NDArray[np.uint8]
    """uint8[boxes]: bit k is set if some behavior fits at each point of the line to the next pin in direction k."""
    pure: NDArray[np.uint8]
    """uint8[boxes]: bit k is set if the widest behavior fits on all of that line."""
    prescribed: NDArray[np.float64]
    """float64[n, m]: clearance from which on a behavior is prescribed, at least that of ``radii`` [m]."""

    @property
    def frame(self) -> Frame:
        """Return left and bottom edge [m], columns and rows."""
        return self.left, self.bottom, self.columns, self.rows


def build_ground(
    segments: Sequence[Any],
    need: Requirements,
    *,
    bounds: tuple[float, float, float, float] | None = None,
    wider: float = 0.0,
    prescribed: NDArray[np.float64] | None = None,
) -> Ground:
    """Build the ground of a place with these walls.

    Parameters
    ----------
    segments : sequence of (k, 4) float64
        Both ends of the walls of each layer [m], the legs' layer first.
    need : Requirements
        Clearances of the behaviors on these layers, and their costs per meter.
    bounds : (float, float, float, float), optional
        Left, bottom, right and top of the place [m]; by default the extent of the walls.
    wider : float
        Additional clearance that the bodies of this width class need [m]; also added to ``prescribed``.
    prescribed : (n, layers) float64, optional
        Clearances from which on behaviors are prescribed to agents [m], none less than those of ``need``, with which
        ways are found; by default the same.

    Returns
    -------
    Ground

    Raises
    ------
    GeometryError
        If the number of layers is not that on which behaviors were measured, if there are neither walls nor bounds, or
        if coordinates are not finite.
    """
    every, layers, kinds = _merged(segments, need)
    asked = need.radii if prescribed is None else prescribed
    frame = _frame_of(every, bounds)
    reach = float(asked.max() + wider)
    starts, lists, far = _near(every, reach, frame)
    boxes = frame[2] * frame[3]
    ground = Ground(
        every,
        layers,
        _of_classes(need.radii, kinds, wider),
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
        _of_classes(asked, kinds, wider),
    )
    _set_everything(ground)
    return ground


def squeezed_ground(ground: Ground, clearance: float) -> Ground:
    """Return a ground on which the narrowest behavior needs no more than ``clearance`` [m], from walls of any class.

    The ``prescribed`` clearances of this behavior become the same. The ways on this ground lead through gaps and out of
    pockets for which no behavior is planned, but into which agents are pushed. Walls and boxes are shared with the
    ground given.
    """
    boxes = ground.columns * ground.rows
    radii, prescribed = ground.radii.copy(), ground.prescribed.copy()
    radii[0] = np.minimum(radii[0], clearance)
    prescribed[0] = radii[0]
    squeezed = ground._replace(
        radii=radii,
        prescribed=prescribed,
        least=min(ground.least, clearance),
        pins=np.zeros((boxes, 2), np.int8),
        widest=np.zeros(boxes, np.int8),
        ways=np.zeros(boxes, np.uint8),
        pure=np.zeros(boxes, np.uint8),
    )
    _set_everything(squeezed)
    return squeezed


def _set_everything(ground: Ground) -> None:
    """Set the pins of all boxes, the widest behavior at each, and the lines between them (``ways``, ``pure``)."""
    everywhere = (0, ground.rows, 0, ground.columns)
    set_pins(ground, *everywhere)
    mend_pins(ground, NOBODY, ground.pins.copy(), ground.widest.copy(), *everywhere)
    set_ways(ground, NOBODY, *everywhere)


def update_ground(
    ground: Ground,
    segments: Sequence[Any],
    need: Requirements,
    window: tuple[float, float, float, float],
    *,
    wider: float = 0.0,
    prescribed: NDArray[np.float64] | None = None,
) -> Ground:
    """Return the ground after walls changed within ``window`` (left, bottom, right, top) [m].

    ``segments`` are all walls after the change; other arguments as of :func:`build_ground`, and as the ground was built
    with. The result equals that of :func:`build_ground` on the same boxes. The old ground is not changed. Fields of the
    old ground do not hold for the new one.
    """
    every, layers, kinds = _merged(segments, need)
    starts, lists, far = _near(every, ground.reach, ground.frame)
    changed = ground._replace(
        segments=every,
        layers=layers,
        radii=_of_classes(need.radii, kinds, wider),
        starts=starts,
        lists=lists,
        far=far,
        pins=ground.pins.copy(),
        widest=ground.widest.copy(),
        ways=ground.ways.copy(),
        pure=ground.pure.copy(),
        prescribed=_of_classes(need.radii if prescribed is None else prescribed, kinds, wider),
    )
    # A pin can change within the reach of a changed wall. Mending a pin looks at the adjacent pins, and testing lines
    # looks at mended pins: so each stage is done anew on a window in which all that can differ lies. Outside of the
    # window of the first stage, ``raw`` holds mended pins of the old ground; the second stage, on a smaller window,
    # reads none of them.
    raw = changed._replace(pins=ground.pins.copy(), widest=ground.widest.copy())
    set_pins(raw, *_boxes_within(ground, window, ground.reach + 8.0 * BOX))
    mend_pins(changed, NOBODY, raw.pins, raw.widest, *_boxes_within(ground, window, ground.reach + 6.0 * BOX))
    set_ways(changed, NOBODY, *_boxes_within(ground, window, ground.reach + 8.0 * BOX))
    return changed


def _boxes_within(
    ground: Ground, window: tuple[float, float, float, float], margin: float
) -> tuple[int, int, int, int]:
    """Return first and last (exclusive) row, then column, of the boxes within ``margin`` [m] of a window.

    ``window`` is left, bottom, right and top [m].
    """
    return (
        max(math.floor((window[1] - margin - ground.bottom) / BOX), 0),
        min(math.ceil((window[3] + margin - ground.bottom) / BOX), ground.rows),
        max(math.floor((window[0] - margin - ground.left) / BOX), 0),
        min(math.ceil((window[2] + margin - ground.left) / BOX), ground.columns),
    )


def _merged(
    segments: Sequence[Any], need: Requirements
) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.bool_]]:
    """Merge the walls of all layers: each wall once, with the class of layers that it stands in.

    ``segments`` are those of :func:`build_ground`. Return walls (k, 4), both ends [m]; their classes (k,); and the
    layers of each class, (classes, layers) bool. If there are no walls, there is one class, of all layers. Raise
    GeometryError if the number of layers is not that of ``need``.
    """
    if len(segments) != need.radii.shape[1]:
        needed = need.radii.shape[1]
        raise GeometryError(f"walls are given for {len(segments)} layers, but behaviors were measured on {needed}")
    walls = [np.ascontiguousarray(each, np.float64).reshape(-1, 4) for each in segments]
    every = np.concatenate(walls)
    layers = np.repeat(np.arange(len(walls)), [len(each) for each in walls])
    # The same wall may run in either direction: sort its ends.
    swap = (every[:, 0] > every[:, 2]) | ((every[:, 0] == every[:, 2]) & (every[:, 1] > every[:, 3]))
    every = np.where(swap[:, None], every[:, [2, 3, 0, 1]], every)
    found, number = np.unique(every, axis=0, return_inverse=True)
    stands = np.zeros((len(found), len(walls)), np.bool_)
    stands[number.ravel(), layers] = True
    # A class is a set of layers.
    kinds, kind = np.unique(stands, axis=0, return_inverse=True)
    if not len(kinds):
        kinds = np.ones((1, len(walls)), np.bool_)
    return np.ascontiguousarray(found), kind.ravel().astype(np.int64), kinds


def _of_classes(clearances: NDArray[np.float64], kinds: NDArray[np.bool_], wider: float) -> NDArray[np.float64]:
    """Return clearances (n, classes) from those of layers (n, layers): the largest over the layers of a class [m].

    ``kinds`` (classes, layers) are the layers of each class. Clearances are raised by ``wider`` [m], then lowered by
    the share _ROUNDING.
    """
    radii = (clearances + wider) * (1.0 - _ROUNDING)
    return np.stack([radii[:, each].max(axis=1) for each in kinds], axis=1)


def _frame_of(segments: NDArray[np.float64], bounds: tuple[float, float, float, float] | None) -> Frame:
    """Return the frame of boxes that covers ``bounds``, or the walls if None, with a rim of EDGE meters.

    ``segments`` (k, 4) are the walls [m]. The edges of boxes are multiples of BOX in all places.
    """
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
    """Return the lists of segments near boxes (``starts``, ``lists``), and ``far``, as :class:`Ground` has them.

    ``segments`` (k, 4) are the walls [m], ``reach`` is the largest clearance of all behaviors [m].
    """
    # List all segments that are within a clearance, and a margin of up to SPARE, of any point of the box.
    listed = reach + CORNER + SPARE
    starts = np.zeros(frame[2] * frame[3] + 1, np.int32)
    count = list_segments(segments, listed, frame, starts, np.zeros(0, np.int32))
    lists = np.zeros(count, np.int32)
    if count:
        list_segments(segments, listed, frame, starts, lists)
    far = np.zeros((frame[3], frame[2]), np.uint8)
    bound_distances(segments, starts, lists, listed, frame, far)
    return starts, lists, far
