"""The table that closes a run."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

_ROWS = {
    "characters": ("characters", "{:d}"),
    "arrived": ("arrived", "{:d}"),
    "steps": ("steps", "{:d}"),
    "mean_time": ("mean time", "{:.1f} s"),
    "behavior_share": ("share of the way", ""),
    "behavior_share_by_area": ("", ""),
    "closest_pair": ("closest pair, body to body", "{:.3f} m"),
    "stance_foot_speed": ("stance-foot speed, mean", "{:.3f} m/s"),
    "lowest_foot": ("lowest foot", "{:.3f} m"),
    "real_time_factor": ("real-time factor", "{:.1f}"),
    "state_hash": ("state hash", "{}"),
    "recording": ("recording", "{}"),
}
"""Key of the summary -> (label, format), in the order shown; a key that a run does not report is left out."""


def summary_rows(summary: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Rows (label, value) of a run's summary."""
    rows = []
    for key, (label, form) in _ROWS.items():
        value = summary.get(key)
        if key == "behavior_share_by_area":
            rows += [(f"  in {area}", _shares(shares)) for area, shares in (value or {}).items()]
        elif key == "behavior_share":
            rows += [(label, _shares(value))] if value else []
        elif key in summary:
            rows.append((label, "-" if value is None else form.format(value)))
    return rows


def _shares(shares: Mapping[str, float]) -> str:
    present = [f"{name} {share:.0%}" for name, share in shares.items() if share > 0]
    return ", ".join(present) or "nobody came by"
