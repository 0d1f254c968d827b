"""Reachable areas of behaviors, and the picture that shows them."""

from pathlib import Path

import numpy as np
import pytest
import shapely

from crowdsim.behaviors.behavior import Behavior
from crowdsim.constants import TRACKING_MARGIN
from crowdsim.figures import write_figure
from crowdsim.scenario.loader import parse_scenario
from crowdsim.scenario.picture import draw_scenario, reachable_areas

TEXT = """\
crowdsim: 1
name: rooms
seed: 1
duration: 10.0
floor: {rectangle: [0, 0, 10, 4]}
obstacles:
  - {name: below, box: {min: [5, 0], max: [6, 1.7]}, top: 2.5}
  - {name: above, box: {min: [5, 2.3], max: [6, 4]}, top: 2.5}
  - {name: bench, box: {min: [1, 0], max: [3, 0.5]}, top: 0.45}
agents:
  - {name: guests, count: 1, start: {rectangle: [1, 1, 2, 3]}, goal: {point: [8, 2]}}
"""


def behavior(name: str, torso: float) -> Behavior:
    return Behavior(name, "", (0.0,), (), 1.0, 1.0, "#1f77b4", np.array([0.15, torso]), Path())


BEHAVIORS = (behavior("narrow", 0.15), behavior("wide", 0.30))


def test_the_wide_stays_in_its_room_and_the_narrow_passes():
    scenario = parse_scenario(TEXT)
    narrow, wide = reachable_areas(scenario, BEHAVIORS)
    assert narrow.covers(shapely.Point(8.0, 2.0))
    assert not wide.covers(shapely.Point(8.0, 2.0))
    reach = 0.30 + TRACKING_MARGIN
    # The first room, less a strip as wide as the torso along walls, and as the legs along the bench.
    beside_the_wall = wide.intersection(shapely.box(0.0, 0.0, 10.0, 1.5))
    assert beside_the_wall.bounds == pytest.approx((reach, reach, 5.0 - reach, 1.5), abs=1e-6)
    assert wide.covers(shapely.Point(2.0, 0.5 + 0.15 + TRACKING_MARGIN + 0.01))
    assert not wide.covers(shapely.Point(2.0, 0.5 + 0.15 + TRACKING_MARGIN - 0.01))
    assert wide.difference(narrow).area < 1e-9


def test_the_picture_has_a_panel_a_layer_and_names_what_it_shows(tmp_path):
    scenario = parse_scenario(TEXT)
    figure = draw_scenario(scenario, BEHAVIORS)
    assert [axes.get_title(loc="left") for axes in figure.axes] == ["legs, 0.1 to 2 m", "torso, 0.65 to 1.5 m"]
    areas = reachable_areas(scenario, BEHAVIORS)
    texts = [text.get_text() for text in figure.legends[0].get_texts()]
    assert {"start", "goal", f"within reach, wide: {areas[1].area:.1f} m²"} < set(texts)
    write_figure(figure, tmp_path / "rooms.png")
    assert (tmp_path / "rooms.png").read_bytes()[:4] == b"\x89PNG"


def test_a_plane_is_named_with_its_one_height():
    planes = "layers: [{name: legs, height: 0.3}, {name: torso, height: 1.2}]\n"
    figure = draw_scenario(parse_scenario(TEXT + planes), BEHAVIORS)
    assert [axes.get_title(loc="left") for axes in figure.axes] == ["legs, at 0.3 m", "torso, at 1.2 m"]


def test_names_of_groups_do_not_overlap_and_stand_once_in_each_panel():
    same = "".join(
        f"  - {{name: from the {side}, count: 1, start: {{rectangle: [1, 1, 2, 3]}}, goal: {{point: [8, {y}]}}}}\n"
        for y, side in enumerate(("north", "south", "east"), start=1)
    )
    figure = draw_scenario(parse_scenario(TEXT + same), BEHAVIORS)
    for axes in figure.axes:
        names = [text for text in axes.texts if text.get_text()]
        assert [name.get_text() for name in names] == [
            "guests", "from the north", "from the south", "from the east",
        ]  # fmt: skip
        assert len({name.get_color() for name in names}) == 4
        boxes = [name.get_window_extent() for name in names]
        assert not any(a.overlaps(b) for k, a in enumerate(boxes) for b in boxes[:k])
        assert axes.get_title(loc="left")
