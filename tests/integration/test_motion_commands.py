"""``crowdsim motion``: tables of captures, graphs in files, pictures."""

import json
import shutil

import pytest

TRIALS = ("16_15_walk_straight_slow_a", "16_11_walk_veer_left_slow_a", "16_13_walk_veer_right_slow_a")


@pytest.fixture
def folder(tmp_path, shared):
    for trial in TRIALS:
        shutil.copy(shared / "mocap" / f"{trial}.bvh", tmp_path)
    return tmp_path


def test_info_says_what_was_assumed_and_cut(crowdsim_here, folder):
    done = crowdsim_here("motion", "info", str(folder), "--json")
    assert done.returncode == 0, done.stderr
    rows = {row["file"]: row for row in json.loads(done.stdout)["files"]}
    straight = rows["16_15_walk_straight_slow_a.bvh"]
    assert (straight["unit"], straight["up"], straight["facing"]) == ("cm", "+y", "+z")
    assert straight["glitches"] == "2"
    assert any(note.startswith("made of a cycle of clip") for note in json.loads(done.stdout)["notes"])
    assert straight["crossings"] == 4
    assert straight["speed_m_s"] == pytest.approx(1.09, abs=0.02)
    assert rows["16_11_walk_veer_left_slow_a.bvh"]["turn_deg"] == pytest.approx(45, abs=5)
    table = crowdsim_here("motion", "info", str(folder))
    assert table.stdout.splitlines()[0].split()[:3] == ["file", "stretches", "frames"]


def test_info_lists_files_that_cannot_be_read(crowdsim_here, shared):
    done = crowdsim_here("motion", "info", str(shared / "faults" / "bvh"), "--json")
    assert done.returncode == 0, done.stderr
    rows = {row["file"]: row for row in json.loads(done.stdout)["files"]}
    assert len(rows) == 21
    assert all(row["problem"] for row in rows.values())  # none of them has legs to walk on
    assert rows["ok.bvh"]["frames"] == 5
    assert rows["nan.bvh"]["frames"] is None


def test_a_folder_without_captures_is_bad_input(crowdsim_here, tmp_path):
    for arguments in (("info", str(tmp_path)), ("graph", str(tmp_path / "none"))):
        done = crowdsim_here("motion", *arguments)
        assert done.returncode == 2
        assert done.stderr.startswith("error: ")


def test_graph_is_kept_and_drawn(crowdsim_here, folder):
    file, picture = folder / "walks.npz", folder / "walks.png"
    command = ("motion", "graph", str(folder), "-o", str(file), "--picture", str(picture), "--json")
    first = crowdsim_here(*command)
    assert first.returncode == 0, first.stderr
    counts = json.loads(first.stdout)
    assert counts["built"]
    assert counts["segments"] == 8
    assert picture.read_bytes()[:4] == b"\x89PNG"
    again = json.loads(crowdsim_here(*command).stdout)
    assert again == counts | {"built": False}


def test_standard_graphs_have_more_segments(crowdsim_here, folder):
    done = crowdsim_here("motion", "graph", str(folder), "--standard", "--best", "2", "--json")
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["segments"] > 50


@pytest.mark.parametrize(
    ("option", "value"),
    [
        ("--threshold", "0"),
        ("--threshold", "nan"),
        ("--detectors", "leaps"),
        ("--detectors", ","),
        ("--best", "0"),
        ("--branching", "3"),
        ("--drift", "-1"),
    ],
)
def test_options_that_make_no_sense_are_bad_input(crowdsim_here, folder, option, value):
    done = crowdsim_here("motion", "graph", str(folder), option, value)
    assert done.returncode == 2
    assert "Traceback" not in done.stderr


def test_synthesized_clips_are_captures_like_any_other(crowdsim_here, tmp_path):
    folder = tmp_path / "sets" / "dance"
    done = crowdsim_here("motion", "synthesize", "dance", str(folder), "--json")
    assert done.returncode == 0, done.stderr
    counts = json.loads(done.stdout)
    assert counts["clips"] == len(list(folder.glob("*.bvh"))) > 30
    graph = json.loads(crowdsim_here("motion", "graph", str(folder), "--json").stdout)
    assert graph["dropped"] == 0
    assert graph["branching"] > 1.9


def test_a_set_that_is_none_is_bad_input(crowdsim_here, tmp_path):
    done = crowdsim_here("motion", "synthesize", "hapy", str(tmp_path))
    assert done.returncode == 2
    assert "there are default, happy, dance" in done.stderr


@pytest.mark.parametrize("command", ["info", "graph", "coverage"])
def test_every_command_takes_unit_and_joints(crowdsim_here, folder, command):
    for option, said in (("--unit=ell", "'ell' is not one of m, cm"), ("--joint=left_hip", "is not ROLE=NAME")):
        done = crowdsim_here("motion", command, str(folder), option)
        assert done.returncode == 2
        assert said in done.stderr
    wrong = crowdsim_here("motion", command, str(folder), "--joint", "left_hip=Nobody")
    assert wrong.returncode == 2
    assert "Nobody" in wrong.stderr
