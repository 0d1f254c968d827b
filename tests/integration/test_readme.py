"""README and quickstart tell the truth: their commands run, their Python runs, and CI runs the test command."""

import json
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
from PIL import Image

ROOT = Path(__file__).parents[2]
PAGES = (ROOT / "README.md", ROOT / "docs" / "quickstart.md")
TEXT = "\n".join(page.read_text(encoding="utf-8") for page in PAGES)
"""Both, one after the other, as they are read: the quickstart goes on with what the README made."""
DOCS = sorted((ROOT / "docs").glob("*.md"))


def blocks(*languages: str) -> list[str]:
    """Contents of the fenced blocks in one of ``languages``, in order."""
    return [body for language, body in re.findall(r"^```(\w+)\n(.*?)^```", TEXT, re.M | re.S) if language in languages]


def command_lines() -> list[str]:
    lines = [line for body in blocks("console", "sh") for line in body.replace("\\\n", " ").splitlines()]
    return [line.removeprefix("$ ").partition("  #")[0].strip() for line in lines]


def opens_a_window(arguments: list[str]) -> bool:
    return arguments[0] == "play" and not {"--shot", "--film"} & set(arguments)


def untimed(summary: str) -> list[list[str]]:
    """Rows (label, value) of a summary without what was timed."""
    rows = [re.split(r"  +", line.strip(), maxsplit=1) for line in summary.splitlines() if line.strip()]
    return [
        [label, *(value.partition("; first movement")[0] for value in values)]
        for label, *values in rows
        if label != "real-time factor"
    ]


def test_commands_run(crowdsim, crowdsim_here, tmp_path):
    """Runs and pictures are made in processes of their own, the first of which compiles; the rest is said here."""
    for library in ("scenarios", "behaviors"):
        (tmp_path / library).symlink_to(ROOT / library)
    commands = [shlex.split(line)[1:] for line in command_lines() if line.startswith("crowdsim ")]
    assert any(arguments[0] == "run" for arguments in commands)
    draws = crowdsim("doctor", "--json").stdout.find('"backend": null') < 0
    for arguments in commands:
        if opens_a_window(arguments):
            continue
        finished = (crowdsim if arguments[0] in {"run", "play"} else crowdsim_here)(*arguments)
        wanted = 3 if arguments[0] == "play" and not draws else 0
        assert finished.returncode == wanted, f"crowdsim {shlex.join(arguments)}: {finished.stderr}"
        if arguments == ["run", "corridor"]:
            assert untimed(finished.stdout) == untimed(blocks("text")[0])


def test_python_runs(tmp_path, environment):
    (tmp_path / "scenarios").symlink_to(ROOT / "scenarios")
    snippets = blocks("python")
    assert snippets
    finished = subprocess.run(
        [sys.executable, "-W", "error", "-c", "\n".join(snippets)],
        cwd=tmp_path, env=environment, capture_output=True, text=True,
    )  # fmt: skip
    assert finished.returncode == 0, finished.stderr


def test_scenarios_pass_check(crowdsim_here, tmp_path):
    scenarios = [body for body in blocks("yaml") if body.startswith("crowdsim:")]
    assert scenarios
    for body in scenarios:
        (tmp_path / "scenario.yaml").write_text(body, encoding="utf-8")
        finished = crowdsim_here("check", "scenario.yaml", "--json")
        assert finished.returncode == 0, finished.stdout
        assert json.loads(finished.stdout)["warnings"] == []


def test_ci_runs_the_test_command_of_the_readme():
    script = (ROOT / ".ci" / "run").read_text(encoding="utf-8").splitlines()
    (ci_command,) = [line for line in script if "tools/check.py" in line]
    assert [line for line in command_lines() if "tools/check.py" in line] == [ci_command]


@pytest.mark.parametrize("page", [*PAGES, ROOT / "CONTRIBUTING.md", *DOCS], ids=lambda page: page.name)
def test_files_that_a_page_points_to_exist(page):
    targets = re.findall(r"\]\((?!https?:|#)([^)\s]+)\)", page.read_text(encoding="utf-8"))
    assert targets
    assert [target for target in targets if not (page.parent / target.partition("#")[0]).exists()] == []


def test_the_readme_fits_two_screens():
    assert PAGES[0].read_text(encoding="utf-8").count("\n") <= 110


def test_the_first_screen_moves_and_tells_of_the_page():
    first = PAGES[0].read_text(encoding="utf-8").splitlines()[:25]
    assert any(re.search(r"\bpage\b", line) and "crowdsim export" in line for line in first)
    (picture,) = re.findall(r"!\[[^\]]+\]\(([^)]+)\)", "\n".join(first))
    assert (ROOT / picture).stat().st_size < 3_000_000
    with Image.open(ROOT / picture) as moving:
        assert moving.n_frames > 1


MADE_BY_A_COMMAND = {"validation.md", "validation-auto.md"}


@pytest.mark.parametrize("page", [PAGES[0], *DOCS], ids=lambda page: page.name)
def test_a_page_links_the_glossary(page):
    if page.name in MADE_BY_A_COMMAND | {"glossary.md"}:
        return
    assert "glossary.md" in page.read_text(encoding="utf-8")
