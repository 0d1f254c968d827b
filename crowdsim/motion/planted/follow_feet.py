"""Follow the feet of captured bodies step by step, and note where they stand."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from crowdsim.constants import CAPTURE_RATE
from crowdsim.motion.graph.pose_table import PoseTable
from crowdsim.motion.planted.follow_kernels import follow_feet
from crowdsim.motion.planted.pin_kernels import COLUMNS
from crowdsim.motion.planted.planted_rows import FootTable

Floats = NDArray[np.float64]

_CHANGES = 6
"""Number of changes in one step, for each body, for which there is room at first."""


class Played(NamedTuple):
    """What N bodies play in one step.

    node: (N,) int32, -1 for a body that is not captured. previous: (N,) int32, the node before it, -1 for none. frame:
    (N,) float64, of the node. track: (N, 3) float64 x, y [m], heading [rad].
    """

    node: NDArray[np.int32]
    previous: NDArray[np.int32]
    frame: Floats
    track: Floats


class Step(NamedTuple):
    """What the kernel reads and writes in one step; see :class:`Played` for the steps before (old) and after (new).

    states: (N, 2, COLUMNS) of all feet. natural: frames that a step takes at the natural rate. spans: (2,) see
    :func:`crowdsim.motion.planted.pin_kernels.pin_feet`. positions, rotations: (1, J, 3), (1, J, 4) float32, room for
    one body. rows, shares, events: (c,), (c,), (c, COLUMNS), room for changes: 2 * body + foot, share of the step at
    which it changes, new state.
    """

    table: PoseTable
    feet: FootTable
    states: Floats
    natural: float
    spans: Floats
    old_node: NDArray[np.int32]
    old_previous: NDArray[np.int32]
    old_frame: Floats
    old_track: Floats
    new_node: NDArray[np.int32]
    new_previous: NDArray[np.int32]
    new_frame: Floats
    new_track: Floats
    positions: NDArray[np.float32]
    rotations: NDArray[np.float32]
    rows: NDArray[np.int64]
    shares: Floats
    events: Floats


class FollowedFeet:
    """The feet of N bodies, followed from step to step.

    Parameters
    ----------
    table, feet : PoseTable, FootTable
        Poses and feet of all nodes.
    count : int
        Number of bodies N.
    steps_per_second : int
        Steps per second; a step has a whole number of frames.
    spans : (2,) float64
        Lengths of the floor along x and y [m], 0 if it is not periodic there.

    Attributes
    ----------
    states : (N, 2, COLUMNS) float64
        How each foot is corrected after the last step, for :func:`crowdsim.motion.planted.pin_kernels.pin_feet`.
    """

    def __init__(self, table: PoseTable, feet: FootTable, count: int, steps_per_second: int, spans: Floats) -> None:
        self._table, self._feet, self._spans = table, feet, spans
        self._natural = float(CAPTURE_RATE // steps_per_second)
        joints = len(table.parents)
        self._room = np.empty((1, joints, 3), np.float32), np.empty((1, joints, 4), np.float32)
        self._old: Played | None = None
        self.states = np.zeros((count, 2, COLUMNS))

    def add(self, new: Played) -> tuple[NDArray[np.int64], Floats, Floats]:
        """Take a step to what bodies play now, ``new``; return the changes of their feet's states, body by body.

        They are 2 * body + foot (c,), share of the step (c,), and new state (c, COLUMNS). ``new`` is kept until the
        next step, so its arrays must not be changed. If a body is no longer captured, its feet become FREE; this is no
        change that is returned.
        """
        # In the first step no body was captured before.
        old = new._replace(node=np.full_like(new.node, -1)) if self._old is None else self._old
        size = _CHANGES * len(new.node)
        while True:
            rows, shares, events = np.empty(size, np.int64), np.empty(size), np.empty((size, COLUMNS))
            # On a copy, as a step with more changes than there is room for is taken again.
            states = self.states.copy()
            kept = self._table, self._feet, states, self._natural, self._spans
            count = follow_feet(Step(*kept, *old, *new, *self._room, rows, shares, events))
            if count <= size:
                break
            size = count
        self._old, self.states = new, states
        return rows[:count], shares[:count], events[:count]
