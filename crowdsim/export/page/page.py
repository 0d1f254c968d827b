"""Write a web page in one file that plays a recording in any browser, without server or network requests."""

from __future__ import annotations

import base64
import codecs
import hashlib
import html
import re
from collections.abc import Iterator, Mapping, Sequence
from importlib import resources
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from crowdsim.errors import CrowdSimError
from crowdsim.export.choice import Choice, choose
from crowdsim.export.options import ExportOptions
from crowdsim.export.page.choice import Chosen, shown_of
from crowdsim.export.page.packed_bodies import LEVELS, pack_bodies, pack_looks
from crowdsim.export.page.packed_feet import feet_units, pack_feet
from crowdsim.export.page.packed_place import pack_density, pack_paths, pack_place
from crowdsim.export.page.packed_poses import (
    ROOTS,
    ROTATIONS,
    pack_gaits,
    pack_node_tracks,
    pack_nodes,
    pack_stretches,
    pack_switches,
    skeleton_facts,
)
from crowdsim.export.page.packing import Block, Ints, compressed, text_of
from crowdsim.export.page.tracks.track_chunks import (
    FRACTIONS,
    PHASES,
    TURNS,
    coding_units,
    pack_events,
    pack_tracks,
    phase_step,
    place_units,
    plan_chunks,
    turn_step,
)
from crowdsim.motion.graph.playback_kernels import FRAME_TICKS
from crowdsim.playback.crowd_mesh import LEVEL_COLORS, group_colors
from crowdsim.playback.moments import telling_time
from crowdsim.recording.header import AgentsRecord, AgentState
from crowdsim.recording.levels import Level
from crowdsim.recording.reader import Recording
from crowdsim.recording.shown.steered_stretches import Stretches, read_stretches
from crowdsim.whole_files import whole_file

PATHS = ("all", "selected", "none")
"""Paths that a page draws at first; with "none", the page contains no paths."""

_PATHS_OF_ALL = 300
"""Number of agents present at once up to which all paths are drawn by default."""
_BARS = 400
"""Largest number of bars of the curve behind the slider."""
_SAMPLES_AT_ONCE = 4_000_000
"""Largest number of values (agents times steps) of a column that are read at once."""


class PageOptions(NamedTuple):
    """The part of a recording that a page shows, and how.

    Attributes
    ----------
    start, end : float or None
        Times [s]; by default all of the recording.
    agents : str or None
        Agent numbers and group names separated by commas; by default all.
    paths : str or None
        One of PATHS; by default "all", or "selected" if more than 300 agents are present at once.
    title : str or None
        Title; by default the scenario's name.
    """

    start: float | None = None
    end: float | None = None
    agents: str | None = None
    paths: str | None = None
    title: str | None = None


def write_page(recording: Recording, file: Path, options: PageOptions | None = None) -> None:
    """Write ``recording`` as one HTML file; equal recordings and options give equal bytes.

    Raises
    ------
    CrowdSimError
        If the recording lacks such times or agents, the choice of paths is unknown, or the file cannot be written.
    """
    options = PageOptions() if options is None else options
    choice = choose(recording, None, options.start, options.end, options.agents)
    with whole_file(file, (".html", ".htm"), "pages") as written:
        write(recording, written, choice, ExportOptions(paths=options.paths, title=options.title))


def write(recording: Recording, file: Path, choice: Choice, options: ExportOptions) -> None:
    """Write the chosen part of ``recording`` to ``file``; :func:`crowdsim.export.formats.export` calls this."""
    file.write_bytes(make_page(recording, choice, options))


def make_page(recording: Recording, choice: Choice, options: ExportOptions) -> bytes:
    """Return the bytes of a page of the chosen part of ``recording``, in UTF-16, in which packed data are smallest.

    Raise CrowdSimError if the part is empty or leaves steps out, or if there is no such choice of paths.
    """
    if options.paths is not None and options.paths not in PATHS:
        raise CrowdSimError(f"a page draws paths of {', '.join(PATHS)}, not '{options.paths}'; choose one of them")
    chosen = shown_of(recording, choice)
    title = recording.header.scenario_name if options.title is None else options.title
    viewer = shared_text("viewer.min.js")
    packed = {"viewer": compressed(viewer.encode()), "data": pack_recording(recording, chosen, options.paths, title)}
    page = fill_page(title, [shared_text("loader.min.js")], shared_text("page.css"), packed, unpacked=[viewer])
    return codecs.BOM_UTF16_LE + page.encode("utf-16-le")


