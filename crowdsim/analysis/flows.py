"""Passages and flow at lines, by PedPy, beside the flows measured in bottlenecks of the same width."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import LineString

from crowdsim.analysis.drawing import BAND, color, legend, panels
from crowdsim.analysis.measured_people import FLOW_SOURCE, FlowBand, flow_band
from crowdsim.analysis.pedpy_library import pandas, pedpy
from crowdsim.analysis.results import Places, Result
from crowdsim.analysis.tracks import Tracks
from crowdsim.recording.measured import LEAST_CROSSINGS, flow_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

WINDOW = 5.0
"""Length of the intervals of which PedPy gives the flow [s]."""


def measure_flow(tracks: Tracks, places: Places) -> Result:
    """Return which agents passed each line when, how many, the flow [1/s], and the flow for each meter [1/(m s)].

    A flow is None if too few agents passed, and that for each meter also if no part of the line is free floor.
    """
    name, title = "flow", "N-t and flow at lines"
    if not places.lines:
        return Result(name, title, {}, ("There is no line: name one under `lines` of the scenario or by --line.",))
    values: dict[str, Any] = {}
    sentences, parts, intervals = [], [], {}
    for line_name, place in places.lines.items():
        line = place.shape
        # The first crossing of each stretch of a track (see Tracks), if it is in the time in which the line is
        # measured.
        crossings = crossing_frames(tracks, line)
        crossings = crossings[place.during(tracks.time(crossings["frame"].to_numpy()))]
        times = tracks.time(crossings["frame"].to_numpy())
        width = _free_width(tracks, line)
        band = flow_band(width)
        flow = flow_of(times)
        intervals[line_name] = _intervals(tracks, line, crossings)
        # `band` and `measured_flow_per_m` are flows of people through bottlenecks as wide as this line.
        values[line_name] = {
            "passages": len(times),
            "first": float(times[0]) if len(times) else None,
            "last": float(times[-1]) if len(times) else None,
            "width": width,
            "flow": flow,
            "flow_per_m": flow / width if flow is not None and width > 0.0 else None,
            "measured_flow_per_m": None if band is None else {**band._asdict(), "source": FLOW_SOURCE},
        }
        sentences.append(_sentence(f"{line_name}{place.times_in_words}", values[line_name], band))
        passed = np.arange(1, len(times) + 1)
        parts.append(
            pandas.DataFrame({"line": line_name, "agent": _agents(tracks, crossings), "time": times, "passed": passed})
        )
    sentences.append(
        "Each stretch of a track counts once at a line, the first time it crosses, as in PedPy. A flow is that between "
        f"the first and the last tenth of the passages; {LEAST_CROSSINGS} are needed."
    )
    table = pandas.concat(parts, ignore_index=True)

    def draw(figure: Figure) -> None:
        """Draw passages (above) and flow for each meter of width (below) over time, a color for each line."""
        upper, lower = panels(figure, 2)
        for number, line_name in enumerate(places.lines):
            mine = table[table.line == line_name]
            upper.step([0.0, *mine.time], [0, *mine.passed], where="post", color=color(number), label=line_name)
            curve = intervals[line_name]
            if len(curve):
                lower.plot(curve.time, curve.flow_per_m, ".-", color=color(number), linewidth=1.0)
        # People were measured at one width: show their band only if all lines are in it.
        bands = {flow_band(each["width"]) for each in values.values()}
        band = bands.pop() if len(bands) == 1 else None
        if band is not None and any(len(curve) for curve in intervals.values()):
            lower.axhspan(band.least, band.most, color=BAND, zorder=0)
            lower.axhline(band.median, color="#7f9db3", linewidth=0.8)
            note = f"measured in {band.studied} bottlenecks of {band.narrowest:g} to {band.widest:g} m"
            lower.text(0.99, 0.03, note, transform=lower.transAxes, ha="right", color="#4c6b82", fontsize="small")
        upper.set(xlabel="time [s]", ylabel="passages N", xlim=(0.0, None), ylim=(0.0, None))
        lower.set(xlabel="time [s]", ylabel="flow [1/(m s)]", xlim=upper.get_xlim(), ylim=(0.0, None))
        legend(upper)

    return Result(name, title, values, (*sentences,), table, draw)


def crossing_frames(tracks: Tracks, line: LineString) -> pandas.DataFrame:
    """Return the first frame in which each stretch of a track crosses a line, by PedPy: id and frame, by frame.

    Stretches that never cross it have no row.
    """
    if tracks.trajectory is None:
        return pandas.DataFrame({"id": np.zeros(0, np.int64), "frame": np.zeros(0, np.int64)})
    # PedPy's lines have two points: take a longer one piece by piece.
    found = []
    for ends in itertools.pairwise(shapely.get_coordinates(line)):
        piece = pedpy.MeasurementLine([tuple(point) for point in ends])
        found.append(pedpy.compute_n_t(traj_data=tracks.trajectory, measurement_line=piece)[1])
    if len(found) == 1:
        return found[0]
    first = pandas.concat(found).groupby("id")["frame"].min()
    return first.sort_values(kind="stable").reset_index()


def _intervals(tracks: Tracks, line: LineString, crossings: pandas.DataFrame) -> pandas.DataFrame:
    """Return PedPy's flow in intervals of WINDOW: the time of their middle [s] and the flow for each meter [1/(m s)].

    ``crossings`` are the rows of :func:`crossing_frames` in the time in which the line is measured. The table is empty
    if there are fewer than two of them, if no whole interval follows the first one, or if no part of the line is free
    floor.
    """
    empty = pandas.DataFrame({"time": [], "flow_per_m": []})
    width = _free_width(tracks, line)
    if len(crossings) < 2 or width <= 0.0:
        return empty
    frames = np.arange(int(tracks.table["frame"].min()), int(tracks.table["frame"].max()) + 1)
    # N-t of these crossings, how many there are up to each frame. PedPy's own would count crossings at other times,
    # too.
    passed = np.searchsorted(np.sort(crossings["frame"].to_numpy()), frames, side="right")
    nt = pandas.DataFrame({"frame": frames, "cumulative_pedestrians": passed, "time": frames / tracks.rate})
    window = max(1, round(WINDOW * tracks.rate))
    flow = pedpy.compute_flow(
        nt=nt,
        crossing_frames=crossings,
        individual_speed=tracks.speeds,
        delta_frame=window,
        frame_rate=float(tracks.rate),
    )
    if not len(flow):
        return empty
    # PedPy gives no times: its intervals begin at the first passage, and those in which nobody passes have no row.
    first = int(crossings["frame"].min())
    ends = np.arange(first + window, int(frames[-1]), window)
    counts = passed[ends - frames[0]]
    some = np.diff(counts, prepend=0) > 0
    return pandas.DataFrame({"time": (ends[some] - 0.5 * window) / tracks.rate, "flow_per_m": flow["flow"] / width})


def _free_width(tracks: Tracks, line: LineString) -> float:
    """Return the length of the line on the free floor [m]."""
    return float(line.intersection(tracks.recording.walkable()).length)


def _agents(tracks: Tracks, crossings: pandas.DataFrame) -> NDArray[np.int64]:
    """Return the agent (n,) of each crossing; rows of :func:`crossing_frames` have only the id of a stretch."""
    agents: NDArray[np.int64] = crossings.merge(tracks.table[["id", "frame", "agent"]], on=["id", "frame"], how="left")[
        "agent"
    ].to_numpy()
    return agents


def _sentence(name: str, values: dict[str, Any], band: FlowBand | None) -> str:
    """Return a sentence on the passages and the flow at a line, beside flows measured at bottlenecks as wide.

    ``values`` are the figures of the line, as in the result; ``band`` is None if nothing was measured at its width.
    """
    text = f"{name} ({values['width']:.2f} m): {values['passages']} passages"
    if values["flow"] is None:
        return f"{text}, too few for a flow."
    text += f", {values['flow']:.2f} /s"
    if values["flow_per_m"] is not None:
        text += f", {values['flow_per_m']:.2f} /(m s)"
    if band is None:
        return f"{text}; nothing was measured at this width."
    return f"{text}; people in bottlenecks of {band.narrowest:g} to {band.widest:g} m: {band.least:g} to {band.most:g}."
