"""Tables, read back by what they are made for."""

import csv
import math
import sqlite3
import sys
from contextlib import closing
from dataclasses import replace

import jupedsim
import numpy as np
import pandas
import pedpy
import pytest

from crowdsim.errors import CrowdSimError
from crowdsim.export.formats import export
from crowdsim.export.options import ExportOptions
from crowdsim.recording.header import AgentState, Ends, SolidRecord
from crowdsim.recording.reader import Recording
from crowdsim.recording.writer import RecordingWriter
from tests.support.odd_recording import ODD_NAMES, odd_header, write_recording
from tests.support.small_recording import small_frame, small_header, write_small_recording


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    """90 steps, 20 a second, of three agents, the last of whom comes after a second."""
    with Recording.open(write_small_recording(tmp_path_factory.mktemp("tables") / "small.h5")) as opened:
        yield opened


def expected_rows(recording, every=1):
    """(id, frame, x, y, heading) of all who are present, one by one."""
    return [
        (
            agent,
            step // every,
            *(float(column[step, agent]) for column in (recording.x, recording.y, recording.heading)),
        )
        for step in range(0, recording.steps, every)
        for agent in range(recording.agent_count)
        if recording.state[step, agent] != AgentState.ABSENT
    ]


def test_the_table_holds_every_row_of_those_present(recording):
    table = recording.table()
    assert list(table) == ["id", "frame", "time", "x", "y", "heading", "behavior", "state", "group"]
    found = table[["id", "frame", "x", "y", "heading"]].itertuples(index=False, name=None)
    assert list(found) == expected_rows(recording)
    assert table.time.iloc[-1] == 89 / 20
    assert set(table.state) == {"moving"}
    assert table[table.id == 1].behavior.unique().tolist() == ["arm_constrained"]


def test_a_table_at_a_lower_rate_holds_recorded_steps(recording):
    table = recording.table(rate=4)
    found = table[["id", "frame", "x", "y", "heading"]].itertuples(index=False, name=None)
    assert list(found) == expected_rows(recording, 5)
    with pytest.raises(CrowdSimError, match="choose one of"):
        recording.table(rate=3)


def test_csv_reads_back(recording, tmp_path):
    table = pandas.read_csv(export(recording, tmp_path / "run.csv"))
    whole = recording.table()
    for name in ("x", "y", "heading", "time"):
        assert np.abs(table[name] - whole[name]).max() <= 5.1e-5
    for name in ("id", "frame", "behavior", "state", "group"):
        assert (table[name] == whole[name].astype(table[name].dtype)).all()


