"""Build the environment that a scenario describes: floor, clearance layers, and a timetable of changes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

from shapely import MultiPolygon, Polygon

from crowdsim.environment.layers import AnySolid, ClearanceLayer, clearance_layers, polygons_only
from crowdsim.scenario.composing.files import Files
from crowdsim.scenario.schema.commands import Command
from crowdsim.scenario.schema.schema import ScenarioFields
from crowdsim.scenario.site import doubts_in, read_site
from crowdsim.scenario.timetable import Timetable, TimetableReader
from crowdsim.yamlfile.document import Complaint
from crowdsim.yamlfile.document import Path as KeyPath


class Environment(NamedTuple):
    """Floor, obstacles and clearance layers of a scenario, and their changes over time.

    Attributes
    ----------
    floor : Polygon or MultiPolygon
        The whole floor, without obstacles [m].
    solids : mapping of KeyPath to tuple of solids
        Solids of the obstacles, as the file draws them, and of the clutter; by entry, as ``("obstacles", 2)``.
    layers : tuple of ClearanceLayer
        Clearance layers at the start of the run, the ground layer first.
    fixed_layers : tuple of ClearanceLayer
        The same layers with only those obstacles that never change.
    timetable : Timetable
        Fixed solids, movable things, and the events that are known at the start.
    commanded : Timetable
        The timetable with the commands of the file added.
    report : tuple of str
        Assumptions that were made and parts of files that were left out, one sentence each.
    """

    floor: Polygon | MultiPolygon
    solids: Mapping[KeyPath, tuple[AnySolid, ...]]
    layers: tuple[ClearanceLayer, ...]
    fixed_layers: tuple[ClearanceLayer, ...]
    timetable: Timetable
    commanded: Timetable
    report: tuple[str, ...]


def build_environment(
    keys: ScenarioFields, files: Files, progress: Callable[[int, int], None] | None = None
) -> tuple[Environment | None, list[Complaint]]:
    """Build the environment of a scenario with the ``files`` that it names.

    ``progress`` is passed on to :func:`~crowdsim.environment.layers.clearance_layers`.

    Returns
    -------
    environment : Environment or None
        None if it cannot be built.
    complaints : list of Complaint
        What is wrong with the floor, the obstacles and the clutter. If nothing is: what is wrong with the events, or
        else with the commands about doors and obstacles, and that obstacles cover all of the floor.
    """
    site = read_site(keys, files)
    if site.complaints:
        return None, site.complaints
    reader = read_timetable(keys, site.solids, ())
    timetable, complaints = reader.timetable(), reader.wrong
    commanded = timetable
    if keys.planner == "collision3d" and (keys.events or any(command.changes_place for command in keys.commands)):
        # Report this alone: dropping the events removes all else that is wrong with them.
        complaints = [(("planner",), "the planner 'collision3d' supports no events; drop them, or use another planner")]
    elif keys.commands and not complaints:
        reader = read_timetable(keys, site.solids, keys.commands)
        commanded, complaints = reader.timetable(), reader.wrong
    # Two layers of one name cannot be built; :mod:`crowdsim.scenario.semantics` complains of them.
    if len({layer.name for layer in keys.bands}) < len(keys.bands):
        return None, complaints
    bands = [layer.band() for layer in keys.bands]
    layers = clearance_layers(site.floor, timetable.at_start(), bands, progress)
    if polygons_only(layers[0].free).is_empty:
        message = "; ".join(["the floor is empty: obstacles cover all of it", *doubts_in(site.report)])
        return None, [*complaints, (("floor",), message)]
    fixed_layers = clearance_layers(site.floor, timetable.fixed, bands) if timetable.movables else layers
    report = tuple(site.report)
    return Environment(site.floor, site.solids, layers, fixed_layers, timetable, commanded, report), complaints


def read_timetable(
    keys: ScenarioFields, solids: Mapping[KeyPath, tuple[AnySolid, ...]], commands: Sequence[Command]
) -> TimetableReader:
    """Read the timetable of a scenario: its events and ``commands``.

    Parameters
    ----------
    keys : ScenarioFields
        Keys of the scenario.
    solids : mapping of KeyPath to tuple of solids
        Solids by the entry they come from.
    commands : sequence of Command
        Commands, applied in the order of time among the events of the file, and after those of the same time.
    """
    names: dict[KeyPath, str] = {("obstacles", number): thing.name for number, thing in enumerate(keys.obstacles)}
    return TimetableReader(keys, [(names.get(path, str(path[0])), each) for path, each in solids.items()], commands)
