"""Distances between nearest agents, and shares of behaviors by place."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from crowdsim.analysis.drawing import COLORS, GRAY, panels
from crowdsim.analysis.measured_people import HALL_SOURCE, HALL_ZONES
from crowdsim.analysis.pedpy_library import pandas
from crowdsim.analysis.results import Places, Result
from crowdsim.analysis.tracks import Tracks
from crowdsim.recording.header import Ends

if TYPE_CHECKING:
    from matplotlib.figure import Figure

APART = 1e4
"""Distance between two frames in the tree of all positions [m]: farther than any floor is long."""

BIN = 0.05
"""Width of the bars in the histogram of distances [m]."""

Floats = NDArray[np.float64]


def measure_distances(tracks: Tracks, _: Places) -> Result:
    """Return quantiles and shares of the distances from each agent to the nearest other one, over all frames.

    Distances are from center to center [m]. Agents that are alone in a frame do not count.
    """
    name, title = "distances", "Distance to the nearest other agent"
    found = nearest_distances(
        tracks.table["frame"].to_numpy(), tracks.table[["x", "y"]].to_numpy(), tracks.recording.header.ends
    )
    known = found[np.isfinite(found)]
    if not len(known):
        return Result(name, title, {}, ("Nobody was ever with another: there is no distance.",))
    quantiles = np.quantile(known, (0.01, 0.05, 0.5, 0.95)).tolist()
    zones = {zone: float(((known >= least) & (known < most)).mean()) for zone, least, most in HALL_ZONES}
    values: dict[str, Any] = {
        "least": float(known.min()),
        **dict(zip(("p1", "p5", "median", "p95"), quantiles, strict=True)),
        "mean": float(known.mean()),
        "zones": zones,
    }
    bounds = ", ".join(f"{zone} from {least:g} m {zones[zone]:.0%}" for zone, least, _ in HALL_ZONES)
    sentences = (
        f"The nearest other is {values['median']:.2f} m away (median), {values['least']:.2f} m at least, by centers.",
        f"Zones of {HALL_SOURCE}: {bounds}.",
    )
    # The histogram leaves out distances of more than some 8 m. The last bar holds the greatest one up to there.
    edges = np.arange(0.0, min(float(known.max()), 8.0) + 2.0 * BIN, BIN)
    counts = np.histogram(known, edges)[0]
    table = pandas.DataFrame({"from": edges[:-1], "to": edges[1:], "count": counts})

    def draw(figure: Figure) -> None:
        """Draw the histogram of distances, and dashed lines at which zones begin."""
        (axes,) = panels(figure)
        axes.bar(edges[:-1], counts / len(known), BIN, align="edge", color=COLORS[0])
        far = min(edges[-1], max(1.5, 1.3 * values["p95"]))
        for zone, least, _ in HALL_ZONES:
            if least < far:
                axes.axvline(least, color=GRAY, linewidth=0.8, linestyle="--")
                axes.annotate(zone, (least, 0.98), (3, 0), xycoords=("data", "axes fraction"), color=GRAY,
                              textcoords="offset points", fontsize="small", va="top")  # fmt: skip
        axes.set(xlabel="distance, center to center [m]", ylabel=f"share per {BIN:g} m", xlim=(0.0, far))

    return Result(name, title, values, sentences, table, draw)


def nearest_distances(frame: NDArray[np.int64], places: Floats, ends: Ends | None = None) -> Floats:
    """Return the distance from each row to the nearest other one of the same frame [m]; infinite if there is none.

    Parameters
    ----------
    frame : (R,) int64
        Frame of each row.
    places : (R, 2) float64
        Positions [m].
    ends : Ends or None
        Ends of a periodic floor, which are the same place. An agent there also sees itself, one length of the floor
        away.
    """
    if not len(frame):
        return np.empty(0)
    # One tree for all frames, each in a plane of its own.
    points = np.column_stack([places, APART * frame.astype(np.float64)])
    # On a periodic floor, each position also counts one length of the floor before and behind.
    others = [points]
    if ends is not None:
        for sign in (-1.0, 1.0):
            beyond = points.copy()
            beyond[:, ends.axis] += sign * (ends.high - ends.low)
            others.append(beyond)
    # Of the two nearest positions, the first is the row itself. The bound leaves out other frames, which are farther.
    found, _ = cKDTree(np.concatenate(others)).query(points, k=2, distance_upper_bound=0.5 * APART)
    return np.asarray(found[:, 1], np.float64)


def measure_behaviors(tracks: Tracks, places: Places) -> Result:
    """Return the share of each behavior in the time of all agents, on the whole floor and by area.

    Shares are over the whole run, as in its summary, also in areas that are measured only at certain times. The shares
    of a place in which no agent was are None. Rows without a known speed, those of very short tracks, do not count.
    """
    name, title = "behaviors", "Behaviors by place"
    header, table = tracks.recording.header, tracks.table
    names = [behavior.name for behavior in header.behaviors]
    moving = table[table["speed"] >= 0.0]  # leaves out nan, the speed in tracks of a few frames
    positions = moving[["x", "y"]].to_numpy()
    where = {"whole floor": np.ones(len(moving), np.bool_)}
    where |= {area: shapely.contains_xy(place.shape, positions) for area, place in places.areas.items()}
    values: dict[str, Any] = {}
    rows = []
    for place, inside in where.items():
        counts = np.bincount(moving["behavior"].to_numpy()[inside], minlength=len(names))
        if counts.sum():
            values[place] = dict(zip(names, (counts / counts.sum()).tolist(), strict=True))
            rows.append({"place": place, **values[place]})
        else:
            values[place] = None
    sentences = [
        f"{place}: "
        + ", ".join(f"{behavior} {share:.0%}" for behavior, share in shares.items() if share >= 0.005)
        + "."
        if shares
        else f"{place}: nobody was there."
        for place, shares in values.items()
    ]
    if not rows:
        return Result(name, title, values, (*sentences,))
    sentences.append("Shares are of the time of all agents; `crowdsim run` prints those of the way.")
    shares_table = pandas.DataFrame(rows)

    def draw(figure: Figure) -> None:
        """Draw a bar for each place, divided by the shares of the behaviors."""
        (axes,) = panels(figure, names_beside=True)
        before = np.zeros(len(rows))
        for behavior in header.behaviors:
            share = shares_table[behavior.name].to_numpy()
            axes.barh(shares_table.place, share, left=before, height=0.6, color=behavior.color,
                      label=behavior.name.replace("_", " "))  # fmt: skip
            before = before + share
        axes.set(xlim=(0.0, 1.0), xlabel="share of the time")
        axes.invert_yaxis()
        axes.legend(frameon=False, fontsize="small", loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=len(names))

    return Result(name, title, values, (*sentences,), shares_table, draw)
