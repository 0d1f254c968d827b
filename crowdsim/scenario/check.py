"""Warn of entries in a scenario that are valid but probably a mistake."""

from __future__ import annotations

from collections.abc import Sequence

from crowdsim.environment.layers import AnySolid, dropped_solids
from crowdsim.geometry.polygons import LARGE_EXTENT
from crowdsim.scenario.scenario import Scenario
from crowdsim.yamlfile.document import Path as KeyPath


def check_scenario(scenario: Scenario) -> list[str]:
    """Return warnings, each with its position in the file; an empty list if there are none."""
    floor = scenario.environment.floor
    warnings = []

    def warn(path: tuple[str | int, ...], message: str) -> None:
        warnings.append(str(scenario.problem(path, message)))

    xmin, ymin, xmax, ymax = floor.bounds
    if max(xmax - xmin, ymax - ymin) > LARGE_EXTENT:
        warn(("floor",), f"the floor is {max(xmax - xmin, ymax - ymin):g} m long; is it drawn in meters?")
    bands = [layer.band() for layer in scenario.bands]
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