def test_odd_names_come_through_csv_as_they_are(tmp_path):
    with Recording.open(write_recording(tmp_path / "odd.h5", odd_header(), 30)) as odd:
        file = export(odd, tmp_path / "odd.csv")
    with file.open(newline="", encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    assert {(int(row["id"]), row["group"]) for row in rows} == set(enumerate(ODD_NAMES))


def test_parquet_is_the_table_to_the_bit(recording, tmp_path):
    table = pandas.read_parquet(export(recording, tmp_path / "run.parquet", rate=10))
    pandas.testing.assert_frame_equal(table, recording.table(rate=10), check_categorical=False)


def test_odd_names_come_through_parquet_as_they_are(tmp_path):
    with Recording.open(write_recording(tmp_path / "odd.h5", odd_header(), 30)) as odd:
        table = pandas.read_parquet(export(odd, tmp_path / "odd.parquet"))
    assert set(zip(table.id, table.group, strict=True)) == set(enumerate(ODD_NAMES))


def assert_same_tracks(loaded, recording, tolerance, every=1):
    """What PedPy loaded has all rows of the recording."""
    data = loaded.data.sort_values(["frame", "id"])
    expected = np.array(expected_rows(recording, every))
    assert loaded.frame_rate == recording.steps_per_second / every
    assert np.array_equal(data[["id", "frame"]], expected[:, :2])
    assert np.abs(data[["x", "y"]].to_numpy() - expected[:, 2:4]).max() <= tolerance


def test_pedpy_reads_text(recording, tmp_path):
    file = export(recording, tmp_path / "run.txt", rate=10)
    assert_same_tracks(pedpy.load_trajectory_from_txt(trajectory_file=file), recording, 5.1e-5, 2)


def test_pedpy_reads_files_for_vadere(recording, tmp_path):
    file = export(recording, tmp_path / "run.traj")
    loaded = pedpy.load_trajectory_from_vadere(trajectory_file=file, frame_rate=20)
    assert_same_tracks(loaded, recording, 6e-5)


def test_steps_for_vadere_end_where_the_next_ones_begin(recording, tmp_path):
    table = pandas.read_csv(export(recording, tmp_path / "run.traj"), sep=" ")
    for _, steps in table.groupby("pedestrianId"):
        ends = steps[["endTime", "endX-PID1", "endY-PID1"]].to_numpy()
        starts = steps[["simTime", "startX-PID1", "startY-PID1"]].to_numpy()
        assert np.array_equal(ends[:-1], starts[1:])
        assert np.array_equal(ends[-1], starts[-1])


def test_steps_for_vadere_do_not_lead_back_across_a_periodic_floor(tmp_path):
    header = replace(small_header(2, 10), ends=Ends(0, -4.0, 4.0))
    with RecordingWriter(tmp_path / "ring.h5", header) as writer:
        for step in range(200):
            frame = small_frame(header, step)
            writer.append(frame._replace(x=header.ends.inside(frame.x)), step)
        writer.finish({})
    with Recording.open(tmp_path / "ring.h5") as ring:
        table = pandas.read_csv(export(ring, tmp_path / "ring.traj"), sep=" ")
        jumps = int((np.abs(np.diff(ring.x[:], axis=0)) > 4.0).sum())
    assert jumps >= 4
    assert (table["endX-PID1"] - table["startX-PID1"]).abs().max() < 0.2
    assert (table.simTime == table.endTime).sum() == jumps + 2


def with_floors(header):
    """Two layers; the cupboard stands in a room of its own, where nobody comes."""
    rooms = "MULTIPOLYGON (((-4 -2.5, 4 -2.5, 4 2.5, -4 2.5, -4 -2.5)), ((10 0, 20 0, 20 9, 10 9, 10 0)))"
    crate = SolidRecord("crate", "POLYGON ((0 -0.3, 1 -0.3, 1 0.3, 0 0.3, 0 -0.3))", 0.0, 0.5)
    return replace(header, walkable=(rooms, "POLYGON ((0 0, 9 0, 9 9, 0 0))"), movables=(crate,))


def test_pedpy_and_jupedsim_read_sqlite(tmp_path):
    header = with_floors(small_header())
    with RecordingWriter(tmp_path / "run.h5", header) as writer:
        for step in range(60):
            if step in (20, 40):
                writer.add_change(0, header.movables[0].footprint if step == 20 else None)
            writer.append(small_frame(header, step), step)
        writer.finish({})
    with Recording.open(tmp_path / "run.h5") as recording:
        file = export(recording, tmp_path / "run.sqlite", rate=10)
        assert_same_tracks(pedpy.load_trajectory_from_jupedsim_sqlite(trajectory_file=file), recording, 0.0, 2)
        headings = recording.heading[:]
    # All areas together: the crate is not always there, and nobody was in the other room.
    assert pedpy.load_walkable_area_from_jupedsim_sqlite(trajectory_file=file).area == pytest.approx(40.0)
    played = jupedsim.Recording(str(file))
    assert played.fps == 10
    assert played.num_frames == 30
    areas = {played.geometry_id_for_frame(frame) for frame in range(10)}
    assert {played.geometry_id_for_frame(frame) for frame in range(20, 30)} == areas
    assert {played.geometry_id_for_frame(frame) for frame in range(10, 20)}.isdisjoint(areas)
    assert [agent.id for agent in played.frame(29).agents] == [0, 1, 2]
    for agent in played.frame(29).agents:
        heading = headings[58, agent.id]
        assert agent.orientation == pytest.approx((np.cos(heading), np.sin(heading)), abs=1e-6)
    bounds = played.bounds()
    assert (bounds.xmin, bounds.xmax, bounds.ymin, bounds.ymax) == (-4.0, 4.0, -2.5, 2.5)
    played.db.close()


def test_sqlite_of_a_part_counts_frames_from_its_beginning(tmp_path):
    with Recording.open(write_recording(tmp_path / "run.h5", with_floors(small_header()), 60)) as recording:
        options = ExportOptions(layer="torso")
        file = export(recording, tmp_path / "run.sqlite", start=1.0, end=2.0, agents="1", options=options)
        with closing(sqlite3.connect(file)) as base:
            rows = base.execute("SELECT frame, id FROM trajectory_data ORDER BY frame").fetchall()
            metadata = dict(base.execute("SELECT key, value FROM metadata").fetchall())
        assert rows == [(frame, 1) for frame in range(21)]
        assert float(metadata["start"]) == 1.0
        assert float(metadata["xmax"]) == 9.0
        with pytest.raises(CrowdSimError, match="no layer 'knees'"):
            export(recording, file, options=ExportOptions(layer="knees"))


def test_sqlite_needs_a_recording_that_holds_free_floors(recording, tmp_path):
    with pytest.raises(CrowdSimError, match="before free floors were kept"):
        export(recording, tmp_path / "run.sqlite")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(("steps", "present"), [(0, True), (5, False)])
def test_nobody_is_a_table_without_rows(tmp_path, steps, present):
    with Recording.open(write_recording(tmp_path / "empty.h5", with_floors(small_header(1)), steps, present)) as empty:
        assert len(empty.table()) == 0
        table = pandas.read_csv(export(empty, tmp_path / "empty.csv"))
        assert len(pandas.read_parquet(export(empty, tmp_path / "empty.parquet"))) == 0
        assert export(empty, tmp_path / "empty.txt").read_text() == "# framerate: 20\n# id frame x/m y/m z/m\n"
        assert len(pandas.read_csv(export(empty, tmp_path / "empty.traj"), sep=" ")) == 0
        played = jupedsim.Recording(str(export(empty, tmp_path / "empty.sqlite")))
    assert played.num_frames == steps
    assert played.geometry().area == pytest.approx(90.0)  # the largest part
    played.db.close()
    assert len(table) == 0
    assert list(table)[:3] == ["id", "frame", "time"]


@pytest.mark.parametrize("kind", ["csv", "parquet", "txt", "sqlite", "traj"])
def test_the_same_recording_gives_the_same_bytes(tmp_path, kind):
    with Recording.open(write_recording(tmp_path / "run.h5", with_floors(small_header()), 60)) as recording:
        files = [export(recording, tmp_path / f"{number}.{kind}").read_bytes() for number in range(2)]
    assert files[0] == files[1]


def test_an_extra_that_is_missing_is_named(recording, tmp_path, monkeypatch):
    for name in ("pandas", "pyarrow"):
        monkeypatch.setitem(sys.modules, name, None)
    with pytest.raises(CrowdSimError, match=r"pip install 'crowdsim\[table\]'"):
        recording.table()
    with pytest.raises(CrowdSimError, match=r"pip install 'crowdsim\[table\]'"):
        export(recording, tmp_path / "run.parquet")


def test_a_part_of_the_run_holds_that_part(recording, tmp_path):
    table = pandas.read_csv(export(recording, tmp_path / "part.csv", rate=10, start=1.0, end=2.0, agents="0,2"))
    assert sorted(table.id.unique()) == [0, 2]
    assert math.isclose(table.time.min(), 1.0)
    assert math.isclose(table.time.max(), 2.0)
    assert len(table) == 2 * 11


def test_wrong_endings_and_options_are_refused(recording, tmp_path):
    for name in ("run.xyz", "run"):
        with pytest.raises(CrowdSimError, match="choose one of html, csv"):
            export(recording, tmp_path / name)
    with pytest.raises(CrowdSimError, match="csv files take no title"):
        export(recording, tmp_path / "run.csv", options=ExportOptions(title="A title"))
    with pytest.raises(CrowdSimError, match="does not exist"):
        export(recording, tmp_path / "nowhere" / "run.csv")
    assert not list(tmp_path.iterdir())


def test_a_format_can_be_named_whatever_the_ending(recording, tmp_path):
    assert export(recording, tmp_path / "run.data", kind="csv").read_text().startswith("id,frame,time")
