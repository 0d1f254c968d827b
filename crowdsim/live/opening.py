"""Data that a page needs before the first step: bodies, motion, and the environment without movables."""

from __future__ import annotations

from typing import Any

import numpy as np

from crowdsim.crowd.simulation import Simulation
from crowdsim.export.page.packed_bodies import LEVELS, pack_bodies, pack_looks
from crowdsim.export.page.packed_feet import pack_no_feet
from crowdsim.export.page.packed_place import density_cells, pack_scenery
from crowdsim.export.page.packed_poses import pack_gaits, pack_node_tracks, pack_nodes, pack_stretches, skeleton_facts
from crowdsim.export.page.packing import Block
from crowdsim.export.page.page import agent_facts, page_units
from crowdsim.export.page.tracks.track_chunks import PLACES, Events, pack_events
from crowdsim.live.pictures import TURN, picture_columns

LONGEST_KEPT = 60.0
"""Longest time for which a page keeps past steps, from which it draws trails, density and footsteps [s]."""


def pack_opening(simulation: Simulation) -> bytes:
    """Return everything that the viewer shows of a simulation before its first step, compressed.

    The viewer is that of exported pages, so all that a page holds is here too, even if empty: there are no steps yet.
    """
    header, block = simulation.header, Block()
    motion, count = header.motion, header.agents.count
    bounds = pack_scenery(block, header)
    agents = np.arange(count)
    facts: dict[str, Any] = {
        "title": header.scenario_name,
        "scenario": header.scenario_name,
        "rate": header.steps_per_second,
        "first": 0,
        "steps": 1,  # so that the viewer's time ends where it begins, until pictures come
        "agents": agents.tolist(),
        "complete": True,
        "behaviors": [{"name": behavior.name, "color": behavior.color} for behavior in header.behaviors],
        "skeleton": skeleton_facts(motion.skeleton),
        "nodes": pack_nodes(block, motion, np.arange(len(motion.node_names))),
        "gaits": pack_gaits(block, motion),
        "bodies": pack_bodies(block, motion.skeleton, count),
        "levels": LEVELS,
        "units": page_units(PLACES),
        "bounds": bounds,
        "ends": None if header.ends is None else [header.ends.axis, header.ends.low, header.ends.high],
        "most": count,
        "curve": {"moving": [], "waiting": []},
        "density": density_cells(bounds),
        "opening": 0.0,
        "paths": "none",
        "path_count": 0,
        "columns": [list(column) for column in picture_columns(motion)],
        "turn": TURN,
        "kept": LONGEST_KEPT,
        **agent_facts(header.agents, agents),
    }
    pack_node_tracks(block, motion, np.arange(len(motion.node_names)))
    none = np.zeros(0, np.int64)
    # The viewer of recordings reads tracks from arrays. Here they are empty, as all steps come over the socket.
    pack_events(block, Events(np.zeros(count, np.int64), *[none] * 5))
    pack_no_feet(block)
    pack_stretches(block, [])
    block.add("stretch_exact", none.astype(np.int8))
    for name in ("agents", "steps", "feet"):
        block.add_varints(f"switch_{name}", none)
    block.add("switch_flags", none.astype(np.uint8))
    for name in ("moving_corners", "moving_spans", "moving_lines", "moving_line_spans"):
        block.add(name, np.zeros(0, np.float32))
    block.add("density", np.zeros(0, np.float32))
    pack_looks(block, motion.skeleton, agents)
    return block.packed(facts)
