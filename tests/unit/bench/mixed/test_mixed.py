"""Benchmarks of both levels in one crowd, on few people."""

import json
import sys

import numpy as np
import pytest

from crowdsim.bench.crowds import drills
from crowdsim.bench.mixed import cases, shares, square, strewn, switch_poses
from crowdsim.bench.mixed.gaps import FAR, KINDS, LeastGaps, core_gaps
from crowdsim.bench.mixed.jupedsim_crowd import RADIUS, walk_anticipating
from crowdsim.bench.mixed.walks import cast_of, scenario_of, walk_mixed
from crowdsim.errors import CrowdSimError
from crowdsim.scenario.loader import parse_scenario
from tests.reference.steering_reference import segment_to_segment

TWO = """\
crowdsim: 1
name: two
seed: 1
duration: 60
steps_per_second: 10
floor: {rectangle: [0, 0, 14, 6]}
agents:
  - {name: east, count: 1, start: {point: [1, 3]}, goal: {point: [13, 3]}}
  - {name: west, count: 1, start: {point: [13, 3.2]}, goal: {point: [1, 3.2]}}
"""


def test_distances_of_cores_are_those_of_the_twin():
    ends = np.random.default_rng(1).normal(0.0, 0.5, (4, 300, 2))
    ends[1, :20] = ends[0, :20]
    ends[3, 10:30] = ends[2, 10:30]
    found = core_gaps(*ends)
    for k, gap in enumerate(found):
        assert gap == pytest.approx(segment_to_segment(ends[:2, k], ends[2:, k]), abs=1e-12)
    assert (found == 0.0).sum() > 10


@pytest.fixture(scope="module")
def crossed():
    """Twelve who cross each other on a square."""
    drawn = square.draw_square(12, 0.2, 1)
    scenario, gaps = scenario_of(drawn.drill), LeastGaps()
    return drawn, walk_mixed(scenario, cast_of(scenario, drawn.state), gaps.watch), gaps


def test_people_of_a_square_go_straight_ahead_to_sides_that_they_are_not_at(crossed):
    drawn, result, _ = crossed
    places = np.column_stack((drawn.state["x"], drawn.state["y"]))
    apart = np.hypot(*(places[:, None] - places).T) + 9.0 * np.eye(12)
    assert apart.min() > max(square.APART, 2.0 * RADIUS)
    assert sum(group.count for group in drawn.drill.groups) == 12
    for place, goal in zip(places, drawn.state["goal"], strict=True):
        left, bottom, right, top = drawn.goals[goal].bounds
        assert left - 0.2 <= place[0] <= right + 0.2 or bottom - 0.2 <= place[1] <= top + 0.2
        assert not (left <= place[0] <= right and bottom <= place[1] <= top)
    assert np.isfinite(result.arrived).all()


def test_gaps_are_taken_of_all_kinds_of_pairs(crossed):
    _, result, gaps = crossed
    assert gaps.agent_steps == pytest.approx(result.agent_steps, abs=12)
    assert 0 < gaps.captured_steps < gaps.agent_steps
    assert set(gaps.gaps) == set(KINDS)
    assert 0.0 < min(gaps.gaps["steered_steered"], gaps.gaps["steered_captured"]) < FAR
    assert 0.0 < gaps.ahead < FAR
    assert gaps.reserved >= 0.0
    # What is looked at more often comes out no farther apart.
    assert min(gaps.gaps.values()) <= result.gap + 1e-9


def test_gaps_are_found_where_bodies_overlap(crossed):
    drawn, *_ = crossed
    gaps = LeastGaps()
    scenario = scenario_of(drawn.drill)

    def watch(time, crowd):
        rows = crowd.steered.world.column("row")
        if len(rows) > 1:
            rows["x"][1], rows["y"][1] = rows["x"][0] + 0.1, rows["y"][0]
            gaps.watch(time, crowd)
            raise StopIteration

    with pytest.raises(StopIteration):
        walk_mixed(scenario, cast_of(scenario, drawn.state), watch)
    assert gaps.gaps["steered_steered"] < 0.0


def test_a_case_says_what_came_of_steered_and_of_auto_people(monkeypatch):
    monkeypatch.setattr(cases, "SEEDS", (1,))
    row = cases.walked(drills.door(2, 1.2), 40.0)
    assert tuple(row) == cases.KEYS
    assert (row["failed"], row["missing"]) == (0, 0)
    assert cases.walked(drills.door(2, 1.2), 1.0)["failed"] == 1
    assert cases.circle(6, 20.0)["failed"] == 0


def test_who_is_alone_takes_no_longer_than_in_company():
    scenario = parse_scenario(TWO)
    alone, both = shares.times_alone(scenario), walk_mixed(scenario)
    assert np.isfinite(alone.times).all()
    assert alone.captured == 1.0
    assert (alone.times <= both.times + 1.0).all()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(shares, "ALONE_SECONDS", 2.0)
        with pytest.raises(AssertionError, match="alone did not arrive in 2 s"):
            shares.times_alone(scenario)


def test_without_jupedsim_its_extra_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "jupedsim", None)
    with pytest.raises(CrowdSimError, match=r"pip install 'crowdsim\[jupedsim\]'"):
        square.measure()


