"""Run points one after the other in one process, which keeps kernels, motion and maps between runs."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal, NamedTuple

from crowdsim.behaviors.library import BehaviorSet
from crowdsim.crowd.simulation import Simulation
from crowdsim.crowd.state.assets import load_behaviors, motion_key
from crowdsim.errors import CrowdSimError
from crowdsim.recording.reader import Recording
from crowdsim.scenario.loader import parse_scenario
from crowdsim.scenario.scenario import Scenario
from crowdsim.sweeps.points import Point

Keep = Literal["none", "recordings", "failures"]
"""Which recordings stay: none, all, or those of runs in which not all agents arrive."""

MOST_KEPT = 4
"""Number of sets of behaviors that a process keeps."""

TIMED = ("real_time_factor", "searches.first_movement_ms")
"""Figures of a summary that depend on the machine; a sweep leaves them out, so that it is the same on any."""

Value = float | int | str | None


class Outcome(NamedTuple):
    """The outcome of a point: the figures of its run, or an error.

    Attributes
    ----------
    figures : dict
        Figures of the run, by name; empty if it failed.
    error : str
        What went wrong, empty if nothing did.
    lasting : bool
        Whether another run would give the same: False if a process died, a bug showed, or a file could not be read or
        written, as on a full disk.
    """

    figures: dict[str, Value]
    error: str = ""
    lasting: bool = True


class Runner:
    """Run points; runs of scenarios with the same motion and layers share what was loaded and computed for them.

    ``recordings`` is the folder for the recordings that stay, None if none does; ``keep`` says which stay.
    """

    def __init__(self, recordings: Path | None = None, keep: Keep = "none") -> None:
        self._recordings, self._keep = recordings, keep
        self._motion: dict[tuple[Any, ...], BehaviorSet] = {}

    def run(self, point: Point) -> Outcome:
        """Run a point with one thread; errors become outcomes."""
        try:
            return Outcome(self._run(point))
        except (CrowdSimError, OSError) as error:
            return Outcome({}, " / ".join(str(error).splitlines()), lasting=not _is_of_files(error))
        except Exception as error:
            what = ": ".join([type(error).__name__, *str(error).splitlines()[:1]])
            return Outcome({}, f"internal error: {what}", lasting=False)

    def _run(self, point: Point) -> dict[str, Value]:
        """Run a point; return its figures, and keep its recording if :func:`is_kept` says so."""
        scenario = parse_scenario(point.text, Path(point.file), point.overrides)
        # Beside the recordings, so that one that stays is renamed, not copied.
        with tempfile.TemporaryDirectory(prefix=".run-", dir=self._recordings) as folder:
            file = Path(folder) / f"{point.name}.h5"
            simulation = Simulation(scenario, workers=1, behavior_set=self._motion_of(scenario))
            with simulation.run(file) as recording:
                figures = figures_of(recording)
            if self._recordings is not None and is_kept(figures, self._keep):
                os.replace(file, self._recordings / file.name)
        return figures

    def _motion_of(self, scenario: Scenario) -> BehaviorSet:
        """Return behaviors and motion graph of a scenario, shared by all scenarios with the same motion and layers.

        Up to MOST_KEPT sets are kept; before one more is loaded, the one that was loaded first is dropped.
        """
        key = motion_key(scenario)
        if key not in self._motion:
            while len(self._motion) >= MOST_KEPT:
                del self._motion[next(iter(self._motion))]
            self._motion[key] = load_behaviors(scenario)
        return self._motion[key]


def is_kept(figures: Mapping[str, Value], keep: Keep) -> bool:
    """Return whether ``keep`` names the recording of a run with these figures."""
    return keep == "recordings" or (keep == "failures" and figures["arrived"] != figures["characters"])


def _is_of_files(error: BaseException | None) -> bool:
    """Return whether an error, or one that led to it, is that a file cannot be read or written."""
    while error is not None and not isinstance(error, OSError):
        error = error.__cause__ or error.__context__
    return error is not None


def figures_of(recording: Recording) -> dict[str, Value]:
    """Return the figures of a run by name: its summary without TIMED, and when 50, 95 and 100 % have arrived [s]."""
    figures = {
        name: value
        for name, value in _flat(recording.summary, "")
        if not any(name == timed or name.startswith(f"{timed}_") for timed in TIMED)
    }
    return {**figures, **{f"t{share}": recording.agent_times.until_share(share) for share in (50, 95, 100)}}


def _flat(values: Mapping[str, Any], prefix: str) -> list[tuple[str, Value]]:
    """Return dotted names and values of nested mappings, each name with ``prefix`` before it.

    The value of a list is its length; so is that of ``unreachable``, which holds reasons by agent.
    """
    found: list[tuple[str, Value]] = []
    for key, value in values.items():
        name = f"{prefix}{key}"
        if name == "unreachable" or isinstance(value, list):
            found.append((name, len(value)))
        elif isinstance(value, Mapping):
            found += _flat(value, f"{name}.")
        else:
            found.append((name, value))
    return found
