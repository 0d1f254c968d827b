"""Checks across keys: what can be wrong with a scenario if each key by itself is valid.

``folder`` is the folder that file names of the scenario are relative to.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from crowdsim.constants import STEERING_RATE
from crowdsim.errors import MotionError
from crowdsim.library import library_folder
from crowdsim.scenario.people.arrivals import start_times
from crowdsim.scenario.people.draws import is_cut_off
from crowdsim.scenario.schema.schema import ScenarioFields
from crowdsim.scenario.schema.spreads import Spread
from crowdsim.yamlfile.document import Complaint
from crowdsim.yamlfile.messages import nearest


def key_complaints(keys: ScenarioFields, folder: Path) -> list[Complaint]:
    """Return complaints of keys that contradict each other, the libraries, or the files in ``folder``."""
    return [
        *_duplicate_names(keys),
        *_behaviors(keys, folder),
        *_captures(keys, folder),
        *_times(keys),
        *_locomotion(keys),
        *_exits(keys),
        *_routes(keys),
        *_periodic(keys),
        *_attributes(keys),
        *_spreads(keys),
    ]


def _duplicate_names(keys: ScenarioFields) -> list[Complaint]:
    """Complain about names given twice. No door may have the name of an obstacle, as events name both."""
    named: dict[str, Sequence[str]] = {
        "obstacles": [obstacle.name for obstacle in keys.obstacles],
        "doors": [door.name for door in keys.doors],
        "layers": [layer.name for layer in keys.bands],
        "agents": [group.name for group in keys.agents],
        "exits": [each.name for each in keys.exits],
        "routes": [route.name for route in keys.routes],
        "areas": [area.name for area in keys.areas],
        "lines": [line.name for line in keys.lines],
    }
    complaints: list[Complaint] = []
    for key, names in named.items():
        first: dict[str, int] = {}
        for number, name in enumerate(names):
            if first.setdefault(name, number) != number:
                message = f"the name '{name}' is taken by {key}.{first[name]}"
                complaints.append(((key, number, "name"), message))
        if key in ("obstacles", "doors") and keys.clutter is not None and "clutter" in first:
            message = "the name 'clutter' is reserved for the random obstacles; choose another one"
            complaints.append(((key, first["clutter"], "name"), message))
    obstacles = {name: number for number, name in enumerate(named["obstacles"])}
    for number, name in enumerate(named["doors"]):
        if name in obstacles:
            message = f"the name '{name}' is taken by obstacles.{obstacles[name]}"
            complaints.append((("doors", number, "name"), message))
    return complaints


def _behaviors(keys: ScenarioFields, folder: Path) -> list[Complaint]:
    """Complain about behaviors that are unknown, named twice, or folders with faults."""
    # Only behaviors that the file names are checked: the default ones ship with the package.
    if "behaviors" not in keys.model_fields_set:
        return []
    # Imported only here, as it loads the modules of clips.
    from crowdsim.behaviors.behavior import FILE_NAME, behavior_folder, is_own

    library = library_folder("behaviors")
    known = sorted(entry.parent.name for entry in library.glob("*/behavior.yaml"))
    complaints: list[Complaint] = []
    names: list[str] = []
    for number, entry in enumerate(keys.behaviors):
        own = is_own(entry)
        name = behavior_folder(entry, folder, library).name
        if name in names:
            complaints.append((("behaviors", number), f"'{name}' is named twice"))
        elif own:
            complaints += [(("behaviors", number), message) for message in _own_behavior(keys, entry, folder)]
        elif name not in known:
            if (folder / name / FILE_NAME).is_file():
                message = f"unknown behavior '{name}'; for the folder beside this file write ./{name}"
            else:
                message = f"unknown behavior '{name}'; {nearest(name, known, 'the library has')}"
            complaints.append((("behaviors", number), message))
        names.append(name)
    return complaints


def _own_behavior(keys: ScenarioFields, entry: str, folder: Path) -> list[str]:
    """Return what is wrong with the folder of an own behavior, and with its use in this scenario.

    ``entry`` is its path as the scenario gives it.
    """
    from crowdsim.behaviors.behavior import FILE_NAME, behavior_folder, read_behavior
    from crowdsim.errors import BehaviorError

    place = behavior_folder(entry, folder, library_folder("behaviors"))
    if not (place / FILE_NAME).is_file():
        return [f"there is no {place / FILE_NAME}; folders are sought beside the scenario file"]
    if keys.planner == "collision3d":
        return ["'collision3d' knows the bodies of the library; drop 'planner', or this behavior"]
    if keys.motion.captures is not None:
        return ["own behaviors go with a built-in 'motion' set; put the captures in the folder of an own behavior"]
    try:
        read_behavior(place.name, place.parent)
    except BehaviorError as error:
        return str(error).splitlines()
    return []


def _captures(keys: ScenarioFields, folder: Path) -> list[Complaint]:
    """Complain about a folder of captures that is absent or lacks clips, and behaviors that captures cannot give."""
    if keys.motion.captures is None:
        return []
    captures = folder / keys.motion.captures
    if not captures.is_dir():
        return [(("motion", "captures"), f"there is no folder {captures}; it is sought beside the scenario file")]
    from crowdsim.behaviors.behavior import CAPTURED

    complaints: list[Complaint] = []
    for name in keys.behaviors:
        if name not in CAPTURED:
            message = f"captured walks give no '{name}'; list only {' and '.join(CAPTURED)} under 'behaviors'"
            complaints.append((("behaviors",), message))
    # The default patterns are looked for together, as most folders have one kind of file. Each given one needs a file.
    if "clips" not in keys.motion.model_fields_set and (none := _why_none(captures, keys.motion.clips)):
        complaints.append((("motion", "captures"), none))
    for number, pattern in enumerate(keys.motion.clips):
        path = ("motion", "clips", number)
        if Path(pattern).is_absolute() or ".." in Path(pattern).parts:
            complaints.append((path, f"'{pattern}' leaves the folder of captures"))
        elif "clips" in keys.motion.model_fields_set and (none := _why_none(captures, [pattern])):
            complaints.append((path, none))
    return complaints


def _why_none(folder: Path, patterns: Sequence[str]) -> str:
    """Return why no capture in a folder matches ``patterns``, '' if one does."""
    from crowdsim.motion.captures.reader import capture_paths

    try:
        capture_paths(folder, patterns)
    except MotionError as error:
        return str(error)
    except ValueError as error:
        return f"'{', '.join(patterns)}' is no pattern of file names: {error}"
    return ""


def _times(keys: ScenarioFields) -> list[Complaint]:
    """Complain about measurements, sources and starts after the end of the run."""
    complaints: list[Complaint] = []
    measured = [(("areas", number), area.start_time) for number, area in enumerate(keys.areas)]
    measured += [(("lines", number), line.start_time) for number, line in enumerate(keys.lines)]
    for path, begins in measured:
        if begins >= keys.duration:
            message = f"the run ends at {keys.duration:g} s, before measuring begins at {begins:g} s"
            complaints.append(((*path, "start_time"), message))
    for number, group in enumerate(keys.agents):
        if group.rate is not None:
            for key, time in (("start_time", group.start_time), ("until", group.until or 0.0)):
                # A source has to begin one step before the end at least, and to end no later than the run.
                if time > keys.duration - (key == "start_time") / keys.steps_per_second:
                    does = "begins" if key == "start_time" else "ends"
                    message = f"the run ends at {keys.duration:g} s, too early for a source that {does} at {time:g} s"
                    complaints.append((("agents", number, key), message))
            continue
        last = float(start_times(keys, number)[-1])
        # An agent starts in the step nearest to its time, which has to be a step of the run; a run has one at least.
        steps = max(round(keys.duration * keys.steps_per_second), 1)
        if not group.on_call and round(last * keys.steps_per_second) >= steps:
            message = f"{keys.duration:g} s end before the last of '{group.name}' starts at {last:g} s"
            complaints.append((("duration",), message))
    return complaints


def _locomotion(keys: ScenarioFields) -> list[Complaint]:
    """Complain about keys that do not go with the levels of locomotion of the groups."""
    complaints: list[Complaint] = []
    if keys.steers and keys.steps_per_second != STEERING_RATE:
        message = (
            f"auto and steered agents take {STEERING_RATE} steps a second; drop this key, or give all groups "
            "'locomotion: captured'"
        )
        complaints.append((("steps_per_second",), message))
    if keys.locomotions() == {"steered"} and keys.planner != "layered":
        message = f"'{keys.planner}' plans for captured agents; drop this key for steered ones"
        complaints.append((("planner",), message))
    if keys.captured_near is not None and "auto" not in keys.locomotions():
        message = "no group moves 'auto'; give one 'locomotion: auto', or drop this key"
        complaints.append((("captured_near",), message))
    return complaints


def _exits(keys: ScenarioFields) -> list[Complaint]:
    """Return complaints of exits that groups name but the file lacks, and of groups that cannot use exits."""
    complaints: list[Complaint] = []
    known = [each.name for each in keys.exits]
    for number, group in enumerate(keys.agents):
        if group.exits is None:
            continue
        path: tuple[str | int, ...] = ("agents", number, "exits")
        if group.locomotion == "captured":
            message = "captured agents go to a 'goal'; give this group 'locomotion: auto' or 'steered'"
            complaints.append((path, message))
        if not known:
            complaints.append((path, "this file has no exits; list them under 'exits', each with a name and a region"))
            continue
        for place, name in enumerate(() if group.exits == "all" else group.exits):
            if name not in known:
                key = name if isinstance(group.exits, dict) else place
                message = f"there is no exit '{name}'; {nearest(name, known, 'the exits are')}"
                complaints.append(((*path, key), message))
    return complaints


def _routes(keys: ScenarioFields) -> list[Complaint]:
    """Return complaints of routes that groups name but the file lacks."""
    known = [route.name for route in keys.routes]
    complaints: list[Complaint] = []
    for number, group in enumerate(keys.agents):
        if group.route is not None and group.route not in known:
            message = f"there is no route '{group.route}'; {nearest(group.route, known, 'the routes are')}"
            complaints.append((("agents", number, "route"), message))
    return complaints


def _periodic(keys: ScenarioFields) -> list[Complaint]:
    """Return complaints of keys that a periodic floor excludes, and of endless ways on a floor that ends."""
    complaints: list[Complaint] = []
    for number, group in enumerate(keys.agents):
        path: tuple[str | int, ...] = ("agents", number)
        if keys.floor.periodic is not None and group.locomotion == "captured":
            message = "captured agents need a floor with ends; give 'locomotion: auto' or 'steered'"
            complaints.append(((*path, "locomotion"), message))
        for key, goal in group.regions():
            # Regions go with any floor; an endless way needs a floor that is periodic along its axis.
            if goal.along is None:
                continue
            if goal.along[1] != keys.floor.periodic:
                message = f"the floor ends along {goal.along[1]}; give it 'periodic: {goal.along[1]}', or name a region"
                complaints.append(((*path, *key, "along"), message))
            elif group.on_arrival == "stay" or group.wait > 0.0 or goal.heading is not None:
                message = "agents never arrive on an endless way; drop 'on_arrival', 'wait' and 'heading'"
                complaints.append(((*path, *key), message))
    if keys.floor.periodic is not None:
        complaints += [
            ((key,), f"a periodic floor has no '{key}'; drop them, or 'periodic'")
            for key in ("doors", "events", "captured_near")
            if getattr(keys, key)
        ]
        complaints += [
            (("commands", number), "a periodic floor cannot be changed; drop this command, or 'periodic'")
            for number, command in enumerate(keys.commands)
            if command.changes_place
        ]
    return complaints


def _attributes(keys: ScenarioFields) -> list[Complaint]:
    """Return complaints of attributes that are words in one group and numbers in another."""
    complaints: list[Complaint] = []
    first: dict[str, int] = {}
    for number, group in enumerate(keys.agents):
        for name, attribute in group.attributes.items():
            other = keys.agents[first.setdefault(name, number)].attributes[name]
            if (attribute.words is None) != (other.words is None):
                kinds = ("a number", "a word") if attribute.words is None else ("a word", "a number")
                message = (
                    f"'{name}' is {kinds[0]} here and {kinds[1]} in agents.{first[name]}; make it the same in both"
                )
                complaints.append((("agents", number, "attributes", name), message))
    return complaints


def _spreads(keys: ScenarioFields) -> list[Complaint]:
    """Return complaints of distributions without a value within their bounds: all draws would be one of the bounds."""
    complaints: list[Complaint] = []
    for number, group in enumerate(keys.agents):
        spreads: list[tuple[tuple[str, ...], Spread]] = [
            ((key,), getattr(group, key)) for key in ("speed", "breadth", "delay")
        ]
        spreads += [(("attributes", name), each) for name, each in group.attributes.items() if each.words is None]
        for path, spread in spreads:
            if is_cut_off(spread):
                both = spread.min is not None and spread.max is not None
                bounds = f", {spread.min:g} to {spread.max:g}" if both else ""
                message = f"no value is within the bounds{bounds}; change 'min' and 'max', or the distribution"
                complaints.append((("agents", number, *path), message))
    return complaints
