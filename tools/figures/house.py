"""Figure of docs/design.md: the rooms of the package, and which imports which, read from the imports themselves."""

from __future__ import annotations

import ast
import re
import tomllib
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import FancyArrowPatch, FancyBboxPatch

from tools.figures.style import BLUE, new_figure

ROOT = Path(__file__).resolve().parents[2]

SUBJECTS = {
    "cli": "commands",
    "bench": "benchmarks",
    "validate": "RiMEA and IMO tests",
    "live": "runs in a browser",
    "sweeps": "many runs",
    "export": "pages, tables, 3D",
    "analysis": "flow, density, times",
    "playback": "pictures, films",
    "crowd": "the simulation",
    "recording": "the file written",
    "scenario": "the file read",
    "following": "from path to motion",
    "steering": "steered crowds",
    "planning": "path and behaviors",
    "behaviors": "behaviors, their clips",
    "motion": "clips, motion graph",
    "environment": "solids to layers",
    "navmesh": "navigation mesh",
    "geometry": "exact predicates",
    "ecs": "columns of agents",
    "yamlfile": "YAML with places",
}
"""What each room is about, in a few words; docs/design.md says more."""

COLUMNS = {
    **{"cli": 3.6, "bench": 0.85, "sweeps": 2.95, "live": 4.5, "validate": 6.4, "export": 1.2, "analysis": 3.7},
    **{"playback": 1.5, "crowd": 6.2, "recording": 1.3},
    **{"scenario": 5.3, "following": 2.4, "steering": 5.0, "planning": 4.6, "behaviors": 3.7, "motion": 1.2},
    **{"environment": 5.2, "navmesh": 2.7, "geometry": 2.2, "ecs": 6.3, "yamlfile": 4.4},
}
"""Where rooms are drawn from left to right, so that few arrows pass behind boxes; new rooms go to the middle."""

BENDS = {("planning", "navmesh"): -0.12, ("validate", "crowd"): 0.0}
"""How far an arrow is bent, as a share of its length."""

WIDE, HIGH = 2.0, 0.62


def levels() -> list[list[str]]:
    """Return the rooms of each level, highest level first, from the import rules."""
    rules = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["importlinter"]["contracts"]
    names = [re.split(r"\s*[|:]\s*", level) for level in rules[0]["layers"]]
    rooms = [[name.removeprefix("crowdsim.") for name in level] for level in names]
    return [kept for level in rooms if (kept := [name for name in level if (ROOT / "crowdsim" / name).is_dir()])]


def imports() -> dict[str, dict[str, int]]:
    """Return for each room how many of its files import each other room."""
    rooms = {room for level in levels() for room in level}
    found: dict[str, dict[str, int]] = {room: {} for room in rooms}
    for room in sorted(rooms):
        for file in sorted((ROOT / "crowdsim" / room).rglob("*.py")):
            for other in sorted(_rooms_in(file, rooms) - {room}):
                found[room][other] = found[room].get(other, 0) + 1
    return found


def _rooms_in(file: Path, rooms: set[str]) -> set[str]:
    """Return the rooms that a file imports from."""
    modules = []
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            modules += [name.name for name in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module:
            modules += [f"{node.module}.{name.name}" for name in node.names]
    parts = [module.split(".") for module in modules]
    return {part[1] for part in parts if part[0] == "crowdsim" and len(part) > 1 and part[1] in rooms}


def direct(found: dict[str, dict[str, int]]) -> set[tuple[str, str]]:
    """Return the imports that are not also a chain of several imports (the transitive reduction)."""

    def below(room: str) -> set[str]:
        return set(found[room]).union(*(below(other) for other in found[room]))

    return {
        (room, other)
        for room, others in found.items()
        for other in others
        if not any(other in below(between) for between in others if between != other)
    }


def draw_house() -> Figure:
    """Boxes for rooms, arrows for imports: light if a chain of other imports leads there too, else dark."""
    shown, found = levels(), imports()
    place = {}
    for row, level in enumerate(shown):
        for column, room in enumerate(level):
            spread = 3.6 + 2.9 * (column - 0.5 * (len(level) - 1))
            place[room] = (COLUMNS.get(room, spread), -1.08 * row)
    figure, (axes,) = new_figure(8.4)
    needed = direct(found)
    for room, others in sorted(found.items()):
        for other in sorted(others):
            _arrow(
                axes,
                f"{room} imports {other}",
                place[room],
                place[other],
                BENDS.get((room, other), 0.0),
                (room, other) in needed,
            )
    for room, (x, y) in place.items():
        corner = (x - 0.5 * WIDE, y - 0.5 * HIGH)
        look = {"boxstyle": "round,pad=0,rounding_size=0.1", "facecolor": "#e8f1f7", "edgecolor": BLUE, "zorder": 5}
        axes.add_patch(FancyBboxPatch(corner, WIDE, HIGH, **look))
        axes.text(x, y + 0.11, room, ha="center", va="center", weight="bold", zorder=6)
        axes.text(x, y - 0.15, SUBJECTS[room], ha="center", va="center", fontsize=7.5, color="#3c4147", zorder=6)
    axes.set(xlim=(-0.2, 7.4), ylim=(-1.08 * (len(shown) - 1) - 0.5, 0.5), aspect="equal")
    axes.axis("off")
    axes.set_title("an arrow points to the room that is imported; light: a chain of dark arrows leads there, too")
    return figure


def _arrow(
    axes: Axes, name: str, start: tuple[float, float], end: tuple[float, float], bend: float, dark: bool
) -> None:
    """Draw an arrow from the lower edge of a room to the upper edge of another, or beside rooms of one row."""
    (x0, y0), (x1, y1) = start, end
    lean = min(max(0.16 * (x1 - x0), -0.6), 0.6)
    tail, head = (x0 + lean, y0 - 0.5 * HIGH), (x1 - lean, y1 + 0.5 * HIGH)
    if y0 == y1:
        sign = 1.0 if x1 > x0 else -1.0
        tail, head = (x0 + sign * 0.5 * WIDE, y0), (x1 - sign * 0.5 * WIDE, y1)
    look: dict[str, Any] = {
        "color": BLUE if dark else "#d5d9dd",
        "linewidth": 1.4 if dark else 0.6,
        "zorder": 3 if dark else 2,
    }
    look["gid"] = name
    look["connectionstyle"] = f"arc3,rad={bend}"
    axes.add_patch(FancyArrowPatch(tail, head, arrowstyle="-|>", mutation_scale=9, shrinkA=0, shrinkB=0, **look))
