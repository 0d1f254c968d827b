"""Precomputed motion maps (2012 paper, tables 1 to 6): what maps cost, how often they lead along a path, and how soon.

Trials are random paths of 10 to 18 m with a clearance of 0.5 m through a room of obstacles, as in figure 8, walked from
standing to within 10 cm of the end. Times are milliseconds of one thread, the best of :data:`PASSES` for each trial.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from crowdsim.bench.registry import Measurement
from crowdsim.environment.clutter import draw_clutter
from crowdsim.environment.layers import LEGS, TORSO, clearance_layers
from crowdsim.errors import PathNotFound
from crowdsim.following.channel import make_channel
from crowdsim.following.exact_following import follow_exactly
from crowdsim.following.graph_search import SearchOptions, SearchResult, search_graph
from crowdsim.following.graph_search_kernels import ASIDE_X, X
from crowdsim.following.map_file import maps_in_file
from crowdsim.following.motion_maps import MotionMaps
from crowdsim.following.path_follower import FollowOptions, FollowResult, FollowStatus, follow_path
from crowdsim.following.probes import body_probes, joint_probes
from crowdsim.geometry.planar import compose
from crowdsim.motion.graph_arrays import GraphArrays
from crowdsim.motion.motion_graph import MotionGraph
from crowdsim.navmesh.navmesh import NavMesh
from crowdsim.planning.annotated_path import AnnotatedPath, PathSamples, Section, arc_lengths
from crowdsim.planning.behavior_library import load_behavior_set

Floats = NDArray[np.float64]
FOUND = FollowStatus.FOUND

SIDE = 30.0
"""Meters, side of the room."""

DENSITY = 0.08
"""Share of the floor that obstacles take."""

SIZES = (0.5, 2.0)
"""Meters, least and greatest extent of an obstacle."""

CLEARANCE = 0.5
LENGTHS = (10.0, 18.0)
TOLERANCE = 0.1

ENTRIES = (2_000, 20_000, 70_117, 200_000, 1_000_000)
"""Entries of all maps together: the third is what the paper has at its depth 12."""

ASTAR_BUDGET = 20_000
"""Nodes that A* may expand."""

PASSES = 3

CAPTURED = ("16_1*.bvh", "16_31*", "16_33*", "16_47*", "16_58*")
"""Captured walks, straight ones and turns of one person."""

_COLUMNS = (
    "table", "set", "search", "depth", "entries", "cells", "mb", "build_s", "load_ms", "trials", "success_percent",
    "median_ms", "mean_ms", "length_m", "path_m", "length_ratio",
)  # fmt: skip


class Trial(NamedTuple):
    """A path to be walked: its points, its samples, and the pose to set out from, standing."""

    points: Floats
    samples: PathSamples
    start: Floats


@dataclass(frozen=True)
class MotionSet:
    """A motion graph with what follows paths with it: body radii (B, 2), facings (B, F), the node that waits."""

    name: str
    motion: MotionGraph
    radii: Floats
    facings: Floats
    waiting: int

    @property
    def graph(self) -> GraphArrays:
        return self.motion.arrays


@dataclass(frozen=True)
class Ground:
    """Meshes of legs and torso, and trials on them."""

    meshes: tuple[NavMesh, NavMesh]
    trials: list[Trial]

    @property
    def arrays(self) -> tuple[Any, Any]:
        return self.meshes[0].arrays, self.meshes[1].arrays


def measure(
    captures: Path | None = None,
    trials: int = 1000,
    entries: Sequence[int] = ENTRIES,
    beside: int = 10,
    astar_budget: int = ASTAR_BUDGET,
) -> Measurement:
    """All tables for the built-in set, and for the walks of the folder ``captures`` if it is given.

    ``entries`` are the sizes of maps that are tried; the runs' own maps come last. ``beside`` of the trials are
    searched with A*, too.
    """
    rows: list[dict[str, Any]] = []
    figures: dict[str, float] = {}
    sets = [load_set("default", None)] + ([] if captures is None else [load_set("captures", captures)])
    for motions in sets:
        ground = make_ground(len(motions.radii) - 1, trials)
        made = [(count, _built(motions, count)) for count in (*entries, None)]
        for count, (maps, row) in made:
            found = follow_all(motions, maps, ground)
            rows.append(row | _summary(motions, ground, found))
            if count == 70_117 or (count is None and 70_117 not in entries):
                figures |= {"maps_mb": row["mb"], "maps_s": row["build_s"], "load_ms": row["load_ms"]}
        # The last are the maps that runs use.
        figures[f"success_{motions.name}"] = rows[-1]["success_percent"]
        for name in ("search_ms_median", "length_ratio_mean"):
            figures[f"{name}_{motions.name}"] = rows[-1]["median_ms" if "ms" in name else "length_ratio"]
        figures |= _of_bodies(motions, ground, found, motions.name)
        stray = CLEARANCE - float(motions.radii[-1].max())
        kept = follow_all(motions, made[-1][1][0], ground, stray)
        rows.append(made[-1][1][1] | _summary(motions, ground, kept) | {"search": "maps, no straying"})
        figures |= _of_bodies(motions, ground, kept, f"no_straying_{motions.name}")
        figures[f"success_no_straying_{motions.name}"] = rows[-1]["success_percent"]
        figures |= _arrivals(motions, made[-1][1][0], ground)
        figures[f"first_movement_ms_median_{motions.name}"] = _first_movement(motions, made[-1][1][0], ground)
        more, ratios = _beside_astar(motions, ground, found, beside, astar_budget)
        rows += more
        figures |= ratios
    names = [motions.name for motions in sets]
    figures["search_ms_median"] = max(figures[f"search_ms_median_{name}"] for name in names)
    figures["length_ratio_mean"] = max(figures[f"length_ratio_mean_{name}"] for name in names)
    ratios_of = [figures[f"ratio_astar_over_maps_{n}"] for n in names if f"ratio_astar_over_maps_{n}" in figures]
    if ratios_of:
        figures["ratio_astar_over_maps"] = min(ratios_of)
    return Measurement([{key: row.get(key) for key in _COLUMNS} for row in rows], figures)


def load_set(name: str, captures: Path | None) -> MotionSet:
    """The built-in behaviors, or frontal walking made of the walks in ``captures``."""
    bands = [(LEGS.low, LEGS.high), (TORSO.low, TORSO.high)]
    if captures is None:
        loaded = load_behavior_set(["lateral", "arm_constrained", "frontal"], bands)
    else:
        loaded = load_behavior_set(["frontal"], bands, captures=captures, capture_patterns=CAPTURED)
    facings = np.full((len(loaded.behaviors), max(len(b.facings) for b in loaded.behaviors)), np.nan)
    for row, behavior in zip(facings, loaded.behaviors, strict=True):
        row[: len(behavior.facings)] = behavior.facings
    graph = loaded.graph.arrays
    # The last behavior is the preferred one; a body waits in it for the search to begin.
    waits = np.flatnonzero(graph.node_idle & (graph.node_behavior == graph.node_behavior.max()))
    radii = np.array([behavior.radii for behavior in loaded.behaviors])
    return MotionSet(name, loaded.graph, radii, facings, int(waits[0]) if len(waits) else -1)


def make_ground(behavior: int, trials: int, seed: int = 0) -> Ground:
    """A room of obstacles like that of the paper's figure 8, and random paths in it for ``behavior``."""
    rng = np.random.default_rng(seed)
    floor = shapely.box(0.0, 0.0, SIDE, SIDE)
    solids = draw_clutter("clutter", floor.buffer(-0.5), DENSITY, SIZES, rng)
    legs, torso = (NavMesh(layer.free) for layer in clearance_layers(floor, solids, (LEGS, TORSO)))
    found: list[Trial] = []
    while len(found) < trials:
        start, goal = rng.uniform(1.0, SIDE - 1.0, (2, 2))
        try:
            path = legs.find_path(start, goal, CLEARANCE)
        except PathNotFound:
            continue
        if LENGTHS[0] <= path.length <= LENGTHS[1]:
            found.append(as_trial(np.array(path.points), behavior))
    return Ground((legs, torso), found)


