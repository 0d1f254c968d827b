"""What can be wrong with a scenario whose every key is well formed."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from crowdsim.constants import STEERING_RATE
from crowdsim.library import library_folder
from crowdsim.scenario.arrivals import start_times
from crowdsim.scenario.schema.schema import ScenarioFields
from crowdsim.yamlfile.document import Complaint
from crowdsim.yamlfile.messages import nearest


def key_complaints(keys: ScenarioFields, folder: Path) -> list[Complaint]:
    """Keys that contradict each other, the library, or what is in ``folder``."""
    return [
        *_duplicate_names(keys),
        *_behaviors(keys),
        *_captures(keys, folder),
        *_times(keys),
        *_locomotion(keys),
        *_exits(keys),
        *_routes(keys),
        *_periodic(keys),
        *_attributes(keys),
    ]


def _duplicate_names(keys: ScenarioFields) -> list[Complaint]:
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
            message = "the name 'clutter' is that of the random obstacles; give another one"
            complaints.append(((key, first["clutter"], "name"), message))
    obstacles = {name: number for number, name in enumerate(named["obstacles"])}
    for number, name in enumerate(named["doors"]):
        if name in obstacles:
            message = f"the name '{name}' is taken by obstacles.{obstacles[name]}"
            complaints.append((("doors", number, "name"), message))
    return complaints


def _behaviors(keys: ScenarioFields) -> list[Complaint]:
    # The default set is the engine's own affair; what the file names must be there.
    if "behaviors" not in keys.model_fields_set:
        return []
    folder = library_folder("behaviors")
    known = sorted(entry.parent.name for entry in folder.glob("*/behavior.yaml"))
    complaints: list[Complaint] = []
    for number, name in enumerate(keys.behaviors):
        if name in keys.behaviors[:number]:
            complaints.append((("behaviors", number), f"'{name}' is named twice"))
        elif name not in known:
            message = f"unknown behavior '{name}'; {nearest(name, known, 'the library has')}"
            complaints.append((("behaviors", number), message))
    return complaints


def _captures(keys: ScenarioFields, folder: Path) -> list[Complaint]:
    if keys.motion.captures is None:
        return []
    captures = folder / keys.motion.captures
    if not captures.is_dir():
        return [(("motion", "captures"), f"there is no folder {captures}; it is sought beside the scenario file")]
    from crowdsim.behaviors.captured import CAPTURED

    complaints: list[Complaint] = []
    for name in keys.behaviors:
        if name not in CAPTURED:
            message = f"captured walks give no '{name}'; list only {' and '.join(CAPTURED)} under 'behaviors'"
            complaints.append((("behaviors",), message))
    for number, pattern in enumerate(keys.motion.clips):
        path = ("motion", "clips", number)
        if Path(pattern).is_absolute() or ".." in Path(pattern).parts:
            complaints.append((path, f"'{pattern}' leaves the folder of captures"))
        elif not _matches(captures, pattern):
            complaints.append((path, f"no file in {captures} matches '{pattern}'"))
    return complaints


def _matches(folder: Path, pattern: str) -> bool:
    try:
        return any(folder.glob(pattern))
    except ValueError:  # such as "**x", which is no pattern at all
        return False


def _times(keys: ScenarioFields) -> list[Complaint]:
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
                if time > keys.duration - (key == "start_time") / keys.steps_per_second:
                    message = f"the run ends at {keys.duration:g} s, before the source does at {time:g} s"
                    complaints.append((("agents", number, key), message))
            continue
        last = float(start_times(keys, number)[-1])
        if last >= keys.duration:
            message = f"{keys.duration:g} s end before the last of '{group.name}' starts at {last:g} s"
            complaints.append((("duration",), message))
    return complaints


def _locomotion(keys: ScenarioFields) -> list[Complaint]:
    complaints: list[Complaint] = []
    if keys.steers and keys.steps_per_second != STEERING_RATE:
        message = (
            f"auto and steered characters take {STEERING_RATE} steps a second; drop this key, or give all groups "
            "'locomotion: captured'"
        )
        complaints.append((("steps_per_second",), message))
    if keys.locomotions() == {"steered"} and keys.planner != "layered":
        message = f"'{keys.planner}' plans for captured characters; drop this key for steered ones"
        complaints.append((("planner",), message))
    if keys.captured_near is not None and "auto" not in keys.locomotions():
        message = "no group moves 'auto'; give one 'locomotion: auto', or drop this key"
        complaints.append((("captured_near",), message))
    return complaints


def _exits(keys: ScenarioFields) -> list[Complaint]:
    """Exits that groups name and the file does not have, and groups that can go to none."""
    complaints: list[Complaint] = []
    known = [each.name for each in keys.exits]
    for number, group in enumerate(keys.agents):
        if group.exits is None:
            continue
        path: tuple[str | int, ...] = ("agents", number, "exits")
        if group.locomotion == "captured":
            message = "captured characters go to a 'goal'; give this group 'locomotion: auto' or 'steered'"
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
    """Routes that groups name and the file does not have."""
    known = [route.name for route in keys.routes]
    complaints: list[Complaint] = []
    for number, group in enumerate(keys.agents):
        if group.route is not None and group.route not in known:
            message = f"there is no route '{group.route}'; {nearest(group.route, known, 'the routes are')}"
            complaints.append((("agents", number, "route"), message))
    return complaints


def _periodic(keys: ScenarioFields) -> list[Complaint]:
    """What a floor without ends does not go with, and ways without end on a floor that has ends."""
    complaints: list[Complaint] = []
    for number, group in enumerate(keys.agents):
        path: tuple[str | int, ...] = ("agents", number)
        if keys.floor.periodic is not None and group.locomotion == "captured":
            message = "captured characters need a floor with ends; give 'locomotion: auto' or 'steered'"
            complaints.append(((*path, "locomotion"), message))
        for key, goal in group.regions():
            if goal.along is None:
                continue
            if goal.along[1] != keys.floor.periodic:
                message = f"the floor ends along {goal.along[1]}; give it 'periodic: {goal.along[1]}', or name a region"
                complaints.append(((*path, *key, "along"), message))
            elif group.on_arrival == "stay" or group.wait > 0.0 or goal.heading is not None:
                message = "nobody arrives on a way without end; drop 'on_arrival', 'wait' and 'heading'"
                complaints.append(((*path, *key), message))
    if keys.floor.periodic is not None:
        complaints += [
            ((key,), f"a periodic floor has no '{key}'; drop them, or 'periodic'")
            for key in ("doors", "events", "captured_near")
            if getattr(keys, key)
        ]
    return complaints


def _attributes(keys: ScenarioFields) -> list[Complaint]:
    """Attributes that are words in one group and numbers in another."""
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
