"""Benchmarks of steered crowds on few agents."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from shapely import box

from crowdsim.bench.crowds import drill_table, drills, endless, rimea_corner, single_file
from crowdsim.bench.crowds.rvo2 import Rvo2
from crowdsim.bench.mixed import hall
from crowdsim.errors import CrowdSimError
from crowdsim.steering.steering import Steering
from crowdsim.steering.walls import build_walls


def test_a_folder_without_rvo2_is_refused(tmp_path):
    with pytest.raises(CrowdSimError, match=r"src/RVO\.h"):
        Rvo2(tmp_path, tmp_path)


def test_drills_say_who_arrived(monkeypatch):
    monkeypatch.setattr(drill_table, "SEEDS", (1,))
    monkeypatch.setattr(drill_table, "DRILLS", ((drills.door(2, 1.2), 40.0),))
    neck = dataclasses.replace(drills.bottleneck(2.4), groups=(drills.Group(24, (-6, -3, -1, 3), box(6, -3, 11, 3)),))
    monkeypatch.setattr(drill_table, "BOTTLENECKS", ((neck, 2.4),))
    monkeypatch.setattr(drill_table, "PARTINGS", ())
    monkeypatch.setattr(drill_table, "LEAST_FLOW", 0.5)
    monkeypatch.setattr(drill_table, "CIRCLES", {6: 5.0})
    monkeypatch.setattr(drill_table, "ONE_WAY", {0.5: (0.5, 2.0)})
    monkeypatch.setattr(drill_table, "BOTH_WAYS", {0.5: 9.0})
    monkeypatch.setattr(endless, "MEASURED", 1.0)
    monkeypatch.setattr(drill_table, "BANDS", {0.5: (0.1, 2.0)})
    monkeypatch.setattr(drill_table, "run_around", lambda seed: rimea_corner.run_around(seed, 8))
    measured = drill_table.measure()
    words = "door bottleneck circle one both single single straight, large straight,"
    assert [row["drill"].split()[0] for row in measured.rows] == words.split()
    assert all(tuple(row) == drill_table.KEYS for row in measured.rows)
    # Nobody is asked for 9 m/s but those who walk both ways.
    assert [row["failed"] for row in measured.rows] == [0, 0, 0, 0, 1, 0, 0, 0, 0, 0]
    assert 4.0 < measured.rows[0]["last_s"] < 40.0
    corner = "large crowd around a corner (RiMEA 15)"
    assert measured.figures[f"{corner} missing"] == 0.0
    assert f"{corner} speed" not in measured.figures


def test_agents_of_a_drill_do_not_touch():
    state = drills.draw_agents(drills.crossing(10), 1)
    places = np.column_stack((state["x"], state["y"]))
    apart = np.hypot(*(places[:, None] - places[None]).transpose(2, 0, 1)) + 9.0 * np.eye(len(state))
    assert apart.min() > 0.52
    with pytest.raises(ValueError, match="9 agents find no room"):
        drills.scatter(np.random.default_rng(1), 9, (0.0, 0.0, 1.0, 1.0))


def test_a_corridor_without_ends_is_alike_everywhere():
    """Moved along, with the ends in the midst of them, the same people decide the same."""
    walls = build_walls(np.array([[-9.0, 0.0, 35.0, 0.0], [-9.0, 2.0, 35.0, 2.0]]))
    with Steering(walls, walls, leg_radius=drills.LEG_RADIUS) as steps:

        def stepped(people):
            all_of_them = endless.with_copies(people)
            assert len(all_of_them) > len(people)
            steps.step(all_of_them)
            return all_of_them[: len(people)].copy()

        def wrap(people):
            endless.shift(people, -endless.LENGTH * np.floor(people["x"] / endless.LENGTH))

        state = endless.draw_endless(2.0, 1, True)
        for _ in range(30):
            state = stepped(state)
            wrap(state)
        moved = state.copy()
        endless.shift(moved, 13.0)
        wrap(moved)
        one, other = stepped(state), stepped(moved)
    for name in ("vx", "vy", "hx", "opposed", "stuck"):
        # Where two choices are as good, rounding may decide.
        assert np.isclose(one[name], other[name], atol=1e-6).sum() >= len(state) - 2
    keys = one["key"] + one["gx"] * one["x"] - other["key"] - other["gx"] * other["x"]
    assert np.isclose(keys, 0.0, atol=1e-6).sum() >= len(state) - 2


@pytest.mark.parametrize("density", [0.5, 3.0])
def test_people_in_a_corridor_without_ends_do_not_touch(density):
    state = endless.draw_endless(density, 1, False)
    assert len(state) == round(52 * density)
    assert state["speed"].mean() == pytest.approx(1.34, abs=0.01)
    along = np.abs(state["x"][:, None] - state["x"])
    along = np.minimum(along, endless.LENGTH - along)
    across = np.abs(state["y"][:, None] - state["y"])
    breadth = state["half"] + 0.125
    free = (along > 0.25) | (across > breadth[:, None] + breadth) | np.eye(len(state), dtype=bool)
    assert free.all()
    assert (state["y"] > breadth).all()
    assert (state["y"] < 2.0 - breadth).all()


@pytest.mark.parametrize("density", single_file.BANDS)
def test_a_file_starts_in_order_without_touching(density):
    state = single_file.draw_file(density, single_file.NARROW, 1)
    assert len(state) == pytest.approx(density * single_file.LENGTH)
    assert np.diff(np.append(state["x"], state["x"][0] + single_file.LENGTH)).min() > 0.25
    assert (np.abs(state["y"] - single_file.NARROW / 2.0) + state["half"] + 0.125 < single_file.NARROW / 2.0).all()


def test_a_file_is_as_fast_as_measured_and_keeps_its_order(monkeypatch):
    monkeypatch.setattr(endless, "MEASURED", 20.0)
    for density, width in ((0.3, single_file.NARROW), (1.9, single_file.NARROW), (1.3, single_file.LANE)):
        result = single_file.run_single_file(density, width, 1)
        low, high = single_file.BANDS[density]
        assert low < result.walked.speed < high
        assert result.overtaken == 0
    assert single_file.run_single_file(2.1, single_file.LANE, 1).overtaken > 0


def test_a_large_crowd_begins_in_rows_between_walls_of_the_lengths_asked_for():
    state = rimea_corner.draw_crowd(1, rimea_corner.COUNT)
    breadth = state["half"] + 0.125
    along = np.abs(state["x"][:, None] - state["x"])
    across = np.abs(state["y"][:, None] - state["y"])
    assert ((along > 0.25) | (across > breadth[:, None] + breadth) | np.eye(len(state), dtype=bool)).all()
    assert (np.minimum(state["y"], rimea_corner.WIDTH - state["y"]) > breadth).all()
    assert state["x"].min() > 0.125
    assert state["x"].max() < rimea_corner.START
    # Both walls, both ends, and the goal between longer walls; chords are a little shorter than their arc.
    outline = rimea_corner.around_corner().area.exterior.length
    assert outline == pytest.approx(50.0 + 81.416 + 2.0 * (20.0 + 3.0), abs=0.06)


def test_few_take_a_time_around_a_corner_between_those_of_both_walls():
    few = rimea_corner.run_around(1, 8)
    assert few.lies_between()
    assert not dataclasses.replace(few, corner=few.short).lies_between()


@pytest.mark.parametrize("density", [1.0, 2.0, 3.0])
def test_who_walks_one_way_is_as_fast_as_people_measured(density):
    least, most = endless.ONE_WAY[density]
    assert least <= endless.run_endless(density, 501).speed <= most


@pytest.mark.parametrize("density", [1.0, 2.0])
def test_who_walks_both_ways_passes(density):
    assert endless.run_endless(density, 501, both_ways=True).speed >= endless.BOTH_WAYS[density]


@pytest.mark.parametrize("width", [0.8, 1.2])
def test_a_neck_lets_through_what_it_is_to(width):
    assert drills.run_drill(drills.bottleneck(width), 501).flow() / width >= drill_table.LEAST_FLOW


@pytest.mark.parametrize("goals", [1, 2, 10])
def test_a_door_lets_through_as_many_wherever_they_go_behind_it(goals):
    """Of two goals or ten, those who queued for one door once took each other for opposing traffic."""
    result = drills.run_drill(drills.parting(goals, 2.0), 501)
    assert np.isfinite(result.arrived).all()
    assert result.flow() / 2.0 >= drill_table.LEAST_PARTING


@pytest.mark.parametrize("drill", [drills.counterflow(100), drills.crossing(40)], ids=["counterflow", "crossing"])
def test_everyone_arrives_in_time(drill):
    # Nobody who has not arrived (nan) is in time.
    (seconds,) = (most for walked, most in drill_table.DRILLS if walked.name == drill.name)
    assert (drills.run_drill(drill, 501).arrived <= seconds).all()


@pytest.mark.parametrize("density", hall.DENSITIES)
def test_nobody_touches_people_or_walls_in_a_full_hall(density):
    least = hall.hall_gaps(density, 20_000, seed=2)
    assert 0.0 < min(least) < max(least) < 0.01
