"""A* on a motion graph among obstacles (2011 paper, tables 2 and 3).

Compares collision tests with the channel of a path, and searches with and without inverse branch kinematics: in the
feature-based graph with all its edges, with as few as the paper's, and for captures also in their standard graph. Times
are milliseconds of one thread, the best of :data:`PASSES` for each query. Means are over the queries that are solved
both with and without bending; in the standard graph, which is searched without bending, over those solved.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from crowdsim.bench.motions.map_trials import CAPTURED, FOUND, PASSES, best_of, load_behaviors, waiting_node
from crowdsim.bench.motions.thinned_graph import thinned
from crowdsim.bench.places.random_ground import GroundKind, random_ground
from crowdsim.bench.registry import Measurement
from crowdsim.following.graph_search.channel import Channel, make_channel
from crowdsim.following.graph_search.graph_search import SearchOptions, SearchResult, search_graph
from crowdsim.following.graph_search.probes import Probes, body_probes
from crowdsim.motion.analysis.capture_sets import as_sources, read_clips
from crowdsim.motion.analysis.standard_graph import build_standard_graph
from crowdsim.motion.captures.reader import capture_paths
from crowdsim.motion.graph.arrays import GraphArrays
from crowdsim.motion.graph.assembly import branching_factor

ROOMS = GroundKind(side=20.0, sizes=(0.4, 1.2), clearance=0.6, lengths=(5.0, 14.0))
"""The environments; the clearance of their paths is the radius of the channels."""

DENSITIES = (0.02, 0.04, 0.08, 0.12)
"""Share of the floor, without 0.5 m along its edge, that obstacles cover in each environment."""

FEW_EDGES = 3
"""Edges per node of the sparse graph, which gives about the paper's branching factor (1.66), counted over all edges."""

STANDARD_BUDGET = 40
"""Factor on the number of nodes to expand in a standard graph, whose segments last only a frame or two."""

_SEARCHES = ("collision tests", "collision tests, bent", "channel", "channel, bent", "channel, to 1 cm")
_COMPARED = _SEARCHES[:4]
"""Searches that are compared over the queries that all of them solve; the one to 1 cm solves fewer."""
_Found = dict[str, list[tuple[SearchResult, float]]]
"""Results by search: for each query the result and its time [ms]."""


@dataclass(frozen=True)
class _Environment:
    """A cluttered room; each query is a path (n, 2) from start to goal [m], and its channel."""

    obstacles: int
    meshes: tuple[Any, Any]
    queries: list[tuple[NDArray[np.float64], Channel]]


def measure(
    captures: Path | None = None,
    densities: Sequence[float] = DENSITIES,
    queries: int = 16,
    budget: int = 5_000,
) -> Measurement:
    """Measure tables 2 and 3 on the graph of the built-in behaviors, or of the walks in the folder ``captures``.

    There is an environment for each of ``densities``, with ``queries`` queries; ``budget`` is the largest number of
    nodes that a search expands.
    """
    radii, graphs = _graphs(captures)
    places = [_environment(density, queries, number) for number, density in enumerate(densities)]
    rows: list[dict[str, Any]] = []
    figures: dict[str, float] = {}
    standard = graphs.pop("standard", None)
    for name, graph in graphs.items():
        solved: _Found = {search: [] for search in _SEARCHES}
        tried: _Found = {search: [] for search in _SEARCHES}
        for number, place in enumerate(places):
            found = {
                search: _search_all(search, graph, body_probes(graph, radii), place, budget) for search in _SEARCHES
            }
            for search in _SEARCHES:
                # The same kind of test with and without bending.
                alike = [found[other] for other in _COMPARED if other.startswith(search.split(",")[0])]
                rows.append(_row(name, number, place, search, found[search], _solved(alike)))
                solved[search] += [found[search][i] for i in _solved([found[other] for other in _COMPARED])]
                tried[search] += found[search]
        # The papers' factor, but over all edges: those that go on with their clips count as transitions, too.
        nodes, edges = len(graph.node_frames), len(graph.edge_target)
        figures |= {f"{name}_nodes": float(nodes), f"{name}_branching": branching_factor(nodes, edges)}
        figures |= {f"{name}_{key}": value for key, value in _figures(solved, tried).items()}
        if standard is not None and name == "all":
            beside, compared = _standard(standard, radii, places, tried, budget)
            rows += beside
            figures |= compared
    return Measurement(rows, figures)


