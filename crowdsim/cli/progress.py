"""Progress lines on stderr: what is being prepared, compiled, simulated, drawn; nothing where it is no terminal."""

from __future__ import annotations

import signal
import time
from importlib.resources import files
from types import FrameType
from typing import TYPE_CHECKING, Any, Self

import typer

from crowdsim.cli.errors_shown import Terminated

if TYPE_CHECKING:
    from rich.progress import Progress, TaskID

LOOK_SECONDS = 0.3
"""Time between looks at which kernels are compiled [s]."""


def progress_bar() -> Progress:
    """A bar that vanishes when it is done."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, SpinnerColumn, TextColumn, TimeRemainingColumn

    console = Console(stderr=True)
    return Progress(
        SpinnerColumn(),
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
        console=console,
        transient=True,
        disable=not console.is_terminal,
    )


class Interruption:
    """Context manager in which Ctrl-C and SIGTERM wait until :meth:`heed`, which raises what they ask for.

    A KeyboardInterrupt amid callbacks of other libraries, such as those that draw, can be lost. A second Ctrl-C does
    not wait.
    """

    def __init__(self) -> None:
        self._asked: KeyboardInterrupt | None = None

    def __enter__(self) -> Self:
        self._before = {number: signal.signal(number, self._note) for number in (signal.SIGINT, signal.SIGTERM)}
        return self

    def __exit__(self, *_: object) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)

    def heed(self) -> None:
        """Raise KeyboardInterrupt, or Terminated, if it was asked for."""
        if self._asked is not None:
            raise self._asked

    def _note(self, number: int, frame: FrameType | None) -> None:
        if number == signal.SIGINT and self._asked is not None:
            raise KeyboardInterrupt
        self._asked = Terminated() if number == signal.SIGTERM else KeyboardInterrupt()


class FirstRun:
    """How much of what a first run compiles is left, by ``first_run.txt``, which ``tools/time_kernels.py`` writes.

    It counts kernels that appear in the cache, whichever process compiled them.
    """

    def __init__(self) -> None:
        from crowdsim.jit import compiled_kernels

        self._compiled_kernels = compiled_kernels
        lines = files("crowdsim").joinpath("first_run.txt").read_text(encoding="utf-8").splitlines()
        kept = compiled_kernels()
        self._seconds = {name: float(taken) for taken, name in map(str.split, lines) if name not in kept}
        self._begin = time.monotonic()
        self._looked = -LOOK_SECONDS
        self._state = (0, 0, "")

    def state(self) -> tuple[int, int, str]:
        """Kernels that are compiled, of how many, and about how long the rest takes in words: empty if unknown."""
        now = time.monotonic()
        if now - self._looked >= LOOK_SECONDS:
            kept = self._compiled_kernels()
            rest = sum(taken for name, taken in self._seconds.items() if name not in kept)
            done = sum(self._seconds.values()) - rest
            # At first, as fast as where the file was written; later as fast as it went.
            pace = (now - self._begin) / done if done > 5.0 else 1.0
            left = f"about {max(round(pace * rest), 1)} s left" if rest > 0.0 else ""
            self._state = sum(name in kept for name in self._seconds), len(self._seconds), left
            self._looked = now
        return self._state


class RunProgress:
    """A bar where stderr is a terminal; elsewhere nothing but one line when kernels have to be compiled.

    Used as a context manager. ``step`` has the form ``Simulation.run`` calls back. After ``begin_steps`` a first Ctrl-C
    or SIGTERM ends the run at the end of its step: a KeyboardInterrupt in the midst of locks and callbacks can be lost
    or leave them shut.
    """

    def __init__(self, title: str) -> None:
        self._title = title
        self._first_run: FirstRun | None = None
        self._compiled: list[str] = []
        self._maps = (0, 0)
        self._steps = (0, 0)
        self._interrupted: KeyboardInterrupt | None = None
        self._stepping = False

    @property
    def steps_done(self) -> int:
        return self._steps[0]

    def __enter__(self) -> Self:
        from numba.core import event

        self._bar = progress_bar()
        self._is_terminal = self._bar.console.is_terminal
        self._task: TaskID = self._bar.add_task(f"{self._title}: preparing", total=None)

        calls = {"on_start": self._compiling, "on_end": self._compiling_ended}
        self._watcher = type("Watcher", (event.Listener,), {name: staticmethod(call) for name, call in calls.items()})()
        event.register("numba:compile", self._watcher)
        self._bar.start()
        self._heeds_interrupts = signal.getsignal(signal.SIGINT) is signal.default_int_handler
        if self._heeds_interrupts:
            signal.signal(signal.SIGINT, self._interrupt)
        self._terminates = signal.getsignal(signal.SIGTERM)
        if callable(self._terminates):
            signal.signal(signal.SIGTERM, self._terminate)
        return self

    def __exit__(self, *_: object) -> None:
        from numba.core import event

        if self._heeds_interrupts:
            signal.signal(signal.SIGINT, signal.default_int_handler)
        if callable(self._terminates):
            signal.signal(signal.SIGTERM, self._terminates)
        event.unregister("numba:compile", self._watcher)
        self._bar.stop()

    def maps(self, done: int, nodes: int) -> None:
        """Show for how many of the motion graph's nodes the map is built."""
        self._maps = (done, nodes) if done < nodes else (0, 0)
        self._show()

    def begin_steps(self) -> None:
        """From now on ``step`` is called again and again."""
        self._stepping = True

    def step(self, step: int, steps: int, simulation: Any) -> None:
        """Show that ``step`` of ``steps`` is done; KeyboardInterrupt where Ctrl-C asked for it."""
        if self._interrupted:
            raise self._interrupted
        self._steps = (step, steps)
        self._show()

    def _interrupt(self, number: int, frame: FrameType | None) -> None:
        if self._interrupted or not self._stepping:
            raise KeyboardInterrupt
        self._interrupted = KeyboardInterrupt()

    def _terminate(self, number: int, frame: FrameType | None) -> None:
        if not self._stepping:
            raise Terminated
        self._interrupted = Terminated()

    def _compiling(self, event: Any) -> None:
        """numba calls this when the cache does not hold a kernel, and for each helper that it is the first to need."""
        self._compiled.append(event.data["dispatcher"].py_func.__name__)
        if self._first_run is None:
            self._first_run = FirstRun()
            _, count, left = self._first_run.state()
            if not self._is_terminal:
                how_much = f"{count} kernels, {left}" if left else "about a minute"
                typer.echo(f"compiling kernels, once for this machine: {how_much}", err=True)
        self._show()

    def _compiling_ended(self, event: Any) -> None:
        self._compiled.pop()
        self._show()

    def _show(self) -> None:
        """Show the kernel that is compiled, else the maps that are built, else the steps that are done."""
        (done, total), title = self._steps, self._title if self.steps_done else f"{self._title}: preparing"
        if self._compiled and self._first_run is not None:
            done, total, left = self._first_run.state()
            title = f"{self._title}: compiling kernels, once for this machine, {left}: {self._compiled[0]}"
        elif self._maps[1]:
            (done, total), title = self._maps, f"{self._title}: motion maps"
        self._bar.update(self._task, completed=done, description=title)
        self._bar.tasks[0].total = total or None
