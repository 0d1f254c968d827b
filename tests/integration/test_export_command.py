"""``crowdsim export`` as a user types it: what it writes, and what it says to what cannot be."""

import pytest

from crowdsim.recording.reader import Recording
from tests.support.small_recording import write_small_recording


@pytest.fixture
def folder(tmp_path):
    write_small_recording(tmp_path / "run.h5")
    return tmp_path


def test_the_ending_names_the_format(crowdsim, folder):
    done = crowdsim("export", "run.h5", "-o", "run.csv", "--rate", "5", "--start", "1", "--end", "2", "--agents", "0,1")
    assert (done.returncode, done.stdout.strip(), done.stderr) == (0, "run.csv", "")
    lines = (folder / "run.csv").read_text().splitlines()
    assert lines[0] == "id,frame,time,x,y,heading,behavior,state,group"
    assert len(lines) == 1 + 2 * 6
    assert lines[1].startswith("0,5,1.0000,")


def test_a_folder_of_one_file_a_character(crowdsim_here, folder):
    done = crowdsim_here("export", "run.h5", "-o", "people/", "--format", "bvh")
    assert (done.returncode, done.stderr) == (0, "")
    assert sorted(file.name for file in (folder / "people").iterdir()) == [f"character-{n}.bvh" for n in range(3)]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["run.h5", "-o", "run.xyz"], "there is no format 'xyz'; choose one of html, csv, parquet"),
        (["run.h5", "-o", "nowhere/run.csv"], "the folder nowhere does not exist"),
        (["run.h5", "-o", "run.csv", "--rate", "7"], "choose one of 1, 2, 4, 5, 10, 20"),
        (["run.h5", "-o", "run.csv", "--agents", "visitor"], "did you mean 'visitors'?"),
        (["run.h5", "-o", "run.csv", "--points"], "csv files take no points"),
        (["run.h5", "-o", "run.sqlite"], "before free floors were kept"),
        (["damaged.h5", "-o", "run.csv"], "damaged.h5 is not a crowdsim recording, or is cut short"),
        (["missing.h5", "-o", "run.csv"], "there is no recording missing.h5"),
    ],
)
def test_what_cannot_be_is_said_and_leaves_nothing(crowdsim_here, folder, arguments, message):
    (folder / "damaged.h5").write_bytes((folder / "run.h5").read_bytes()[:30_000])
    before = sorted(file.name for file in folder.iterdir())
    done = crowdsim_here("export", *arguments)
    assert done.returncode == 2
    assert message in done.stderr
    assert "Traceback" not in done.stderr
    assert sorted(file.name for file in folder.iterdir()) == before


def test_a_run_of_the_library_is_handed_on(recorded, crowdsim_here, tmp_path):
    file = recorded("corridor", "agents.0.count=2")
    for name in ("run.sqlite", "run.glb"):
        done = crowdsim_here("export", str(file), "-o", name)
        assert done.returncode == 0, done.stderr
        assert (tmp_path / name).stat().st_size > 10_000
    with Recording.open(file) as recording:
        assert recording.walkable().area > 1.0
        assert [len(recording.goals_of(agent)) for agent in range(2)] == [1, 1]
        assert [area.name for area in recording.header.areas] == list(recording.measured.areas)
        assert len(recording.table()) == sum(int((recording.state[k] != 0).sum()) for k in range(recording.steps))
