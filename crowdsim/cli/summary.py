"""The summary table of a run."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

import typer

from crowdsim.cli.errors_shown import NOBODY_ARRIVED
from crowdsim.cli.tables import print_table

_ON_TIME = 0.1
"""Largest delay of an event that is not reported [s]: every event waits for the next step."""


_NAMED = 5
"""Number of agents of a group that are named in one line."""

_FAR = "none within 1 m"
"""What is said of the closest two if none came within CENTER_LIMIT, up to which runs with steered agents measure."""

_NEVER = {
    "waiting": "never: an agent was in the way until the end",
    "overtaken": "never: an agent was in the way until the next event",
}


def tell_summary(summary: dict[str, Any], as_json: bool) -> None:
    """Print the summary of a run; if nobody could arrive, also print why, and exit with NOBODY_ARRIVED."""
    if as_json:
        typer.echo(json.dumps(summary))
    else:
        print_table(summary_rows(summary))
    why = nobody_arrived(summary)
    if why is not None:
        typer.echo(f"nobody arrived: {why}", err=True)
        raise typer.Exit(NOBODY_ARRIVED)


def nobody_arrived(summary: Mapping[str, Any]) -> str | None:
    """Return why no agent arrived; None if one arrived or made a round, or if no reason is known.

    Known reasons: every agent lacks a way or waits, and at least one lacks a way; or no agent ever appeared. Agents
    that commands removed or never added do not count.
    """
    count = summary["characters"] - summary["removed"] - summary["not_added"]
    lost, waiting = summary["unreachable"], summary["waiting"] or 0
    if summary["arrived"] or any(summary["laps"].values()):
        return None
    if lost and len(lost) + waiting >= count:
        return f"no way for {len(lost)} of {count} agents, {waiting} still waited; {next(iter(lost.values()))}"
    if summary["lowest_foot"] is None:  # no foot was ever there
        return f"no agent appeared within {summary['steps']} steps; check start times and start places"
    return None


def summary_rows(summary: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Return rows (label, value) of a run's summary."""
    areas = summary["behavior_share_by_area"]
    margins, bodies = summary["obstacle_margin"], summary.get("closest_bodies")
    return [
        ("characters", str(summary["characters"])),
        ("arrived", str(summary["arrived"])),
        *([("  removed", str(summary["removed"]))] if summary.get("removed") else []),
        *([("  on call, never added", str(summary["not_added"]))] if summary.get("not_added") else []),
        *_left_rows(summary),
        *((f"  no way for agent {agent}", reason) for agent, reason in summary["unreachable"].items()),
        *((f"rounds of {group}", str(count)) for group, count in summary["laps"].items()),
        *((f"left through {name}", _left(exit_)) for name, exit_ in summary["exits"].items()),
        *_event_rows(summary),
        *_stand_rows(summary["stands"]),
        *([_search_row(summary["searches"])] if summary["searches"] else []),
        ("steps", str(summary["steps"])),
        ("mean time to arrive", _quantity(summary["mean_time"], "{:.1f} s")),
        ("share of the way", _shares(summary["behavior_share"])),
        *((f"  in {area}", _shares(shares)) for area, shares in areas.items()),
        *_level_rows(summary),
        *_measured_rows(summary),
        ("closest two, center to center", _quantity(summary["closest_pair"], "{:.3f} m", _FAR)),
        *([] if bodies is None else [("  body to body", f"{bodies:.3f} m")]),
        *((f"body to obstacle, {layer}", _quantity(margin, "{:.3f} m")) for layer, margin in margins.items()),
        ("stance-foot speed", _quantity(summary["stance_foot_speed"], "{:.3f} m/s")),
        ("lowest foot", _quantity(summary["lowest_foot"], "{:.3f} m")),
        ("real-time factor", _quantity(summary["real_time_factor"], "{:.1f}")),
        ("state hash", summary["state_hash"]),
        ("recording", summary["recording"]),
        *([("page", summary["page"])] if "page" in summary else []),
    ]


