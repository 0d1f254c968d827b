"""The site of the documentation is built without a warning, and its examples can be typed."""

import doctest
import re
import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import shapely
import typer

from crowdsim.cli.app import app
from crowdsim.scenario.loader import builtin_scenarios, parse_scenario
from tools import draw_pictures

DOCS = Path(__file__).parents[2] / "docs"
GALLERY = (DOCS / "gallery.md").read_text(encoding="utf-8")
COMMANDS = re.findall(r"^crowdsim .*$", GALLERY, re.M)


def test_the_site_has_no_warning(tmp_path: Path) -> None:
    pytest.importorskip("sphinx")
    command = [sys.executable, "-m", "sphinx", "-W", "--keep-going", "-q", "-b", "html", DOCS, tmp_path / "site"]
    built = subprocess.run([*command, "-d", tmp_path / "pages"], capture_output=True, text=True, timeout=600)
    assert built.returncode == 0, built.stderr
    # Members are there, not only names.
    assert "keep_poses" in (tmp_path / "site" / "api.html").read_text(encoding="utf-8")


def test_every_page_is_in_the_site() -> None:
    trees = re.findall(r"```{toctree}\n(.*?)```", (DOCS / "index.md").read_text(encoding="utf-8"), re.S)
    listed = {line for tree in trees for line in tree.splitlines() if line and not line.startswith(":")}
    assert listed == {page.stem for page in DOCS.glob("*.md")} - {"index"}


def test_the_api_lists_what_the_package_offers() -> None:
    import crowdsim

    text = (DOCS / "api.md").read_text(encoding="utf-8")
    assert set(re.findall(r"^\.\. auto\w+:: (\w+)$", text, re.M)) == set(crowdsim.__all__)


def test_everything_that_the_package_offers_has_an_example_that_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import crowdsim

    monkeypatch.chdir(tmp_path)
    finder, runner = doctest.DocTestFinder(recurse=False), doctest.DocTestRunner(optionflags=doctest.ELLIPSIS)
    names = {"np": np, "shapely": shapely, **{name: getattr(crowdsim, name) for name in crowdsim.__all__}}
    for name in crowdsim.__all__:
        (example,) = finder.find(names[name], name, module=False, extraglobs=names)
        assert example.examples, name
        runner.run(example)
    assert runner.summarize() == doctest.TestResults(0, runner.tries)


def test_the_gallery_has_eleven_examples_with_pictures() -> None:
    examples = GALLERY.split("\n## ")[1:]
    assert len(examples) == 11
    for example in examples:
        (picture,) = re.findall(r"!\[[^\]]+\]\(([^)]+)\)", example)
        assert (DOCS / picture).is_file()
        assert "crowdsim " in example


@pytest.mark.parametrize("command", COMMANDS)
def test_commands_of_the_gallery_can_be_typed(command: str) -> None:
    name, *arguments = shlex.split(command)[1:]
    commands = typer.main.get_command(app).commands
    given = commands[name].make_context(name, list(arguments)).params
    if name in {"run", "check"}:
        assert str(given["scenario"]) in {*builtin_scenarios(), "street.yaml", "four.yaml", "session.yaml"}


@pytest.mark.parametrize(("number", "drawn"), [(0, draw_pictures.STREET), (1, draw_pictures.FOUR_WAYS)])
def test_scenarios_of_the_gallery_are_those_that_are_drawn(number: int, drawn: str) -> None:
    text = re.findall(r"^```yaml\n(.*?)^```", GALLERY, re.M | re.S)[number]
    assert text == drawn
    assert parse_scenario(text).name
