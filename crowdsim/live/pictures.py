"""Messages to a page: pictures, which hold the agents of a step as bytes, and doors and movables as JSON."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
from numpy.typing import NDArray

from crowdsim.crowd.simulation import Simulation
from crowdsim.playback.scenery import solids_mesh
from crowdsim.recording.header import AgentState, MotionRecord, RecordedFrame, SolidRecord
from crowdsim.scenario.timetable import Movable, Placing, placed

MAGIC = b"CSL1"
"""First bytes of a picture, before the step (uint32) and the number of rows (uint32)."""

TURN = 65_536
"""Integer units of heading per turn."""

_CAPTURED = (("node", "int16"), ("previous", "int16"), ("frame", "float32"))
_STEERED = (("phase", "float32"),)
_ALWAYS = (
    ("agent", "uint32"),
    ("x", "float32"),
    ("y", "float32"),
    ("heading", "uint16"),
    ("behavior", "int8"),
    ("state", "int8"),
)

Columns = tuple[tuple[str, str], ...]
"""Name and numpy type of each column."""


def picture_columns(motion: MotionRecord) -> Columns:
    """Return name and type of each column of a picture, those of the largest type first.

    In this order each column begins at a multiple of the size of its type, as the arrays of JavaScript need.
    """
    columns = [*_ALWAYS, *(_CAPTURED if len(motion.node_names) else ()), *(_STEERED if motion.gaits else ())]
    if len(motion.node_names) > np.iinfo(np.int16).max:  # more nodes than int16 surely numbers
        columns = [(name, "int32" if kind == "int16" else kind) for name, kind in columns]
    return tuple(sorted(columns, key=lambda column: -np.dtype(column[1]).itemsize))


def picture(step: int, frame: RecordedFrame, columns: Columns) -> bytes:
    """Return a picture of a step: a head, then the columns one after another, each with a value per present agent."""
    here = np.flatnonzero(np.asarray(frame.state) != AgentState.ABSENT)
    parts = [MAGIC, np.array([step, len(here)], "<u4").tobytes()]
    for name, kind in columns:
        values = here if name == "agent" else np.asarray(getattr(frame, name))[here]
        if name == "heading":
            values = _turns(values)
        parts.append(values.astype(np.dtype(kind).newbyteorder("<")).tobytes())
    return b"".join(parts)


def _turns(headings: NDArray[Any]) -> NDArray[np.int64]:
    """Return headings [rad] as whole numbers from 0 to TURN - 1."""
    units = np.rint(headings.astype(np.float64) * (TURN / (2.0 * np.pi))).astype(np.int64)
    return np.mod(units, TURN)


def things(simulation: Simulation) -> list[dict[str, Any]]:
    """Return doors and movable obstacles in types of JSON: outlines, triangles and lines of those present."""
    doors = {door.name for door in simulation.scenario.doors}
    return [_thing(movable, placing, movable.name in doors) for movable, placing in simulation.movables()]


def _thing(movable: Movable, placing: Placing | None, door: bool) -> dict[str, Any]:
    """Return a movable for the page: its name, and whether it is a door, and present.

    If it is present, also [m]: its top, the outline of its convex hull (n, 2), and flat lists of x, y, z: the corners
    of its triangles, three each, and the ends of its lines, two each.
    """
    thing: dict[str, Any] = {"name": movable.name, "door": door, "there": placing is not None}
    if placing is None:
        return thing
    solids = [
        SolidRecord(solid.name, placed(solid.footprint, placing).wkt, solid.bottom, solid.top)
        for solid in movable.solids
    ]
    mesh = solids_mesh(solids)
    # The hull of a footprint without area is a line or a point, which has no exterior.
    outline = movable.footprint(placing).convex_hull
    thing["top"] = max((solid.top for solid in solids), default=0.0)
    thing["outline"] = np.round(np.array(getattr(outline, "exterior", outline).coords), 3).tolist()
    thing["corners"] = np.round(mesh.points[mesh.triangles].reshape(-1), 3).tolist()
    thing["lines"] = np.round(mesh.outline.reshape(-1), 3).tolist()
    return thing


def text(kind: str, **facts: Any) -> str:
    """Return a message as JSON: its kind, and facts about it by name."""
    return json.dumps({"kind": kind, **facts}, separators=(",", ":"), allow_nan=False)
