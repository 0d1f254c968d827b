"""``crowdsim plan``."""

from __future__ import annotations

from typing import Annotated

import typer

from crowdsim.cli.options import Debug, Json, Overrides, Scenario, read_point


def plan(
    scenario: Scenario,
    start: Annotated[str, typer.Option("--from", metavar="X,Y", help="Start, in meters.")],
    goal: Annotated[str, typer.Option("--to", metavar="X,Y", help="Goal, in meters.")],
    overrides: Overrides = None,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Plan one path and show its sections."""
    raise NotImplementedError
