"""The command ``crowdsim analyze``: its folder, its JSON, and its refusals."""

import json

import pytest
from typer.testing import CliRunner

from crowdsim.cli.app import app
from tests.support.walking_recording import random_walkers, write_tracks


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    with write_tracks(tmp_path_factory.mktemp("analyze") / "run.h5", *random_walkers(12, 120)) as recording:
        return recording.path


def analyze(*arguments):
    return CliRunner().invoke(app, ["analyze", *map(str, arguments)])


def test_it_writes_a_folder_beside_the_recording_and_tells_what_it_found(run):
    shown = analyze(run, "--only", "evacuation,flow", "--line", "near=-2,-2.5,-2,2.5")
    assert shown.exit_code == 0, shown.output
    folder = run.with_name("run-analysis")
    assert str(folder / "index.html") in shown.output.replace("\n", "")
    assert "near (5.00 m)" in shown.output
    values = json.loads((folder / "analysis.json").read_text(encoding="utf-8"))
    assert set(values["flow"]) == {"across", "near"}
    assert "maps" not in values


def test_json_is_all_that_it_prints(run, tmp_path):
    shown = analyze(run, "--only", "flow", "--json", "-o", tmp_path / "found")
    values = json.loads(shown.stdout)
    assert values["flow"]["across"]["passages"] == 12
    assert all((tmp_path / "found" / name).is_file() for name in ("analysis.json", "index.html", "flow.csv"))


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (("--only", "flw"), "there is no measurement 'flw'"),
        (("--line", "door=1,2"), "expected name=x0,y0,x1,y1"),
        (("--area", "middle=0,0,1,1"), "there is a place 'middle' already"),
        (("--rate", "7"), "7"),
        (("--voronoi-rate", "0"), "is below 0.001"),
    ],
)
def test_what_it_cannot_measure_is_refused_with_nothing_written(run, tmp_path, arguments, told):
    shown = analyze(run, *arguments, "-o", tmp_path / "found")
    assert shown.exit_code == 2
    assert told in " ".join(shown.output.split())
    assert not (tmp_path / "found").exists()
