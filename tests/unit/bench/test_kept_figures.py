"""Figures that are kept: a line for each figure and commit, in the file of the machine."""

import csv
import subprocess
from dataclasses import replace

import pytest

from crowdsim.bench.kept_figures import COLUMNS, keep_figures, machine_name
from crowdsim.bench.registry import BenchResult
from crowdsim.errors import CrowdSimError

RESULT = BenchResult(
    name="navmesh",
    machine={"processor": "AMD EPYC 9B14 96-Core Processor @ 2.6GHz", "cores": 2, "system": "Linux"},
    versions={"python": "3.11.9", "numba": "0.61.0"},
    rows=[],
    figures={"path_us": 15.25, "build_ms": 4.0},
    headline=(),
)


@pytest.fixture
def repository(tmp_path):
    git(tmp_path, "init", "-q")
    (tmp_path / "code.py").write_text("x = 1\n")
    commit(tmp_path, "2026-01-02T03:04:05")
    return tmp_path


def git(folder, *arguments, **environment):
    who = ["-c", "user.name=a", "-c", "user.email=a@b.c"]
    subprocess.run(["git", "-C", str(folder), *who, *arguments], check=True, capture_output=True, **environment)


def commit(folder, date):
    git(folder, "add", "-A")
    git(folder, "commit", "-q", "-m", date, env={"GIT_COMMITTER_DATE": date, "PATH": "/usr/bin:/bin"})


def lines(file):
    with file.open(newline="") as table:
        return list(csv.DictReader(table))


def test_the_machine_names_the_file():
    assert machine_name(RESULT) == "amd-epyc-9b14-96-core-2-cores"


def test_a_line_for_each_figure_and_commit(repository):
    file = keep_figures(RESULT, repository)
    assert file.read_text().splitlines()[0] == ",".join(COLUMNS)
    assert [(row["figure"], row["value"], row["date"]) for row in lines(file)] == [
        ("build_ms", "4", "2026-01-02"),
        ("path_us", "15.25", "2026-01-02"),
    ]
    commit(repository, "2026-02-02T03:04:05")
    keep_figures(replace(RESULT, figures={"path_us": 16.0}), repository)
    assert [row["value"] for row in lines(file) if row["figure"] == "path_us"] == ["15.25", "16"]


def test_figures_of_the_same_commit_are_replaced(repository):
    keep_figures(RESULT, repository)
    file = keep_figures(replace(RESULT, figures={"path_us": 17.0}), repository)
    assert [(row["figure"], row["value"]) for row in lines(file)] == [("path_us", "17")]


def test_the_load_of_the_machine_is_kept_and_files_without_it_are_read(repository):
    file = repository / f"{machine_name(RESULT)}.csv"
    file.write_text(",".join(COLUMNS[:-1]) + "\nnavmesh,path_us,2025-01-01,abc,14,3.11.9,0.61.0\n")
    keep_figures(replace(RESULT, figures={"path_us": 15.25}, load=1.25), repository)
    assert [(row["commit"], row["load"]) for row in lines(file)][:1] == [("abc", "")]
    assert [row["load"] for row in lines(file)][1:] == ["1.2"]


def test_a_changed_checkout_is_marked(repository):
    (repository / "code.py").write_text("x = 2\n")
    file = keep_figures(RESULT, repository)
    assert all(row["commit"].endswith("+") for row in lines(file))


def test_other_tables_and_other_folders_are_refused(repository, tmp_path_factory):
    (repository / f"{machine_name(RESULT)}.csv").write_text("a,b\n1,2\n")
    with pytest.raises(CrowdSimError, match="first line"):
        keep_figures(RESULT, repository)
    with pytest.raises(CrowdSimError, match="no git repository"):
        keep_figures(RESULT, tmp_path_factory.mktemp("elsewhere"))
    with pytest.raises(CrowdSimError, match="does not exist"):
        keep_figures(RESULT, repository / "absent")
