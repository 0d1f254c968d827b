"""Analyze a recording: make the measurements that are wanted, for tables, pictures and one page."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from crowdsim.analysis.company import measure_behaviors, measure_distances
from crowdsim.analysis.densities import (
    VORONOI_RATE,
    fundamental_diagram,
    levels_of_service,
    measure_areas,
)
from crowdsim.analysis.flows import measure_flow
from crowdsim.analysis.leaving import measure_evacuation, measure_groups
from crowdsim.analysis.maps import measure_maps
from crowdsim.analysis.pedpy_library import pedpy
from crowdsim.analysis.places import places_of
from crowdsim.analysis.results import Places, Result
from crowdsim.analysis.tracks import Tracks, read_tracks
from crowdsim.errors import CrowdSimError
from crowdsim.recording.reader import Recording
from crowdsim.yamlfile.messages import nearest

# Functions that make results: from tracks and places; and from measurements in areas, which are made once for both.
_DIRECT: dict[str, Callable[[Tracks, Places], Result]] = {
    "evacuation": measure_evacuation,
    "groups": measure_groups,
    "flow": measure_flow,
    "maps": measure_maps,
    "distances": measure_distances,
    "behaviors": measure_behaviors,
}
_OF_AREAS = {"diagram": fundamental_diagram, "service": levels_of_service}

MEASUREMENTS = ("evacuation", "groups", "flow", "diagram", "service", "maps", "distances", "behaviors")
"""Names of the results, in the order in which they are shown."""

LEAST_RATE = 0.001
"""Least rate at which areas are measured [1/s]: about every quarter of an hour."""


class Analysis(NamedTuple):
    """All that was measured in a recording.

    Attributes
    ----------
    tracks : Tracks
        Its tracks.
    places : Places
        Areas and lines.
    results : tuple of Result
        The results, in the order of MEASUREMENTS.
    """

    tracks: Tracks
    places: Places
    results: tuple[Result, ...]

    def values(self) -> dict[str, Any]:
        """Return all figures, for programs and JSON; None stands for those that are unknown or infinite."""
        recording = self.tracks.recording
        return {
            "recording": recording.path.name,
            "scenario": recording.header.scenario_name,
            "seed": recording.header.seed,
            "state_hash": recording.summary.get("state_hash"),
            "duration": recording.duration,
            "complete": recording.complete,
            "frames_per_second": self.tracks.rate,
            "measured_by": f"PedPy {pedpy.__version__}",
            "notes": list(self.tracks.notes),
            **{result.name: _plain(result.values) for result in self.results},
        }


def _plain(value: Any) -> Any:
    """Return values for JSON, with None instead of nan and infinity, which JSON does not have."""
    if isinstance(value, dict):
        return {key: _plain(inner) for key, inner in value.items()}
    if isinstance(value, list):
        return [_plain(inner) for inner in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def analyze(
    recording: Recording,
    *,
    lines: Sequence[str] = (),
    areas: Sequence[str] = (),
    rate: float | None = None,
    voronoi_rate: float = VORONOI_RATE,
    only: Sequence[str] = (),
) -> Analysis:
    """Make the measurements of a recording that are wanted.

    Parameters
    ----------
    recording : Recording
        The recording.
    lines, areas : sequence of str
        Further lines and areas beside those of the scenario, as ``door=10,4.5,10,5.5`` [m].
    rate : float or None
        Frames per second [1/s], a divisor of the recording's; by default up to 10.
    voronoi_rate : float
        Times a second at which areas are measured [1/s], LEAST_RATE at least.
    only : sequence of str
        Names of MEASUREMENTS; by default all.

    Raises
    ------
    CrowdSimError
        If a place, a rate or a name is wrong, or the recording is damaged or too old.
    """
    for name in only:
        if name not in MEASUREMENTS:
            raise CrowdSimError(f"there is no measurement '{name}'; {nearest(name, MEASUREMENTS, 'there are')}")
    if not voronoi_rate >= LEAST_RATE:
        raise CrowdSimError(f"a rate of {voronoi_rate:g} a second is below {LEAST_RATE:g}; leave it out, or give 2")
    wanted = [name for name in MEASUREMENTS if not only or name in only]
    places = places_of(recording.header, lines, areas)
    tracks = read_tracks(recording, rate)
    measured = measure_areas(tracks, places, voronoi_rate) if any(name in _OF_AREAS for name in wanted) else None
    results = []
    for name in wanted:
        if name in _DIRECT:
            results.append(_DIRECT[name](tracks, places))
        elif measured is not None:
            results.append(_OF_AREAS[name](measured, tracks))
    return Analysis(tracks, places, (*results,))
