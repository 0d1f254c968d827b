"""Running the command line in a process of its own, as a user does, or in that of the tests."""

import gc
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from crowdsim.__main__ import main
from tests.support.browser import Visit, chromium
from tests.support.recorded import Recorded

ROOT = Path(__file__).parents[2]

Crowdsim = Callable[..., subprocess.CompletedProcess[str]]


@pytest.fixture(scope="session")
def environment() -> dict[str, str]:
    """The environment of child processes: they import this checkout from whatever folder they run in."""
    return {**os.environ, "PYTHONPATH": str(ROOT), "COLUMNS": "120"}


@pytest.fixture(scope="session")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Recorded:
    """``recorded("plaza", "agents.0.count=2")`` gives the file of a run that all test files share."""
    base = tmp_path_factory.getbasetemp()
    folder = (base.parent if os.environ.get("PYTEST_XDIST_WORKER") else base) / "recorded"
    folder.mkdir(exist_ok=True)
    return Recorded(folder)


@pytest.fixture
def crowdsim(tmp_path: Path, environment: dict[str, str]) -> Crowdsim:
    """``crowdsim("run", "corridor", ...)`` in an empty folder; gives the finished process."""

    def call(*arguments: str, folder: Path = tmp_path, **options: object) -> subprocess.CompletedProcess[str]:
        command = [sys.executable, "-m", "crowdsim", *arguments]
        return subprocess.run(
            command, cwd=folder, env=environment, capture_output=True, text=True, timeout=600, **options
        )

    return call


@pytest.fixture
def crowdsim_here(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Iterator[Crowdsim]:
    """As ``crowdsim``, without the second or two that a process takes to start: for what it says and its exit code."""
    before = gc.get_threshold()

    def call(*arguments: str) -> subprocess.CompletedProcess[str]:
        monkeypatch.chdir(tmp_path)
        monkeypatch.setenv("COLUMNS", "120")
        monkeypatch.setattr(sys, "argv", ["crowdsim", *arguments])
        capsys.readouterr()
        with pytest.raises(SystemExit) as ended:
            main()
        return subprocess.CompletedProcess(arguments, int(ended.value.code or 0), *capsys.readouterr())

    yield call
    gc.set_threshold(*before)


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    """A headless Chromium."""
    with chromium() as opened:
        yield opened


@pytest.fixture
def visit(browser: Any) -> Iterator[Callable[..., Visit]]:
    """``visit(file, link, **options)`` opens a page, which is closed when the test ends."""
    opened: list[Visit] = []

    def to(file: Path, link: str = "", **options: object) -> Visit:
        opened.append(Visit(browser, file, link, **options))
        return opened[-1].ready()

    yield to
    for each in opened:
        each.page.close()
