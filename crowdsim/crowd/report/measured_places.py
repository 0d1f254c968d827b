"""Measurements on the lines and in the areas that a scenario names."""

from __future__ import annotations

import itertools
from array import array
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from crowdsim.crowd.report.share import EVERYBODY, Share
from crowdsim.geometry.elementary import hypot
from crowdsim.geometry.planar import shorter_ways
from crowdsim.recording.header import AgentState, RecordedFrame
from crowdsim.recording.measured import AreaSeries, Crossings, Measured, flow_of
from crowdsim.scenario.scenario import Scenario

SPEED_SECONDS = 1.0
"""Time between the two positions from which a speed is computed [s]: bodies sway within a step."""

Floats = NDArray[np.float64]
"""Array of float64."""


class MeasuredPlaces:
    """Count the agents in the areas and those that cross the lines, step by step.

    Parameters
    ----------
    scenario : Scenario
        The scenario, with its areas and lines.
    share : Share
        The agents whose steps are added. All processes that share the run must add each step at the same time.
    """

    def __init__(self, scenario: Scenario, share: Share = EVERYBODY) -> None:
        self._share = share
        self._rate = scenario.steps_per_second
        self._areas, self._lines = scenario.areas, scenario.lines
        self._shapes = [area.shape() for area in scenario.areas]
        # The size of an area is that of its floor that is free at the start. The width of a line is its length over
        # floor that no fixed obstacle covers: a door on it does not make it narrower, even if that is closed at first.
        free = scenario.environment.layers[0].free
        self._sizes = [float(shape.intersection(free).area) for shape in self._shapes]
        for shape in self._shapes:
            shapely.prepare(shape)
        always_free = scenario.environment.fixed_layers[0].free
        self._widths = [float(line.shape().intersection(always_free).length) for line in scenario.lines]
        self._pieces = [np.array(line.points) for line in scenario.lines]
        self._span = np.array(scenario.span)
        self._window = round(SPEED_SECONDS * self._rate)
        # Positions in the last steps of the window [m]. By area, the count and the mean speed [m/s] (nan for none) in
        # each step. By line, its crossings in parts: agents, times [s], and True for those to its left. There is a part
        # for each step and piece with crossings, behind an empty one, so that there is always one to join.
        self._places: list[Floats] = []
        self._counts = [array("i") for _ in self._areas]
        self._speeds = [array("f") for _ in self._areas]
        nobody = np.zeros(0, np.int64), np.zeros(0), np.zeros(0, np.bool_)
        self._crossed: list[list[tuple[NDArray[np.int64], Floats, NDArray[np.bool_]]]] = [[nobody] for _ in self._lines]
        self._step = 0

    def add(self, frame: RecordedFrame) -> None:
        """Add one step of the agents of the share."""
        if not self._areas and not self._lines:
            return
        # Agents outside of the world are at nan, which is in no area and crosses no line.
        places = np.column_stack((frame.x, frame.y)).astype(np.float64)
        places[np.asarray(frame.state) == AgentState.ABSENT] = np.nan
        inside = [shapely.contains_xy(shape, places) for shape in self._shapes]
        for count, here in zip(self._counts, inside, strict=True):
            count.append(int(here.sum()))
        if self._places:
            # If an agent has crossed an end of a periodic floor, move its old position to the side of the new one,
            # beyond that end: then the way between them is straight.
            self._cross(places - self._way(self._places[-1], places), places)
        self._places.append(places)
        since = self._places[0]
        if len(self._places) > self._window:
            self._places.pop(0)
            pace = hypot(*self._way(since, places).T) / SPEED_SECONDS
        else:
            pace = np.full(len(places), np.nan)  # the window is not full: no speed is known yet
        for speed, here in zip(self._speeds, inside, strict=True):
            # The mean is over the agents of all processes; counts are summed up by `join`.
            paces, _ = self._share.ranks.together(pace[here & ~np.isnan(pace)])
            speed.append(float(paces.mean()) if len(paces) else np.nan)
        self._step += 1

    def join(self) -> None:
        """Take in what other processes have counted of the other agents; all must call it at the same time."""
        ranks = self._share.ranks
        for count in self._counts:
            count[:] = array("i", ranks.sum(np.array(count, np.int64)).tolist())
        for number, parts in enumerate(self._crossed):
            agents, times, to_left = (ranks.together(np.concatenate(column))[0] for column in zip(*parts, strict=True))
            self._crossed[number] = [(agents, times, to_left)]

    def measured(self) -> Measured:
        """Return all measurements, for the recording."""
        areas = {
            area.name: AreaSeries(size, np.array(count, np.int32), np.array(speed, np.float32))
            for area, size, count, speed in zip(self._areas, self._sizes, self._counts, self._speeds, strict=True)
        }
        lines = {}
        for line, width, parts in zip(self._lines, self._widths, self._crossed, strict=True):
            agents, times, to_left = (np.concatenate(column) for column in zip(*parts, strict=True))
            order = np.lexsort((agents, times))
            lines[line.name] = Crossings(
                line.shape().length, width, agents[order].astype(np.int32), times[order], to_left[order]
            )
        return Measured(areas, lines)

    def summary(self) -> dict[str, Any]:
        """Return the figures under the names that ``crowdsim run --json`` prints."""
        measured = self.measured()
        areas, lines = {}, {}
        for area in self._areas:
            series = measured.areas[area.name]
            times = np.arange(len(series.count)) / self._rate
            during = (times >= area.start_time) & (times < (np.inf if area.until is None else area.until))
            count, speed = series.count[during], series.speed[during]
            walked = speed[~np.isnan(speed)].astype(np.float64)
            areas[area.name] = {
                "density": float(count.mean() / series.size) if len(count) and series.size > 0.0 else None,
                "density_most": float(count.max() / series.size) if len(count) and series.size > 0.0 else None,
                "speed": float(walked.mean()) if len(walked) else None,
            }
        for line in self._lines:
            crossings = measured.lines[line.name]
            during = (crossings.time >= line.start_time) & (
                crossings.time < (np.inf if line.until is None else line.until)
            )
            left = int(crossings.to_left[during].sum())
            right = int(during.sum()) - left
            # The flow is that of the direction in which more agents cross; to the right if the numbers are equal.
            flow = flow_of(crossings.time[during & (crossings.to_left == (left > right))])
            lines[line.name] = {
                "to_left": left,
                "to_right": right,
                "flow": flow,
                "flow_per_m": flow / crossings.width if flow is not None and crossings.width > 0.0 else None,
            }
        return {"areas": areas, "lines": lines}

    def _way(self, before: Floats, after: Floats) -> Floats:
        """Return displacements (n, 2) between positions (n, 2) [m], across the ends of a periodic floor if shorter."""
        way = after - before
        return np.column_stack([shorter_ways(way[:, axis], self._span[axis]) for axis in range(2)])

    def _cross(self, before: Floats, after: Floats) -> None:
        """Note which agents crossed which line on the straight way between two steps, and when.

        ``before`` and ``after`` (n, 2) are positions of the agents of the share [m].
        """
        for number, points in enumerate(self._pieces):
            for first, second in itertools.pairwise(points):
                agents, share, to_left = crossings_of(before, after, first, second)
                times = (self._step - 1 + share) / self._rate
                if len(agents):
                    self._crossed[number].append((agents + self._share.agents.start, times, to_left))


