"""Planted feet of captured bodies for a page: where feet are in the nodes it plays, and where they stand."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from crowdsim.export.page.choice import Chosen
from crowdsim.export.page.packed_poses import rows_of_nodes
from crowdsim.export.page.packing import Block, Ints, first_differences, zigzag
from crowdsim.export.page.tracks.track_chunks import FINE_PLACES, place_units
from crowdsim.geometry.planar import Floats, compose, invert, wrap_angle
from crowdsim.motion.planted.pin_kernels import COLUMNS, FADES, MODE, NODE, SINCE, STANDS, UNTIL, YAW, X
from crowdsim.recording.reader import Recording

PLACES = 10_000
"""Integer units per meter and radian of feet in nodes."""
TIMES, FRAMES = 1000, 100
"""Integer units per second, and per frame, of changes."""
_COLUMNS = ("times", "modes", "nodes", "since", "fading", "x", "y", "yaws")
"""Columns of changes."""
_ANGLES, _FINE_ANGLES = 1000, 10_000
"""Integer units per radian of changes, and those of few agents."""


def feet_units(places: int) -> dict[str, int]:
    """Return the units of changes a second, frame, meter and radian, if tracks have ``places`` units a meter."""
    angles = _FINE_ANGLES if places == FINE_PLACES else _ANGLES
    return {"time": TIMES, "frame": FRAMES, "place": 2 * places, "angle": angles}


def pack_feet(block: Block, recording: Recording, chosen: Chosen, played: Ints) -> None:
    """Add the places of the feet in the nodes ``played``, and the changes of the feet of the agents.

    Places are packed column by column, as differences from row to row: ball x, y [m] and heading [rad] of the left
    foot, then of the right one, relative to the first row of their node. ``feet_across`` are the axes (2, 3) of the
    ankle joints that point to the left of their feet. ``feet_counts`` are the numbers of changes, for each agent of
    the left foot, then of the right one.

    ``played`` holds the nodes of the page, ascending, which numbers them in this order. A change has its time since the
    one before of the same foot, mode, node, the frame from which it holds, how long it fades, and a planar pose as
    :func:`_coded_poses` has it, in columns of their own.
    """
    table = recording.foot_table
    if table is None or not len(played):
        pack_no_feet(block)
        return
    motion = recording.header.motion
    rows = rows_of_nodes(motion, played)
    places = np.rint(table.places[rows] * PLACES).astype(np.int64)
    block.add_varints("feet_rows", zigzag(first_differences(places.reshape(len(rows), 6)).T.ravel()))
    block.add("feet_across", table.across.astype(np.float32))
    counts = np.zeros(2 * len(chosen.agents), np.int64)
    ticks, parts = [np.zeros(0, np.int64)], [np.zeros((0, COLUMNS))]
    begin, end = (step / recording.steps_per_second for step in (chosen.first, chosen.first + chosen.steps))
    for number, agent in enumerate(chosen.agents.tolist()):
        for foot in (0, 1):
            times, states = recording.planted_feet.changes_of(agent, foot)
            # That which holds at the beginning, and all that follow.
            some = slice(max(int(np.searchsorted(times, begin, side="right")) - 1, 0), np.searchsorted(times, end))
            times, states = times[some], states[some]
            # Changes in nodes that the page does not play have no effect in it.
            mine = np.isin(states[:, NODE], played)
            counts[2 * number + foot] = np.count_nonzero(mine)
            ticks.append(np.diff(np.rint(np.maximum(times[mine] - begin, 0.0) * TIMES).astype(np.int64), prepend=0))
            parts.append(states[mine])
    states = np.concatenate(parts)
    states[:, NODE] = np.searchsorted(played, states[:, NODE])
    since = np.rint(states[:, SINCE] * FRAMES).astype(np.int64)
    fading = np.where(states[:, MODE] == FADES, np.rint(states[:, UNTIL] * FRAMES).astype(np.int64) - since, 0)
    states[:, SINCE] = since / FRAMES
    units = feet_units(place_units(chosen))
    poses = _coded_poses(states, counts, _Feet(places / PLACES, motion.node_frames[played]), units)
    mode, node = (states[:, column].astype(np.int64) for column in (MODE, NODE))
    columns = np.concatenate(ticks), mode, node, since, np.maximum(fading, 0), *zigzag(poses).T
    block.add_varints("feet_counts", counts)
    for name, column in zip(_COLUMNS, columns, strict=True):
        block.add_varints(f"feet_{name}", column)


class _Feet:
    """Places of feet in the nodes of a page: ``places`` (R, 2, 3) [m, rad], ``frames`` (n,) of each node."""

    def __init__(self, places: Floats, frames: NDArray[np.int32]) -> None:
        self._places = places
        self.frames = frames.astype(np.int64)
        self._first = np.cumsum(self.frames + 1) - self.frames - 1

    def at(self, node: Ints, frame: Floats, foot: Ints) -> Floats:
        """Return places (n, 3) of feet in frames of nodes, between rows along straight lines."""
        whole = np.minimum(np.floor(frame).astype(np.int64), self.frames[node])
        row = self._first[node] + whole
        now = self._places[row, foot]
        later = self._places[np.minimum(row + 1, self._first[node] + self.frames[node]), foot]
        way = later - now
        way[:, 2] = wrap_angle(way[:, 2])
        found: Floats = now + (frame - whole)[:, None] * way
        return found


def _coded_poses(states: Floats, counts: Ints, feet: _Feet, units: dict[str, int]) -> Ints:
    """Return the poses (n, 3) of changes as integers, in ``units``; changes are sorted by foot, ``counts`` of each.

    A foot that stands in the node before, and in this one, is expected to stay: its pose is coded by the difference
    from that at the end of that node. Other poses of standing feet are seen from the one in which the foot stood last.
    What fades is coded as it is. All follows from what a decoder finds, so that errors do not add up.
    """
    scale = np.array([units["place"], units["place"], units["angle"]], np.float64)
    stands = states[:, MODE] == STANDS
    foot = np.repeat(np.arange(len(counts)), counts)
    coded = np.rint(states[:, X : YAW + 1] * scale).astype(np.int64)
    # Standing poses in the order of their number in the foot: all first ones, then all second ones, and so on.
    some = np.flatnonzero(stands)
    number = np.arange(len(some)) - np.searchsorted(foot[some], foot[some])
    found = coded / scale
    for rank in range(1, int(number.max(initial=0)) + 1):
        at = np.flatnonzero(number == rank)
        now, last = some[at], some[at - 1]
        side, node = foot[now] % 2, states[last, NODE].astype(np.int64)
        begins = feet.at(node, states[last, SINCE], side)
        ends = feet.at(node, feet.frames[node].astype(np.float64), side)
        stays = now == last + 1
        # Where it stood at the end of that node, or last.
        before = np.where(stays[:, None], compose(found[last], compose(invert(begins), ends)), found[last])
        asked = states[now, X : YAW + 1]
        way = np.where(stays[:, None], asked - before, compose(invert(before), asked))
        way[:, 2] = wrap_angle(way[:, 2])
        coded[now] = np.rint(way * scale).astype(np.int64)
        way = coded[now] / scale
        found[now] = np.where(stays[:, None], before + way, compose(before, way))
    return coded


def pack_no_feet(block: Block) -> None:
    """Add that no foot is put anywhere."""
    none = np.zeros(0, np.int64)
    for name in ("rows", "counts", *_COLUMNS):
        block.add_varints(f"feet_{name}", none)
    block.add("feet_across", np.zeros(0, np.float32))
