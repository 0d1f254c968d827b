"""What a run says while it goes on, where stderr is no terminal."""

import io
import re
from pathlib import Path

import numba
import pytest
from rich.console import Console
from rich.progress import Progress

from crowdsim import first_run, jit
from crowdsim.cli import progress as shown
from crowdsim.cli.progress import QUIET_SECONDS, WHOLE_RUN, FirstRun, FirstRunElsewhere, RunProgress, progress_bar
from crowdsim.first_run import read_seconds


@pytest.fixture(autouse=True)
def _alone(monkeypatch):
    """No other process compiles ahead."""
    monkeypatch.setattr(first_run, "usable_processors", lambda: 1)


PACKAGE = Path(__file__).parents[3] / "crowdsim"


def test_nothing_is_said_when_nothing_compiles(capsys):
    with RunProgress("corridor") as progress:
        progress.step(1, 10, None)
        progress.step(2, 10, None)
    assert progress.steps_done == 2
    captured = capsys.readouterr()
    assert captured.out == captured.err == ""


def test_compiling_is_said_once(capsys):
    @numba.njit
    def one(x):
        return x + 1

    @numba.njit
    def two(x):
        return one(x) + 1

    with RunProgress("corridor"):
        assert two(1) == 3
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.count("\n") == 1
    assert "compiling" in captured.err


def test_nothing_is_said_after_the_run(capsys):
    with RunProgress("corridor"):
        pass

    @numba.njit
    def three(x):
        return x + 3

    assert three(1) == 4
    assert capsys.readouterr().err == ""


def test_what_a_first_run_compiles_are_kernels_of_the_package():
    assert len(read_seconds()) > 40
    for name in read_seconds():
        folder, file, function = re.fullmatch(r"(\w+)/(\w+)\.(\w+)", name).groups()
        [found] = PACKAGE.rglob(f"{folder}/{file}.py")
        decorated = rf"@(shared_)?(kernel|helper)\ndef {function}\("
        assert re.search(decorated, found.read_text(encoding="utf-8")), name


def test_how_much_is_left_follows_what_is_compiled(monkeypatch):
    names, compiled, now = read_seconds(), set(), [100.0]
    monkeypatch.setattr(jit, "compiled_kernels", lambda: set(compiled))
    monkeypatch.setattr(shown.time, "monotonic", lambda: now[0])
    first = FirstRun()
    assert first.state() == (0, len(names), f"about {round(sum(names.values()))} s left")
    half = sorted(names, key=names.get)[len(names) // 2 :]
    compiled.update(half)
    now[0] += 2.0 * sum(names[name] for name in half)
    rest = 2.0 * sum(seconds for name, seconds in names.items() if name not in half)
    assert first.state() == (len(half), len(names), f"about {round(rest)} s left")
    compiled.update(names)
    now[0] += 1.0
    assert first.state() == (len(names), len(names), "")


def test_what_is_compiled_is_shown_and_what_was_shown_before_comes_back(monkeypatch):
    monkeypatch.setattr(jit, "compiled_kernels", lambda: set())
    console = Console(file=io.StringIO(), force_terminal=True)
    monkeypatch.setattr(shown, "progress_bar", lambda: Progress(console=console, auto_refresh=False))

    @numba.njit
    def inner(x):
        return x + 1

    @numba.njit
    def outer(x):
        return inner(x) + 1

    with RunProgress("corridor") as progress:
        seen = []
        update = progress._bar.update

        def noted(task, **what):
            update(task, **what)
            seen.append((progress._bar.tasks[0].description, progress._bar.tasks[0].completed))

        monkeypatch.setattr(progress._bar, "update", noted)
        progress.maps(3, 91)
        assert seen[-1] == ("corridor: motion maps", 3)
        outer(1)
        compiling = [(words, done) for words, done in seen if "compiling" in words]
        assert compiling
        assert all(words.endswith("s left: outer") and done == 0 for words, done in compiling)
        assert seen[-1] == ("corridor: motion maps", 3)
        assert progress._bar.tasks[0].total == 91
        progress.maps(91, 91)
        assert seen[-1] == ("corridor: preparing", 0)
        progress.step(2, 10, None)
        assert seen[-1] == ("corridor", 2)
        assert progress._bar.tasks[0].total == 10


def test_the_time_left_of_a_sweep_is_known_however_long_its_points_take():
    now = [0.0]
    for remembered, left in ((WHOLE_RUN, 17 * 90.0), (30.0, None)):
        bar = progress_bar(remembered)
        bar.get_time = lambda: now[0]
        task = bar.add_task("sweeping", total=20)
        for done in (1, 2, 3):
            now[0] += 90.0
            bar.update(task, completed=done)
        assert bar.tasks[0].time_remaining == left


def test_what_other_processes_compile_is_shown_while_kernels_appear(monkeypatch):
    names, now = read_seconds(), [100.0]
    order = sorted(names)
    compiled = set(order[:3])
    monkeypatch.setattr(jit, "compiled_kernels", lambda: set(compiled))
    monkeypatch.setattr(shown.time, "monotonic", lambda: now[0])
    bar = Progress(console=Console(file=io.StringIO(), force_terminal=True), auto_refresh=False)
    first = FirstRunElsewhere(bar)

    def line(later):
        now[0] += later
        first.look()
        task = bar.tasks[0]
        return task.visible, task.completed, task.total, task.description

    # What is missing may be what these runs never need.
    assert line(1.0)[0] is False
    compiled.add(order[3])
    is_shown, done, total, words = line(1.0)
    assert (is_shown, done, total) == (True, 1, len(names) - 3)
    assert re.fullmatch(r"compiling kernels, once for this machine, about \d+ s left", words)
    assert line(QUIET_SECONDS - 1.0)[0] is True
    assert line(2.0)[0] is False
    compiled.update(order[:-1])
    assert line(1.0)[:2] == (True, len(names) - 4)
    compiled.update(order)
    assert line(1.0)[0] is False


def test_an_empty_cache_is_told_in_one_line_without_a_terminal(monkeypatch, capsys):
    monkeypatch.setattr(jit, "compiled_kernels", lambda: set())
    bar = progress_bar()
    first = FirstRunElsewhere(bar)
    with bar, first:
        first.look()
        first.look()
    said = capsys.readouterr()
    assert said.out == ""
    assert re.fullmatch(
        rf"compiling kernels, once for this machine: {len(read_seconds())} kernels, about \d+ s left\n", said.err
    )
