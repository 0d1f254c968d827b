"""Precomputed motion maps (2012 paper, tables 1 to 6): cost of maps, success along paths, and search time.

Trials are those of :mod:`crowdsim.bench.motions.map_trials`. Times are milliseconds of one thread, the best of three
for each trial. All joints keep within the clearance of the path, except in rows that say otherwise.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from crowdsim.bench.motions.map_arrivals import measure_arrivals
from crowdsim.bench.motions.map_trials import (
    CLEARANCE,
    FOUND,
    TOLERANCE,
    Ground,
    MotionSet,
    Trial,
    as_trial,
    best_of,
    follow_all,
    follow_trial,
    load_set,
    load_standard,
    make_ground,
    most_excess,
    walked,
)
from crowdsim.bench.registry import Measurement
from crowdsim.following.follower.follow_options import FollowOptions
from crowdsim.following.follower.path_follower import FollowResult, FollowStatus
from crowdsim.following.graph_search.channel import make_channel
from crowdsim.following.graph_search.graph_search import SearchOptions, search_graph
from crowdsim.following.graph_search.probes import body_probes
from crowdsim.following.maps.map_file import maps_in_file
from crowdsim.following.maps.motion_maps import MotionMaps

PAPER_ENTRIES = 70_117
"""Entries of all maps together in the paper, at its depth of 12."""

ENTRIES = (2_000, 20_000, PAPER_ENTRIES, 200_000, 1_000_000, 10_000_000)
"""Sizes to measure: entries of all maps together."""

STANDARD_ENTRIES = (PAPER_ENTRIES, 1_000_000, 10_000_000)
"""Sizes for standard graphs, whose nodes are many and short."""

ASTAR_BUDGET = 20_000
"""Largest number of nodes that A* expands."""

_COLUMNS = tuple(
    (
        "table set search depth entries cells mb build_s load_ms trials success_percent "
        "median_ms mean_ms length_m path_m length_ratio held_percent off_m off_degrees excess_m"
    ).split()
)


def measure(
    captures: Path | None = None,
    trials: int = 1000,
    entries: Sequence[int] = ENTRIES,
    beside: int = 40,
    astar_budget: int = ASTAR_BUDGET,
    depth: dict[str, Any] | None = None,
) -> Measurement:
    """Measure all tables for the built-in set, and for the walks in the folder ``captures`` if given.

    Parameters
    ----------
    captures : Path or None
        Folder of captures.
    trials : int
        Number of paths; a tenth of them for standard graphs.
    entries : sequence of int
        Sizes of maps to try with a fifth of the trials; maps as in runs come last, with all trials. For standard graphs
        they are those of STANDARD_ENTRIES up to the largest of these.
    beside : int
        Number of trials that are also searched with A*; a quarter of it for standard graphs.
    astar_budget : int
        Largest number of nodes that A* expands; a tenth of it for standard graphs.
    depth : dict or None
        Size arguments of :meth:`MotionMaps.build`, measured instead of ``entries`` and the maps of runs; then without
        standard graphs.
    """
    rows: list[dict[str, Any]] = []
    figures: dict[str, float] = {}
    entries = entries if depth is None else ()
    sets = [load_set("default", None)] + ([] if captures is None else [load_set("captures", captures)])
    for motions in sets:
        ground = make_ground(len(motions.radii) - 1, trials)
        _measure_set(motions, ground, entries, depth, beside, astar_budget, rows, figures)
    sizes = [size for size in STANDARD_ENTRIES if size <= max(entries, default=0)]
    for motions, folder in zip(sets, (None, captures), strict=False):
        if sizes:
            _measure_standard(
                motions, folder, sizes, max(trials // 10, 1), beside // 4, astar_budget // 10, rows, figures
            )
    names = [motions.name for motions in sets]
    # Figures whose worst value over all sets is a figure, too.
    worst = {
        "search_ms_median": max,
        "length_ratio_mean": max,
        "ratio_astar_over_maps": min,
        "maps_mb": max,
        "maps_s": max,
    }
    for name, of in worst.items():
        each = [figures[f"{name}_{which}"] for which in names if f"{name}_{which}" in figures]
        if each:
            figures[name] = of(each)
    headline = [*[f"success_{name}" for name in names], *worst]
    table = [{key: row.get(key) for key in _COLUMNS} for row in rows]
    return Measurement(table, figures, tuple(name for name in headline if name in figures))


def _measure_standard(
    features: MotionSet,
    captures: Path | None,
    sizes: Sequence[int],
    trials: int,
    beside: int,
    budget: int,
    rows: list[dict[str, Any]],
    figures: dict[str, float],
) -> None:
    """Add to ``rows`` and ``figures`` those of the standard graph of a set's clips, with maps of ``sizes`` entries."""
    standard = load_standard(f"{features.name}, standard graph", captures, features)
    ground = make_ground(0, trials)
    for count in sizes:  # what follows the loop is of the last, largest maps
        maps, row = _built(standard, count)
        found = follow_all(standard, maps, ground)
        rows.append(row | _summary(standard, ground, found))
        del maps
    figures[f"success_standard_{features.name}"] = rows[-1]["success_percent"]
    rows += _beside_astar(standard, ground, found, beside, budget)[0]


