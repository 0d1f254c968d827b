"""What the user sees when a command fails: the one place that turns exceptions into a message and an exit code.

0 done, 2 bad input or usage, 3 nothing here can draw, 130 interrupted, 1 a bug. A traceback only with ``--debug``.
"""

from __future__ import annotations

import os
import sys
from typing import Any

import typer
from typer.core import TyperGroup

from crowdsim.errors import CrowdSimError

BAD_INPUT = 2
BUG = 1
INTERRUPTED = 130
_DEBUG = "crowdsim.debug"


def remember_debug(context: typer.Context, wanted: bool) -> bool:
    """Keep the value of ``--debug``, given before or after the command's name, for when the command fails."""
    if wanted:
        context.meta[_DEBUG] = True
    return wanted


class Commands(TyperGroup):
    """The group of all commands; shows what they raise."""

    def invoke(self, ctx: Any) -> Any:
        try:
            result = super().invoke(ctx)
            sys.stdout.flush()
            return result
        except (typer.Exit, typer.Abort):
            raise
        except BrokenPipeError:
            _discard_stdout()
            raise typer.Exit(0) from None
        except KeyboardInterrupt as interrupt:
            message = str(interrupt) or "interrupted"
            raise typer.Exit(_show(ctx, interrupt, message, INTERRUPTED)) from None
        except CrowdSimError as error:
            raise typer.Exit(_show(ctx, error, _each_line("error: ", error), error.exit_code)) from None
        except OSError as error:
            place = f"{error.filename}: " if error.filename else ""
            raise typer.Exit(_show(ctx, error, f"error: {place}{error.strerror or error}", BAD_INPUT)) from None
        except Exception as error:
            if hasattr(error, "format_message"):  # a usage error: typer prints it and exits with 2
                raise
            message = (
                f"internal error: {type(error).__name__}: {_first_line(error)}; run again with --debug to see where"
            )
            raise typer.Exit(_show(ctx, error, message, BUG)) from None


def _show(ctx: Any, error: BaseException, message: str, code: int) -> int:
    if ctx.meta.get(_DEBUG):
        import traceback

        traceback.print_exception(error)
    typer.echo(message, err=True)
    return code


def _each_line(prefix: str, error: Exception) -> str:
    return "\n".join(prefix + line for line in str(error).splitlines() or [type(error).__name__])


def _first_line(error: Exception) -> str:
    return (str(error).splitlines() or [""])[0]


def _discard_stdout() -> None:
    """Whoever read our output has gone (``| head``): leave quietly, and let the interpreter's last flush succeed."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, sys.stdout.fileno())
