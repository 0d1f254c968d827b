"""``crowdsim plan``."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from crowdsim.cli.options import Debug, Json, Overrides, Scenario, read_point

if TYPE_CHECKING:
    from crowdsim.behaviors.behavior import Behavior
    from crowdsim.planning.labels.annotated_path import AnnotatedPath


def plan(
    scenario: Scenario,
    start: Annotated[str, typer.Option("--from", metavar="X,Y", help="Start, in meters.")],
    goal: Annotated[str, typer.Option("--to", metavar="X,Y", help="Goal, in meters.")],
    planner: Annotated[str | None, typer.Option(metavar="NAME", help="layered, greedy_literal or collision3d.")] = None,
    picture: Annotated[
        Path | None, typer.Option(metavar="OUT.png", help="Draw the path in the colors of its behaviors.")
    ] = None,
    overrides: Overrides = None,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Plan one path through the environment at the start of the run, and show its behaviors section by section."""
    ends = read_point(start, "--from"), read_point(goal, "--to")

    from crowdsim.cli.tables import print_rows
    from crowdsim.crowd.state.assets import prepare
    from crowdsim.crowd.state.environment import EnvironmentState
    from crowdsim.scenario.loader import load_scenario

    changes = [*(overrides or [])]
    if planner is not None:
        changes.append(f"planner={planner}")
    loaded = load_scenario(scenario, changes)
    assets = prepare(loaded)
    environment = EnvironmentState(assets)
    path = environment.route(*ends)
    # Time a second plan: the first one builds the roadmap that later ones share.
    begin = time.perf_counter()
    environment.route(*ends)
    milliseconds = 1e3 * (time.perf_counter() - begin)
    if picture is not None:
        from crowdsim.figures import write_figure
        from crowdsim.scenario.picture import draw_plan

        write_figure(draw_plan(loaded, assets.behaviors, path), picture)
    sections = _sections(path, assets.behaviors)
    if as_json:
        found = {
            "planner": assets.planner,
            "length": path.length,
            "cost": path.cost,
            "gap": path.gap if math.isfinite(path.gap) else None,
            "missing_clearance": list(path.missing),
            "milliseconds": milliseconds,
            "sections": sections,
            "points": path.points.tolist(),
        }
        typer.echo(json.dumps(found))
        return
    labels = {"start": "from m", "end": "to m", "length": "length m", "cost": "cost"}
    rows = [{label: f"{section[key]:.2f}" for key, label in labels.items()} for section in sections]
    print_rows([{"behavior": section["behavior"], **row} for section, row in zip(sections, rows, strict=True)])
    # The gap is infinite if the planner proves no lower bound of the cost.
    above = f"no more than {path.gap:.1%} above the cheapest there is"
    if not math.isfinite(path.gap):
        above = "the planner proves no bound of the cheapest there is"
    typer.echo(
        f"\n{path.length:.2f} m, cost {path.cost:.2f}, changes of behavior included; {above}; {milliseconds:.1f} ms"
    )
    for end, missing in zip(("start", "goal"), path.missing, strict=True):
        if missing > 0.0:
            typer.echo(
                f"the {end} is nearer to obstacles than plans allow: up to {missing:.3f} m of clearance are missing"
            )


def _sections(path: AnnotatedPath, behaviors: Sequence[Behavior]) -> list[dict[str, Any]]:
    """Return the sections of a path with behavior, start, end and length along the path [m], and cost."""
    return [
        {
            "behavior": behaviors[section.behavior].name,
            "start": section.start,
            "end": section.end,
            "length": section.end - section.start,
            "cost": (section.end - section.start) * behaviors[section.behavior].cost_per_meter,
        }
        for section in path.sections
    ]
