"""``crowdsim plan``."""

from __future__ import annotations

import json
from typing import Annotated, Any

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
    """Plan one path through the place as it is at the start, and show which behavior it uses where."""
    ends = read_point(start, "--from"), read_point(goal, "--to")

    from crowdsim.cli.tables import print_rows
    from crowdsim.crowd.place import Place
    from crowdsim.crowd.setting import prepare
    from crowdsim.planning.planner import plan_path
    from crowdsim.scenario.loader import load_scenario

    loaded = load_scenario(scenario, overrides or [])
    setting = prepare(loaded)
    path = plan_path(Place(setting, loaded.changes()).meshes, setting.behaviors, *ends)
    sections: list[dict[str, Any]] = [
        {
            "behavior": setting.behaviors[section.behavior].name,
            "start": section.start,
            "end": section.end,
            "length": section.end - section.start,
            "cost": (section.end - section.start) * setting.behaviors[section.behavior].cost_per_meter,
        }
        for section in path.sections
    ]
    if as_json:
        found = {"length": path.length, "cost": path.cost, "sections": sections, "points": path.points.tolist()}
        typer.echo(json.dumps(found))
        return
    print_rows(
        [
            {
                "behavior": section["behavior"],
                "from m": f"{section['start']:.2f}",
                "to m": f"{section['end']:.2f}",
                "length m": f"{section['length']:.2f}",
                "cost": f"{section['cost']:.2f}",
            }
            for section in sections
        ]
    )
    typer.echo(f"\n{path.length:.2f} m, cost {path.cost:.2f}, changes of behavior included")
