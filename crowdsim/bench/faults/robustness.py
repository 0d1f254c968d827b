"""Files, caches and meshes with random faults, counted by outcome: read, refused, made again, failed."""

from __future__ import annotations

import os
from typing import Any

from crowdsim.bench.faults.watched import run_cases
from crowdsim.bench.registry import Measurement
from crowdsim.errors import CrowdSimError

SHARE = "CROWDSIM_FAULT_SHARE"
"""Environment variable: the share of all cases to run, 1 by default."""

_CASES = {
    "edits of meshes": ("edited_mesh", 31_250),
    "scenarios": ("mutated_scenario", 10_000),
    "BVH": ("mutated_clip", 2_000),
    "recordings": ("mutated_recording", 2_000),
    "motion maps": ("damaged_map", 250),
    "kernels": ("damaged_kernel", 250),
    "killed runs": ("killed_run", 100),
}
"""Subject -> (case, number of cases); a sequence of edits has 32 edits on average."""


def measure() -> Measurement:
    """Run all cases in watched processes; every ``failed`` must be 0."""
    rows: list[dict[str, Any]] = []
    figures: dict[str, float] = {}
    for what, (case, count) in _CASES.items():
        tally = run_cases(f"crowdsim.bench.faults.cases:{case}", range(max(1, round(count * _share()))), seconds=120.0)
        found = {kind: tally.outcomes.get(kind, 0) for kind in ("fine", "refused", "anew")}
        worst = f"{tally.failures[0][0]}: {tally.failures[0][1]}" if tally.failures else ""
        rows.append(
            {"faults in": what, "cases": sum(tally.outcomes.values()), **found, "failed": tally.failed, "first": worst}
        )
        figures[f"{what.replace(' ', '_')}_failed"] = float(tally.failed)
    return Measurement(rows, figures)


def _share() -> float:
    """Return the share of cases to run, in (0, 1], from the environment; raise CrowdSimError for any other value."""
    text = os.environ.get(SHARE, "1")
    try:
        share = float(text)
    except ValueError:
        share = 0.0
    if not 0.0 < share <= 1.0:
        raise CrowdSimError(f"{SHARE}: {text!r} is no share above 0 and up to 1")
    return share
