"""What recordings hold for those who read them elsewhere: free floors, all goals, areas and lines, times."""

from dataclasses import replace

import h5py
import numpy as np
import pytest
import shapely

from crowdsim.analysis.analyze import analyze
from crowdsim.errors import RecordingError
from crowdsim.recording.header import AgentState, LayerRecord, ShapeRecord, SolidRecord
from crowdsim.recording.reader import Recording
from crowdsim.recording.writer import RecordingWriter
from tests.support.small_recording import small_frame, small_header, write_small_recording

FLOORS = ("POLYGON ((-4 -2.5, 4 -2.5, 4 2.5, -4 2.5, -4 -2.5))", "MULTIPOLYGON (((0 0, 4 0, 4 2, 0 2, 0 0)))")


@pytest.fixture
def header():
    header = small_header()
    routes = np.array([[0.0, 0], [1, 0], [2, 0], [3, 3], [4, 4], [5, 5]])
    return replace(
        header,
        agents=replace(header.agents, routes=routes, route_ends=np.array([3, 4, 6])),
        layers=(LayerRecord("legs", 0.1, 2.0), LayerRecord("torso", 0.8, 1.5)),
        movables=(
            SolidRecord("crate", "POLYGON ((0 0, 1 0, 1 1, 0 1, 0 0))", 0.0, 0.5),
            SolidRecord("sign", "POLYGON ((2 0, 3 0, 3 1, 2 1, 2 0))", 1.0, 1.2),
            SolidRecord("lamp", "POLYGON ((3 0, 4 0, 4 1, 3 1, 3 0))", 2.5, 3.0),
        ),
        walkable=FLOORS,
        areas=(ShapeRecord('the "hall"', "POLYGON ((0 0, 1 0, 1 1, 0 0))"),),
        lines=(ShapeRecord("door", "LINESTRING (0 0, 1 1, 2 0)"),),
    )


@pytest.fixture
def recording(header, tmp_path):
    """The crate is there from the second step on, sign and lamp from the third."""
    with RecordingWriter(tmp_path / "kept.h5", header) as writer:
        for step in range(4):
            if step == 1:
                writer.add_change(0, header.movables[0].footprint)
            if step == 2:
                writer.add_change(1, header.movables[1].footprint)
                writer.add_change(2, header.movables[2].footprint)
            writer.append(small_frame(header, step), step)
        writer.finish({})
    with Recording.open(tmp_path / "kept.h5") as opened:
        yield opened


def test_areas_and_lines_come_back(recording, header):
    assert recording.header.areas == header.areas
    assert recording.header.lines == header.lines


def test_all_goals_come_back(recording):
    assert [recording.goals_of(agent).tolist() for agent in range(3)] == [
        [[0, 0], [1, 0], [2, 0]],
        [[3, 3]],
        [[4, 4], [5, 5]],
    ]
    for agent in (-1, 3):
        with pytest.raises(RecordingError, match="agents 0 to 2"):
            recording.goals_of(agent)


def test_the_free_floor_is_that_between_what_stands_all_the_time(recording):
    assert recording.walkable().equals(shapely.from_wkt(FLOORS[0]))
    assert recording.walkable("torso").equals(shapely.from_wkt(FLOORS[1]))


def test_movables_take_floor_of_the_layers_that_they_are_in(recording):
    assert recording.walkable("legs", 0.0).area == pytest.approx(40.0)
    assert recording.walkable("legs", 0.05).area == pytest.approx(39.0)
    # The ground layer holds what is in any layer; nobody's head is in the lamp.
    assert recording.walkable("legs", 0.1).area == pytest.approx(38.0)
    assert recording.walkable("torso", 0.05).area == pytest.approx(8.0)
    assert recording.walkable("torso", 0.1).area == pytest.approx(7.0)


def test_a_layer_that_is_not_there_is_refused(recording):
    with pytest.raises(RecordingError, match="no layer 'knees'; there are: legs, torso"):
        recording.walkable("knees")


def test_older_files_say_what_they_lack(tmp_path):
    with Recording.open(write_small_recording(tmp_path / "old.h5", 3)) as old:
        with pytest.raises(RecordingError, match="before free floors were kept"):
            old.walkable()
        with pytest.raises(RecordingError, match="before all goals were kept"):
            old.goals_of(0)
        assert old.header.areas == old.header.lines == ()


def test_files_of_before_areas_were_kept_are_read(tmp_path):
    file = write_small_recording(tmp_path / "old.h5", 3)
    with h5py.File(file, "r+") as opened:
        for name in ("area_names", "area_shapes", "line_names", "line_shapes"):
            del opened["place"][name]
    with Recording.open(file) as old:
        assert old.header.areas == ()


