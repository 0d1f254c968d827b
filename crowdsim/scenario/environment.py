"""The environment that a scenario describes: a floor, the layers of what stands on it, and a timetable."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from shapely import MultiPolygon, Polygon

from crowdsim.environment.layers import AnySolid, ClearanceLayer, clearance_layers, polygons_only
from crowdsim.scenario.schema.schema import ScenarioFields
from crowdsim.scenario.site import doubts_in, read_site
from crowdsim.scenario.timetable import Timetable, read_timetable
from crowdsim.yamlfile.document import Complaint
from crowdsim.yamlfile.document import Path as KeyPath


class Environment(NamedTuple):
    """What characters walk in.

    Attributes
    ----------
    floor : the floor before anything stands on it
    solids : those of the file's obstacles where they are drawn, and of the clutter, by entry: ``("obstacles", 2)``
    layers : clearance layers as they are at the start, the ground layer first
    fixed_layers : the same with nothing on the floor but what never changes
    timetable : what never changes, what does, and when
    report : what was assumed and left out, a line each
    """

    floor: Polygon | MultiPolygon
    solids: Mapping[KeyPath, tuple[AnySolid, ...]]
    layers: tuple[ClearanceLayer, ...]
    fixed_layers: tuple[ClearanceLayer, ...]
    timetable: Timetable
    report: tuple[str, ...]


def build_environment(keys: ScenarioFields, folder: Path) -> tuple[Environment | None, list[Complaint]]:
    """Build the environment of a scenario whose files are named relative to ``folder``.

    Returns
    -------
    environment : None if it cannot be built
    complaints : everything that is wrong with the floor, what stands on it, the layers and the events
    """
    site = read_site(keys, folder)
    if site.complaints:
        return None, site.complaints
    names: dict[KeyPath, str] = {("obstacles", number): thing.name for number, thing in enumerate(keys.obstacles)}
    things = [(names.get(path, str(path[0])), solids) for path, solids in site.solids.items()]
    timetable, complaints = read_timetable(keys, things)
    if keys.planner == "collision3d" and keys.events:
        complaints = [(("planner",), "'collision3d' knows a place that stands still; drop the events")]
    if len({layer.name for layer in keys.bands}) < len(keys.bands):
        return None, complaints
    bands = [layer.band() for layer in keys.bands]
    layers = clearance_layers(site.floor, timetable.at_start(), bands)
    if polygons_only(layers[0].free).is_empty:
        message = "; ".join(["the floor is empty: obstacles cover all of it", *doubts_in(site.report)])
        return None, [*complaints, (("floor",), message)]
    fixed_layers = clearance_layers(site.floor, timetable.fixed, bands) if timetable.movables else layers
    return Environment(site.floor, site.solids, layers, fixed_layers, timetable, tuple(site.report)), complaints