def _left_rows(summary: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Return rows (label, text): agents on the way at the end, how many of them waited, and agents that did not enter.

    There is no row for a number of 0. Agents are given by group.
    """
    rows = []
    for label, key in (("  on the way at the end", "on_the_way"), ("  did not enter", "not_entered")):
        groups = {name: agents for name, agents in summary[key].items() if agents}
        if groups:
            rows.append((label, "; ".join(f"{name} {_numbered(agents)}" for name, agents in groups.items())))
        if groups and key == "on_the_way" and summary["waiting"]:
            rows.append(("    of these, waiting", str(summary["waiting"])))
    return rows


def _numbered(agents: Sequence[int]) -> str:
    """Return how many ``agents`` there are, at least one, and the numbers of the first _NAMED of them."""
    numbers = ", ".join(map(str, agents[:_NAMED])) + (", ..." if len(agents) > _NAMED else "")
    return f"{len(agents)} (agents {numbers})" if len(agents) > 1 else f"1 (agent {numbers})"


def _level_rows(summary: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Return rows (label, text): the share of the way on each level, and the number of switches between levels.

    There are none for a crowd of one level, whose summary has no ``level_share``.
    """
    if "level_share" not in summary:
        return []
    switches = summary["switches"]
    text = f"{_shares(summary['level_share'])}"
    return [
        ("  captured and steered", text),
        ("  changes of level", f"{switches['steered']} to steered, {switches['captured']} to captured"),
    ]


def _left(exit_: Mapping[str, Any]) -> str:
    """Return how many agents left through an exit, and when the last one did."""
    return str(exit_["left"]) if exit_["last"] is None else f"{exit_['left']}, the last one at {exit_['last']:.1f} s"


def _measured_rows(summary: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Return rows (label, text): density and speed in each area, passages and flow at each line."""
    rows = []
    for name, area in summary["areas"].items():
        density, most = (_quantity(area[key], "{:.2f}") for key in ("density", "density_most"))
        rows.append((f"density in {name}", f"{density} /m2, {most} at most; {_quantity(area['speed'], '{:.2f} m/s')}"))
    for name, line in summary["lines"].items():
        text = f"{line['to_left']} to the left, {line['to_right']} to the right"
        if line["flow"] is not None:
            text += f"; {line['flow']:.2f} /s, {_quantity(line['flow_per_m'], '{:.2f}')} /(m s)"
        rows.append((f"passages at {name}", text))
    return rows


def _event_rows(summary: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Return rows (label, text): how many events happened, which late or never, and how many paths were planned again.

    There are none if no event was due. A delay of up to _ON_TIME is not late.
    """
    events = summary["events"]
    if not events:
        return []
    happened = sum(event["outcome"] == "happened" for event in events)
    rows = [("events", f"{happened} of {len(events)} that were due happened")]
    for event in events:
        label = f"  {event['event']} at {event['at']:g} s"
        if event["outcome"] != "happened":
            rows.append((label, _NEVER[event["outcome"]]))
        elif event["late"] > _ON_TIME:
            rows.append((label, f"{event['late']:.1f} s late: an agent was in the way"))
    return [*rows, ("plans made anew for them", str(summary["replans"]))]


def _stand_rows(stands: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Return a row (label, text): how many agents stood at goals, and how far off goals and required headings at most.

    There is none if no agent stood; the heading is left out if none was required.
    """
    if not stands["stood"]:
        return []
    text = f"{stands['stood']}, {100.0 * stands['off_goal_most']:.1f} cm off at most"
    if stands["off_heading_most"] is not None:
        text += f", turned {stands['off_heading_most']:.0f} degrees off at most"
    return [("stands at goals", text)]


def _search_row(searches: Mapping[str, Any]) -> tuple[str, str]:
    """Return label and text: the number of motion searches, what happened to some, and the median time to a motion.

    ``sliced``: searches of more than one slice. ``backtracked``: how often one would have had to change nodes already
    played. ``recovered``: how often a search from behind played nodes found a motion. One search may count several
    times in ``backtracked`` and in ``recovered``. The time is left out if no search has found any nodes.
    """
    text = str(searches["asked"])
    if searches["sliced"]:
        text += f", {searches['sliced']} in several slices"
    if searches["backtracked"]:
        text += f"; {searches['backtracked']} turned back behind nodes already played"
        text += f", {searches['recovered']} found motion from there"
    first = searches["first_movement_ms_median"]
    return "searches for motion", text if first is None else f"{text}; first movement after {first:.1f} ms"


def _quantity(value: float | None, form: str, none: str = "none") -> str:
    """Return a value in a format, as ``{:.1f} s``; ``none`` if it is None."""
    return none if value is None else form.format(value)


def _shares(shares: Mapping[str, float]) -> str:
    """Return the shares above 0 in percent, with their names."""
    present = [f"{name} {share:.0%}" for name, share in shares.items() if share > 0]
    return ", ".join(present) or "no agent went here"
