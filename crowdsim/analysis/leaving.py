"""When agents arrive, and what their way cost: travel time, way, detour and waiting, by group."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from crowdsim.analysis.drawing import COLORS, GRAY, color, legend, panels
from crowdsim.analysis.pedpy_library import pandas
from crowdsim.analysis.results import Places, Result
from crowdsim.analysis.tracks import Tracks

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SLOW = 0.2
"""Speed below which an agent waits [m/s]."""

LEAST_WAY = 1.0
"""Straight way below which no detour is computed [m]: an agent that comes back to its start has an infinite one."""

Floats = NDArray[np.float64]


def measure_evacuation(tracks: Tracks, _: Places) -> Result:
    """Return how many agents have not arrived yet over time, when half and 95 % have, and which are left at the end.

    Agents that a command takes out before they arrive do not count.
    """
    name, title = "evacuation", "Evacuation curve"
    recording = tracks.recording
    times = recording.agent_times
    came = np.flatnonzero(~np.isnan(times.entered) & ~times.removed)
    removed = int(times.removed.sum())
    if not len(came):
        why = "All who came were taken out by commands" if removed else "Nobody was present"
        figures = {"characters": 0, "removed": removed}
        return Result(name, title, figures, (f"{why}: there is nothing to measure.",))
    arrived = np.sort(times.arrived[came][~np.isnan(times.arrived[came])])
    left = came[np.isnan(times.arrived[came])]
    groups = np.array(recording.header.agents.groups, np.str_)
    stayed = {str(group): int((groups[left] == group).sum()) for group in np.unique(groups[left])}
    values = {
        "characters": len(came),
        "arrived": len(arrived),
        **{f"t{share}": times.until_share(share) for share in (50, 95, 100)},
        "left_at_the_end": stayed,
        "agents_left_at_the_end": left.tolist(),
        "removed": removed,
    }
    sentences = [f"{len(arrived)} of {len(came)} agents have arrived after {recording.duration:.1f} s."]
    for share in (50, 95):
        at = values[f"t{share}"]
        sentences.append(f"{share} % have after {at:.1f} s." if at is not None else f"{share} % never have.")
    if removed:
        sentences.append(f"Taken out by commands, and not counted: {removed}.")
    if stayed:
        who = ", ".join(f"{count} of {group}" for group, count in stayed.items())
        sentences.append(f"Who has not: {who}.")
    # The curve falls by one at each arrival; the last point is the end of the run.
    steps = np.concatenate([[0.0], arrived, [max(recording.duration, float(arrived[-1]) if len(arrived) else 0.0)]])
    remaining = np.concatenate([[len(came)], len(came) - np.arange(1, len(arrived) + 1), [len(left)]])
    table = pandas.DataFrame({"time": steps, "not_arrived": remaining})

    def draw(figure: Figure) -> None:
        """Draw the curve of agents that have not arrived, and dashed lines at t50 and t95."""
        (axes,) = panels(figure)
        axes.step(steps, remaining, where="post", color=COLORS[0])
        for share in (50, 95):
            at = values[f"t{share}"]
            if at is not None:
                axes.axvline(at, color=GRAY, linewidth=0.8, linestyle="--")
                label_at = (at, 0.97 - 0.1 * (share == 95))
                axes.annotate(f"t{share} = {at:.1f} s", label_at, (3, 0), xycoords=("data", "axes fraction"),
                              textcoords="offset points", color=GRAY, fontsize="small", va="top")  # fmt: skip
        axes.set(xlabel="time [s]", ylabel="agents not arrived", xlim=(0.0, None), ylim=(0.0, 1.05 * len(came)))

    return Result(name, title, values, (*sentences,), table, draw)


def measure_groups(tracks: Tracks, _: Places) -> Result:
    """Return travel time, way, detour and waiting of each group."""
    name, title = "groups", "Travel time, way, detour and waiting by group"
    table = characters(tracks)
    if not len(table):
        return Result(name, title, {}, ("Nobody was present: there is nothing to measure.",))
    values: dict[str, Any] = {}
    sentences = [
        f"Waiting is time slower than {SLOW:g} m/s before arrival; detour is the way walked for each meter between its "
        f"ends, which are at least {LEAST_WAY:g} m apart."
    ]
    for group, members in table.groupby("group", observed=True):
        values[str(group)] = {
            "characters": len(members),
            "arrived": int(members.travel_time.notna().sum()),
            **{column: _spread(members[column].to_numpy(float)) for column in _MEASURED},
        }
        sentences.append(_sentence(str(group), values[str(group)]))

    def draw(figure: Figure) -> None:
        """Draw a panel for each quantity: its cumulative distribution in each group."""
        axes = panels(figure, len(_MEASURED))
        for panel, (column, label) in zip(axes, _MEASURED.items(), strict=True):
            for number, (group, members) in enumerate(table.groupby("group", observed=True)):
                known = np.sort(members[column].dropna().to_numpy(float))
                if len(known):
                    share = np.arange(1, len(known) + 1) / len(known)
                    panel.step([known[0], *known], [0.0, *share], where="post", color=color(number), label=str(group))
            panel.set(xlabel=label, ylabel="share of the group", ylim=(0.0, 1.05))
        legend(axes[0])

    return Result(name, title, values, (*sentences,), table, draw)


_MEASURED = {"travel_time": "travel time [s]", "way": "way [m]", "detour": "detour", "waiting": "waiting [s]"}


def characters(tracks: Tracks) -> pandas.DataFrame:
    """Return a row for each agent that came: agent, group, entered, arrived, travel_time, way, detour, waiting.

    Times are in seconds and ways in meters. Waiting is the time in which the agent was slower than SLOW; detour is its
    way divided by the straight line between its ends, nan if the line is shorter than LEAST_WAY. Way, detour and
    waiting count until the agent arrives, or as long as it is there. Arrival and travel time of agents that never
    arrive are nan.
    """
    recording, table = tracks.recording, tracks.table
    times = recording.agent_times
    came = np.flatnonzero(~np.isnan(times.entered))
    agent, x, y = (table[column].to_numpy() for column in ("agent", "x", "y"))
    until = np.where(np.isnan(times.arrived), np.inf, times.arrived)[agent]
    before = tracks.time(table["frame"].to_numpy()) <= until + 1e-9
    # Displacements between successive rows count if both rows are of one agent, before its arrival.
    same = agent[1:] == agent[:-1]
    moved = [np.diff(along) for along in (x, y)]
    ends = recording.header.ends
    if ends is not None:
        # Across the ends of a periodic floor, the shorter way counts.
        moved[ends.axis] = ends.shorter(moved[ends.axis])
    counted = same & before[1:]
    count = recording.agent_count

    def total(values: Floats) -> Floats:
        """Return the sum (agents,) of a value (rows - 1,) of the displacements that count."""
        return np.bincount(agent[1:][counted], values[counted], minlength=count).astype(np.float64)

    way, straight = total(np.hypot(*moved)), np.hypot(total(moved[0]), total(moved[1]))
    slow = before & (table["speed"].to_numpy() < SLOW)
    with np.errstate(divide="ignore", invalid="ignore"):
        detour = np.where(straight >= LEAST_WAY, way / straight, np.nan)
    waiting = np.bincount(agent[slow], minlength=count) / tracks.rate
    return pandas.DataFrame(
        {
            "agent": came,
            "group": np.array(recording.header.agents.groups, np.str_)[came],
            "entered": times.entered[came],
            "arrived": times.arrived[came],
            "travel_time": (times.arrived - times.entered)[came],
            "way": way[came],
            "detour": detour[came],
            "waiting": waiting[came],
        }
    )


def _spread(values: Floats) -> dict[str, float] | None:
    """Return mean, median, and 5 and 95 % quantiles of the values that are not nan; None if all are."""
    known = values[np.isfinite(values)]
    if not len(known):
        return None
    quantiles = zip(("p5", "median", "p95"), np.quantile(known, (0.05, 0.5, 0.95)).tolist(), strict=True)
    return {"mean": float(known.mean()), **dict(quantiles)}


def _sentence(group: str, values: dict[str, Any]) -> str:
    """Return a sentence on how a group arrived, without figures that are None, as they were not measured."""
    parts = [f"{values['arrived']} of {values['characters']} arrived"]
    for column, unit in (("travel_time", " s"), ("way", " m"), ("detour", ""), ("waiting", " s")):
        if values[column] is not None:
            parts.append(f"{column.replace('_', ' ')} {values[column]['median']:.3g}{unit}")
    return f"{group}: {', '.join(parts)} (medians)." if len(parts) > 1 else f"{group}: {parts[0]}."
