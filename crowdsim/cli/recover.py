"""``crowdsim recover``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from crowdsim.cli.options import Debug


def recover(
    part: Annotated[Path, typer.Argument(metavar="FILE.part", help="What a killed run left.")],
    output: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="FILE", help="Recording to write [default: FILE].")
    ] = None,
    debug: Debug = False,
) -> None:
    """Make a recording of what a killed run left; it says that it is not complete."""
    from crowdsim.recording.recovery import recover as recover_part

    with recover_part(part, output) as recording:
        typer.echo(
            f"{recording.path}: {recording.steps} steps, the first {recording.duration:g} s of a run that was killed"
        )