def _measure_set(
    motions: MotionSet,
    ground: Ground,
    entries: Sequence[int],
    depth: dict[str, Any] | None,
    beside: int,
    budget: int,
    rows: list[dict[str, Any]],
    figures: dict[str, float],
) -> None:
    """Add to ``rows`` and ``figures`` those of one set of motions; the parameters are as of :func:`measure`."""
    name = motions.name
    # Maps of several sizes, along a fifth of the paths.
    fewer = Ground(ground.meshes, ground.trials[: max(len(ground.trials) // 5, 1)])
    for count in entries:
        maps, row = _built(motions, count)
        rows.append(row | _summary(motions, fewer, follow_all(motions, maps, fewer)))
        del maps
        if count == PAPER_ENTRIES:
            figures |= _costs(row, name)
    # Maps of ``depth``, or as in runs, along all paths.
    maps, row = _built(motions, None, depth)
    if PAPER_ENTRIES not in entries:
        figures |= _costs(row, name)
    found = follow_all(motions, maps, ground)
    rows.append(row | _summary(motions, ground, found))
    figures[f"success_{name}"] = rows[-1]["success_percent"]
    figures[f"search_ms_median_{name}"] = rows[-1]["median_ms"]
    figures[f"length_ratio_mean_{name}"] = rows[-1]["length_ratio"]
    figures |= _of_bodies(motions, ground, found, name)
    # The same maps, but joints may leave the clearance: only the discs of the behaviors are kept clear.
    freely = replace(motions, reach=None)
    free = follow_all(freely, maps, fewer)
    rows.append(row | _summary(freely, fewer, free) | {"search": "maps, discs alone"})
    figures |= _of_bodies(motions, fewer, free, f"discs_alone_{name}")
    arrivals, ends = measure_arrivals(motions, maps, fewer, name)
    rows += arrivals
    figures |= ends
    figures[f"first_movement_ms_median_{name}"] = _first_movement(motions, maps, ground)
    more, ratios = _beside_astar(motions, ground, found, beside, budget)
    rows += more
    figures |= ratios


def _costs(row: dict[str, Any], name: str) -> dict[str, float]:
    """Return the figures of a set that tell what its maps cost: size [MB], time to build [s] and to load [ms]."""
    return {f"maps_mb_{name}": row["mb"], f"maps_s_{name}": row["build_s"], f"load_ms_{name}": row["load_ms"]}


def _built(
    motions: MotionSet, entries: int | None, depth: dict[str, Any] | None = None
) -> tuple[MotionMaps, dict[str, Any]]:
    """Return maps with ``entries`` entries, or of ``depth``, or as in runs if both are None; and their cost."""
    graph = motions.graph
    sizes = depth or {}
    if entries is not None:  # depth and reach [m] so large that the number of entries alone ends a map
        sizes = {"depth": 64, "reach": 1e3, "max_entries": max(entries // len(graph.node_frames), 1)}
    MotionMaps.build(graph, depth=1)  # compiles kernels
    begin = time.perf_counter()
    maps = MotionMaps.build(graph, **sizes)
    seconds = time.perf_counter() - begin
    with tempfile.TemporaryDirectory() as folder:
        maps_in_file(Path(folder), graph, **sizes)
        loaded, load_ms = best_of(lambda: maps_in_file(Path(folder), graph, **sizes))
        assert loaded.entry_count == maps.entry_count
        del loaded
    row = {
        "table": "maps",
        "set": motions.name,
        "search": "maps" if entries is not None or depth else "maps of runs",
        "depth": maps.depth,
        "entries": maps.entry_count,
        "cells": maps.cell_count,
        "mb": round(maps.bytes / 1e6, 3),
        "build_s": round(seconds, 4),
        "load_ms": round(load_ms, 3),
    }
    return maps, row


def _summary(
    motions: MotionSet, ground: Ground, found: Sequence[tuple[Any, float]], compared: Sequence[int] | None = None
) -> dict[str, Any]:
    """Return success over all trials, times, and lengths of motions relative to their paths.

    found: result and time [ms] of each trial. compared: trials whose times and lengths count, all of them solved; by
    default the times of all trials and the lengths of the solved ones.
    """
    good = [i for i, (result, _) in enumerate(found) if result.status == FOUND]
    timed, gone = (range(len(found)), good) if compared is None else (compared, compared)
    row: dict[str, Any] = {
        "trials": len(found),
        "success_percent": round(100.0 * len(good) / max(len(found), 1), 2),
    }
    if len(timed):
        ms = np.array([found[i][1] for i in timed])
        row |= {"median_ms": round(float(np.median(ms)), 3), "mean_ms": round(float(ms.mean()), 3)}
    if len(gone):
        paths = np.array([ground.trials[i].samples.arc[-1] for i in gone])
        lengths = np.array([walked(motions.graph, found[i][0], ground.trials[i].points[-1]) for i in gone])
        row |= {"length_m": round(float(lengths.mean()), 3), "path_m": round(float(paths.mean()), 3)}
        row["length_ratio"] = round(float((lengths / paths).mean()), 4)
    return row


def _of_bodies(
    motions: MotionSet, ground: Ground, found: Sequence[tuple[FollowResult, float]], name: str
) -> dict[str, float]:
    """Return figures over all motions found: how far joints leave the clearance of the path at most [m], and how often.

    The second is the percentage of motions in which they leave it by 2 cm at most. Without motions they are inf and 0.
    """
    excess = [
        most_excess(motions, trial, result)
        for trial, (result, _) in zip(ground.trials, found, strict=True)
        if result.status == FOUND
    ]
    table = np.array(excess or [np.inf])
    return {
        f"joints_excess_m_most_{name}": float(table.max()),
        f"joints_within_2_cm_percent_{name}": 100.0 * float((table <= 0.02).mean()),
    }


def _first_movement(motions: MotionSet, maps: MotionMaps, ground: Ground) -> float:
    """Return the median time from a start and a goal to a playable motion (path, samples, search) [ms]."""
    options = FollowOptions(goal_tolerance=TOLERANCE, budget=2_000)
    behavior = len(motions.radii) - 1

    def answer(trial: Trial) -> FollowResult:
        """Find a path between the ends of a trial, and a motion along it."""
        path = ground.meshes[0].find_path(trial.points[0], trial.points[-1], CLEARANCE)
        return follow_trial(motions, maps, ground, as_trial(np.array(path.points), behavior), options)

    return float(np.median([best_of(partial(answer, trial))[1] for trial in ground.trials[:200]]))


def _beside_astar(
    motions: MotionSet, ground: Ground, found: Sequence[tuple[FollowResult, float]], beside: int, budget: int
) -> tuple[list[dict[str, Any]], dict[str, float]]:
    """Return rows and figures of tables 5 and 6: A*, and A* in the channel, each compared with maps on the same trials.

    These are the first ``beside`` trials; ``found`` holds what maps find in all trials, see :func:`_summary`.
    ``budget`` is the largest number of nodes that A* expands.
    """
    probes = body_probes(motions.graph, motions.radii)
    options = SearchOptions(goal_tolerance=TOLERANCE, on_the_way=True, branch_kinematics=False, budget=budget)
    chosen = range(min(beside, len(found)))
    searches: dict[str, list[tuple[Any, float]]] = {"A*": [], "A*-Ch": [], "maps": [found[i] for i in chosen]}
    for i in chosen:
        trial = ground.trials[i]
        wheres: tuple[tuple[str, dict[str, Any]], ...] = (
            ("A*", {"meshes": ground.arrays}),
            ("A*-Ch", {"channel": make_channel(trial.points, CLEARANCE)}),
        )
        for name, where in wheres:
            begin = time.perf_counter()
            result = search_graph(
                motions.graph, probes, trial.start, motions.waiting, trial.points[-1], options=options, **where
            )
            searches[name].append((result, (time.perf_counter() - begin) * 1e3))
    rows, figures = [], {}
    for name, key in (("A*", "astar"), ("A*-Ch", "channel")):
        both = [i for i in chosen if searches[name][i][0].status == searches["maps"][i][0].status == FOUND]
        rows += [
            {"table": f"beside {name}", "set": motions.name, "search": s} | _summary(motions, ground, searches[s], both)
            for s in (name, "maps")
        ]
        figures[f"solved_by_{key}_and_maps_{motions.name}"] = float(len(both))
        # Trials that exceed the budget of A* would take even longer, so with them the ratio is a lower bound. Trials
        # that A* proves to be unsolvable are not compared.
        tried = [i for i in chosen if searches[name][i][0].status != FollowStatus.BLOCKED]
        for label, those in (("", tried), ("_solved", both)):
            if those:
                ms = {s: np.array([searches[s][i][1] for i in those]) for s in (name, "maps")}
                ratio = f"ratio_{key}_over_maps{label}"
                figures[f"{ratio}_{motions.name}"] = float(ms[name].mean() / ms["maps"].mean())
                figures[f"{ratio}_median_{motions.name}"] = float(np.median(ms[name] / ms["maps"]))
    return rows, figures
