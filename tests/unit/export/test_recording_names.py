"""A recording is not written over a scenario, nor under the name of another kind of file."""

import pytest
from typer.testing import CliRunner

from crowdsim.cli.app import app
from crowdsim.errors import CrowdSimError
from crowdsim.export.recording_names import require_not_the_scenario, require_recording_name


@pytest.mark.parametrize("name", ["run.h5", "run.hdf5", "run", "run.7", "RUN.H5"])
def test_a_recording_may_be_called(tmp_path, name):
    require_recording_name(tmp_path / name)


@pytest.mark.parametrize("name", ["run.csv", "run.html", "run.GLB"])
def test_a_recording_under_the_name_of_an_export_is_refused_with_both_commands(tmp_path, name):
    with pytest.raises(CrowdSimError, match=r"name it \S*run\.h5, and then: crowdsim export \S*run\.h5 -o "):
        require_recording_name(tmp_path / name)


@pytest.mark.parametrize("name", ["run.yaml", "run.yml", "run.png", "run.mp4"])
def test_a_recording_under_the_name_of_a_scenario_or_a_picture_is_refused(tmp_path, name):
    with pytest.raises(CrowdSimError, match=r"a recording is an HDF5 file; name it \S*run\.h5$"):
        require_recording_name(tmp_path / name)


def test_the_scenario_that_is_served_is_not_replaced(tmp_path):
    mine, other = tmp_path / "mine.yaml", tmp_path / "other.yaml"
    mine.write_text("name: mine")
    other.write_text("name: other")
    require_not_the_scenario(other, str(mine))
    require_not_the_scenario(tmp_path / "absent.yaml", str(mine))
    require_not_the_scenario(mine, "corridor")
    with pytest.raises(CrowdSimError, match="is the scenario itself"):
        require_not_the_scenario(tmp_path / "." / "mine.yaml", str(mine))


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["run", "mine.yaml", "-o", "mine.yaml"], "mine.yaml: a recording is an HDF5 file; name it mine.h5"),
        (["run", "mine.yaml", "-o", "mine.html", "--page"], "mine.html: a recording is an HDF5 file; name it mine.h5"),
        (["serve", "mine.yaml", "--record", "mine.h5"], "mine.yaml is the scenario itself and would be replaced"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_commands_refuse_such_names_before_they_begin(tmp_path, monkeypatch, arguments, words):
    pytest.importorskip("websockets")
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.yaml").write_text(SCENARIO)
    refused = CliRunner().invoke(app, arguments)
    assert refused.exit_code == 2
    assert words in refused.output
    assert (tmp_path / "mine.yaml").read_text() == SCENARIO
    assert [file.name for file in tmp_path.iterdir()] == ["mine.yaml"]


SCENARIO = """\
crowdsim: 1
name: mine
seed: 1
duration: 5
floor: {rectangle: [0, 0, 9, 4]}
agents:
  - {name: walkers, count: 1, start: {point: [1, 2]}, goal: {point: [8, 2]}}
"""
