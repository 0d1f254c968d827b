"""What can be wrong with a scenario whose every key is well formed."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from crowdsim.environment.layers import polygons_only
from crowdsim.errors import Problem
from crowdsim.library import library_folder
from crowdsim.scenario.arrivals import start_times
from crowdsim.scenario.changes import read_changes
from crowdsim.scenario.placement import NOMINAL_RADIUS, try_placement
from crowdsim.scenario.scenario import Scenario
from crowdsim.scenario.site import doubts_in
from crowdsim.yamlfile.messages import nearest


def semantic_problems(scenario: Scenario) -> list[Problem]:
    """Everything that contradicts itself, the floor or the library, with its place in the file."""
    problems = [
        *_duplicate_names(scenario),
        *_behaviors(scenario),
        *_captures(scenario),
        *_times(scenario),
        *scenario.site().problems,
    ]
    if scenario.site().problems:
        return problems
    problems += _events(scenario)
    names = [layer.name for layer in scenario.bands]
    if len(set(names)) < len(names):
        return problems
    if polygons_only(scenario.layers()[0].free).is_empty:
        doubts = doubts_in(scenario.site().report)
        message = "; ".join(["the floor is empty: obstacles cover all of it", *doubts])
        return [*problems, scenario.problem(("floor",), message)]
    return problems + try_placement(scenario, NOMINAL_RADIUS)[1]


def _duplicate_names(scenario: Scenario) -> list[Problem]:
    named: dict[str, Sequence[str]] = {
        "obstacles": [obstacle.name for obstacle in scenario.obstacles],
        "doors": [door.name for door in scenario.doors],
        "layers": [layer.name for layer in scenario.bands],
        "agents": [group.name for group in scenario.agents],
        "areas": [area.name for area in scenario.areas],
    }
    problems = []
    for key, names in named.items():
        first: dict[str, int] = {}
        for number, name in enumerate(names):
            if first.setdefault(name, number) != number:
                message = f"the name '{name}' is taken by {key}.{first[name]}"
                problems.append(scenario.problem((key, number, "name"), message))
        if key in ("obstacles", "doors") and scenario.clutter is not None and "clutter" in first:
            message = "the name 'clutter' is that of the random obstacles; give another one"
            problems.append(scenario.problem((key, first["clutter"], "name"), message))
    obstacles = {name: number for number, name in enumerate(named["obstacles"])}
    for number, name in enumerate(named["doors"]):
        if name in obstacles:
            message = f"the name '{name}' is taken by obstacles.{obstacles[name]}"
            problems.append(scenario.problem(("doors", number, "name"), message))
    return problems


def _events(scenario: Scenario) -> list[Problem]:
    if scenario.planner == "collision3d" and scenario.events:
        return [scenario.problem(("planner",), "'collision3d' knows a place that stands still; drop the events")]
    wrong = read_changes(scenario, scenario.things())[1]
    return [scenario.problem(("events", number, key), message) for number, key, message in wrong]


def _behaviors(scenario: Scenario) -> list[Problem]:
    # The default set is the engine's own affair; what the file names must be there.
    if "behaviors" not in scenario.model_fields_set:
        return []
    folder = library_folder("behaviors")
    known = sorted(entry.parent.name for entry in folder.glob("*/behavior.yaml"))
    problems = []
    for number, name in enumerate(scenario.behaviors):
        if name in scenario.behaviors[:number]:
            problems.append(scenario.problem(("behaviors", number), f"'{name}' is named twice"))
        elif name not in known:
            message = f"unknown behavior '{name}'; {nearest(name, known, 'the library has')}"
            problems.append(scenario.problem(("behaviors", number), message))
    return problems


def _captures(scenario: Scenario) -> list[Problem]:
    captures = scenario.captures()
    if captures is None:
        return []
    folder, patterns = captures
    if not folder.is_dir():
        message = f"there is no folder {folder}; it is sought beside the scenario file"
        return [scenario.problem(("motion", "captures"), message)]
    from crowdsim.behaviors.captured import CAPTURED

    problems = []
    for name in scenario.behaviors:
        if name not in CAPTURED:
            message = f"captured walks give no '{name}'; list only {' and '.join(CAPTURED)} under 'behaviors'"
            problems.append(scenario.problem(("behaviors",), message))
    for number, pattern in enumerate(patterns):
        path = ("motion", "clips", number)
        if Path(pattern).is_absolute() or ".." in Path(pattern).parts:
            problems.append(scenario.problem(path, f"'{pattern}' leaves the folder of captures"))
        elif not _matches(folder, pattern):
            problems.append(scenario.problem(path, f"no file in {folder} matches '{pattern}'"))
    return problems


def _matches(folder: Path, pattern: str) -> bool:
    try:
        return any(folder.glob(pattern))
    except ValueError:  # such as "**x", which is no pattern at all
        return False


def _times(scenario: Scenario) -> list[Problem]:
    problems = []
    for number, group in enumerate(scenario.agents):
        if group.rate is not None:
            for key, time in (("start_time", group.start_time), ("until", group.until or 0.0)):
                if time > scenario.duration - (key == "start_time") / scenario.steps_per_second:
                    message = f"the run ends at {scenario.duration:g} s, before the source does at {time:g} s"
                    problems.append(scenario.problem(("agents", number, key), message))
            continue
        last = float(start_times(scenario, number)[-1])
        if last >= scenario.duration:
            message = f"{scenario.duration:g} s end before the last of '{group.name}' starts at {last:g} s"
            problems.append(scenario.problem(("duration",), message))
    return problems
