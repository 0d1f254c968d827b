"""``crowdsim scenarios`` and ``crowdsim behaviors``."""

from __future__ import annotations

import json

import typer

from crowdsim.cli.options import Debug, Json


def scenarios(as_json: Json = False, debug: Debug = False) -> None:
    """List the built-in scenarios."""
    from crowdsim.cli.tables import print_table
    from crowdsim.scenario.loader import built_in_scenarios

    found = {name: description for name, description in built_in_scenarios()}
    if as_json:
        typer.echo(json.dumps(found))
    else:
        print_table(list(found.items()))


def behaviors(
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """List the built-in behaviors, narrowest first, with the clearances measured from their clips."""
    from crowdsim.cli.tables import print_rows

    raise NotImplementedError
