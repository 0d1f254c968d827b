"""Tracks of a recording in chunks of steps, each of which can be decoded without the others."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from crowdsim.constants import CAPTURE_RATE
from crowdsim.export.page.choice import Chosen
from crowdsim.export.page.packing import Block, Ints, second_differences, varints, zigzag
from crowdsim.motion.graph.playback_kernels import FRAME_TICKS
from crowdsim.recording.header import AgentState, MotionRecord
from crowdsim.recording.reader import Recording

PLACES = 1000
"""Integer units per meter for positions of tracks."""
_TURN, _STEERED_TURN = 8192, 2048
"""Integer units per turn for headings: if there are captured nodes, whose feet turn with the track, and if not."""
_SAMPLES = 1 << 20
"""Largest number of positions in a chunk, which a browser decodes at once."""
_SHORTEST, _LONGEST = 64, 1024
"""Least and greatest number of steps of a chunk."""

COLUMNS = ("x", "y", "heading", "frame")


class ChunkPlan(NamedTuple):
    """Division of the steps: ``steps`` per chunk, and ``margin`` more on both sides, to interpolate across borders."""

    steps: int
    margin: int


class Events(NamedTuple):
    """Steps at which something changes: one row per change, sorted by character, then by time.

    Attributes
    ----------
    counts : (N,) int64
        Number of changes of each character.
    step : (E,) int64
        Step, counted from the first of the page.
    node, previous : (E,) int64
        Indices into the nodes that are played, -1 for none.
    behavior : (E,) int64
        Behavior, -1 if absent.
    state : (E,) int64
        :class:`AgentState`, plus 4 if the character is steered.
    """

    counts: Ints
    step: Ints
    node: Ints
    previous: Ints
    behavior: Ints
    state: Ints


def turn_units(motion: MotionRecord) -> int:
    """Return the integer units of heading per turn."""
    return _TURN if len(motion.node_names) else _STEERED_TURN


def plan_chunks(agents: int) -> ChunkPlan:
    """Return chunks of as many steps as a browser decodes at once."""
    steps = int(np.clip(_SAMPLES // max(agents, 1), _SHORTEST, _LONGEST))
    return ChunkPlan(steps, 1)


class _Rows(NamedTuple):
    """Columns (steps, N) of some steps."""

    x: NDArray[np.float32]
    y: NDArray[np.float32]
    heading: NDArray[np.float32]
    node: NDArray[np.int32]
    previous: NDArray[np.int32]
    frame: NDArray[np.float32]
    behavior: NDArray[np.int8]
    state: NDArray[np.int8]
    phase: NDArray[np.float32]

    @property
    def steered(self) -> NDArray[np.bool_]:
        """Return (steps, N) whether each character is steered."""
        here: NDArray[np.bool_] = self.state != AgentState.ABSENT
        return here & np.isfinite(self.phase)


def read_rows(recording: Recording, chosen: Chosen, first: int, end: int) -> _Rows:
    """Return the columns of the chosen characters from step ``first`` to before ``end`` of the page."""
    rows = slice(chosen.first + first, chosen.first + end)
    return _Rows(*(getattr(recording, name)[rows][:, chosen.agents] for name in _Rows._fields))


def pack_tracks(block: Block, recording: Recording, chosen: Chosen, plan: ChunkPlan) -> tuple[Events, Ints]:
    """Add all chunks to the block; return the changes, and the nodes that are played, ascending.

    Chunk ``c`` is an array ``chunk_c``: the columns one after another, each character by character. ``chunk_sizes``
    holds the number of bytes of each column.
    """
    found = _Changes(len(chosen.agents))
    sizes = []
    for number, (low, high) in enumerate(chunk_spans(chosen.steps, plan)):
        rows = read_rows(recording, chosen, low, high)
        first = min(number * plan.steps - low, len(rows.x))
        found.take(rows, low + first, slice(first, first + plan.steps))
        packed = _packed_columns(rows, recording.steps_per_second, turn_units(recording.header.motion))
        sizes.append([len(part) for part in packed])
        block.add(f"chunk_{number}", np.concatenate(packed))
    block.add("chunk_sizes", np.array(sizes, np.uint32).reshape(-1, len(COLUMNS)))
    return found.events()


def chunk_spans(steps: int, plan: ChunkPlan) -> Iterator[tuple[int, int]]:
    """Yield the first step of each chunk and the step after its last, with margins."""
    for first in range(0, steps, plan.steps):
        yield max(first - plan.margin, 0), min(first + plan.steps + plan.margin, steps)


def _packed_columns(rows: _Rows, rate: int, turn: int) -> list[NDArray[np.uint8]]:
    """Return the bytes of each of COLUMNS."""
    here = (rows.state != AgentState.ABSENT).T
    captured = here & (rows.node >= 0).T
    every = _begins(here)
    node = rows.node.T
    again = np.zeros_like(captured)
    again[:, 1:] = node[:, 1:] != node[:, :-1]
    turns = np.asarray(rows.heading.T, np.float64) * (turn / (2.0 * np.pi))
    natural = CAPTURE_RATE // rate * FRAME_TICKS
    parts = [
        (_whole(rows.x.T, here, PLACES), every[here], 0, 0),
        (_whole(rows.y.T, here, PLACES), every[here], 0, 0),
        (_whole(turns, here, 1), every[here], 0, turn),
        (_whole(rows.frame.T, captured, FRAME_TICKS), (_begins(captured) | again)[captured], natural, 0),
    ]
    return [
        varints(zigzag(second_differences(values, begins, usual, around))) for values, begins, usual, around in parts
    ]


def _whole(values: NDArray[np.float64] | NDArray[np.float32], some: NDArray[np.bool_], units: int) -> Ints:
    chosen = np.asarray(values[some], np.float64)
    return np.rint(chosen * units).astype(np.int64)


def _begins(here: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return (N, steps) whether a stretch of steps begins."""
    before = np.zeros_like(here)
    before[:, 1:] = here[:, :-1]
    return here & ~before


