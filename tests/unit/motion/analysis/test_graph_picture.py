"""The picture of a motion graph."""

import pytest

import crowdsim.motion.analysis.graph_picture as graph_picture
from crowdsim.motion.graph.motion_graph import MotionSource, build_motion_graph
from tests.unit.motion.walker import walk


def test_no_more_rows_of_the_error_image_are_drawn_than_allowed(monkeypatch: pytest.MonkeyPatch) -> None:
    clip = walk(steps=9)
    rows = 2 * clip.frame_count // 3
    monkeypatch.setattr(graph_picture, "_PIXELS", rows)
    sources = [MotionSource(clip, 0, ("crossing", "standing"))]
    figure = graph_picture.draw_motion_graph(sources, build_motion_graph(sources))
    assert len(figure.axes[0].images[0].get_array()) <= rows
