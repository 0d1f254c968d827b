"""Exit codes, messages, and what is left behind when a command fails or is stopped.

What processes do as they end is tried in some of their own; what commands say, in the process of the tests.
"""

import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from crowdsim.errors import RecordingError

USAGE = 2


@pytest.mark.parametrize(
    "arguments",
    [
        ["jump"],
        ["run"],
        ["run", "corridor", "--workers", "0"],
        ["run", "corridor", "--seed", "-1"],
        ["run", "corridor", "--nonsense"],
        ["plan", "corridor", "--from", "1,2"],
        ["plan", "corridor", "--from", "1", "--to", "2,3"],
        ["plan", "corridor", "--from", "nan,0", "--to", "2,3"],
        ["play", "a.h5", "--size", "large"],
        ["play", "a.h5", "--size", "0x0", "--shot", "a.png"],
        ["play", "a.h5", "--shot", "a.png", "--film", "a.mp4"],
        ["play", "a.h5", "--film", "a.mp4", "--time", "3"],
        ["play", "a.h5", "--shot", "a.png", "--start", "3"],
    ],
    ids=" ".join,
)
def test_wrong_usage_exits_with_2(crowdsim_here, arguments):
    finished = crowdsim_here(*arguments)
    assert finished.returncode == USAGE
    assert finished.stdout == ""
    assert "Error" in finished.stderr
    assert "Traceback" not in finished.stderr


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (["run", "nowhere.yaml"], "nowhere.yaml"),
        (["run", "coridor"], "corridor"),
        (["check", "coridor"], "corridor"),
        (["run", "corridor", "--set", "agents.0.cuont=3"], "count"),
        (["run", "corridor", "--set", "agents"], "agents"),
        (["run", "corridor", "-o", "absent/folder/a.h5"], "absent/folder"),
        (["run", "corridor", "-o", "."], "folder"),
        (["play", "absent.h5", "--shot", "a.png"], "absent.h5"),
        (["bench", "absent"], "startup"),
        (["bench", "navmesh", "--maps", "absent"], "clutter_200.json"),
        (["bench", "startup", "--maps", "."], "takes no maps"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else value,
)
def test_bad_input_exits_with_2_and_says_what_is_wrong(crowdsim_here, tmp_path, arguments, word):
    finished = crowdsim_here(*arguments)
    assert finished.returncode == 2
    assert finished.stdout == ""
    assert finished.stderr.startswith("error: ")
    assert word in finished.stderr
    assert "Traceback" not in finished.stderr
    assert list(tmp_path.iterdir()) == []


def test_debug_adds_the_traceback_on_either_side_of_the_command(crowdsim):
    for arguments in (["run", "nowhere.yaml", "--debug"], ["--debug", "run", "nowhere.yaml"]):
        finished = crowdsim(*arguments)
        assert finished.returncode == 2
        assert "Traceback" in finished.stderr
        assert "ScenarioError" in finished.stderr


def test_an_unwritable_place_is_refused_before_the_run(crowdsim, tmp_path):
    (tmp_path / "folder.h5").mkdir()
    begin = time.monotonic()
    finished = crowdsim("run", "corridor", "-o", "folder.h5")
    assert finished.returncode == 2
    assert "folder.h5" in finished.stderr
    assert time.monotonic() - begin < 10


def test_a_bug_is_one_line_and_exit_code_1(environment, tmp_path):
    broken = (
        "import sys, crowdsim.cli.run as run\n"
        "def fail(*_): raise ZeroDivisionError('first\\nsecond')\n"
        "run._output_file = fail\n"
        "from crowdsim.cli.app import main\n"
        "sys.argv = ['crowdsim', 'run', 'corridor', *sys.argv[1:]]\n"
        "main()\n"
    )

    def call(*more: str) -> subprocess.CompletedProcess[str]:
        command = [sys.executable, "-c", broken, *more]
        return subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True)

    finished = call()
    assert finished.returncode == 1
    assert finished.stderr == "internal error: ZeroDivisionError: first; run again with --debug to see where\n"
    assert "Traceback" in call("--debug").stderr


