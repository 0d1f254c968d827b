"""Segments, graphs and the files they are kept in are the same in every process, whatever the hash seed and threads."""

import os
import subprocess
import sys

import pytest

BUILD = """
import hashlib, sys
from pathlib import Path
from crowdsim.motion.analysis.capture_sets import as_sources, read_clips
from crowdsim.motion.analysis.graph_file import GraphSettings, build_graph, graph_in_file
from crowdsim.motion.captures.reader import capture_paths
from crowdsim.motion.graph.segmentation import segment_clip

folder, out = map(Path, sys.argv[1:])
paths = capture_paths(folder)
for source in as_sources(read_clips(paths)):
    print(source.clip.name, segment_clip(source.clip, source.detectors))
for name, settings in (("features", GraphSettings(branching=1.8)), ("standard", GraphSettings(standard=True))):
    graph, built = graph_in_file(out / f"{name}.npz", paths, settings)
    assert built
    print(name, graph.report, hashlib.sha256((out / f"{name}.npz").read_bytes()).hexdigest())
"""

ENVIRONMENTS = {
    "one": {"PYTHONHASHSEED": "0", "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "NUMBA_NUM_THREADS": "1"},
    "two": {"PYTHONHASHSEED": "12345", "OPENBLAS_NUM_THREADS": "2", "OMP_NUM_THREADS": "2", "NUMBA_NUM_THREADS": "2"},
    "any": {"PYTHONHASHSEED": "random", "OPENBLAS_NUM_THREADS": "4"},
}


@pytest.mark.parametrize("other", ["two", "any"])
def test_graphs_are_the_same_in_every_process(crowdsim_here, tmp_path, other):
    folder = tmp_path / "clips"
    assert crowdsim_here("motion", "synthesize", "default", str(folder)).returncode == 0
    for path in folder.glob("*.bvh"):
        if path.stem not in ("walk", "walk_left_45", "walk_right_90", "side_left", "walk_to_side_left"):
            path.unlink()
    said = []
    for name in ("one", other):
        out = tmp_path / name
        out.mkdir()
        done = subprocess.run(
            [sys.executable, "-c", BUILD, str(folder), str(out)],
            capture_output=True, text=True, timeout=300, env={**os.environ, **ENVIRONMENTS[name]},
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
        said.append(done.stdout)
    assert said[0] == said[1]
    assert said[0].count("Segment(") > 5