def as_trial(points: Floats, behavior: int) -> Trial:
    """The path through ``points`` (n, 2), all of it in one behavior."""
    arc = arc_lengths(points)
    samples = AnnotatedPath(points, arc, (Section(behavior, 0.0, float(arc[-1])),), 0.0).sample()
    return Trial(points, samples, samples.pose[0].copy())


def follow_trial(
    motions: MotionSet, maps: MotionMaps, ground: Ground, trial: Trial, options: FollowOptions
) -> FollowResult:
    return follow_path(
        motions.graph, maps, trial.samples, ground.arrays, motions.radii, motions.facings,
        trial.start, motions.waiting, options,
    )  # fmt: skip


def follow_all(
    motions: MotionSet, maps: MotionMaps, ground: Ground, stray: float = np.inf
) -> list[tuple[FollowResult, float]]:
    """What the follower finds in each trial, and milliseconds."""
    options = FollowOptions(goal_tolerance=TOLERANCE, budget=2_000)
    follow_trial(motions, maps, ground, ground.trials[0], options)
    return [_best(lambda t=trial: follow_trial(motions, maps, ground, t, options)) for trial in ground.trials]  # type: ignore[misc]


def _best(search: Callable[[], Any]) -> tuple[Any, float]:
    seconds = []
    for _ in range(PASSES):
        begin = time.perf_counter()
        result = search()
        seconds.append(time.perf_counter() - begin)
    return result, min(seconds) * 1e3