def test_a_reader_that_leaves_early_is_no_error(environment):
    command = f"set -o pipefail; {sys.executable} -m crowdsim scenarios | head -c 0"
    finished = subprocess.run(["bash", "-c", command], env=environment, capture_output=True, text=True)
    assert finished.returncode == 0
    assert finished.stderr == ""


def test_a_full_disk_is_told(environment):
    command = f"{sys.executable} -m crowdsim scenarios > /dev/full"
    finished = subprocess.run(["bash", "-c", command], env=environment, capture_output=True, text=True)
    assert finished.returncode == 2
    assert "No space left" in finished.stderr


def begin_run(environment: dict[str, str], folder: Path) -> subprocess.Popen[str]:
    """A run of the corridor that has begun to write its file."""
    command = [sys.executable, "-m", "crowdsim", "run", "corridor", "-o", "run.h5"]
    child = subprocess.Popen(
        command, cwd=folder, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    deadline = time.monotonic() + 300
    while not list(folder.iterdir()):
        assert child.poll() is None, child.communicate()
        assert time.monotonic() < deadline
        time.sleep(0.01)
    return child


def test_a_killed_run_leaves_nothing_that_looks_whole(environment, tmp_path):
    from crowdsim.recording.reader import Recording

    child = begin_run(environment, tmp_path)
    child.kill()
    child.communicate()
    assert child.returncode == -signal.SIGKILL
    assert not (tmp_path / "run.h5").exists()
    for left in tmp_path.iterdir():
        with pytest.raises(RecordingError, match="unfinished"):
            Recording.open(left)


def test_an_interrupted_run_says_so_and_leaves_nothing(environment, tmp_path):
    child = begin_run(environment, tmp_path)
    child.send_signal(signal.SIGINT)
    output, errors = child.communicate(timeout=60)
    assert child.returncode == 130
    assert output == ""
    assert "interrupted" in errors
    assert "Traceback" not in errors
    assert list(tmp_path.iterdir()) == []


def test_every_built_in_scenario_passes_check(crowdsim_here):
    names = json.loads(crowdsim_here("scenarios", "--json").stdout)
    assert "corridor" in names
    for name in names:
        finished = crowdsim_here("check", name, "--json")
        assert finished.returncode == 0, finished.stdout + finished.stderr
        assert json.loads(finished.stdout)["errors"] == []


def test_check_gives_errors_as_json(crowdsim_here, tmp_path):
    (tmp_path / "bad.yaml").write_text("name: bad\nagents: 3\nnonsense: 1\n", encoding="utf-8")
    finished = crowdsim_here("check", "bad.yaml", "--json")
    assert finished.returncode == 2
    report = json.loads(finished.stdout)
    assert report["ok"] is False
    assert len(report["errors"]) >= 2


@pytest.mark.parametrize(
    ("behaviors", "told"),
    [
        ("[lateral, arm_constrained]", "no motion leads from 'arm_constrained' to 'lateral' and back"),
        ("[lateral]", "no node of behavior 'lateral' walks straight on"),
    ],
)
def test_check_refuses_built_in_behaviors_that_a_run_refuses(crowdsim_here, behaviors, told):
    chosen = ("corridor", "--set", f"behaviors={behaviors}")
    refused = [crowdsim_here(command, *chosen) for command in ("check", "run")]
    assert [finished.returncode for finished in refused] == [2, 2]
    assert told in refused[0].stderr
    assert refused[0].stderr.splitlines()[-1] == refused[1].stderr.splitlines()[-1]
    report = json.loads(crowdsim_here("check", *chosen, "--json").stdout)
    assert report["ok"] is False
    assert told in report["errors"][0]["message"]


@pytest.mark.parametrize("wider", ["behaviors=[frontal]", "motion.set=happy"])
def test_check_warns_of_groups_that_no_behavior_brings_to_their_goal(crowdsim_here, wider):
    finished = crowdsim_here("check", "corridor", "--set", wider, "--json")
    assert finished.returncode == 0
    (warning,) = json.loads(finished.stdout)["warnings"]
    assert "agents.0.goal: no way from the start of 'walkers'" in warning


def test_check_names_the_file_of_a_mesh_it_cannot_use_in_json_too(crowdsim_here, tmp_path):
    (tmp_path / "huge.obj").write_text("v 0 0 0\nv 1e308 0 0\nv 0 1e308 1e308\nf 1 2 3\n")
    (tmp_path / "huge.yaml").write_text(
        "crowdsim: 1\nname: huge\nseed: 1\nduration: 5\nfloor: {derive: true}\n"
        "obstacles: [{name: a, mesh: {file: huge.obj}}]\n"
        "agents: [{name: a, count: 1, start: {point: [1, 1]}, goal: {point: [2, 1]}}]\n"
    )
    finished = crowdsim_here("check", "huge.yaml", "--json")
    assert finished.returncode == 2
    [error] = json.loads(finished.stdout)["errors"]
    assert (error["file"], error["line"], error["key"]) == ("huge.yaml", 6, "obstacles.0.mesh")


def test_behaviors_are_listed_with_measured_radii(crowdsim_here):
    listed = json.loads(crowdsim_here("behaviors", "--json").stdout)
    assert [behavior["name"] for behavior in listed] == ["lateral", "arm_constrained", "frontal"]
    torso = [behavior["radii"]["torso"] for behavior in listed]
    assert 0.1 < torso[0] < torso[1] < torso[2] < 0.5


def test_plan_gives_annotated_sections(crowdsim_here):
    finished = crowdsim_here("plan", "corridor", "--from", "1,0", "--to", "21,0", "--json")
    assert finished.returncode == 0, finished.stderr
    path = json.loads(finished.stdout)
    assert {section["behavior"] for section in path["sections"]} == {"lateral", "arm_constrained", "frontal"}
    assert path["points"][0] == [1.0, 0.0]
    assert path["points"][-1] == [21.0, 0.0]
    assert sum(section["length"] for section in path["sections"]) == pytest.approx(path["length"])


def test_plan_in_3d_tells_no_gap_to_a_bound(crowdsim_here):
    finished = crowdsim_here("plan", "corridor", "--from", "1,0", "--to", "3,0", "--planner", "collision3d", "--json")
    assert finished.returncode == 0, finished.stderr
    assert json.loads(finished.stdout)["gap"] is None


def test_plan_without_a_path_exits_with_2(crowdsim_here):
    finished = crowdsim_here("plan", "corridor", "--from", "1,0", "--to", "1,500")
    assert finished.returncode == 2
    assert finished.stderr.startswith("error: ")


def test_doctor_reports_versions_threads_cache_and_drawing(crowdsim):
    finished = crowdsim("doctor", "--json")
    assert finished.returncode == 0, finished.stderr
    report = json.loads(finished.stdout)
    assert report["versions"]["numba"] != "missing"
    assert report["numba"]["threading_layer"] in ("tbb", "omp", "workqueue")
    assert Path(report["kernel_cache"]["folder"]).is_dir()
    assert report["drawing"]["backend"] or report["drawing"]["remedy"]
    assert "MPI" in report["mpi"]["library"], report["mpi"]["remedy"]  # the tests need it: two processes have met


def test_the_schema_is_printed_or_written(crowdsim_here, tmp_path):
    printed = crowdsim_here("schema")
    assert printed.returncode == 0, printed.stderr
    assert json.loads(printed.stdout)["properties"]["seed"]["description"]
    written = crowdsim_here("schema", "-o", "keys.json")
    assert (written.returncode, written.stdout) == (0, "")
    assert (tmp_path / "keys.json").read_text() == printed.stdout
    wrong = crowdsim_here("schema", "-o", "keys.txt")
    assert wrong.returncode == USAGE
    assert wrong.stderr == "error: keys.txt: schemas are written as .json; choose such a name\n"


def test_bench_lists_its_names(crowdsim_here):
    finished = crowdsim_here("bench")
    assert finished.returncode == 0
    names = [line.split()[0] for line in finished.stdout.splitlines()]
    assert names == [
        "startup",
        "navmesh",
        "environment",
        "planner",
        "plan-soundness",
        "motion-graph",
        "planted-feet",
        "motion-search",
        "crowd",
        "ranks",
        "studies",
        "drills",
        "hall",
        "strewn-halls",
        "auto-drills",
        "auto-square",
        "auto-shares",
        "auto-switches",
        "robustness",
        "soak",
        "page",
        "film",
        "export",
        "driven",
        "live",
        "motion-maps",
    ]