def _standard(
    graph: GraphArrays, radii: NDArray[np.float64], places: Sequence[_Environment], features: _Found, budget: int
) -> tuple[list[dict[str, Any]], dict[str, float]]:
    """Return rows of plain searches of the standard graph, and their time relative to the feature-based graph.

    ``features`` holds the results of the same searches there. Figures are over the queries solved in both graphs.
    """
    probes = body_probes(graph, radii)
    rows: list[dict[str, Any]] = []
    figures = {"standard_nodes": float(len(graph.node_frames))}
    for search in ("collision tests", "channel"):
        tried: list[tuple[SearchResult, float]] = []
        for number, place in enumerate(places):
            found = _search_all(search, graph, probes, place, budget * STANDARD_BUDGET, passes=1)
            rows.append(_row("standard", number, place, search, found, _solved([found])))
            tried += found
        both = _solved([tried, features[search]])
        key = search.replace(" ", "_")
        figures[f"standard_found_{key}"] = float(sum(result.status == FOUND for result, _ in tried))
        figures[f"standard_compared_{key}"] = float(len(both))
        ours, theirs = (_means([found[i] for i in both]) for found in (features[search], tried))
        for what in ("length", "expansions", "ms") if both else ():
            figures[f"standard_over_features_{what}_{key}"] = theirs[what] / max(ours[what], 1e-9)
    return rows, figures


def _graphs(captures: Path | None) -> tuple[NDArray[np.float64], dict[str, GraphArrays]]:
    """Return radii of the behaviors (B, layers) [m], and the graphs to compare by name.

    These are the graph with all its edges, the same with few, and for captures also their standard graph.
    """
    names = () if captures is None else _capture_names(captures)
    loaded, standard = load_behaviors(captures, names), {}
    if captures is not None:
        sources = as_sources(read_clips([captures / name for name in names]))
        standard["standard"] = build_standard_graph(sources).arrays
    graph = loaded.graph.arrays
    radii = np.array([behavior.radii for behavior in loaded.behaviors])
    return radii, {"all": graph, "few": thinned(graph, FEW_EDGES)} | standard


def _capture_names(captures: Path) -> list[str]:
    """Return the walks of one person among the curated captures, or all files of any other folder."""
    walks = [path for pattern in CAPTURED for path in captures.glob(pattern)]
    return sorted(path.name for path in walks or capture_paths(captures, ["*.bvh"]))


def _solved(searches: Sequence[list[tuple[SearchResult, float]]]) -> list[int]:
    """Return the numbers of the queries that all of ``searches``, each a list of results by query, have solved."""
    return [i for i, results in enumerate(zip(*searches, strict=True)) if all(r.status == FOUND for r, _ in results)]


def _environment(density: float, count: int, seed: int) -> _Environment:
    """Return a room that obstacles cover by the share ``density``, with ``count`` queries."""
    ground = random_ground(ROOMS, density, count, seed)
    queries = [(points, make_channel(points, ROOMS.clearance)) for points in ground.paths]
    return _Environment(ground.obstacles, (ground.legs.arrays, ground.torso.arrays), queries)


def _search_all(
    name: str, graph: GraphArrays, probes: Probes, place: _Environment, budget: int, passes: int = PASSES
) -> list[tuple[SearchResult, float]]:
    """Return the result of each query of an environment, and its shortest time [ms].

    The words of ``name`` say how a query is searched: ``bent`` with branch kinematics, ``1 cm`` to that distance from
    the goal, ``channel`` in the path's channel and not with collision tests. Each is searched ``passes`` times, with at
    most ``budget`` nodes expanded.
    """
    options = SearchOptions(branch_kinematics="bent" in name, budget=budget)
    if "1 cm" in name:
        options = replace(options, goal_tolerance=0.01)
    waiting = waiting_node(graph)
    results = []
    for points, channel in place.queries:
        ahead = points[1] - points[0]
        start = np.array([*points[0], np.arctan2(ahead[1], ahead[0])])
        where: dict[str, Any] = {"channel": channel} if "channel" in name else {"meshes": place.meshes}
        search = partial(search_graph, graph, probes, start, waiting, points[-1], options=options, **where)
        results.append(best_of(search, passes))
    return results


