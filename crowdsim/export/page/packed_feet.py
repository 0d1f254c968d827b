"""Planted feet of captured bodies for a page: where feet are in the nodes it plays, and where they stand."""

from __future__ import annotations

import numpy as np

from crowdsim.export.page.choice import Chosen
from crowdsim.export.page.packing import Block, Ints, first_differences, zigzag
from crowdsim.motion.planted.pin_kernels import MODE, NODE, SINCE, UNTIL, YAW, X
from crowdsim.recording.reader import Recording

PLACES = 10_000
"""Integer units per meter, radian and second."""
FRAMES = 1000
"""Integer units per frame."""


def pack_feet(block: Block, recording: Recording, chosen: Chosen, played: Ints) -> None:
    """Add the places of the feet in the nodes ``played``, and the changes of the feet of the agents.

    Places are packed column by column, as differences from row to row: ball x, y [m] and heading [rad] of the left
    foot, then of the right one, relative to the first row of their node. ``feet_across`` are the axes (2, 3) of the
    ankle joints that point to the left of their feet. ``feet_counts`` are the numbers of changes, for each agent of
    the left foot, then of the right one.

    ``played`` holds the nodes of the page, ascending, which numbers them in this order. A change has its time since the
    one before of the same foot, mode, node, frames, and a planar pose, as :mod:`crowdsim.motion.planted.pin_kernels`
    has them.
    """
    table = recording.foot_table
    if table is None or not len(played):
        pack_no_feet(block)
        return
    motion = recording.header.motion
    rows = np.concatenate(
        [np.arange(motion.node_first[n], motion.node_first[n] + motion.node_frames[n] + 1) for n in played]
    )
    places = np.rint(table.places[rows].reshape(len(rows), 6) * PLACES).astype(np.int64)
    block.add_varints("feet_rows", zigzag(first_differences(places).T.ravel()))
    block.add("feet_across", table.across.astype(np.float32))
    counts = np.zeros(2 * len(chosen.agents), np.int64)
    parts: list[Ints] = []
    begin, end = (step / recording.steps_per_second for step in (chosen.first, chosen.first + chosen.steps))
    for number, agent in enumerate(chosen.agents.tolist()):
        for foot in (0, 1):
            times, states = recording.planted_feet.changes_of(agent, foot)
            # That which holds at the beginning, and all that follow.
            some = slice(max(int(np.searchsorted(times, begin, side="right")) - 1, 0), np.searchsorted(times, end))
            times, states = times[some], states[some]
            node = np.searchsorted(played, states[:, NODE].astype(np.int64))
            node = np.minimum(node, len(played) - 1)
            # Changes in nodes that the page does not play have no effect in it.
            mine = played[node] == states[:, NODE]
            counts[2 * number + foot] = np.count_nonzero(mine)
            ticks = np.rint(np.maximum(times[mine] - begin, 0.0) * PLACES).astype(np.int64)
            states, node = states[mine], node[mine]
            columns = [np.diff(ticks, prepend=0), states[:, MODE].astype(np.int64), node]
            columns += [np.rint(states[:, k] * FRAMES).astype(np.int64) for k in (SINCE, UNTIL)]
            columns += [zigzag(np.rint(states[:, k] * PLACES).astype(np.int64)) for k in range(X, YAW + 1)]
            parts.append(np.stack(columns, axis=1).ravel())
    block.add_varints("feet_counts", counts)
    block.add_varints("feet_changes", np.concatenate([np.zeros(0, np.int64), *parts]))


def pack_no_feet(block: Block) -> None:
    """Add that no foot is put anywhere."""
    none = np.zeros(0, np.int64)
    for name in ("feet_rows", "feet_counts", "feet_changes"):
        block.add_varints(name, none)
    block.add("feet_across", np.zeros(0, np.float32))
