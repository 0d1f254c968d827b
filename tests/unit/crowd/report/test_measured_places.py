"""What is measured in areas and at lines is what a slow count of every step says."""

import itertools
from pathlib import Path

import numpy as np
import pytest
from shapely import Point, Polygon

from crowdsim.analysis.analyze import analyze
from crowdsim.cli.summary import summary_rows
from crowdsim.crowd.report.measured_places import crossings_of
from crowdsim.crowd.simulation import Simulation
from crowdsim.recording.header import AgentState
from crowdsim.recording.measured import flow_of
from crowdsim.recording.reader import Recording
from crowdsim.scenario.loader import parse_scenario
from tests.support.steered_scenes import steered_scene

GROUPS = (
    "name: east, count: 12, start: {rectangle: [0.5, 0.5, 4, 3.5]}, goal: {rectangle: [15, 0, 16, 4]}",
    "name: west, count: 5, start: {rectangle: [12, 0.5, 15, 3.5]}, goal: {rectangle: [0, 0, 1, 4]}",
)
CORNERS = ((6.0, -0.5), (9.0, 0.5), (9.5, 5.0), (6.0, 3.0))
BEND = ((8.0, 0.0), (8.5, 2.0), (8.0, 4.0))
PLACES = f"""\
areas:
  - {{name: middle, polygon: {[list(point) for point in CORNERS]}, start_time: 3, until: 6}}
lines:
  - {{name: bend, points: {[list(point) for point in BEND]}}}
"""


def run(tmp_path: Path, locomotion: str = "steered") -> Recording:
    text = steered_scene(*GROUPS, floor="{rectangle: [0, 0, 16, 4]}", rest=PLACES, duration=30)
    return Simulation(parse_scenario(text.replace("locomotion: steered", f"locomotion: {locomotion}"))).run(
        tmp_path / "run.h5"
    )


def side(at: tuple[float, float], first: tuple[float, float], second: tuple[float, float]) -> bool:
    """Whether a place is on the left of a line, or on it."""
    (x, y), (x1, y1), (x2, y2) = at, first, second
    return (x2 - x1) * (y - y1) - (y2 - y1) * (x - x1) >= 0.0


def along(at: tuple[float, float], first: tuple[float, float], second: tuple[float, float]) -> float:
    (x, y), (x1, y1), (x2, y2) = at, first, second
    return ((x2 - x1) * (x - x1) + (y2 - y1) * (y - y1)) / ((x2 - x1) ** 2 + (y2 - y1) ** 2)


@pytest.mark.parametrize("locomotion", ["steered", "auto"])
def test_areas_and_lines_are_measured_as_a_slow_count_has_it(tmp_path: Path, locomotion: str) -> None:
    with run(tmp_path, locomotion) as recording:
        x, y, state = recording.x[:], recording.y[:], recording.state[:]
        area, line = recording.measured.areas["middle"], recording.measured.lines["bend"]
        summary, rows = recording.summary, dict(summary_rows({**recording.summary, "recording": "run.h5"}))
    shape, steps, agents = Polygon(CORNERS), *x.shape
    present = state != AgentState.ABSENT

    counts = [
        sum(present[t, a] and shape.contains(Point(x[t, a], y[t, a])) for a in range(agents)) for t in range(steps)
    ]
    np.testing.assert_array_equal(area.count, counts)
    assert area.size == pytest.approx(shape.intersection(Polygon([(0, 0), (16, 0), (16, 4), (0, 4)])).area)
    speeds = np.full(steps, np.nan)
    for t in range(10, steps):
        inside = [
            a for a in range(agents) if present[t, a] and present[t - 10, a] and shape.contains(Point(x[t, a], y[t, a]))
        ]
        if inside:
            speeds[t] = np.mean([np.hypot(x[t, a] - x[t - 10, a], y[t, a] - y[t - 10, a]) for a in inside])
    np.testing.assert_allclose(area.speed, speeds, atol=1e-5)
    during = slice(30, 60)
    assert summary["areas"]["middle"] == {
        "density": pytest.approx(np.mean(counts[during]) / area.size),
        "density_most": pytest.approx(np.max(counts[during]) / area.size),
        "speed": pytest.approx(np.nanmean(speeds[during]), abs=1e-5),
    }

    crossed = []
    for t in range(1, steps):
        for a in range(agents):
            before, after = (x[t - 1, a], y[t - 1, a]), (x[t, a], y[t, a])
            for first, second in itertools.pairwise(BEND):
                is_there = present[t - 1, a] and present[t, a]
                if is_there and side(before, first, second) != side(after, first, second):
                    low, high = 0.0, 1.0
                    for _ in range(50):
                        share = (low + high) / 2.0
                        at = tuple(b + share * (c - b) for b, c in zip(before, after, strict=True))
                        if side(at, first, second) == side(before, first, second):
                            low = share
                        else:
                            high = share
                    if 0.0 <= along(at, first, second) < 1.0:
                        crossed.append(((t - 1 + low) / 10.0, a, side(after, first, second)))
    crossed.sort()
    np.testing.assert_array_equal(line.agent, [agent for _, agent, _ in crossed])
    np.testing.assert_allclose(line.time, [time for time, _, _ in crossed], atol=1e-6)
    np.testing.assert_array_equal(line.to_left, [to_left for _, _, to_left in crossed])
    assert line.length == pytest.approx(2.0 * np.hypot(0.5, 2.0))
    assert line.width == pytest.approx(line.length), "all of it is free floor"
    # Everybody goes through once, those who go east to the right of who walks up along the line.
    assert (summary["lines"]["bend"]["to_left"], summary["lines"]["bend"]["to_right"]) == (5, 12)
    assert summary["lines"]["bend"]["flow"] is None, "12 passages are too few"
    assert rows["passages at bend"] == "5 to the left, 12 to the right"
    assert "/m2" in rows["density in middle"]