def shared_text(name: str) -> str:
    """Return the text of a file that all pages share."""
    return (resources.files("crowdsim.export.page") / name).read_text(encoding="utf-8")


def fill_page(
    title: str,
    scripts: Sequence[str],
    style: str,
    packed: Mapping[str, bytes] | None = None,
    unpacked: Sequence[str] = (),
    panel: str = "",
    allowed: Sequence[str] = (),
) -> str:
    """Return the HTML of a page, which does not name its encoding: a byte order mark or a server has to.

    Parameters
    ----------
    title : str
        Title.
    scripts : sequence of str
        Scripts, which run in turn.
    style : str
        Style sheet.
    packed : mapping
        Compressed data by the name of the element that holds them; none if the scripts get their data elsewhere.
    unpacked : sequence of str
        Further scripts, contained in ``packed``, which ``scripts`` may run.
    panel : str
        HTML of further controls.
    allowed : sequence of str
        Directives of the content security policy beside those for its own scripts and style, and saved pictures.
    """
    parts = {
        "{{policy}}": "; ".join([_policy([*scripts, *unpacked], style), *allowed]),
        "{{title}}": html.escape(title),
        "{{style}}": style,
        "{{panel}}": panel,
        "{{data}}": "\n".join(
            f'<script type="application/octet-stream" id="{name}">{text_of(data)}</script>'
            for name, data in (packed or {}).items()
        ),
        "{{scripts}}": "\n".join(f"<script>{script}</script>" for script in scripts),
    }
    # Replace all parts at once, because a title may look like the name of a part.
    return re.sub("|".join(map(re.escape, parts)), lambda found: parts[found[0]], shared_text("page.html"))


def _policy(scripts: Sequence[str], style: str) -> str:
    """Return the content security policy: the page's own scripts and style, saving of pictures, and nothing else."""
    own = " ".join(_digest(script) for script in scripts)
    return f"default-src 'none'; script-src {own}; style-src {_digest(style)}; img-src data: blob:"


def _digest(text: str) -> str:
    """Return the SHA-256 of a text as content security policies take it."""
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode('utf-8')).digest()).decode()}'"


def pack_recording(recording: Recording, chosen: Chosen, paths: str | None, title: str) -> bytes:
    """Return everything that the viewer shows, compressed; ``paths`` is one of PATHS, or None for the default."""
    header, block = recording.header, Block()
    motion = header.motion
    plan = plan_chunks(len(chosen.agents))
    stretches = pack_stretches(block, list(_stretches(recording, chosen)))
    events, played = pack_tracks(block, recording, chosen, plan, stretches)
    pack_events(block, events)
    present, moving, waiting = activity(recording, chosen)
    most = int(present.max(initial=0))
    bounds = pack_place(block, recording, chosen)
    facts: dict[str, Any] = {
        "title": title,
        "scenario": header.scenario_name,
        "rate": recording.steps_per_second,
        "first": chosen.first,
        "steps": chosen.steps,
        "agents": chosen.agents.tolist(),
        "complete": recording.complete,
        "behaviors": [{"name": behavior.name, "color": behavior.color} for behavior in header.behaviors],
        "skeleton": skeleton_facts(motion.skeleton),
        "nodes": pack_nodes(block, motion, played),
        "gaits": pack_gaits(block, motion),
        "bodies": pack_bodies(block, motion.skeleton, most),
        "levels": LEVELS,
        "chunk": plan.steps,
        "margin": plan.margin,
        "units": page_units(place_units(chosen)),
        "feet": feet_units(place_units(chosen)),
        "coding": coding_units(recording, place_units(chosen)).tolist(),
        "bounds": bounds,
        "ends": None if header.ends is None else [header.ends.axis, header.ends.low, header.ends.high],
        "most": most,
        "curve": {"moving": moving.tolist(), "waiting": waiting.tolist()},
        "density": pack_density(block, recording, chosen, bounds),
        "opening": _opening(recording, chosen),
        **agent_facts(recording.header.agents, chosen.agents),
    }
    pack_node_tracks(block, motion, played)
    pack_feet(block, recording, chosen, played, plan.steps)
    pack_switches(block, recording, chosen)
    facts["paths"] = paths = paths or ("all" if most <= _PATHS_OF_ALL else "selected")
    facts["path_count"] = 0 if paths == "none" else pack_paths(block, recording, chosen)
    pack_looks(block, motion.skeleton, chosen.agents)
    return block.packed(facts)


