"""How far planted feet drift as recordings show captured bodies, and what pinning them costs.

The built-in corridor and clutter are run; with captures, clutter alone, as the corridor's gaps are made for built-in
bodies. The bars: 1 cm in built-in sets, and for captures 5 mm more than in the clips themselves.
"""

from __future__ import annotations

import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from crowdsim.bench.registry import Measurement
from crowdsim.crowd.simulation import Simulation
from crowdsim.recording.reader import Recording
from crowdsim.recording.shown.foot_drift import shown_stances
from crowdsim.scenario.loader import load_scenario

_BODIES = 2000
"""Number of bodies that are posed at once to measure time."""


def measure(captures: Path | None = None, names: tuple[str, ...] = ("corridor", "clutter")) -> Measurement:
    """Measure the scenarios ``names``, or clutter walked with the captures in the folder ``captures``."""
    options = [] if captures is None else [f"motion={{captures: {captures.resolve()}}}"]
    rows = []
    for name in names if captures is None else ("clutter",):
        with (
            tempfile.TemporaryDirectory() as folder,
            Simulation(load_scenario(name, options)) as simulation,
            simulation.run(Path(folder) / f"{name}.h5") as recording,
        ):
            rows.append({"scenario": name, **_figures(recording)})
    return Measurement(rows, {f"{row['scenario']}_{key}": row[key] for row in rows for key in row if key != "scenario"})


def _figures(recording: Recording) -> dict[str, Any]:
    """Return drifts of stances as shown, in the clips (own), and what showing adds [cm], and times.

    The times are those to follow the feet of a step [ms] and to pose a body [us].
    """
    begin = time.perf_counter()
    recording.planted_feet  # noqa: B018  (follows the feet of all steps)
    following = time.perf_counter() - begin
    found = shown_stances(recording)
    return {
        "stances": len(found.shown),
        "most_cm": round(100.0 * float(found.shown.max()), 2),
        "own_most_cm": round(100.0 * float(found.own.max()), 2),
        "added_most_cm": round(100.0 * float((found.shown - found.own).max()), 2),
        "added_p95_cm": round(100.0 * float(np.quantile(found.shown - found.own, 0.95)), 2),
        "following_ms_a_step": round(1e3 * following / recording.steps, 3),
        "posing_us_a_body": round(_posing(recording), 1),
    }


def _posing(recording: Recording) -> float:
    """Return the time to pose a captured body in the middle of a recording [us], of _BODIES at once."""
    moment = 0.5 * recording.duration
    frame = recording.at_time(moment)
    agents = np.resize(np.flatnonzero(frame.node >= 0), _BODIES)
    tracks = np.stack([frame.x, frame.y, frame.heading], axis=1)[agents]
    played = frame.node[agents], frame.previous[agents], frame.frame[agents]
    begin = time.perf_counter()
    recording.played_poses(moment, agents, *played, tracks)
    return 1e6 * (time.perf_counter() - begin) / _BODIES