def crossings_of(
    before: Floats, after: Floats, first: Floats, second: Floats
) -> tuple[NDArray[np.int64], Floats, NDArray[np.bool_]]:
    """Find which agents cross a line between two points on their straight way from ``before`` to ``after``.

    Positions are (n, 2) [m], nan for agents that do not count. ``first`` and ``second`` (2,) are the ends of the line
    [m]; they must differ. A position on the line counts as on its left, and the second end does not belong to the line.

    Returns
    -------
    agents : (k,) int64
        Agents that cross.
    share : (k,) float64
        Share of the way at which each crosses.
    to_left : (k,) bool
        True if the agent is to the left of the direction from ``first`` to ``second`` after the crossing.
    """
    ux, uy = second - first
    # Signed areas: positive on the left of the line. A way crosses the infinite line if the side changes.
    left = [ux * (at[:, 1] - first[1]) - uy * (at[:, 0] - first[0]) for at in (before, after)]
    crosses = ((left[0] >= 0.0) != (left[1] >= 0.0)) & ~np.isnan(left[0]) & ~np.isnan(left[1])
    agents = np.flatnonzero(crosses)
    share = left[0][agents] / (left[0][agents] - left[1][agents])
    at = before[agents] + share[:, None] * (after[agents] - before[agents])
    along = (ux * (at[:, 0] - first[0]) + uy * (at[:, 1] - first[1])) / (ux * ux + uy * uy)
    # The crossing must lie on the segment; the end belongs to the next segment of a polyline.
    hits = (along >= 0.0) & (along < 1.0)
    return agents[hits], share[hits], left[1][agents[hits]] >= 0.0