@pytest.mark.parametrize("ends", [[3, 3, 6], [3, 4, 7], [0, 4, 6], [3, 4], [3.0, 4.0, 6.0]])
def test_routes_that_do_not_fit_are_refused(header, tmp_path, ends):
    wrong = replace(header, agents=replace(header.agents, route_ends=np.array(ends)))
    with pytest.raises(RecordingError, match="routes do not fit"):
        RecordingWriter(tmp_path / "wrong.h5", wrong)


def test_free_floors_that_do_not_fit_are_refused(header, tmp_path):
    with pytest.raises(RecordingError, match="1 walkable areas for 2 layers"):
        RecordingWriter(tmp_path / "wrong.h5", replace(header, walkable=FLOORS[:1]))


@pytest.mark.parametrize("steps", [150, 3])
def test_times_are_those_of_the_states(tmp_path, steps):
    header = small_header(5)
    generator = np.random.default_rng(1)
    entered, arrived, left = generator.integers(0, steps, (3, 5))
    states = np.full((steps, 5), AgentState.ABSENT)
    for agent in range(4):  # the last one never comes
        begin, there, end = sorted((entered[agent], arrived[agent], left[agent]))
        states[begin:end, agent] = AgentState.MOVING
        states[there:end, agent] = AgentState.ARRIVED if agent % 2 else AgentState.WAITING
    with RecordingWriter(tmp_path / "times.h5", header) as writer:
        for step in range(steps):
            frame = small_frame(header, 90 + step)  # when all have come
            writer.append(frame._replace(state=states[step]), step)
        writer.finish({})
    with Recording.open(tmp_path / "times.h5") as recording:
        times = recording.agent_times
    for agent in range(5):
        present = np.flatnonzero(states[:, agent] != AgentState.ABSENT)
        there = np.flatnonzero(states[:, agent] == AgentState.ARRIVED)
        stays = len(present) and present[-1] == steps - 1
        wanted_left = np.nan if stays or not len(present) else (present[-1] + 1) / 20
        wanted = (
            present[0] / 20 if len(present) else np.nan,
            there[0] / 20 if len(there) else wanted_left,
            wanted_left,
        )
        assert np.array_equal([column[agent] for column in times[:3]], wanted, equal_nan=True)
        assert not times.removed[agent]


def write_present(path, until, commands):
    """Write a recording of 20 steps in which each agent is present before step ``until[agent]``, and commands."""
    header = replace(small_header(len(until)), walkable=FLOORS)
    with RecordingWriter(path, header) as writer:
        for step in range(20):
            for command in commands:
                if round(command["at"] * 20) == step:
                    writer.add_command(command)
            states = np.where(step < np.array(until), AgentState.MOVING, AgentState.ABSENT)
            writer.append(small_frame(header, 90 + step)._replace(state=states), step)
        writer.finish({})


def test_agents_that_a_command_takes_out_have_not_arrived(tmp_path):
    commands = [{"at": 0.2, "open": "gate"}, {"at": 0.5, "remove_agents": {"agents": [0, 1, 3]}}]
    # Agent 0 is taken out, 1 has left before, 2 leaves at the same time by itself, 3 never comes, 4 stays.
    write_present(tmp_path / "removed.h5", [10, 6, 10, 0, 20], commands)
    with Recording.open(tmp_path / "removed.h5") as recording:
        times = recording.agent_times
        found = analyze(recording, only=["evacuation"]).results[0]
    assert times.removed.tolist() == [True, False, False, False, False]
    assert np.array_equal(times.arrived, [np.nan, 0.3, 0.5, np.nan, np.nan], equal_nan=True)
    assert np.array_equal(times.left, [0.5, 0.3, 0.5, np.nan, np.nan], equal_nan=True)
    assert times.until_share(66) == 0.5
    assert (found.values["characters"], found.values["arrived"], found.values["removed"]) == (3, 2, 1)
    assert "Taken out by commands, and not counted: 1." in found.sentences


def test_nothing_is_measured_if_all_were_taken_out(tmp_path):
    write_present(tmp_path / "removed.h5", [10, 10], [{"at": 0.5, "remove_agents": {"agents": [0, 1]}}])
    with Recording.open(tmp_path / "removed.h5") as recording:
        found = analyze(recording, only=["evacuation"]).results[0]
    assert found.values == {"characters": 0, "removed": 2}
    assert found.sentences == ("All who came were taken out by commands: there is nothing to measure.",)


@pytest.mark.parametrize("removal", [{"agents": [2]}, {"agents": [-1]}, {"agents": ["a"]}, {"agents": 5}, 5, [1]])
def test_commands_that_take_out_nobody_there_is_are_refused(tmp_path, removal):
    write_present(tmp_path / "damaged.h5", [10, 10], [{"at": 0.5, "remove_agents": removal}])
    with Recording.open(tmp_path / "damaged.h5") as recording:
        with pytest.raises(RecordingError, match=r"damaged\.h5 is damaged"):
            _ = recording.commands
        with pytest.raises(RecordingError, match=r"damaged\.h5 is damaged"):
            _ = recording.agent_times
