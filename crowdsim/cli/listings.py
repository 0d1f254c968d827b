"""``crowdsim scenarios``, ``crowdsim behaviors`` and ``crowdsim schema``."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any

import typer

from crowdsim.cli.options import Debug, Json


def scenarios(as_json: Json = False, debug: Debug = False) -> None:
    """List the built-in scenarios."""
    from crowdsim.cli.tables import print_table
    from crowdsim.scenario.loader import builtin_scenarios, load_scenario

    found = {name: load_scenario(path).description for name, path in builtin_scenarios().items()}
    if as_json:
        typer.echo(json.dumps(found))
    else:
        print_table(list(found.items()))


def behaviors(
    picture: Annotated[
        Path | None, typer.Option(metavar="OUT.png", help="Draw the width of each behavior over height.")
    ] = None,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """List the built-in behaviors, narrowest first."""
    from crowdsim.behaviors.behavior import list_behaviors
    from crowdsim.behaviors.library import load_behavior_set
    from crowdsim.cli.tables import print_rows
    from crowdsim.environment.layers import LEGS, TORSO
    from crowdsim.library import library_folder

    bands = (LEGS, TORSO)
    found = load_behavior_set(list_behaviors(library_folder("behaviors")), [(b.low, b.high) for b in bands]).behaviors
    if picture is not None:
        from crowdsim.behaviors.clearance_profiles import draw_profiles, measure_profile
        from crowdsim.figures import write_figure

        profiles = [measure_profile(behavior.name, library_folder("behaviors")) for behavior in found]
        write_figure(draw_profiles(profiles, [(band.name, band.low, band.high) for band in bands]), picture)
    rows: list[dict[str, Any]] = [
        {
            "name": behavior.name,
            "description": behavior.description,
            "speed": behavior.speed,
            "cost_per_meter": behavior.cost_per_meter,
            "radii": {band.name: round(float(radius), 4) for band, radius in zip(bands, behavior.radii, strict=True)},
        }
        for behavior in sorted(found, key=lambda behavior: behavior.radii.max())
    ]
    if as_json:
        typer.echo(json.dumps(rows))
        return
    print_rows(
        [
            {
                "name": row["name"],
                "speed m/s": row["speed"],
                "cost a meter": row["cost_per_meter"],
                **{f"{layer} radius m": f"{radius:.3f}" for layer, radius in row["radii"].items()},
                "description": row["description"],
            }
            for row in rows
        ]
    )


def schema(
    output: Annotated[Path | None, typer.Option("--output", "-o", metavar="FILE", help="Write it to a file.")] = None,
    debug: Debug = False,
) -> None:
    """Print the JSON schema of a scenario file, with which editors complete, check and explain its keys."""
    from crowdsim.scenario.schema.schema import json_schema_text
    from crowdsim.whole_files import whole_file

    if output is None:
        typer.echo(json_schema_text(), nl=False)
        return
    with whole_file(output, (".json",), "schemas") as part:
        part.write_text(json_schema_text(), encoding="utf-8")
