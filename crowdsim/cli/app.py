"""The ``crowdsim`` command and its subcommands."""

from __future__ import annotations

import gc
from typing import Annotated

import typer

from crowdsim.cli.bench import bench
from crowdsim.cli.doctor import doctor
from crowdsim.cli.errors_shown import Commands, remember_debug
from crowdsim.cli.export import export
from crowdsim.cli.listings import behaviors, scenarios, schema
from crowdsim.cli.motion_commands.coverage import coverage
from crowdsim.cli.motion_commands.motion import motion
from crowdsim.cli.plan import plan
from crowdsim.cli.play import play
from crowdsim.cli.run import check, recover, run
from crowdsim.cli.serve import serve
from crowdsim.cli.study_commands.analyze import analyze
from crowdsim.cli.study_commands.sweep import sweep
from crowdsim.cli.validate import validate

app = typer.Typer(
    cls=Commands, no_args_is_help=True, rich_markup_mode=None, pretty_exceptions_enable=False, add_completion=True
)
for command in (
    run,
    check,
    serve,
    play,
    export,
    analyze,
    sweep,
    recover,
    plan,
    scenarios,
    behaviors,
    schema,
    bench,
    validate,
    doctor,
):
    app.command()(command)
motion.command()(coverage)
app.add_typer(motion, name="motion")


def _show_version(wanted: bool) -> None:
    """Print the version and exit, if ``wanted``."""
    if wanted:
        from crowdsim.version import __version__

        typer.echo(f"crowdsim {__version__}")
        raise typer.Exit


@app.callback()
def crowdsim(
    version: Annotated[
        bool, typer.Option("--version", help="Print the version.", callback=_show_version, is_eager=True)
    ] = False,
    debug: Annotated[
        bool, typer.Option("--debug", help="Show the traceback of an error.", callback=remember_debug, is_eager=True)
    ] = False,
) -> None:
    """Simulate agents that walk through cluttered places as people do."""


def main() -> None:
    """Run the command line and leave the process with the command's exit code."""
    # Compilation of kernels creates millions of objects that stay; default garbage collection scans them repeatedly.
    gc.set_threshold(50_000, 20, 20)
    app(prog_name="crowdsim")