class _Changes:
    """Collects changes step by step."""

    def __init__(self, agents: int) -> None:
        self._last = np.full((4, agents), -2, np.int64)
        self._agents = agents
        self._parts: list[Ints] = []

    def take(self, rows: _Rows, first: int, span: slice) -> None:
        """Record the changes in some steps, the first of which is step ``first`` of the page."""
        state = rows.state[span].astype(np.int64)
        here = state != AgentState.ABSENT
        captured = here & (rows.node[span] >= 0)
        values = np.stack(
            [
                np.where(captured, rows.node[span], -1),
                np.where(captured, rows.previous[span], -1),
                np.where(here, rows.behavior[span], -1),
                state + 4 * rows.steered[span],
            ]
        )
        before = np.concatenate([self._last[:, None], values[:, :-1]], axis=1)
        step, agent = np.nonzero((values != before).any(axis=0))
        self._parts.append(np.concatenate([[agent, step + first], values[:, step, agent]]))
        self._last = values[:, -1] if values.shape[1] else self._last

    def events(self) -> tuple[Events, Ints]:
        """Return all changes, and the nodes that are played."""
        empty = np.zeros((6, 0), np.int64)
        agent, step, node, previous, behavior, state = np.concatenate([empty, *self._parts], axis=1)
        order = np.lexsort((step, agent))
        played = np.unique(np.concatenate([node, previous]))
        played = played[played >= 0]
        node, previous = (np.where(values < 0, -1, np.searchsorted(played, values)) for values in (node, previous))
        columns = (values[order] for values in (step, node, previous, behavior, state))
        return Events(np.bincount(agent, minlength=self._agents).astype(np.int64), *columns), played


def pack_events(block: Block, events: Events) -> None:
    """Add changes to the block: steps since the previous change, and the new values plus one."""
    agent = np.repeat(np.arange(len(events.counts)), events.counts)
    same = np.append(False, agent[1:] == agent[:-1]) if len(agent) else np.zeros(0, bool)
    since = np.where(same, np.diff(events.step, prepend=0), events.step)
    block.add_varints("event_counts", events.counts)
    block.add_varints("event_steps", since)
    block.add_varints("event_nodes", events.node + 1)
    block.add_varints("event_previous", events.previous + 1)
    block.add("event_behaviors", (events.behavior + 1).astype(np.uint8))
    block.add("event_states", events.state.astype(np.uint8))
