"""Warn of entries in a scenario that are valid but probably a mistake."""

from __future__ import annotations

from collections.abc import Sequence

import shapely

from crowdsim.behaviors.behavior import Behavior
from crowdsim.constants import TRACKING_MARGIN
from crowdsim.environment.layers import AnySolid, dropped_solids, polygons_only
from crowdsim.geometry.polygons import LARGE_EXTENT, buffered
from crowdsim.planning.query.requirements import Requirements
from crowdsim.scenario.scenario import Scenario
from crowdsim.yamlfile.document import Path as KeyPath

_ARC = 8
"""Chords of a quarter circle around a corner: the fewer, the narrower are gaps that count as wide enough."""

_NEAR = 0.5
"""Distance of a start or goal from free area up to which agents may still come to it [m]."""


def check_scenario(scenario: Scenario) -> list[str]:
    """Return warnings of valid entries that are probably mistakes, each with its position in the file.

    These are a very large floor, events after the end of the run, things that meet no layer or lie off the floor,
    starts, routes and goals that lie off the floor in part, and areas and lines that lie off it as a whole. The list is
    empty if there are none.
    """
    floor = scenario.environment.floor
    warnings = []

    def warn(path: tuple[str | int, ...], message: str) -> None:
        """Add a warning about the entry at the key ``path``."""
        warnings.append(str(scenario.problem(path, message)))

    xmin, ymin, xmax, ymax = floor.bounds
    if max(xmax - xmin, ymax - ymin) > LARGE_EXTENT:
        warn(("floor",), f"the floor is {max(xmax - xmin, ymax - ymin):g} m long; is it drawn in meters?")
    bands = [layer.band() for layer in scenario.bands]
    # All that may stand on the floor at some time: key path, name and solids.
    things: list[tuple[KeyPath, str, Sequence[AnySolid]]] = [
        (("obstacles", number), obstacle.name, scenario.environment.solids["obstacles", number])
        for number, obstacle in enumerate(scenario.obstacles)
    ]
    things += [(("doors", number), door.name, door.solids()) for number, door in enumerate(scenario.doors)]
    for number, event in enumerate(scenario.events):
        if event.insert is not None:
            things.append((("events", number, "insert"), event.insert.name, event.insert.solids()))
        if event.at >= scenario.duration:
            warn(("events", number, "at"), f"the run ends at {scenario.duration:g} s, before this happens")
    for path, name, solids in things:
        # A thing made of several solids has an effect if at least one solid meets a layer.
        met = [solid for solid in solids if not dropped_solids([solid], bands)]
        if solids and not met:
            heights = ", ".join(f"{band.name} {band.low:g} to {band.high:g} m" for band in bands)
            low, high = min(solid.bottom for solid in solids), max(solid.top for solid in solids)
            warn(path, f"'{name}' ({low:g} to {high:g} m) meets no layer ({heights}) and has no effect")
        elif solids and not any(solid.footprint.intersects(floor) for solid in met):
            warn(path, f"'{name}' lies off the floor and has no effect")
    for number, group in enumerate(scenario.agents):
        start: tuple[str | int, ...] = ("agents", number, "start")
        for path, shape in ((start, group.start.shape()), *scenario.destinations(number)):
            if not floor.covers(shape):
                what = "start" if path == start else "route" if path[0] == "routes" else "goal"
                warn(path, f"part of the {what} of '{group.name}' lies off the floor and is not used")
    measured = [("areas", number, area.name, area.shape()) for number, area in enumerate(scenario.areas)]
    measured += [("lines", number, line.name, line.shape()) for number, line in enumerate(scenario.lines)]
    for kind, number, name, shape in measured:
        if not shape.intersects(floor):
            warn((kind, number), f"'{name}' lies off the floor; no agent will be counted there")
    return warnings


def check_ways(scenario: Scenario, behaviors: Sequence[Behavior]) -> list[str]:
    """Return warnings of groups on whose way even the narrowest behavior does not fit; an empty list if there are none.

    ``behaviors`` are those of the scenario. Doors and other movables count as absent. Nothing is checked on a periodic
    floor, as ways may lead across its ends, nor for the planner that checks bodies in 3D, which does not plan by
    clearances.
    """
    environment = scenario.environment
    if scenario.planner == "collision3d" or any(scenario.span):
        return []
    # On each layer, the area in which the narrowest behavior fits, as plans require it.
    narrowest = Requirements.of(behaviors, len(environment.layers), TRACKING_MARGIN).radii.min(axis=0)
    eroded = [
        buffered(layer.free, -float(radius), _ARC)
        for layer, radius in zip(environment.fixed_layers, narrowest, strict=True)
    ]
    parts = polygons_only(shapely.intersection_all(eroded)).geoms
    names = ", ".join(behavior.name for behavior in behaviors)
    warnings = []
    for number, group in enumerate(scenario.agents):
        # Parts of the area that come within _NEAR of the start and of all places so far: a way stays in one part.
        joined = [part for part in parts if shapely.dwithin(part, group.start.shape(), _NEAR)]
        for path, shape in scenario.destinations(number):
            joined = [part for part in joined if shapely.dwithin(part, shape, _NEAR)]
            if not joined:
                message = (
                    f"no way from the start of '{group.name}' to here is wide enough for any behavior ({names}); "
                    "widen it, or see with --picture where each behavior fits"
                )
                warnings.append(str(scenario.problem(path, message)))
                break
    return warnings
