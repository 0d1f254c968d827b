"""Smallest gaps between bodies of both levels, at several times in every step."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from crowdsim.constants import CAPTURE_RATE, STEERING_RATE
from crowdsim.crowd.mixed.mixed_crowd import MixedCrowd
from crowdsim.crowd.mixed.seen import TRACK_ROOM
from crowdsim.crowd.state.components import CORE, RADIUS, SLOT_FRAMES
from crowdsim.geometry.planar import wrap_angle

TIMES = (0.2, 0.4, 0.6, 0.8, 1.0)
"""Times within a step at which gaps are measured, as parts of the step."""

FAR = 1.0
"""Distance between the centers of two bodies beyond which they are ignored [m]; also the largest gap returned."""

KINDS = ("steered_steered", "steered_captured", "captured_captured")

Floats = NDArray[np.float64]


class LeastGaps:
    """Smallest gaps so far.

    Attributes
    ----------
    gaps : dict
        By kind of pair [m]. Steered bodies are capsules, captured ones those of their behaviors.
    reserved : float
        Smallest gap between two captured bodies on their reserved ways, which are straight between samples [m].
    ahead : float
        Smallest gap between a steered body and the rest of any reserved way [m].
    agent_steps, captured_steps : int
        Number of bodies measured, each step once, and of captured ones among them.
    """

    def __init__(self) -> None:
        self.gaps = dict.fromkeys(KINDS, FAR)
        self.reserved = self.ahead = FAR
        self.agent_steps = self.captured_steps = 0
        self._before: NDArray[Any] | None = None

    def watch(self, _: float, crowd: MixedCrowd) -> None:
        """Measure the step that ``crowd`` has just done; the time, the first argument, is not needed."""
        others = crowd.captured_as_seen()
        rows, captured = crowd.everybody(), len(others.rows)
        # 0 steered, 1 captured: the sum of a pair's is its number in KINDS.
        kind = np.repeat([0, 1], [len(rows) - captured, captured])
        self.agent_steps += len(rows)
        self.captured_steps += captured
        for part in TIMES:
            # At the end of the step bodies that are new in it count, too.
            now = rows if part == 1.0 else between(self._before, rows, part)
            self._bodies(now, kind if part == 1.0 else kind[np.isin(rows["id"], now["id"])])
        self._ways(crowd)
        steered = rows[kind == 0]
        if len(steered) and len(others.segments):
            self._ahead(steered, others.segments)
        self._before = rows

    def _bodies(self, rows: NDArray[Any], kind: NDArray[np.int64]) -> None:
        """Measure all pairs of bodies that are near each other.

        ``rows`` are ROW[n], records of :mod:`crowdsim.steering.row_kernels`; ``kind`` (n,) is 1 for captured bodies,
        else 0.
        """
        pairs = near_pairs(np.column_stack((rows["x"], rows["y"])))
        begin, end = cores(rows)
        radii = rows["radius"]
        for number, name in enumerate(KINDS):
            first, second = pairs[kind[pairs].sum(axis=1) == number].T
            gap = core_gaps(begin[first], end[first], begin[second], end[second]) - radii[first] - radii[second]
            self.gaps[name] = min(self.gaps[name], float(gap.min(initial=FAR)))

    def _ways(self, crowd: MixedCrowd) -> None:
        """Measure pairs of captured bodies on the ways that they have reserved, at TIMES within the step just done."""
        view, step = crowd.captured.world.view(), crowd.step_count - 1
        frames = CAPTURE_RATE // STEERING_RATE
        for part in TIMES:
            # Time since the first sample of each timeline, in slots; a body keeps its last sample. The first sample of
            # a way reserved in the middle of a slot is placed so that this gives the body's place.
            at = (step + part) * frames / SLOT_FRAMES - view.timeline_start
            last = view.timeline.shape[1] - 1
            here = np.clip(np.floor(at).astype(np.int64), 0, last)
            there = np.minimum(here + 1, last)
            rows = np.arange(len(here))
            share = np.clip(at - here, 0.0, 1.0)[:, None]
            sample = view.timeline[rows, here] * (1.0 - share) + view.timeline[rows, there] * share
            core = sample[:, CORE : CORE + 2]
            first, second = near_pairs(sample[:, :2]).T
            begin, end, radii = sample[:, :2] - core, sample[:, :2] + core, sample[:, RADIUS]
            gap = core_gaps(begin[first], end[first], begin[second], end[second]) - radii[first] - radii[second]
            self.reserved = min(self.reserved, float(gap.min(initial=FAR)))

    def _ahead(self, steered: NDArray[Any], segments: Floats) -> None:
        """Measure ``steered`` bodies (ROW[n]) against all pieces of reserved ways that are still to be walked.

        ``segments`` (k, 5) hold both ends x, y, x, y and the radius [m], enlarged by TRACK_ROOM, which is taken off
        again. The quarter pieces of bent tracks are enlarged by REST of their sample instead (see
        :mod:`crowdsim.crowd.state.components`), so that their gaps come out larger by TRACK_ROOM - REST.
        """
        middles = 0.5 * (segments[:, :2] + segments[:, 2:4])
        longest = 0.5 * float(np.hypot(*(segments[:, 2:4] - segments[:, :2]).T).max())
        # Between the middles at a gap of FAR: that gap, half of the longest piece, and less than FAR for both bodies.
        reach = longest + 2.0 * FAR
        near = cKDTree(np.column_stack((steered["x"], steered["y"]))).query_ball_point(middles, reach)
        piece = np.repeat(np.arange(len(near)), [len(each) for each in near])
        body = np.concatenate([np.array(each, np.int64) for each in near])
        begin, end = cores(steered)
        apart = core_gaps(begin[body], end[body], segments[piece, :2], segments[piece, 2:4])
        gap = apart - steered["radius"][body] - (segments[piece, 4] - TRACK_ROOM)
        self.ahead = min(self.ahead, float(gap.min(initial=FAR)))


def between(before: NDArray[Any] | None, rows: NDArray[Any], part: float) -> NDArray[Any]:
    """Return the bodies of both steps, interpolated from the rows ``before`` (ROW) to ``rows``, those one step later.

    There are none if ``before`` is None. ``part`` is the share of the step, 0 to 1. Of the fields, x, y, hx, hy and
    half are interpolated; all others are those of the later step.
    """
    if before is None:
        return rows[:0]
    # Bodies of both steps in the order of ``rows``, and the row of each before.
    _, old, new = np.intersect1d(before["id"], rows["id"], return_indices=True)
    new = np.sort(new)
    old = np.argsort(before["id"])[np.searchsorted(np.sort(before["id"]), rows["id"][new])]
    now = rows[new].copy()
    for name in ("x", "y"):
        now[name] = (1.0 - part) * before[name][old] + part * now[name]
    heading = before["heading"][old] + part * wrap_angle(now["heading"] - before["heading"][old])
    now["hx"], now["hy"] = np.cos(heading), np.sin(heading)
    # A body that has just changed its level has another radius, and at once its new breadth.
    same = before["radius"][old] == now["radius"]
    now["half"] = np.where(same, (1.0 - part) * before["half"][old] + part * now["half"], now["half"])
    return now


def near_pairs(places: Floats) -> NDArray[np.int64]:
    """Return (k, 2) the pairs of rows of ``places`` (n, 2) [m] that are within FAR of each other."""
    return cKDTree(places).query_pairs(FAR, output_type="ndarray").astype(np.int64) if len(places) else _NO_PAIRS


_NO_PAIRS = np.zeros((0, 2), np.int64)


def cores(rows: NDArray[Any]) -> tuple[Floats, Floats]:
    """Return both ends (n, 2) of the core segments of capsules (ROW[n]), which lie across their headings [m]."""
    middles = np.column_stack((rows["x"], rows["y"]))
    across = np.column_stack((-rows["hy"], rows["hx"])) * rows["half"][:, None]
    return middles - across, middles + across


def core_gaps(a: Floats, b: Floats, c: Floats, d: Floats) -> Floats:
    """Return distances (k,) between segments from ``a`` to ``b`` and from ``c`` to ``d``, each (k, 2) [m].

    Segments that cross have 0; else the distance is the least of an end of one segment from the other segment.
    """
    ends = [_off(a, c, d), _off(b, c, d), _off(c, a, b), _off(d, a, b)]
    apart = np.minimum.reduce(ends)
    crosses = (_side(a, b, c) * _side(a, b, d) < 0.0) & (_side(c, d, a) * _side(c, d, b) < 0.0)
    return np.where(crosses, 0.0, apart)


def _off(point: Floats, begin: Floats, end: Floats) -> Floats:
    """Return distances (k,) of points (k, 2) from segments [m]; a segment may be a point."""
    along = end - begin
    square = np.maximum((along * along).sum(axis=1), 1e-300)
    share = np.clip(((point - begin) * along).sum(axis=1) / square, 0.0, 1.0)
    return np.asarray(np.hypot(*(point - begin - share[:, None] * along).T))


def _side(begin: Floats, end: Floats, point: Floats) -> Floats:
    """Return twice the signed areas (k,) of triangles [m2], positive if ``point`` lies left of ``begin`` to ``end``."""
    u, v = end - begin, point - begin
    return np.asarray(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0])