def test_who_crosses_a_line_does_so_between_its_ends_and_once() -> None:
    before = np.array([[-1.0, 0.0], [-1.0, 2.0], [1.0, 0.5], [-1.0, 0.0], [np.nan, np.nan], [0.0, 0.5]])
    after = np.array([[1.0, 0.0], [1.0, 2.0], [-1.0, 0.5], [-0.5, 0.0], [1.0, 0.0], [1.0, 0.5]])
    agents, share, to_left = crossings_of(before, after, np.array([0.0, -1.0]), np.array([0.0, 1.0]))
    assert agents.tolist() == [0, 2, 5], "above the end, on this side, from nowhere: none of these"
    assert share.tolist() == [0.5, 0.5, 0.0]
    assert to_left.tolist() == [False, True, False]
    # Two halves of a line that meet where somebody goes through count it once.
    halves = [
        crossings_of(before[:1], after[:1], *ends)[0]
        for ends in (np.array([[0.0, -1.0], [0.0, 0.0]]), np.array([[0.0, 0.0], [0.0, 1.0]]))
    ]
    assert sum(len(found) for found in halves) == 1


def test_the_flow_is_that_of_the_middle_eight_tenths() -> None:
    times = np.concatenate([[0.0, 5.0], np.arange(16) * 0.5 + 20.0, [50.0, 90.0]])
    assert flow_of(times) == pytest.approx(2.0), "one passage every 0.5 s"
    assert flow_of(times[1:]) is None, "19 passages are too few"
    assert flow_of(np.zeros(20)) is None, "at one moment there is no flow"


def test_nothing_is_held_of_a_run_that_measures_nothing(tmp_path: Path) -> None:
    text = steered_scene(GROUPS[1], floor="{rectangle: [0, 0, 16, 4]}", duration=2)
    with Simulation(parse_scenario(text)).run(tmp_path / "run.h5") as recording:
        assert recording.measured.areas == recording.measured.lines == {}
        assert recording.summary["areas"] == recording.summary["lines"] == {}


def test_a_flow_for_each_meter_is_that_of_the_free_part_of_the_line_as_in_an_analysis(tmp_path: Path) -> None:
    neck = Path(__file__).parents[4] / "tools" / "studies" / "neck.yaml"
    scenario = parse_scenario(neck.read_text(encoding="utf-8"), neck, ["agents.0.count=30", "duration=60"])
    with Simulation(scenario).run(tmp_path / "run.h5") as recording:
        summary, line = recording.summary["lines"]["neck"], recording.measured.lines["neck"]
        analyzed = analyze(recording, only=["flow"]).values()["flow"]["neck"]
    assert (line.length, line.width) == (4.0, pytest.approx(1.2))
    assert summary["flow_per_m"] == pytest.approx(summary["flow"] / 1.2)
    assert analyzed["width"] == pytest.approx(line.width)
    assert analyzed["passages"] == summary["to_left"] + summary["to_right"] == 30
    # The analysis knows times of passages to a tenth of a second.
    assert analyzed["flow_per_m"] == pytest.approx(summary["flow_per_m"], rel=0.03)
