"""Turn exceptions into a message and an exit code: the only place that does.

Exit codes: 0 done, 2 bad input or usage, 3 no drawing backend, 4 no agent could arrive, or a test or all points of a
sweep failed, 130 interrupted, 143 terminated, 1 a bug. A traceback is printed only with ``--debug``.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any, TextIO

import typer
from typer.core import TyperGroup

from crowdsim.errors import CacheWarning, CrowdSimError, GeometryWarning
from crowdsim.whole_files import NO_ROOM

BAD_INPUT = 2
BUG = 1
NOBODY_ARRIVED = 4
INTERRUPTED = 130
TERMINATED = 143
_DEBUG = "crowdsim.debug"


class Terminated(KeyboardInterrupt):
    """Raised on SIGTERM: commands end as on Ctrl-C, with another exit code."""


@contextmanager
def _terminated_as_interrupted() -> Iterator[None]:
    """Raise Terminated on SIGTERM inside the block; restore the former handler of the signal afterwards.

    In other threads than the main one, change nothing.
    """

    def terminate(number: int, frame: FrameType | None) -> None:
        """Raise Terminated: the handler of SIGTERM."""
        raise Terminated

    # Python sets handlers of signals in its main thread only.
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGTERM, terminate)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


def _show_warning(
    message: Warning | str,
    category: type[Warning],
    filename: str,
    lineno: int,
    file: TextIO | None = None,
    line: str | None = None,
) -> None:
    """Print crowdsim's own warnings as one line; leave all others to Python."""
    if issubclass(category, CacheWarning | GeometryWarning):
        typer.echo(f"warning: {message}", err=True)
    else:
        _usual_warning(message, category, filename, lineno, file, line)


_usual_warning = warnings.showwarning
"""Python's own function, kept before :meth:`Commands.invoke` replaces it."""


def remember_debug(context: typer.Context, wanted: bool) -> bool:
    """Store ``--debug``, given before or after the command's name, in case the command fails."""
    if wanted:
        context.meta[_DEBUG] = True
    return wanted


class Commands(TyperGroup):
    """The group of all commands; prints the errors that they raise."""

    def invoke(self, ctx: Any) -> Any:
        """Run a command; turn its exceptions into a message and an exit code."""
        warnings.showwarning = _show_warning
        try:
            with _terminated_as_interrupted():
                result = super().invoke(ctx)
            sys.stdout.flush()
            return result
        except BrokenPipeError:  # the reader of the output is gone, as with `| head`: not an error
            _discard_stdout()
            raise typer.Exit(0) from None
        except (KeyboardInterrupt, Exception) as error:
            typers_own = isinstance(error, typer.Exit | typer.Abort) or hasattr(error, "format_message")
            if typers_own:  # a regular exit, or a usage error that typer prints
                raise
            if ctx.meta.get(_DEBUG):
                import traceback

                traceback.print_exception(error)
            message, code = describe(error)
            typer.echo(message, err=True)
            raise typer.Exit(code) from None


def describe(error: BaseException) -> tuple[str, int]:
    """Return the message to print for an error, and the exit code.

    Interruptions, and errors of an import that one made fail, are INTERRUPTED or TERMINATED. Errors of crowdsim name
    their own code. Errors of the operating system count as bad input, all others as bugs.
    """
    error = _interruption_behind(error) or error
    if isinstance(error, Terminated):
        return str(error) or "terminated", TERMINATED
    if isinstance(error, KeyboardInterrupt):
        return str(error) or "interrupted", INTERRUPTED
    if isinstance(error, CrowdSimError):
        return "\n".join(f"error: {line}" for line in str(error).splitlines()), error.exit_code
    if isinstance(error, OSError):
        # Without a working folder no relative path is found, so the file's name would mislead.
        if isinstance(error, FileNotFoundError) and _is_nowhere():
            return "error: the folder in which this was started does not exist any more; change to another", BAD_INPUT
        place = f"{error.filename}: " if error.filename else ""
        remedy = "; make room on the disk, or choose another place" if error.errno in NO_ROOM else ""
        return f"error: {place}{error.strerror or error}{remedy}", BAD_INPUT
    what = ": ".join([type(error).__name__, *str(error).splitlines()[:1]])
    return f"internal error: {what}; run again with --debug to see where", BUG


def _interruption_behind(error: BaseException) -> KeyboardInterrupt | None:
    """Return the interruption that made an import fail, which numpy and others turn into an ImportError; else None."""
    cause: BaseException | None = error if isinstance(error, ImportError) else None
    while cause is not None and not isinstance(cause, KeyboardInterrupt):
        cause = cause.__cause__ or cause.__context__
    return cause


def _is_nowhere() -> bool:
    """Return whether the working folder was deleted."""
    try:
        os.getcwd()
    except FileNotFoundError:
        return True
    return False


def _discard_stdout() -> None:
    """Send further output to nowhere, because its reader is gone (``| head``): Python's last flush then succeeds."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, sys.stdout.fileno())
