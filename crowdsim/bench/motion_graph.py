"""Standard against feature-based motion graphs (2011 paper, table 1): time to build, size, branching, as the set grows.

Times are seconds from clips in memory to the finished graph, the median of :data:`REPEATS`. Both graphs are built with
one threshold.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from crowdsim.bench.registry import Measurement
from crowdsim.library import library_folder
from crowdsim.motion.capture_files import capture_paths
from crowdsim.motion.capture_sets import as_sources, read_clips
from crowdsim.motion.clip import Clip
from crowdsim.motion.motion_graph import DEFAULT_THRESHOLD, MotionGraph, MotionSource, build_motion_graph
from crowdsim.motion.standard_graph import build_standard_graph

FRAMES = (693, 1185, 1660, 2329, 3347, 6887)
"""The sizes of the paper's sets."""

REPEATS = 3

_Build = Callable[[Sequence[MotionSource]], MotionGraph]
_GRAPHS: dict[str, _Build] = {"standard": build_standard_graph, "features": build_motion_graph}
_PAPER_SECONDS = {693: (208.1, 1.5), 1185: (650.0, 4.0), 1660: (1297.7, 6.3), 2329: (2577.5, 6.5),
                  3347: (4853.5, 6.6), 6887: (22272.5, 27.0)}  # fmt: skip


def measure(captures: Path | None = None, sizes: Sequence[int] = FRAMES) -> Measurement:
    """Table 1 over the captures in the folder ``captures``, by default over the clips of the built-in behaviors."""
    clips = _read(captures)
    total = sum(clip.frame_count for clip in clips)
    rows: list[dict[str, Any]] = []
    figures: dict[str, float] = {}
    for size in [size for size in sizes if size <= total] or [total]:
        sources = as_sources(_first_frames(clips, size))
        for (kind, build), paper in zip(_GRAPHS.items(), _PAPER_SECONDS.get(size, (None, None)), strict=True):
            seconds, graph = _timed(build, sources)
            report = graph.report
            rows.append(
                {
                    "frames": size,
                    "graph": kind,
                    "seconds": round(seconds, 3),
                    "nodes": report.nodes,
                    "edges": report.edges,
                    "transitions": report.transitions,
                    "branching": round(report.branching, 2),
                    "out_degree": round(report.out_degree, 2),
                    "paper_s": paper,
                }
            )
            name = f"{kind}_{size}"
            figures[f"{name}_s"] = seconds
            figures |= {f"{name}_{key}": float(rows[-1][key]) for key in ("nodes", "edges", "transitions")}
            figures[f"{name}_branching"] = report.branching
    figures["threshold_m"] = DEFAULT_THRESHOLD
    return Measurement(rows, figures)


def _timed(
    build: Callable[[Sequence[MotionSource]], MotionGraph], sources: list[MotionSource]
) -> tuple[float, MotionGraph]:
    seconds = []
    for _ in range(REPEATS):
        begin = time.perf_counter()
        graph = build(sources)
        seconds.append(time.perf_counter() - begin)
    return statistics.median(seconds), graph


def _read(captures: Path | None) -> list[Clip]:
    """All clips on one skeleton, by default those of the built-in behaviors."""
    if captures is not None:
        paths = capture_paths(captures)
    else:
        folders = sorted(folder for folder in library_folder("behaviors").glob("*/clips") if folder.is_dir())
        paths = [path for folder in folders for path in capture_paths(folder)]
    clips = read_clips(paths)
    for clip in clips:
        clip.joint_positions  # noqa: B018  (cached: reading a clip is no part of building a graph)
    return clips


def _first_frames(clips: Sequence[Clip], count: int) -> list[Clip]:
    """The first ``count`` frames of ``clips``, the last of them cut where it must be."""
    chosen: list[Clip] = []
    for clip in clips:
        rest = count - sum(c.frame_count for c in chosen)
        if rest <= 0:
            break
        if rest < clip.frame_count:
            clip = Clip(clip.name, clip.skeleton, clip.root_positions[:rest], clip.rotations[:rest])
        chosen.append(clip)
    return chosen
