"""Progress on stderr: preparation, compilation, simulation, drawing.

Bars are shown on a terminal only. Elsewhere, one line is printed if kernels have to be compiled, and nothing else.
"""

from __future__ import annotations

import signal
import threading
import time
from contextlib import ExitStack
from types import FrameType
from typing import TYPE_CHECKING, Any, Self

import typer

from crowdsim.cli.errors_shown import Terminated

if TYPE_CHECKING:
    from rich.progress import Progress, TaskID

LOOK_SECONDS = 0.3
"""Time between counts of compiled kernels [s]."""

WHOLE_RUN = 1e9
"""Time over which the pace of whole runs is measured [s]: longer than any study, as a single run may take minutes."""

QUIET_SECONDS = 60.0
"""Time without a new kernel after which other processes no longer count as compiling [s]: the slowest takes 13 s of
CPU, and processes share the machine."""


def progress_bar(remembered: float = 30.0) -> Progress:
    """Return a bar that vanishes when it is done; the time left follows the pace of the last ``remembered`` seconds."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, SpinnerColumn, TextColumn, TimeRemainingColumn
    from rich.table import Column

    console = Console(stderr=True)
    return Progress(
        SpinnerColumn(),
        TextColumn("{task.description}", markup=False, table_column=Column()),  # wrapped, not cut off, in 80 columns
        BarColumn(bar_width=16),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
        console=console,
        transient=True,
        speed_estimate_period=remembered,
        disable=not console.is_terminal,
    )


class Interruption:
    """Context manager that holds back Ctrl-C and SIGTERM until :meth:`heed` raises them.

    A KeyboardInterrupt inside a lock, or in a callback of another library, can be lost or leave the lock closed. A
    Ctrl-C after a first signal raises at once, as do all signals while ``waits`` is False. Ctrl-C is left alone if it
    is ignored or has another handler than Python's own. SIGTERM is left alone if it is ignored or its handler is not a
    Python function. ``asked`` is the exception of the last signal that was held back, or None.
    """

    def __init__(self, waits: bool = True) -> None:
        self.waits = waits
        self.asked: KeyboardInterrupt | None = None
        self._before: dict[int, Any] = {}

    def __enter__(self) -> Self:
        if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
            self._before[signal.SIGINT] = signal.signal(signal.SIGINT, self._note)
        present = signal.getsignal(signal.SIGTERM)
        if present is signal.SIG_DFL or callable(present):
            self._before[signal.SIGTERM] = signal.signal(signal.SIGTERM, self._note)
        return self

    def __exit__(self, *_: object) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)

    def heed(self) -> None:
        """Raise the exception of the signal that was held back, if there is one."""
        if self.asked is not None:
            raise self.asked

    def _note(self, number: int, frame: FrameType | None) -> None:
        """Hold a signal back until :meth:`heed`: the handler of both signals.

        Raise its exception at once for a Ctrl-C after a signal that was held back, or if ``waits`` is False.
        """
        again = number == signal.SIGINT and self.asked is not None
        asked = Terminated() if number == signal.SIGTERM else KeyboardInterrupt()
        if again or not self.waits:
            raise asked
        self.asked = asked


class FirstRun:
    """Progress of the compilation in a first run, estimated from the times in ``first_run.json``.

    Kernels count when they appear in the cache, whichever process compiled them. ``missing`` is the CPU time that it
    takes to compile those that were not in the cache at first [s]; ``processes``, the number of processes that compile.
    """

    def __init__(self) -> None:
        from crowdsim.first_run import read_seconds
        from crowdsim.jit import compiled_kernels

        self._compiled_kernels = compiled_kernels
        kept = compiled_kernels()
        self._seconds = {name: seconds for name, seconds in read_seconds().items() if name not in kept}
        self.missing = sum(self._seconds.values())
        self.processes = 1
        self._begin = time.monotonic()
        self._looked = -LOOK_SECONDS  # so that the first call reads the cache
        self._state = (0, 0, "")

    def state(self) -> tuple[int, int, str]:
        """Return how many kernels are compiled, of how many, and the time left in words, empty if all are compiled.

        Only kernels count that a first run compiles and that were not in the cache at first. The cache is read again
        after LOOK_SECONDS.
        """
        now = time.monotonic()
        if now - self._looked >= LOOK_SECONDS:
            kept = self._compiled_kernels()
            rest = sum(taken for name, taken in self._seconds.items() if name not in kept)
            done = self.missing - rest
            # The pace is the time of the clock for each second of CPU time in the file. Begin as if this machine were
            # as fast as the one that wrote the file; use the pace measured here once 5 s of that CPU time are compiled.
            pace = (now - self._begin) / done if done > 5.0 else 1.0 / self.processes
            left = f"about {max(round(pace * rest), 1)} s left" if rest > 0.0 else ""
            self._state = sum(name in kept for name in self._seconds), len(self._seconds), left
            self._looked = now
        return self._state

    def sentence(self) -> str:
        """Return the sentence to print if no bar is shown.

        "About a minute" is a guess for kernels that ``first_run.json`` does not list.
        """
        _, count, left = self.state()
        return "compiling kernels, once for this machine: " + (f"{count} kernels, {left}" if left else "about a minute")


class FirstRunElsewhere:
    """Context manager that shows what other processes compile, by what appears in the cache.

    It shows a line below those of ``bar`` while kernels appear. If the bar is not shown, it prints one line on stderr.
    """

    def __init__(self, bar: Progress) -> None:
        from crowdsim.jit import compiled_kernels

        self._bar = bar
        self._first_run = FirstRun()
        self._done = self._first_run.state()[0]
        # An empty cache is filled for sure, so the line is shown at once. One that lacks some kernels may never need
        # them: there the line is shown only after a kernel has appeared.
        self._grew_at = -QUIET_SECONDS if compiled_kernels() else time.monotonic()
        self._task: TaskID = bar.add_task("", total=None, visible=False)
        self._is_said = False
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._watch, daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._over.set()
        self._thread.join()
        self._bar.remove_task(self._task)

    def _watch(self) -> None:
        """Look every LOOK_SECONDS until the block ends, in a thread of its own."""
        while not self._over.wait(LOOK_SECONDS):
            self.look()

    def look(self) -> None:
        """Count the kernels in the cache; show the line while other processes compile, else hide it.

        They count as compiling if kernels are left and the last one appeared less than QUIET_SECONDS ago. If the bar is
        not shown, print :meth:`FirstRun.sentence` instead, once.
        """
        done, total, left = self._first_run.state()
        if done != self._done:
            self._done, self._grew_at = done, time.monotonic()
        is_compiling = bool(left) and time.monotonic() - self._grew_at < QUIET_SECONDS
        words = f"compiling kernels, once for this machine, {left}"
        self._bar.update(self._task, description=words, completed=done, total=total, visible=is_compiling)
        if is_compiling and not self._is_said and not self._bar.console.is_terminal:
            typer.echo(self._first_run.sentence(), err=True)
            self._is_said = True


class RunProgress:
    """Context manager with a progress bar on a terminal; elsewhere it prints one line if kernels have to be compiled.

    If many have to be compiled, other processes help. ``step`` is the callback of
    ``Simulation.run``. From ``begin_steps`` to ``end_steps``, a first Ctrl-C or SIGTERM ends the run at the end of its
    step, see :class:`Interruption`.
    """

    def __init__(self, title: str) -> None:
        self._title = title
        self._first_run: FirstRun | None = None
        self._ahead = ExitStack()
        self._compiled: list[str] = []
        self._maps = (0, 0)
        self._steps = (0, 0)
        self._interruption = Interruption(waits=False)

    @property
    def steps_done(self) -> int:
        """Return the number of steps done."""
        return self._steps[0]

    def __enter__(self) -> Self:
        from numba.core import event

        self._bar = progress_bar()
        self._is_terminal = self._bar.console.is_terminal
        self._task: TaskID = self._bar.add_task(f"{self._title}: preparing", total=None)

        # numba calls a listener for each compilation. The class is made here, as its base is imported only now.
        calls = {"on_start": self._compiling, "on_end": self._compiling_ended}
        self._watcher = type("Watcher", (event.Listener,), {name: staticmethod(call) for name, call in calls.items()})()
        event.register("numba:compile", self._watcher)
        self._bar.start()
        self._interruption.__enter__()
        return self

    def __exit__(self, *_: object) -> None:
        from numba.core import event

        self._interruption.__exit__()
        self._ahead.close()
        event.unregister("numba:compile", self._watcher)
        self._bar.stop()

    def maps(self, done: int, nodes: int) -> None:
        """Show that ``done`` of the motion graph's ``nodes`` have a map; show steps again when all have one."""
        self._maps = (done, nodes) if done < nodes else (0, 0)
        self._show()

    def begin_steps(self) -> None:
        """Hold signals back from now on, because ``step`` is called regularly and raises them."""
        self._interruption.waits = True

    def end_steps(self) -> None:
        """Raise a signal that came after the last step; those that come from now on raise at once."""
        self._interruption.waits = False
        self._interruption.heed()

    def step(self, step: int, steps: int, simulation: Any) -> None:
        """Show that ``step`` of ``steps`` is done; raise KeyboardInterrupt after Ctrl-C, Terminated after SIGTERM."""
        # Count the step first: it is complete, also if a signal ends the run now.
        self._steps = (step, steps)
        self._show()
        self._interruption.heed()

    def _compiling(self, event: Any) -> None:
        """Note a kernel that is compiled; numba calls this for kernels missing in the cache, and for their helpers.

        For the first one, let other processes compile ahead, and print the sentence if there is no terminal.
        """
        self._compiled.append(event.data["dispatcher"].py_func.__name__)
        if self._first_run is None:
            from crowdsim.first_run import CompilingAhead

            self._first_run = FirstRun()
            self._first_run.processes += self._ahead.enter_context(CompilingAhead(self._first_run.missing)).count
            if not self._is_terminal:
                typer.echo(self._first_run.sentence(), err=True)
        self._show()

    def _compiling_ended(self, event: Any) -> None:
        """Note that numba has compiled the kernel or helper that it began last."""
        self._compiled.pop()
        self._show()

    def _show(self) -> None:
        """Show the kernel that is being compiled (not its helpers), else the maps being built, else the steps done."""
        (done, total), title = self._steps, self._title if self.steps_done else f"{self._title}: preparing"
        if self._compiled and self._first_run is not None:
            done, total, left = self._first_run.state()
            title = f"{self._title}: compiling kernels, once for this machine, {left}: {self._compiled[0]}"
        elif self._maps[1]:
            (done, total), title = self._maps, f"{self._title}: motion maps"
        self._bar.update(self._task, completed=done, description=title)
        self._bar.tasks[0].total = total or None  # `update` cannot set it to None, unknown
