"""The motion set that comes with the engine gives the graph that the engine needs."""

from pathlib import Path

import numpy as np
import pytest
from ruamel.yaml import YAML

from crowdsim.library import library_folder
from crowdsim.motion.captures.reader import read_capture
from crowdsim.motion.graph.motion_graph import MotionGraph, MotionSource, build_motion_graph

BEHAVIORS = ("lateral", "arm_constrained", "frontal")


@pytest.fixture(scope="module")
def sources() -> list[MotionSource]:
    return default_sources()


def default_sources() -> list[MotionSource]:
    folder = library_folder("behaviors")
    files = {name: YAML(typ="safe").load(folder / name / "behavior.yaml") for name in BEHAVIORS}
    detectors = {name: tuple(entry["detectors"]) for name, entry in files.items()}
    found = []
    for index, name in enumerate(BEHAVIORS):

        def clip(entry: dict, home: Path = folder / name) -> object:
            capture = read_capture(home / entry["file"])
            assert len(capture.clips) == 1
            assert not capture.report.glitches
            return capture.clips[0]

        found += [MotionSource(clip(entry), index, detectors[name]) for entry in files[name]["clips"]]
        found += [MotionSource(clip(entry), index, (), idle=True) for entry in files[name]["idle"]]
        for entry in files[name]["transitions"]:
            ends = entry["from"], entry["to"]
            wider = max(BEHAVIORS.index(end) for end in ends)
            both = tuple(sorted(set(detectors[ends[0]] + detectors[ends[1]])))
            found.append(MotionSource(clip(entry), wider, both))
    return found


@pytest.fixture(scope="module")
def graph(sources: list[MotionSource]) -> MotionGraph:
    return build_motion_graph(sources)


def test_every_segment_is_in_one_strongly_connected_graph(graph: MotionGraph) -> None:
    assert graph.report.dropped == ()
    assert set(graph.arrays.node_behavior) == {0, 1, 2}
    assert graph.report.nodes >= 70


def test_each_behavior_can_wait_and_every_walk_can_stop(graph: MotionGraph) -> None:
    arrays = graph.arrays
    assert sorted(arrays.node_behavior[arrays.node_idle]) == [0, 1, 2]
    assert ((arrays.stop_edge >= 0) == ~arrays.node_ends_standing).all()
    source = np.repeat(np.arange(graph.report.nodes), np.diff(arrays.edge_start))
    for idle in np.flatnonzero(arrays.node_idle):
        assert idle in arrays.edge_target[source == idle]


def test_seams_of_the_track_are_small(graph: MotionGraph) -> None:
    jump = np.hypot(graph.arrays.edge_transform[:, 0], graph.arrays.edge_transform[:, 1])
    assert np.percentile(jump, 95) < 0.06
    assert jump.max() < 0.15


def test_joined_moments_leave_room_to_turn(graph: MotionGraph) -> None:
    room = graph.arrays.edge_high - graph.arrays.edge_low
    assert np.median(room) > np.radians(15)
