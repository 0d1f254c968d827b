"""What a set of motions can follow: of a set drawn with ruler and compass, and of that set without its left turns."""

from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
import pytest
import shapely

from crowdsim.errors import MotionError
from crowdsim.following.coverage import (
    ANGLES,
    LEADS,
    Coverage,
    _paths,
    coverage_rows,
    draw_coverage,
    measure_coverage,
    missing_turns,
)
from crowdsim.following.follower.path_follower import FollowStatus
from crowdsim.following.maps.motion_maps import MotionMaps
from crowdsim.motion.graph.arrays import GraphArrays
from crowdsim.motion.graph.pose_table import PoseTable
from tests.unit.following.walking_graph import FRONTAL, graph_of, pieces


class Reach(NamedTuple):
    room: np.ndarray
    least: float


@dataclass(frozen=True)
class Found:
    status: FollowStatus
    expansions: int


def set_of(graph: GraphArrays) -> SimpleNamespace:
    """The graph with bodies of one joint each, 0.2 m left of the track."""
    rotations = np.zeros((len(graph.tracks), 2, 4), np.float32)
    rotations[:, :, 0] = 1.0
    root = np.tile(np.float32([0.0, 0.0, 1.0]), (len(graph.tracks), 1))
    offsets = np.float32([[0.0, 0.0, 0.0], [0.0, 0.2, 0.0]])
    poses = PoseTable(np.array([-1, 0], np.int32), offsets, graph.node_track, graph.node_frames, root, rotations)
    return SimpleNamespace(arrays=graph, poses=poses)


def measure(only_right: bool = False, radii: tuple[float, ...] = (2.0, 0.5), **options: int):
    parts = [part for part in pieces() if part.behavior == FRONTAL and part.begin in "CS" and part.end in "CS"]
    graph = graph_of([part for part in parts if not (only_right and part.track[-1, 2] > 0.0)])
    graph = graph._replace(node_behavior=np.zeros_like(graph.node_behavior))
    maps = MotionMaps.build(graph)
    return measure_coverage(set_of(graph), maps, np.zeros((1, 1)), radii=radii, clearances=(0.15, 0.3, 0.6), **options)


def test_narrow_ways_are_followed_less_and_bodies_need_their_room() -> None:
    coverage = measure()
    assert coverage.curvature.tolist() == [2.0, 0.5, 0.0, -0.5, -2.0]
    assert (coverage.share[:, 0] == 0.0).all()
    assert (coverage.share[:, 2] == 1.0).all()


def test_wide_turns_stay_on_the_ground() -> None:
    assert (measure(radii=(80.0,)).share[:, 2] == 1.0).all()


def test_the_table_shows_what_is_missing() -> None:
    """Without pieces that turn left, long left turns fail; sharp ones are taken on the spot, the long way."""
    whole, lacking = measure(), measure(only_right=True)
    assert (whole.share[:, 1:] == 1.0).all()
    assert lacking.share[1, 1] < 0.9
    np.testing.assert_array_equal(lacking.share[2:], whole.share[2:])


def test_any_number_of_workers_gives_the_same_and_tells_of_it() -> None:
    told: list[tuple[int, int]] = []
    one, three = measure(), measure(workers=3, progress=lambda *done: told.append(done))
    np.testing.assert_array_equal(one.share, three.share)
    assert told == [(done, 15) for done in range(1, 16)]


def test_rows_and_picture_show_each_turn() -> None:
    coverage = measure()
    rows = coverage_rows(coverage)
    assert [row["turn"] for row in rows] == ["left, 0.5 m", "left, 2 m", "straight", "right, 2 m", "right, 0.5 m"]
    axes = draw_coverage(coverage, "walks").axes[0]
    assert len(axes.texts) == coverage.share.size


@pytest.mark.parametrize("bend", [0.0, 0.5, -2.0])
def test_paths_turn_as_they_should(bend: float) -> None:
    paths = _paths(bend, 2)
    assert len(paths) == len(LEADS) * (len(ANGLES) if bend else 1)
    for path in paths:
        line = shapely.LineString(path.pose[:, :2])
        assert line.length == pytest.approx(path.arc[-1], rel=0.02)
        chord = np.diff(path.pose[:, :2], axis=0)
        ways = np.arctan2(chord[:, 1], chord[:, 0])
        middle = 0.5 * (path.pose[1:, 2] + path.pose[:-1, 2])
        assert np.abs((ways - middle + np.pi) % (2 * np.pi) - np.pi).max() < 0.11
        assert (path.behavior == 2).all()
        assert np.abs(np.diff(path.pose[:, 2])).max() <= abs(bend) * 0.1 + 1e-9


@pytest.mark.parametrize("wrong", [{"workers": 0}])
def test_wrong_numbers_are_refused(wrong: dict[str, int]) -> None:
    with pytest.raises(MotionError, match="coverage needs radii"):
        measure(**wrong)


def test_more_room_is_never_worse(monkeypatch) -> None:
    """A search that goes astray where there is room counts for nothing if one with less room did not."""
    import crowdsim.following.coverage as module

    search = module.search_path

    def astray(character, *arguments):
        found = search(character, *arguments)
        return found if character.reach.least < 0.5 else replace(found, status=FollowStatus.BLOCKED)

    monkeypatch.setattr(module, "search_path", astray)
    share = measure().share
    assert (np.diff(share, axis=1) >= 0.0).all()
    assert (share[:, 2] == 1.0).all()


def test_a_path_is_tried_in_less_room_where_nothing_is_found_in_more(monkeypatch) -> None:
    import crowdsim.following.follower.path_follower as module

    tried: list[float] = []

    def search(character, *_):
        tried.append(character.reach.least)
        status = FollowStatus.FOUND if character.reach.least == 0.3 else FollowStatus.BLOCKED
        return Found(status, 7)

    monkeypatch.setattr(module, "search_path", search)
    reach = Reach(np.array([0.42]), 0.42)
    found = module.follow_path(module.Character(None, None, None, None, reach), None, (), np.zeros(3))
    assert tried == [0.42, 0.4, 0.35, 0.3]
    assert (found.status, found.expansions) == (FollowStatus.FOUND, 28)


def test_what_nothing_follows_is_told_with_what_to_add() -> None:
    curvature, clearance = np.array([1.0, 0.0, -1.0]), np.array([0.2, 0.5])
    lacking = Coverage(curvature, clearance, np.array([[0.0, 0.0], [0.0, 1.0], [0.5, 0.2]]))
    assert missing_turns(lacking) == [
        "no motion follows turns to the left: add walks that turn left by 45 and by 90 degrees"
    ]
    assert missing_turns(Coverage(curvature, clearance, np.ones((3, 2)))) == []
