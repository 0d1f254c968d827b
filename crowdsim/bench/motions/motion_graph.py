"""Standard and feature-based motion graphs as sets grow (2011 paper, table 1): build time, size, branching, foot drift.

Times are seconds from clips in memory to the finished graph, the median of :data:`REPEATS`. Both graphs use the same
threshold.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from crowdsim.bench.registry import Measurement
from crowdsim.motion.analysis.capture_sets import as_sources, read_clips
from crowdsim.motion.analysis.standard_graph import build_standard_graph
from crowdsim.motion.captures.reader import capture_paths
from crowdsim.motion.clips.clip import Clip
from crowdsim.motion.graph.assembly import GraphReport, clip_frames
from crowdsim.motion.graph.motion_graph import (
    CAPTURED_DRIFT,
    DEFAULT_THRESHOLD,
    MotionGraph,
    MotionSource,
    build_motion_graph,
)
from crowdsim.motion.graph.transition_drift import clip_stances, transition_drifts
from crowdsim.motion.synthesis.library import motion_database
from crowdsim.motion.synthesis.styles import MANNERS

FRAMES = (693, 1185, 1660, 2329, 3347, 6887)
"""Sizes of the paper's sets [frames]."""

REPEATS = 3

_GRAPHS: dict[str, Callable[..., MotionGraph]] = {"standard": build_standard_graph, "features": build_motion_graph}
_PAPER_SECONDS = {
    693: (208.1, 1.5),
    1185: (650.0, 4.0),
    1660: (1297.7, 6.3),
    2329: (2577.5, 6.5),
    3347: (4853.5, 6.6),
    6887: (22272.5, 27.0),
}
"""Frames of a set -> times that the paper gives for its standard and its feature-based graph [s]."""


def measure(captures: Path | None = None, sizes: Sequence[int] = FRAMES) -> Measurement:
    """Measure table 1 on the captures in the folder ``captures``, by default on each of the built-in motion sets.

    A size beyond that of a set means all of it. As elsewhere, transitions between captures that let planted feet slide
    are left out.
    """
    most_drift = None if captures is None else CAPTURED_DRIFT
    rows: list[dict[str, Any]] = []
    figures: dict[str, float] = {}
    for name, clips in _sets(captures).items():
        total = sum(clip.frame_count for clip in clips)
        for size in dict.fromkeys(min(size, total) for size in sizes):
            sources = as_sources(_first_frames(clips, size))
            paper = _PAPER_SECONDS.get(size, (None, None))
            for (kind, build), paper_seconds in zip(_GRAPHS.items(), paper, strict=True):
                seconds, graph = _timed(partial(build, most_drift=most_drift), sources)
                row = _row(name, size, kind, seconds, graph.report)
                drift = _drift_cm(graph, [source.clip for source in sources])
                rows.append(row | drift | {"paper_s": paper_seconds})
                figures |= {f"{name}_{kind}_{size}_{key}": value for key, value in drift.items()}
                prefix = f"{name}_{kind}_{size}"
                figures[f"{prefix}_s"] = seconds
                figures |= {f"{prefix}_{key}": float(row[key]) for key in ("nodes", "edges", "transitions")}
                figures[f"{prefix}_branching"] = graph.report.branching
    figures["threshold_m"] = DEFAULT_THRESHOLD
    return Measurement(rows, figures)


def _row(name: str, size: int, kind: str, seconds: float, report: GraphReport) -> dict[str, Any]:
    """Return the row of a graph that was built from ``size`` frames in the time ``seconds`` [s]."""
    return {
        "set": name,
        "frames": size,
        "graph": kind,
        "seconds": round(seconds, 3),
        "nodes": report.nodes,
        "edges": report.edges,
        "transitions": report.transitions,
        "branching": round(report.branching, 2),
        "out_degree": round(report.out_degree, 2),
    }


def _drift_cm(graph: MotionGraph, clips: list[Clip]) -> dict[str, float]:
    """Return how far a planted foot drifts at most [cm]: in clips, across transitions, and the excess over clips."""
    used = {clip_frames(name)[0] for name in graph.node_names}
    own = [stance.drift for clip in clips if clip.name in used for stance in clip_stances(clip)]
    across = transition_drifts(graph, clips)
    most = {"clip": np.array(own), "across": across.played, "added": across.added}
    return {f"{key}_drift_cm": round(100.0 * float(np.max(drift, initial=0.0)), 2) for key, drift in most.items()}


def _timed(
    build: Callable[[Sequence[MotionSource]], MotionGraph], sources: list[MotionSource]
) -> tuple[float, MotionGraph]:
    """Return the median time of REPEATS builds of a graph [s], and the graph."""
    seconds = []
    for _ in range(REPEATS):
        begin = time.perf_counter()
        graph = build(sources)
        seconds.append(time.perf_counter() - begin)
    return statistics.median(seconds), graph


def _sets(captures: Path | None) -> dict[str, list[Clip]]:
    """Return clips on one skeleton by the name of their set."""
    if captures is not None:
        sets = {"captures": read_clips(capture_paths(captures))}
    else:
        sets = {name: motion_database(manner) for name, manner in MANNERS.items()}
    for clip in (clip for clips in sets.values() for clip in clips):
        clip.joint_positions  # noqa: B018  (fills a cache: reading a clip is not part of building a graph)
    return sets


def _first_frames(clips: Sequence[Clip], count: int) -> list[Clip]:
    """Return the first ``count`` frames of ``clips``; the last clip is cut if necessary."""
    chosen: list[Clip] = []
    for clip in clips:
        rest = count - sum(c.frame_count for c in chosen)
        if rest <= 0:
            break
        if rest < clip.frame_count:
            clip = Clip(clip.name, clip.skeleton, clip.root_positions[:rest], clip.rotations[:rest])
        chosen.append(clip)
    return chosen
