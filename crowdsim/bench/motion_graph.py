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
from crowdsim.errors import CrowdSimError
from crowdsim.library import library_folder
from crowdsim.motion.capture_files import read_folder
from crowdsim.motion.clip import Clip
from crowdsim.motion.features import WALKING_DETECTORS
from crowdsim.motion.motion_graph import DEFAULT_THRESHOLD, MotionGraph, MotionSource, build_motion_graph
from crowdsim.motion.retargeting import on_one_skeleton
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
    clips = _ordered(captures)
    total = sum(clip.frame_count for clip in clips)
    rows: list[dict[str, Any]] = []
    figures: dict[str, float] = {}
    for size in [size for size in sizes if size <= total] or [total]:
        sources = [MotionSource(clip, 0, WALKING_DETECTORS) for clip in _first_frames(clips, size)]
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


def _ordered(captures: Path | None) -> list[Clip]:
    """All clips on one skeleton, those of the person who has most frames first, then by name."""
    if captures is not None:
        clips = [clip for capture in read_folder(captures) for clip in capture.clips]
    else:
        folders = sorted(folder for folder in library_folder("behaviors").glob("*/clips") if folder.is_dir())
        clips = [clip for folder in folders for capture in read_folder(folder) for clip in capture.clips]
    if not clips:
        raise CrowdSimError(f"{captures}: no captures to build a motion graph of")
    frames: dict[bytes, int] = {}
    for clip in clips:
        bones = clip.skeleton.offsets.round(6).tobytes()
        frames[bones] = frames.get(bones, 0) + clip.frame_count
    clips.sort(key=lambda clip: -frames[clip.skeleton.offsets.round(6).tobytes()])
    clips = on_one_skeleton(clips)
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
