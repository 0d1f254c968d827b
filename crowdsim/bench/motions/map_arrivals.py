"""Accuracy of motions that must end standing, with a heading, or both; with and without branch kinematics."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from crowdsim.bench.motions.map_trials import FOUND, TOLERANCE, Ground, MotionSet, Trial, follow_trial, most_excess
from crowdsim.following.follower.exact_following import follow_exactly
from crowdsim.following.follower.follow_options import FollowOptions
from crowdsim.following.follower.path_follower import FollowResult
from crowdsim.following.maps.motion_maps import MotionMaps
from crowdsim.geometry.planar import compose, wrap_angle

Floats = NDArray[np.float64]

ARRIVAL = 0.01
"""Distance from the goal within which a motion with branch kinematics must end [m]."""

EXCESS = 0.02
"""Largest distance by which a joint may leave its section [m]."""

_KEYS = {
    "standing": "to a stand",
    "exact": "to a stand, bent",
    "heading": "with a heading",
    "exact_heading": "to a stand with a heading, bent",
}


class Arrival(NamedTuple):
    """End of a motion that was found.

    Attributes
    ----------
    off : float
        Distance from the goal [m].
    degrees : float
        Difference from the required heading [degrees], 0 if there is none.
    excess : float
        Largest distance by which a joint leaves its section [m].
    """

    off: float
    degrees: float
    excess: float


def measure_arrivals(
    motions: MotionSet, maps: MotionMaps, ground: Ground, name: str
) -> tuple[list[dict[str, Any]], dict[str, float]]:
    """Return rows and figures, one row for each search of _KEYS: trials solved, and those that meet their requirements.

    Required headings are arbitrary for the built-in set, which has turns on the spot, and within 30 degrees of the
    path's end for captured walks. Motions that need only a heading do not have to stand, unless branch kinematics is
    used. A motion meets its requirements if it ends within ARRIVAL (with branch kinematics) or TOLERANCE of the goal
    and 15 degrees of the heading, as searches have to, and no joint leaves its section by more than EXCESS. Largest
    distances, angles and excesses are -1 if no motion is found. Names of figures end with ``name``.
    """
    spread = np.pi if motions.name == "default" else np.radians(30.0)
    turns = np.random.default_rng(1).uniform(-spread, spread, len(ground.trials))
    headings = [
        float(wrap_angle(trial.samples.pose[-1, 2] + turn)) for trial, turn in zip(ground.trials, turns, strict=True)
    ]
    options = FollowOptions(goal_tolerance=TOLERANCE, budget=2_000)

    def plain(trial: Trial, wanted: FollowOptions) -> FollowResult:
        """Follow a trial without branch kinematics."""
        return follow_trial(motions, maps, ground, trial, wanted)

    def bent(trial: Trial, wanted: FollowOptions) -> FollowResult:
        """Follow a trial to within ARRIVAL of its goal by branch kinematics, with a larger budget."""
        where = motions.character(maps), trial.samples, ground.arrays, trial.start, motions.waiting
        return follow_exactly(*where, replace(wanted, budget=4_000), ARRIVAL)[0]

    rows: list[dict[str, Any]] = []
    figures: dict[str, float] = {}
    for key, search in _KEYS.items():
        asked = headings if "heading" in key else [None] * len(headings)
        wanted = [replace(options, goal_heading=turn, end_standing=key == "standing") for turn in asked]
        how = bent if key.startswith("exact") else plain
        arrivals, ms = _arrivals(motions, ground, wanted, how)
        bar = ARRIVAL if how is bent else TOLERANCE
        held = sum(one.off <= bar and one.degrees <= 15.0 and one.excess <= EXCESS for one in arrivals)
        trials, most = len(ground.trials), np.max(arrivals, axis=0, initial=-1.0) if arrivals else np.full(3, -1.0)
        row: dict[str, Any] = {
            "table": "arrivals",
            "set": motions.name,
            "search": search,
            "trials": trials,
            "success_percent": round(100.0 * len(arrivals) / trials, 2),
            "held_percent": round(100.0 * held / max(len(arrivals), 1), 2),
            "median_ms": round(float(np.median(ms)), 3),
            "mean_ms": round(float(ms.mean()), 3),
            "off_m": round(float(most[0]), 4),
            "off_degrees": round(float(most[1]), 2),
            "excess_m": round(float(most[2]), 4),
        }
        rows.append(row)
        figures[f"{key}_success_{name}"] = row["success_percent"]
        figures[f"{key}_held_percent_{name}"] = row["held_percent"]
        figures[f"{key}_off_m_most_{name}"] = row["off_m"]
        figures[f"{key}_off_degrees_most_{name}"] = row["off_degrees"]
    return rows, figures


def _arrivals(
    motions: MotionSet,
    ground: Ground,
    wanted: list[FollowOptions],
    how: Callable[[Trial, FollowOptions], FollowResult],
) -> tuple[list[Arrival], Floats]:
    """Follow each trial by the function ``how`` with its options in ``wanted``.

    Return the ends of the motions that are found, and the times of all trials [ms].
    """
    how(ground.trials[0], wanted[0])  # compiles kernels
    arrivals, ms = [], []
    for trial, options in zip(ground.trials, wanted, strict=True):
        begin = time.perf_counter()
        found = how(trial, options)
        ms.append((time.perf_counter() - begin) * 1e3)
        if found.status == FOUND:
            end = compose(found.origins[-1], motions.graph.node_motion[found.nodes[-1]])
            off = float(np.hypot(*(end[:2] - trial.points[-1])))
            turned = 0.0 if options.goal_heading is None else abs(float(wrap_angle(end[2] - options.goal_heading)))
            arrivals.append(Arrival(off, float(np.degrees(turned)), most_excess(motions, trial, found)))
    return arrivals, np.array(ms)