def _row(
    graph: str, number: int, place: _Environment, name: str, found: list[tuple[SearchResult, float]], common: list[int]
) -> dict[str, Any]:
    """Return the row of a search; means are over the queries in ``common``.

    Those are solved by the same kind of test with and without bending; in the standard graph, by this search alone. The
    search to 1 cm does not solve all of them, and its means are over what it found nevertheless.
    """
    means = _means([found[i] for i in common])
    bent = [result.gap * 1e3 for result, _ in found if result.bent]
    return {
        "edges": graph,
        "environment": number + 1,
        "obstacles": place.obstacles,
        "search": name,
        "found": sum(result.status == FOUND for result, _ in found),
        "compared": len(common),
        "length_m": round(means["length"], 2),
        "left_m": round(means["left"], 3),
        "expansions": round(means["expansions"]),
        "collision_tests": round(means["collision_tests"]),
        "ms": round(means["ms"], 2),
        "all_ms": round(_means(found)["ms"], 2),
        "bent": len(bent),
        "most_off_mm": round(max(bent, default=0.0), 2),
    }


def _means(found: list[tuple[SearchResult, float]]) -> dict[str, float]:
    """Return means over results: length and distance left to the goal [m], work, and time [ms]; 0 without any."""
    table = [(r.length, r.gap, r.expansions, r.collision_tests, ms) for r, ms in found]
    keys = ("length", "left", "expansions", "collision_tests", "ms")
    return dict(zip(keys, np.mean(table, axis=0).tolist() if table else [0.0] * len(keys), strict=True))


def _figures(solved: _Found, tried: _Found) -> dict[str, float]:
    """Return figures over all environments: ratios of collision tests to the channel, and how much bending saves.

    They also hold how many queries each search solves, its mean time over all queries [ms], and the largest distance
    of the end of a bent motion from the goal [mm]. Ratios and savings over no queries are left out. ``solved`` holds
    the queries that all searches of _COMPARED solve, ``tried`` all.
    """
    mean = {name: _means(found) for name, found in solved.items()}
    figures = {"compared": float(len(solved["channel"])), "queries": float(len(tried["channel"]))}
    if solved["channel"]:
        tests = mean["collision tests"]["collision_tests"], mean["channel"]["collision_tests"]
        figures["collision_tests_ratio"] = tests[0] / max(tests[1], 1.0)
        figures["ratio_tests_over_channel_ms"] = mean["collision tests"]["ms"] / max(mean["channel"]["ms"], 1e-9)
    for name in ("channel", "collision tests"):
        # Compare within one kind of test only: in a sparse graph, few queries are solved in a channel.
        both = _solved([tried[name], tried[f"{name}, bent"]])
        if not both:
            continue
        plain, bent = (_means([tried[search][i] for i in both]) for search in (name, f"{name}, bent"))
        key = name.replace(" ", "_")
        for what in ("length", "expansions", "ms"):
            figures[f"bending_less_{what}_percent_{key}"] = 100.0 * (1.0 - bent[what] / max(plain[what], 1e-9))
        whole = [m["length"] + m["left"] for m in (plain, bent)]
        figures[f"bending_less_length_to_goal_percent_{key}"] = 100.0 * (1.0 - whole[1] / max(whole[0], 1e-9))
    both = _solved([tried["channel, to 1 cm"], tried["channel, bent"]])
    fine, bent = (_means([tried[search][i] for i in both]) for search in ("channel, to 1 cm", "channel, bent"))
    for what in ("length", "expansions", "ms") if both else ():
        figures[f"bending_less_{what}_percent_than_to_1_cm"] = 100.0 * (1.0 - bent[what] / max(fine[what], 1e-9))
    for name, found in tried.items():
        key = name.replace(",", "").replace(" ", "_")
        figures[f"found_{key}"] = float(sum(result.status == FOUND for result, _ in found))
        figures[f"all_ms_{key}"] = _means(found)["ms"]
    gaps = [result.gap for found in tried.values() for result, _ in found if result.bent]
    figures["bent"] = float(len(gaps))
    figures["bent_most_off_mm"] = 1e3 * max(gaps, default=0.0)
    return figures