def _built(motions: MotionSet, entries: int | None) -> tuple[MotionMaps, dict[str, Any]]:
    """Maps of that many entries, or with None as runs have them, and what they cost."""
    graph = motions.graph
    sizes: dict[str, Any] = {}
    if entries is not None:
        sizes = {"depth": 64, "reach": 1e3, "max_entries": max(entries // len(graph.node_frames), 1)}
    MotionMaps.build(graph, depth=1)
    begin = time.perf_counter()
    maps = MotionMaps.build(graph, **sizes)
    seconds = time.perf_counter() - begin
    with tempfile.TemporaryDirectory() as folder:
        maps_in_file(Path(folder), graph, **sizes)
        loaded, load_ms = _best(lambda: maps_in_file(Path(folder), graph, **sizes))
        assert loaded.entry_count == maps.entry_count
        del loaded
    row = {
        "table": "maps",
        "set": motions.name,
        "search": "maps of runs" if entries is None else "maps",
        "depth": maps.depth,
        "entries": maps.entry_count,
        "cells": maps.cell_count,
        "mb": round(maps.bytes / 1e6, 3),
        "build_s": round(seconds, 4),
        "load_ms": round(load_ms, 3),
    }
    return maps, row


def _summary(motions: MotionSet, ground: Ground, found: Sequence[tuple[FollowResult, float]]) -> dict[str, Any]:
    """Success, times, and the length of motions beside that of their paths."""
    good = [i for i, (result, _) in enumerate(found) if result.status == FOUND]
    paths = np.array([ground.trials[i].samples.arc[-1] for i in good])
    lengths = np.array([_walked(motions.graph, found[i][0], ground.trials[i].points[-1]) for i in good])
    ms = np.array([ms for _, ms in found])
    return {
        "trials": len(found),
        "success_percent": round(100.0 * len(good) / len(found), 2),
        "median_ms": round(float(np.median(ms)), 3),
        "mean_ms": round(float(ms.mean()), 3),
        "length_m": round(float(lengths.mean()), 3) if good else None,
        "path_m": round(float(paths.mean()), 3) if good else None,
        "length_ratio": round(float((lengths / paths).mean()), 4) if good else None,
    }


def _walked(graph: GraphArrays, found: FollowResult | SearchResult, goal: Floats) -> float:
    """Meters of track to where the motion is nearest to ``goal`` in its last node."""
    node = int(found.nodes[-1])
    rows = int(graph.node_track[node]) + np.arange(int(graph.node_frames[node]) + 1)
    track = compose(found.origins[-1], graph.tracks[rows])[:, :2]
    arc = arc_lengths(track)
    last = arc[int(np.argmin(np.hypot(*(track - goal).T)))]
    seams = compose(found.origins[:-1], graph.node_motion[found.nodes[:-1]])[:, :2] - found.origins[1:, :2]
    return float(graph.node_length[found.nodes[:-1]].sum() + last + np.hypot(*seams.T).sum())


def _of_bodies(
    motions: MotionSet, ground: Ground, found: Sequence[tuple[FollowResult, float]], name: str
) -> dict[str, float]:
    """How far joints, projected on the floor, leave the clearance of the path, over all motions found (meters)."""
    joints = range(len(motions.motion.poses.parents))
    probes = joint_probes(motions.graph, motions.motion.poses, list(joints))
    excess = []
    for trial, (result, _) in zip(ground.trials, found, strict=True):
        if result.status != FOUND:
            continue
        line = shapely.LineString(trial.points)
        places: list[Floats] = []
        for node, origin in zip(result.nodes, result.origins, strict=True):
            rows = probes.row[probes.first[node] : probes.first[node + 1]]
            if len(places) == len(result.nodes) - 1:
                # The motion is over where it passes the goal.
                track = compose(origin, np.column_stack([rows[:, X : X + 2], np.zeros(len(rows))]))[:, :2]
                rows = rows[: int(np.argmin(np.hypot(*(track - trial.points[-1]).T))) + len(joints)]
            local = np.zeros((len(rows), 3))
            local[:, :2] = rows[:, X : X + 2] + rows[:, ASIDE_X : ASIDE_X + 2]
            places.append(compose(origin, local)[:, :2])
        points = np.concatenate(places)
        excess.append(float(shapely.distance(line, shapely.points(points)).max()) - CLEARANCE)
    table = np.array(excess or [np.inf])
    return {
        f"joints_excess_m_most_{name}": float(table.max()),
        f"joints_within_2_cm_percent_{name}": 100.0 * float((table <= 0.02).mean()),
    }


def _arrivals(motions: MotionSet, maps: MotionMaps, ground: Ground) -> dict[str, float]:
    """Of motions that end standing: how far off the goal, without branch kinematics and with it (100 trials)."""
    options = FollowOptions(goal_tolerance=TOLERANCE, budget=1_000)
    standing = replace(options, end_standing=True)
    probes = body_probes(motions.graph, motions.radii)
    plain, exact = [], []
    tried = ground.trials[:100]
    for trial in tried:
        found = follow_trial(motions, maps, ground, trial, standing)
        if found.status == FOUND:
            end = compose(found.origins[-1], motions.graph.node_motion[found.nodes[-1]])
            plain.append(float(np.hypot(*(end[:2] - trial.points[-1]))))
        exact.append(
            follow_exactly(
                motions.graph, maps, probes, trial.samples, ground.arrays, motions.radii, motions.facings,
                trial.start, motions.waiting, options,
            )[1]
        )  # fmt: skip
    within = [off for off in exact if off <= 0.01]
    return {
        f"standing_success_{motions.name}": 100.0 * len(plain) / len(tried),
        f"standing_off_m_most_{motions.name}": max(plain, default=-1.0),
        f"exact_share_percent_{motions.name}": 100.0 * len(within) / len(tried),
        f"exact_off_m_median_{motions.name}": float(np.median(exact)),
    }


def _first_movement(motions: MotionSet, maps: MotionMaps, ground: Ground) -> float:
    """Median milliseconds from a start and a goal to a motion that can be played: path, samples, search."""
    options = FollowOptions(goal_tolerance=TOLERANCE, budget=2_000)
    behavior = len(motions.radii) - 1

    def answer(trial: Trial) -> FollowResult:
        path = ground.meshes[0].find_path(trial.points[0], trial.points[-1], CLEARANCE)
        return follow_trial(motions, maps, ground, as_trial(np.array(path.points), behavior), options)

    return float(np.median([_best(lambda t=trial: answer(t))[1] for trial in ground.trials[:200]]))  # type: ignore[misc]


def _beside_astar(
    motions: MotionSet, ground: Ground, found: Sequence[tuple[FollowResult, float]], beside: int, budget: int
) -> tuple[list[dict[str, Any]], dict[str, float]]:
    """Table 5: A* and A* in the channel, each beside maps on the same trials."""
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
        rows += [_compared(motions, ground, f"beside {name}", s, searches[s], both) for s in (name, "maps")]
        ms = {s: np.array([searches[s][i][1] for i in both]) for s in (name, "maps")}
        figures[f"compared_with_{key}_{motions.name}"] = float(len(both))
        if both:
            figures[f"ratio_{key}_over_maps_{motions.name}"] = float(ms[name].mean() / ms["maps"].mean())
            figures[f"ratio_{key}_over_maps_median_{motions.name}"] = float(np.median(ms[name] / ms["maps"]))
    return rows, figures


def _compared(
    motions: MotionSet, ground: Ground, table: str, name: str, results: list[tuple[Any, float]], both: list[int]
) -> dict[str, Any]:
    """Success over all trials; times and lengths over those that both searches solved."""
    row: dict[str, Any] = {"table": table, "set": motions.name, "search": name, "trials": len(results)}
    good = sum(result.status == FOUND for result, _ in results)
    row["success_percent"] = round(100.0 * good / max(len(results), 1), 2)
    if both:
        ms = np.array([results[i][1] for i in both])
        lengths = np.array([_walked(motions.graph, results[i][0], ground.trials[i].points[-1]) for i in both])
        paths = np.array([ground.trials[i].samples.arc[-1] for i in both])
        row |= {"median_ms": round(float(np.median(ms)), 3), "mean_ms": round(float(ms.mean()), 3)}
        row |= {"length_m": round(float(lengths.mean()), 3), "path_m": round(float(paths.mean()), 3)}
        row["length_ratio"] = round(float((lengths / paths).mean()), 4)
    return row
