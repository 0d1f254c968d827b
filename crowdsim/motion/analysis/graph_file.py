"""A motion graph in a file, which is rebuilt only if its input has changed."""

from __future__ import annotations

import hashlib
import json
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from crowdsim.errors import MotionError
from crowdsim.motion.analysis.capture_sets import as_sources, read_clips
from crowdsim.motion.analysis.standard_graph import build_standard_graph
from crowdsim.motion.clips.skeleton import Skeleton
from crowdsim.motion.graph.arrays import GraphArrays
from crowdsim.motion.graph.assembly import GraphReport, MotionGraph
from crowdsim.motion.graph.features import WALKING_DETECTORS
from crowdsim.motion.graph.motion_graph import CAPTURED_DRIFT, DEFAULT_THRESHOLD, build_motion_graph
from crowdsim.motion.graph.pose_table import PoseTable
from crowdsim.whole_files import whole_file

FORMAT = "crowdsim motion graph"
VERSION = 2
"""Version of the file and of the way graphs are built. Raise it if either changes; graphs are then built anew."""

SUFFIX = ".npz"


@dataclass(frozen=True)
class GraphSettings:
    """Settings of a graph; see :func:`build_motion_graph`, :func:`build_standard_graph` and :func:`read_clips`.

    standard: True for a standard motion graph, False for a feature-based one.
    """

    standard: bool = False
    threshold: float = DEFAULT_THRESHOLD
    branching: float | None = None
    max_out_edges: int | None = None
    most_drift: float | None = CAPTURED_DRIFT
    detectors: tuple[str, ...] = WALKING_DETECTORS
    meters_per_unit: float | None = None
    joints: Mapping[str, str] | None = None


def build_graph(paths: Sequence[Path], settings: GraphSettings) -> MotionGraph:
    """Build the graph of the captures ``paths``; raise MotionError if they or the settings give none."""
    sources = as_sources(read_clips(paths, settings.meters_per_unit, settings.joints), settings.detectors)
    if not settings.standard:
        return build_motion_graph(
            sources, settings.threshold, settings.max_out_edges, settings.branching, settings.most_drift
        )
    if settings.branching is not None:
        raise MotionError(
            "a standard graph needs a threshold and takes no branching factor; remove the branching factor"
        )
    return build_standard_graph(sources, settings.threshold, settings.max_out_edges, most_drift=settings.most_drift)


def graph_in_file(file: Path, paths: Sequence[Path], settings: GraphSettings) -> tuple[MotionGraph, bool]:
    """Return the graph in ``file``, and True if it had to be built and written.

    It is built if the file does not exist, or holds a graph of other captures, settings or of another VERSION.
    """
    made_of = _made_of(paths, settings)
    if file.is_file():
        header, stored = _read(file)
        if stored is not None and header["made_of"] == made_of:
            return stored, False
    graph = build_graph(paths, settings)
    _write(file, graph, made_of)
    return graph, True


def _made_of(paths: Sequence[Path], settings: GraphSettings) -> dict[str, Any]:
    """Return the hashes of all input files, and the settings."""
    hashes = {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in _with_skeletons(paths)}
    return {"sources": hashes, "settings": json.loads(json.dumps(asdict(settings)))}


def _with_skeletons(paths: Sequence[Path]) -> list[Path]:
    """Return ``paths`` and the ASF files with which any AMC files among them may be read."""
    folders = {path.parent for path in paths if path.suffix.lower() == ".amc"}
    return [*paths, *sorted(skeleton for folder in folders for skeleton in folder.glob("*.asf"))]


def _write(file: Path, graph: MotionGraph, made_of: dict[str, Any]) -> None:
    """Write a graph and a description of its input."""
    skeleton = graph.skeleton
    header = {
        "format": FORMAT,
        "version": VERSION,
        "made_of": made_of,
        "node_names": graph.node_names,
        "report": asdict(graph.report),
        "joints": skeleton.names,
        "roles": dict(skeleton.roles),
    }
    arrays: dict[str, Any] = {f"graph_{name}": array for name, array in graph.arrays._asdict().items()}
    arrays |= {f"poses_{name}": array for name, array in graph.poses._asdict().items()}
    arrays |= {f"skeleton_{name}": getattr(skeleton, name) for name in _SKELETON}
    with whole_file(file, (SUFFIX,), "motion graphs") as written, written.open("wb") as stream:
        np.savez(stream, header=np.frombuffer(json.dumps(header).encode(), np.uint8), **arrays)


_SKELETON = ("parents", "offsets", "end_parents", "end_offsets")


def _read(file: Path) -> tuple[dict[str, Any], MotionGraph | None]:
    """Return the header of a file, and its graph, None if the file is of another VERSION.

    Raise MotionError if it holds no motion graph.
    """
    try:
        with file.open("rb") as stream, np.load(stream, allow_pickle=False) as stored:
            header = json.loads(stored["header"].tobytes())
            if header["format"] != FORMAT:
                raise MotionError(f"{file}: not a motion graph")
            return header, _graph(header, stored) if header["version"] == VERSION else None
    except (OSError, ValueError, LookupError, TypeError, zipfile.BadZipFile, EOFError) as error:
        raise MotionError(f"{file}: cannot be read as a motion graph ({error}); delete it or name another") from error


def _graph(header: dict[str, Any], stored: Any) -> MotionGraph:
    """Return the graph of a file's arrays."""
    arrays = GraphArrays(**{name: stored[f"graph_{name}"] for name in GraphArrays._fields})
    poses = PoseTable(**{name: stored[f"poses_{name}"] for name in PoseTable._fields})
    parents, offsets, end_parents, end_offsets = (stored[f"skeleton_{name}"] for name in _SKELETON)
    skeleton = Skeleton(tuple(header["joints"]), parents, offsets, end_parents, end_offsets, header["roles"])
    report = dict(header["report"], dropped=tuple((name, why) for name, why in header["report"]["dropped"]))
    return MotionGraph(arrays, tuple(header["node_names"]), poses, skeleton, GraphReport(**report))
