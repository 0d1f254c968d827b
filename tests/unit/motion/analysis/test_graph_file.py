"""A motion graph in a file: the same when read, built anew when and only when what it was made of changes."""

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import crowdsim.motion.analysis.graph_file as graph_file
from crowdsim.errors import CrowdSimError, MotionError
from crowdsim.motion.analysis.graph_file import GraphSettings, build_graph, graph_in_file
from crowdsim.motion.captures.reader import capture_paths
from crowdsim.motion.graph.assembly import MotionGraph

SETTINGS = GraphSettings()


@pytest.fixture
def captures(tmp_path: Path, shared: Path) -> Path:
    folder = tmp_path / "captures"
    folder.mkdir()
    for trial in ("16_15_walk_straight_slow_a", "16_11_walk_veer_left_slow_a"):
        shutil.copy(shared / "mocap" / f"{trial}.bvh", folder)
    return folder


def require_equal(one: MotionGraph, other: MotionGraph) -> None:
    for a, b in ((one.arrays, other.arrays), (one.poses, other.poses)):
        for name in a._fields:
            first, second = getattr(a, name), getattr(b, name)
            assert first.dtype == second.dtype, name
            assert np.array_equal(first, second), name
    assert one.node_names == other.node_names
    assert one.report == other.report
    assert one.skeleton.names == other.skeleton.names
    assert dict(one.skeleton.roles) == dict(other.skeleton.roles)


def test_a_graph_is_the_same_when_read(captures: Path, tmp_path: Path) -> None:
    paths = capture_paths(captures)
    graph, built = graph_in_file(tmp_path / "walks.npz", paths, SETTINGS)
    assert built
    read, built = graph_in_file(tmp_path / "walks.npz", paths, SETTINGS)
    assert not built
    require_equal(read, graph)
    graph_in_file(tmp_path / "again.npz", paths, SETTINGS)
    assert (tmp_path / "again.npz").read_bytes() == (tmp_path / "walks.npz").read_bytes()


def test_a_graph_is_built_only_when_its_sources_or_settings_change(captures: Path, tmp_path: Path) -> None:
    file = tmp_path / "graph.npz"
    paths = capture_paths(captures)
    _, built = graph_in_file(file, paths, SETTINGS)
    assert built
    _, built = graph_in_file(file, paths, replace(SETTINGS, threshold=0.05))
    assert built
    _, built = graph_in_file(file, paths, SETTINGS)
    assert built
    # The same walk under one comment more: other bytes.
    paths[0].write_bytes(paths[0].read_bytes() + b"\n")
    _, built = graph_in_file(file, paths, SETTINGS)
    assert built
    _, built = graph_in_file(file, paths[:1], SETTINGS)
    assert built


def test_another_version_is_built_anew(captures: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "graph.npz"
    graph_in_file(file, capture_paths(captures), SETTINGS)
    monkeypatch.setattr(graph_file, "VERSION", graph_file.VERSION + 1)
    _, built = graph_in_file(file, capture_paths(captures), SETTINGS)
    assert built
    _, built = graph_in_file(file, capture_paths(captures), SETTINGS)
    assert not built


@pytest.mark.parametrize("content", [b"", b"no archive", b"PK\x03\x04broken"])
def test_what_is_no_graph_is_refused(tmp_path: Path, content: bytes) -> None:
    file = tmp_path / "graph.npz"
    file.write_bytes(content)
    with pytest.raises(MotionError, match=r"graph\.npz: cannot be read as a motion graph"):
        graph_in_file(file, [], SETTINGS)


def test_another_archive_is_refused(tmp_path: Path) -> None:
    np.savez(tmp_path / "graph.npz", header=np.arange(3))
    with pytest.raises(MotionError, match="cannot be read as a motion graph"):
        graph_in_file(tmp_path / "graph.npz", [], SETTINGS)


def test_a_file_cut_short_is_refused(captures: Path, tmp_path: Path) -> None:
    file = tmp_path / "graph.npz"
    graph_in_file(file, capture_paths(captures), SETTINGS)
    file.write_bytes(file.read_bytes()[:-200])
    with pytest.raises(MotionError, match="cannot be read as a motion graph"):
        graph_in_file(file, [], SETTINGS)


def test_the_name_must_say_what_it_is(captures: Path, tmp_path: Path) -> None:
    with pytest.raises(CrowdSimError, match=r"\.npz"):
        graph_in_file(tmp_path / "graph.h5", capture_paths(captures), SETTINGS)


def test_settings_that_do_not_go_together_are_refused(captures: Path) -> None:
    with pytest.raises(MotionError, match="standard"):
        build_graph(capture_paths(captures), GraphSettings(standard=True, branching=1.5))
    with pytest.raises(MotionError, match="no feature detector"):
        build_graph(capture_paths(captures), GraphSettings(detectors=("leaps",)))