def page_units(places: int) -> dict[str, int]:
    """Return the integer units of a page whose tracks have ``places`` units per meter.

    They are units per meter of tracks (place), whole turn, cycle (phase), frame, radian of joints (rotation), and meter
    of root joints (root); the steps of turns and phases by which they are coded (turn_step, phase_step), in these
    units; and the parts of a unit or step to which the ends of stretches are exact.
    """
    return {
        "place": places,
        "turn": TURNS,
        "turn_step": turn_step(places),
        "phase": PHASES,
        "phase_step": phase_step(places),
        "exact": FRACTIONS,
        "frame": FRAME_TICKS,
        "rotation": ROTATIONS,
        "root": ROOTS,
    }


def _opening(recording: Recording, chosen: Chosen) -> float:
    """Return the time at which the page opens [s]: the telling time within its range."""
    first, last = chosen.first, chosen.first + chosen.steps - 1
    rate = recording.steps_per_second
    return min(max(telling_time(recording), first / rate), last / rate)


def agent_facts(agents: AgentsRecord, chosen: Ints) -> dict[str, Any]:
    """Return groups and levels with their colors; group and goal (x, y) [m] of each of the agents ``chosen`` (n,)."""
    names = sorted(set(agents.groups))
    index = {name: number for number, name in enumerate(names)}
    return {
        "groups": names,
        "group_colors": [list(map(int, color)) for color in group_colors(len(names))],
        "locomotion_levels": [
            {"name": level.name.lower(), "color": LEVEL_COLORS[level]} for level in (Level.CAPTURED, Level.STEERED)
        ],
        "group_of": [index[agents.groups[agent]] for agent in chosen.tolist()],
        "goals": [[_number(value) for value in goal] for goal in agents.goals[chosen].tolist()],
    }


def _number(value: float) -> float | None:
    """Return a value rounded to two digits; None if it is not finite, which JSON cannot hold."""
    return round(value, 2) if np.isfinite(value) else None


def activity(recording: Recording, chosen: Chosen) -> tuple[Ints, Ints, Ints]:
    """Return numbers of agents: present in each step (steps,), and moving and waiting in each bar (bars,).

    Bars are drawn behind the slider: at most _BARS equal spans of steps, each with its largest number in a step.
    """
    present, moving, waiting = (np.zeros(chosen.steps, np.int64) for _ in range(3))
    at_once = max(1, _SAMPLES_AT_ONCE // max(recording.agent_count, 1))
    for first in range(0, chosen.steps, at_once):
        rows = slice(chosen.first + first, chosen.first + min(first + at_once, chosen.steps))
        state = recording.state[rows][:, chosen.agents]
        span = slice(first, first + len(state))
        present[span] = np.count_nonzero(state != AgentState.ABSENT, axis=1)
        moving[span] = np.count_nonzero(state == AgentState.MOVING, axis=1)
        waiting[span] = np.count_nonzero(state == AgentState.WAITING, axis=1)
    bars = np.unique(np.linspace(0, chosen.steps, min(_BARS, chosen.steps), endpoint=False).astype(np.int64))
    return present, np.maximum.reduceat(moving, bars), np.maximum.reduceat(waiting, bars)


def _stretches(recording: Recording, chosen: Chosen) -> Iterator[tuple[Ints, Stretches]]:
    """Yield some agents (A,) at a time, as indices into those of the page, with their steered stretches."""
    if not recording.header.motion.gaits:
        return
    rows = slice(chosen.first, chosen.first + chosen.steps)
    at_once = max(1, _SAMPLES_AT_ONCE // chosen.steps)
    for first in range(0, len(chosen.agents), at_once):
        agents = chosen.agents[first : first + at_once]
        columns = slice(int(agents[0]), int(agents[-1]) + 1)
        found = read_stretches(recording, rows, columns, agents - agents[0])
        yield np.arange(first, first + len(agents)), found
