"""The tracks of a recording as PedPy takes them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import Polygon

from crowdsim.analysis.pedpy_library import pandas, pedpy
from crowdsim.analysis.results import polygons_of
from crowdsim.recording.header import Ends
from crowdsim.recording.reader import Recording
from crowdsim.recording.track_rows import TrackRows, all_rows, steps_a_frame, track_blocks

RATE = 10
"""Largest number of frames per second by default [1/s]."""

MOST_ROWS = 2_000_000
"""Number of rows above which the default rate is lowered: PedPy takes 1 microsecond to 10 for each."""

SPEED_SECONDS = 1.0
"""Time between the two positions from which a speed is computed [s]: bodies sway within a step."""


class Tracks(NamedTuple):
    """Tracks of a recording at ``rate`` frames per second.

    Attributes
    ----------
    recording : Recording
        The recording.
    rate : int
        Frames per second [1/s].
    table : pandas.DataFrame
        Columns id, frame, x, y [m], agent, state (AgentState), behavior (its number in the header), speed [m/s]; in
        order of id and frame. An id is a stretch of an agent's track without a gap: an agent that crosses the ends of
        a periodic floor begins a new one.
    trajectory : pedpy.TrajectoryData or None
        The same for PedPy; None if nobody is present.
    speeds : pandas.DataFrame
        PedPy's individual speeds: id, frame, speed [m/s].
    walkable : Polygon
        The part of the free floor in which most rows of the table are [m]; PedPy takes one polygon only.
    notes : tuple of str
        What a reader has to know.
    """

    recording: Recording
    rate: int
    table: pandas.DataFrame
    trajectory: pedpy.TrajectoryData | None
    speeds: pandas.DataFrame
    walkable: Polygon
    notes: tuple[str, ...]

    @property
    def frames(self) -> int:
        """Return the number of frames of the whole recording, rounded up: the first step is frame 0."""
        return -(-self.recording.steps * self.rate // self.recording.steps_per_second)

    def time(self, frame: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return the times (n,) of frames (n,) [s]."""
        return np.asarray(frame, np.float64) / self.rate


def read_tracks(recording: Recording, rate: float | None = None) -> Tracks:
    """Read the tracks of a recording.

    Parameters
    ----------
    recording : Recording
        The recording.
    rate : float or None
        Frames per second, a divisor of the recording's; by default the largest one up to 10 with few enough rows.

    Raises
    ------
    RecordingError
        If the rate is not a divisor, the recording is damaged, or holds no free floor.
    """
    notes = []
    chosen = _usual_rate(recording) if rate is None else rate
    every = steps_a_frame(recording, chosen)
    frames_a_second = recording.steps_per_second // every
    if rate is None and frames_a_second < min(RATE, recording.steps_per_second):
        notes.append(f"{frames_a_second} frames a second are measured, as there are many tracks; --rate asks for more")
    if not recording.complete:
        notes.append("the run was killed and recovered: what came later is missing")
    rows = all_rows(track_blocks(recording, every))
    x, y = rows.x.astype(np.float64), rows.y.astype(np.float64)
    order = np.lexsort((rows.frame, rows.agent))
    table = pandas.DataFrame(
        {
            "id": _stretches(rows, x, y, order, recording.header.ends),
            "frame": rows.frame[order],
            "x": x[order],
            "y": y[order],
            "agent": rows.agent[order],
            "state": rows.state[order],
            "behavior": rows.behavior[order],
        }
    )
    walkable, more = _walkable(recording, table)
    notes += more
    if not len(table):
        table["speed"] = np.zeros(0)
        return Tracks(recording, frames_a_second, table, None, table[["id", "frame", "speed"]], walkable, (*notes,))
    trajectory = pedpy.TrajectoryData(table[["id", "frame", "x", "y"]], frame_rate=float(frames_a_second))
    speeds = individual_speeds(trajectory)
    return Tracks(
        recording,
        frames_a_second,
        table.merge(speeds, on=["id", "frame"], how="left"),
        trajectory,
        speeds,
        walkable,
        (*notes,),
    )


def individual_speeds(trajectory: pedpy.TrajectoryData) -> pandas.DataFrame:
    """Return PedPy's speeds [m/s] over SPEED_SECONDS, in a row for each of the track's frames.

    The time is rounded to as many frames before a frame as after it, at least one each, so it is 2 s at 1 frame per
    second. At the ends of a track, the speed is taken over the half of the time that lies within the track. It is nan
    if the track has neither half around a frame, as in a track of a few frames.
    """
    half = max(1, round(0.5 * SPEED_SECONDS * trajectory.frame_rate))
    with np.errstate(divide="ignore", invalid="ignore"):
        return pedpy.compute_individual_speed(
            traj_data=trajectory,
            frame_step=half,
            speed_calculation=pedpy.SpeedCalculation.BORDER_SINGLE_SIDED,
        )


def _usual_rate(recording: Recording) -> int:
    """Return the largest divisor of the recorded rate up to RATE with which there are at most MOST_ROWS rows, or 1."""
    steps = recording.steps_per_second
    rates = [steps // every for every in range(1, steps + 1) if steps % every == 0 and steps // every <= RATE]
    most = recording.steps * max(recording.most_present, 1)  # rows at the recorded rate, if all were always present
    return next((rate for rate in rates if most * rate // steps <= MOST_ROWS), rates[-1])


def _stretches(
    rows: TrackRows, x: NDArray[np.float64], y: NDArray[np.float64], order: NDArray[np.int64], ends: Ends | None
) -> NDArray[np.int64]:
    """Return, for each row in the ``order`` (R,) of agents and frames, the number (R,) of its stretch of a track.

    ``x`` and ``y`` (R,) are positions of ``rows`` [m]. A stretch ends if frames are missing, or if an agent jumps
    across the ends of a periodic floor. If each agent has one stretch, its number is the agent's.
    """
    agent, frame = rows.agent[order], rows.frame[order]
    if not len(agent):
        return np.zeros(0, np.int64)
    same = agent[1:] == agent[:-1]
    broken = same & (np.diff(frame) != 1)
    if ends is not None:
        along = np.diff((x, y)[ends.axis][order])
        broken |= same & (np.abs(along) > 0.5 * (ends.high - ends.low))
    if not broken.any():
        return agent
    return np.concatenate([[0], np.cumsum(broken | ~same)])


def _walkable(recording: Recording, table: pandas.DataFrame) -> tuple[Polygon, list[str]]:
    """Return the part of the free floor with the most rows of ``table``, as PedPy takes one polygon only, and notes.

    Of parts with equally many rows, it is the largest. Notes say what Voronoi cells leave out.
    """
    free = recording.walkable()
    parts = polygons_of(free)
    places = table[["x", "y"]].to_numpy()
    for part in parts:
        shapely.prepare(part)
    inside = [int(shapely.contains_xy(part, places).sum()) if len(places) else 0 for part in parts]
    best = max(range(len(parts)), key=lambda number: (inside[number], parts[number].area))
    notes = []
    elsewhere = sum(inside) - inside[best]
    if elsewhere:
        share = elsewhere / len(places)
        notes.append(
            f"the free floor has {len(parts)} parts, and PedPy takes one: Voronoi cells leave out "
            f"{share:.0%} of the places, which lie in others"
        )
    if recording.header.movables:
        notes.append("doors and things that come and go do not bound Voronoi cells")
    return parts[best], notes