def test_a_square_is_walked_here_and_in_jupedsim(monkeypatch):
    pytest.importorskip("jupedsim")
    monkeypatch.setattr(square, "COUNT", 8)
    monkeypatch.setattr(square, "DENSITIES", (0.2,))
    measured = square.measure()
    (row,) = measured.rows
    assert (row["missing"], row["jupedsim_missing"]) == (0, 0)
    # So few on so small a square are there in seconds, of which setting out is most.
    assert row["failed"] == int(row["last_s"] > square.SLOWER * row["jupedsim_last_s"])
    assert json.loads(json.dumps(measured.figures)) == measured.figures
    assert set(measured.headline) <= set(measured.figures)
    drawn = square.draw_square(8, 0.2, 1)
    theirs = walk_anticipating(drawn.state, drawn.drill.area, drawn.goals, 0.5)
    assert np.isnan(theirs).all(), "nobody can be there by then"


def test_a_kick_of_a_joint_is_told_from_its_own_motion():
    plain = np.zeros((8, 2, 3))
    plain[:, :, 0] = 0.04 * np.arange(8)[:, None]
    plain[3:, 1, 0] += 0.3
    assert switch_poses.beyond_levels(plain, plain) == pytest.approx((0.0, 0.0, 0.0), abs=1e-12)
    shown = plain.copy()
    shown[5:, 1, 1] += 0.05
    assert switch_poses.beyond_levels(shown, plain) == pytest.approx((0.05, 0.0, 0.0), abs=1e-12)


def test_a_change_of_speed_is_told_from_those_of_both_levels():
    plain = np.zeros((8, 1, 3))
    # Steady before the switch at the third row; afterwards slower by 0.3 m/s in each thirtieth of a second.
    plain[:, 0, 0] = np.cumsum([0.04, 0.04, 0.04, 0.04, 0.03, 0.02, 0.01, 0.0])
    assert switch_poses.beyond_levels(plain, plain)[1] == pytest.approx(0.0, abs=1e-12)
    shown = plain.copy()
    shown[4:, 0, 1] += 0.01 * np.arange(1, 5)
    assert switch_poses.beyond_levels(shown, plain) == pytest.approx((0.01, 0.3, 0.0))
    shown[4:, 0, 2] += 0.02 * np.arange(1, 5)
    _, track, vertical = switch_poses.beyond_levels(shown, plain)
    assert (track, vertical) == pytest.approx((0.3, 0.6)), "along the floor and along the vertical apart"


def test_a_foot_slips_only_while_it_is_planted():
    balls = np.zeros((12, 2, 3))
    # The left foot creeps 4 mm on the floor, is lifted and carried ahead, and creeps 2 mm.
    balls[:5, 0, 0] = 0.001 * np.arange(5)
    balls[5:8, 0] = [[0.1, 0.0, 0.03], [0.3, 0.0, 0.05], [0.5, 0.0, 0.02]]
    balls[8:, 0, 0] = 0.6 + 0.001 * np.minimum(np.arange(4), 2)
    planted = switch_poses.planted_feet(balls)
    assert planted[:, 0].tolist() == [True] * 5 + [False] * 4 + [True] * 3
    assert planted[:, 1].all()
    assert switch_poses.largest_slip(balls, planted) == pytest.approx(0.004)
    # Not its way, but how far it comes.
    balls[:5, 0, 0] = [0.0, 0.003, 0.0, 0.003, 0.0]
    assert switch_poses.largest_slip(balls, planted) == pytest.approx(0.003)


def test_switches_of_a_run_are_measured_as_shown(tmp_path):
    path = tmp_path / "two.yaml"
    path.write_text(TWO)
    measured = switch_poses.measure([(str(path), 1)])
    rows = [row for row in measured.rows if row["switches"]]
    assert {row["to"] for row in measured.rows} == {"steered", "captured"}
    assert rows
    for row in rows:
        for key, most in (("jump", 0.05), ("speed", 0.3), ("lift", 0.3), ("slip", 0.03)):
            assert 0.0 <= row[f"{key}_median"] <= row[f"{key}_p90"] <= row[f"{key}_worst"] < most
            bar = getattr(switch_poses, f"MOST_{key.upper().replace('LIFT', 'SPEED')}")
            assert (row[f"{key}_over"] > 0) == (row[f"{key}_worst"] > bar)
        assert row["jump_worst"] > 0.0


def test_halls_count_those_who_do_not_arrive(monkeypatch):
    found = strewn.measure(dense=(1, 2), normal=(1,), each=3)
    assert [(row["locomotion"], row["density"], row["halls"]) for row in found.rows] == [
        ("steered", "dense", 2),
        ("steered", "normal", 1),
        ("auto", "dense", 2),
        ("auto", "normal", 1),
    ]
    for row in found.rows:
        assert row["people"] == 6 * row["halls"]
        assert row["missing"] == 0
        assert row["all_arrive"] == row["halls"]
        assert 8.0 < row["mean_s"] < 60.0
    # Nobody crosses a hall in four seconds.
    monkeypatch.setattr(strewn, "SECONDS", 4.0)
    [row, *_] = strewn.measure(dense=(1,), normal=(1,), each=2).rows
    assert (row["all_arrive"], row["missing"], row["most_missing"]) == (0, 4, 4)
