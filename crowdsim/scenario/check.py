"""What is lawful in a scenario but hardly meant."""

from __future__ import annotations

from collections.abc import Sequence

from shapely import MultiPolygon, Polygon

from crowdsim.environment.layers import AnyLayer, AnySolid, dropped_solids
from crowdsim.geometry.polygons import LARGE_EXTENT
from crowdsim.scenario.scenario import Scenario


def check_scenario(scenario: Scenario) -> list[str]:
    """Warnings, one a line, each beginning with the place in the file; empty if nothing stands out."""
    floor = scenario.floor_polygon()
    site = scenario.site()
    solids, owners = site.solids, site.owners
    warnings = []

    def warn(path: tuple[str | int, ...], message: str) -> None:
        warnings.append(str(scenario.problem(path, message)))

    xmin, ymin, xmax, ymax = floor.bounds
    if max(xmax - xmin, ymax - ymin) > LARGE_EXTENT:
        warn(("floor",), f"the floor is {max(xmax - xmin, ymax - ymin):g} m long; is it drawn in meters?")
    bands = [layer.band() for layer in scenario.bands]
    # What several solids make up has an effect if one of them has.
    effective = {
        solid_path for solid_path, solid in zip(owners, solids, strict=True) if _has_effect(solid, bands, floor)
    }
    for number, obstacle in enumerate(scenario.obstacles):
        path = ("obstacles", number)
        own = [solid for solid, owner in zip(solids, owners, strict=True) if owner == path]
        if path in effective or not own:
            continue
        if any(solid.footprint.intersects(floor) for solid in own):
            heights = ", ".join(f"{band.name} {band.low:g} to {band.high:g} m" for band in bands)
            low, high = min(solid.bottom for solid in own), max(solid.top for solid in own)
            warn(path, f"'{obstacle.name}' ({low:g} to {high:g} m) meets no layer ({heights}) and has no effect")
        else:
            warn(path, f"'{obstacle.name}' lies off the floor and has no effect")
    for number, group in enumerate(scenario.agents):
        for key, region in (("start", group.start), ("goal", group.goal)):
            if not floor.covers(region.shape()):
                warn(("agents", number, key), f"part of the {key} of '{group.name}' lies off the floor and is not used")
    for number, area in enumerate(scenario.areas):
        if not area.shape().intersects(floor):
            warn(("areas", number), f"'{area.name}' lies off the floor; nobody will be counted in it")
    return warnings


def _has_effect(solid: AnySolid, bands: Sequence[AnyLayer], floor: Polygon | MultiPolygon) -> bool:
    return not dropped_solids([solid], bands) and bool(solid.footprint.intersects(floor))
