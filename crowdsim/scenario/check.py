"""What is lawful in a scenario but hardly meant."""

from __future__ import annotations

from crowdsim.environment.layers import dropped_solids
from crowdsim.geometry.polygons import LARGE_EXTENT
from crowdsim.scenario.scenario import Scenario


def check_scenario(scenario: Scenario) -> list[str]:
    """Warnings, one a line, each beginning with the place in the file; empty if nothing stands out."""
    floor = scenario.floor_polygon()
    solids = list(scenario.solids())
    warnings = []

    def warn(path: tuple[str | int, ...], message: str) -> None:
        warnings.append(str(scenario.problem(path, message)))

    xmin, ymin, xmax, ymax = floor.bounds
    if max(xmax - xmin, ymax - ymin) > LARGE_EXTENT:
        warn(("floor",), f"the floor is {max(xmax - xmin, ymax - ymin):g} m long; is it drawn in meters?")
    bands = [layer.band() for layer in scenario.bands]
    places: list[tuple[str | int, ...]] = [("obstacles", number) for number in range(len(solids))]
    solids += [door.solid() for door in scenario.doors]
    places += [("doors", number) for number in range(len(scenario.doors))]
    for number, event in enumerate(scenario.events):
        if event.insert is not None:
            solids.append(event.insert.solid())
            places.append(("events", number, "insert"))
        if event.at >= scenario.duration:
            warn(("events", number, "at"), f"the run ends at {scenario.duration:g} s, before this happens")
    for path, solid in zip(places, solids, strict=True):
        if dropped_solids([solid], bands):
            heights = ", ".join(f"{band.name} {band.low:g} to {band.high:g} m" for band in bands)
            message = (
                f"'{solid.name}' ({solid.bottom:g} to {solid.top:g} m) meets no layer ({heights}) and has no effect"
            )
            warn(path, message)
        elif not solid.footprint.intersects(floor):
            warn(path, f"'{solid.name}' lies off the floor and has no effect")
    for number, group in enumerate(scenario.agents):
        for key, region in ((("start",), group.start), *group.regions()):
            if not floor.covers(region.shape()):
                what = "start" if key == ("start",) else "goal"
                warn(
                    ("agents", number, *key), f"part of the {what} of '{group.name}' lies off the floor and is not used"
                )
    for number, area in enumerate(scenario.areas):
        if not area.shape().intersects(floor):
            warn(("areas", number), f"'{area.name}' lies off the floor; nobody will be counted in it")
    return warnings
