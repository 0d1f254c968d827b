"""Tracks of a recording in chunks of steps, each of which can be decoded without the others."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from crowdsim.constants import CAPTURE_RATE, NONE
from crowdsim.export.page.choice import Chosen
from crowdsim.export.page.packing import Block, Ints
from crowdsim.export.page.tracks.context_kernels import MIXED, MODELS, ROWS
from crowdsim.export.page.tracks.expected_kernels import PHASE_STEP, PLACE, RATE, TURN_STEP
from crowdsim.export.page.tracks.mixing_kernels import Coder, new_mixer
from crowdsim.export.page.tracks.played_kernels import TRACK_UNITS, NodeTracks
from crowdsim.export.page.tracks.range_kernels import EVEN, new_state
from crowdsim.export.page.tracks.track_kernels import code_chunk
from crowdsim.motion.graph.playback_kernels import FRAME_TICKS
from crowdsim.recording.header import AgentState, MotionRecord
from crowdsim.recording.reader import Recording
from crowdsim.recording.shown.track_blocks import TICKS_PER_SECOND

PLACES, FINE_PLACES = 720, 4000
"""Integer units per meter for positions of tracks, and for positions of few agents, which are finer because an error of
the hips is more than doubled at the knees of straight legs. Units of 1.39 mm leave a steered position within a circle
of 1 mm, a captured one within 0.97 mm along each axis."""
_FEW = 100_000
"""Largest number of positions on a page with fine units; each position then takes some 5 bits more."""
PHASES = 50_000
"""Integer units per cycle for gait phases. The phase of a body at rest, 0.06 cycles after a foot lands, is a whole
number of them: otherwise a page takes a body at rest as walking, and plans other steps than playback does."""
_PHASE_STEP, _FINE_PHASE_STEP = 15, 10
"""Steps by which differences from expected phases are coded, and those of few agents [units of phase]."""
FRACTIONS = 64
"""Parts of a unit of places, or of a step of turns and phases, to which the last steps of a stretch are exact, because
footsteps after the stretch are extrapolated from them."""
TURNS = 1 << 17
"""Integer units per turn for headings."""
_PLAYED_TURN_STEP, _FINE_TURN_STEP, _COARSE_TURN_STEP = 16, 64, 163
"""Steps by which differences from expected turns are coded [units of turn]: of captured agents, whose feet turn with
the track; of few steered agents; and of many. At 10 steps a second, steered agents turn by at most 32 of the last ones
in a step, at 20 steps by 16."""
_OFF, _SUM_OFF = 0.0175, 0.008
"""Largest error of a coarse heading, and of the sum of the errors so far [rad]. Bodies show a mean of nine headings."""
_SAMPLES = 1 << 20
"""Largest number of positions in a chunk, which a browser decodes at once."""
_SHORTEST, _LONGEST = 64, 1024
"""Least and greatest number of steps of a chunk."""

_TURN_RATE = 2.5
"""Largest turn rate of steered agents that is expected [rad/s]; other turns take more bytes."""
_LARGEST = 24
"""Bytes that a value takes at most."""


class ChunkPlan(NamedTuple):
    """Division of the steps: ``steps`` per chunk, and ``margin`` more on both sides, to interpolate across borders."""

    steps: int
    margin: int


class Events(NamedTuple):
    """Steps at which something changes: one row per change, sorted by agent, then by time.

    Attributes
    ----------
    counts : (N,) int64
        Number of changes of each agent.
    step : (E,) int64
        Step, counted from the first of the page.
    node, previous : (E,) int64
        Indices into the nodes that are played, -1 for none.
    behavior : (E,) int64
        Behavior, -1 if absent.
    state : (E,) int64
        :class:`AgentState`, plus 4 if the agent is steered.
    """

    counts: Ints
    step: Ints
    node: Ints
    previous: Ints
    behavior: Ints
    state: Ints


def place_units(chosen: Chosen) -> int:
    """Return the integer units of places per meter: fine ones if the agents have few positions in all."""
    return FINE_PLACES if len(chosen.agents) * chosen.steps <= _FEW else PLACES


def turn_step(places: int) -> int:
    """Return the step by which turns of steered agents are coded [units of turn], for ``places`` units per meter."""
    return _FINE_TURN_STEP if places == FINE_PLACES else _COARSE_TURN_STEP


def phase_step(places: int) -> int:
    """Return the step by which phases are coded [units of phase], for ``places`` units per meter."""
    return _FINE_PHASE_STEP if places == FINE_PLACES else _PHASE_STEP


def plan_chunks(agents: int) -> ChunkPlan:
    """Return the division of the steps of ``agents`` agents into chunks that a browser decodes at once."""
    steps = int(np.clip(_SAMPLES // max(agents, 1), _SHORTEST, _LONGEST))
    return ChunkPlan(steps, 1)


class PackedStretches(NamedTuple):
    """Stretches of steps in which agents are steered, with the phases that their bodies show.

    Attributes
    ----------
    agents, begins, stops : (S,) int64
        Agent, first step, and step after the last, sorted by agent, then by time.
    starts : (S,) int64
        Index in ``phases`` of each stretch's first step.
    phases : (P,) float64
        Phases of all these steps, in units of a page.
    """

    agents: Ints
    begins: Ints
    stops: Ints
    starts: Ints
    phases: NDArray[np.float64]

    def within(self, low: int, high: int) -> Ints:
        """Return (k, 4) the parts of stretches in the steps from ``low`` to before ``high``, counted from ``low``.

        Columns: agent, first step, step after the last, index in ``phases``.
        """
        first, end = np.maximum(self.begins, low), np.minimum(self.stops, high)
        some = first < end
        columns = self.agents, first - low, end - low, self.starts + first - self.begins
        return np.ascontiguousarray(np.stack([column[some] for column in columns], axis=1))


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
        """Return (steps, N) whether each agent is steered."""
        here: NDArray[np.bool_] = self.state != AgentState.ABSENT
        return here & np.isfinite(self.phase)


def read_rows(recording: Recording, chosen: Chosen, first: int, end: int) -> _Rows:
    """Return the columns of the chosen agents from step ``first`` to before ``end`` of the page."""
    rows = slice(chosen.first + first, chosen.first + end)
    return _Rows(*(getattr(recording, name)[rows][:, chosen.agents] for name in _Rows._fields))


def pack_tracks(
    block: Block, recording: Recording, chosen: Chosen, plan: ChunkPlan, stretches: PackedStretches
) -> tuple[Events, Ints]:
    """Add all chunks to the block; return the changes, and the nodes that are played, ascending.

    Chunk ``c`` is an array ``chunk_c``, coded by :mod:`crowdsim.export.page.tracks.track_kernels`. It holds tracks,
    frames of nodes, and the phases of ``stretches``. One more array, ``stretch_exact``, holds the values of _Ends.
    """
    units = coding_units(recording, place_units(chosen))
    nodes = node_tracks(recording.header.motion)
    # The coder turns ``phases``, chunk by chunk, into what a decoder finds.
    phases = np.rint(stretches.phases).astype(np.int64)
    found, exact = _Changes(len(chosen.agents)), _Ends(units, stretches, phases)
    for number, (low, high) in enumerate(chunk_spans(chosen.steps, plan)):
        rows = read_rows(recording, chosen, low, high)
        # The chunk's own steps without its margins, counted in ``rows``.
        first = number * plan.steps - low
        own = range(first, min(first + plan.steps, high - low))
        found.take(rows, low + first, slice(own.start, own.stop))
        coded, headings = _coded(rows, units, nodes, stretches.within(low, high), phases, own)
        exact.take(rows, headings, low, own)
        block.add(f"chunk_{number}", coded)
    block.add("stretch_exact", exact.values)
    return found.events()


def coding_units(recording: Recording, places: int) -> Ints:
    """Return the units by which tracks are coded, see :mod:`crowdsim.export.page.tracks.expected_kernels`."""
    rate, steps = recording.steps_per_second, (phase_step(places), turn_step(places), _PLAYED_TURN_STEP)
    # Rounded to an even number: at 10 and at 20 steps a second it is then a multiple of _COARSE_TURN_STEP.
    most = 2 * round(0.5 * _TURN_RATE / rate * TURNS / (2.0 * np.pi))
    return np.array([places, TURNS, rate, PHASES, most, CAPTURE_RATE // rate * FRAME_TICKS, *steps], np.int64)


def chunk_spans(steps: int, plan: ChunkPlan) -> Iterator[tuple[int, int]]:
    """Yield the first step of each chunk and the step after its last, with margins."""
    for first in range(0, steps, plan.steps):
        yield max(first - plan.margin, 0), min(first + plan.steps + plan.margin, steps)


def node_tracks(motion: MotionRecord) -> NodeTracks:
    """Return the tracks of all nodes, rounded as pages hold them; zeros for older recordings, which have no tracks."""
    rows = np.zeros((len(motion.pool_root), 3), np.int64)
    if len(motion.pool_tracks):
        rows = np.rint(motion.pool_tracks.astype(np.float64) * TRACK_UNITS).astype(np.int64)
    first, frames = (np.ascontiguousarray(values, np.int32) for values in (motion.node_first, motion.node_frames))
    return NodeTracks(first, frames, rows)


def _coded(
    rows: _Rows, units: Ints, nodes: NodeTracks, stretches: Ints, phases: Ints, own: range
) -> tuple[NDArray[np.uint8], Ints]:
    """Return the bytes of a chunk, and the headings (N, steps) that a decoder finds [units of turn].

    ``rows`` are the chunk's steps with its margins, ``own`` those without. ``units`` are those of :func:`coding_units`.
    ``stretches`` (k, 4) are those of :meth:`PackedStretches.within`. ``phases`` (P,) are those of all stretches, in
    units of a page; those in ``own`` become what a decoder finds.
    """
    here = (rows.state != AgentState.ABSENT).T
    node = np.where(here, rows.node.T, NONE).astype(np.int32)
    places, per_radian = float(units[PLACE]), TURNS / (2.0 * np.pi)
    exact = np.stack(
        [
            np.where(here, values.T, 0.0).astype(np.float64) * per
            for values, per in ((rows.x, places), (rows.y, places), (rows.heading, per_radian))
        ]
    )
    tracks = np.zeros((4, *here.shape), np.int64)  # the coder fills in all but frames
    tracks[3] = np.rint(np.where(node != NONE, rows.frame.T, 0.0).astype(np.float64) * FRAME_TICKS)
    # Only coarse headings are chosen for few bits; others are rounded.
    slack = np.array([_OFF, _SUM_OFF]) * (per_radian if units[TURN_STEP] == _COARSE_TURN_STEP else 0.0)
    out = np.zeros(_LARGEST * (tracks.size + len(phases)) + 64, np.uint8)
    coder = Coder(new_state(), out, np.full((MODELS, 2), EVEN, np.uint16), new_mixer(MIXED, ROWS))
    spans = np.array([own.start, own.stop], np.int64)
    size = code_chunk(tracks, exact, here.astype(np.uint8), node, nodes, stretches, phases, spans, units, slack, coder)
    return out[:size], tracks[2]


class _Ends:
    """Collects the last steps of stretches exactly: differences from what a decoder finds.

    ``values`` (S, steps, 4) int8: x, y, heading, phase, the last step first, in 1 / FRACTIONS of a unit of place, or of
    a step of turns and phases. There are as many steps as two samples of footstep plans may need.
    """

    def __init__(self, units: Ints, stretches: PackedStretches, phases: Ints) -> None:
        self._stretches = stretches
        self._units = units
        self._phases = phases
        # Columns x, y, heading, node of a chunk's last steps, and headings that a decoder finds, each (steps, N).
        self._before: tuple[NDArray[Any], ...] | None = None
        steps = -(-int(units[RATE]) // TICKS_PER_SECOND) + 1
        self.values = np.zeros((len(stretches.agents), steps, 4), np.int8)

    def take(self, rows: _Rows, headings: Ints, low: int, own: range) -> None:
        """Take the values of the stretches whose last step is in ``own``, the steps of a chunk without its margins.

        ``rows``, and ``headings`` (N, steps) as a decoder finds them, begin at step ``low``.
        """
        known, turn_step, most = self._stretches, float(self._units[TURN_STEP]), self.values.shape[1]
        every = rows.x, rows.y, rows.heading, rows.node, headings.T
        columns: tuple[NDArray[Any], ...] = tuple(each[own.start : own.stop] for each in every)
        first, stop = low + own.start, low + own.stop
        if self._before is not None:
            # Steps before a chunk, which a decoder takes from the chunk before.
            first -= len(self._before[0])
            columns = tuple(np.concatenate(each) for each in zip(self._before, columns, strict=True))
        self._before = tuple(each[-most:].copy() for each in columns)
        x, y, heading, node, found = columns
        some = np.flatnonzero((known.stops > low + own.start) & (known.stops <= stop))
        for back in range(most):
            # Stretches that have such a step.
            step = known.stops[some] - 1 - back
            some, step = (part[step >= known.begins[some]] for part in (some, step))
            row, who = step - first, known.agents[some]
            # Stretches reach into captured steps. A page shows their tracks without rounding: nothing is added there.
            steered = node[row, who] == NONE
            exact = np.stack([x[row, who], y[row, who]]).astype(np.float64) * float(self._units[PLACE])
            places = exact - np.floor(exact + 0.5)
            turns = heading[row, who].astype(np.float64) * TURNS / (2.0 * np.pi) - found[row, who]
            turns = (turns - TURNS * np.rint(turns / TURNS)) / turn_step
            at = known.starts[some] + step - known.begins[some]
            phases = (known.phases[at] - self._phases[at]) / float(self._units[PHASE_STEP])
            off = np.stack([*np.where(steered, places, 0.0), np.where(steered, turns, 0.0), phases], axis=1)
            # Headings that were chosen for few bits may be off by more than int8 holds: limit the values.
            self.values[some, back] = np.clip(np.rint(off * FRACTIONS), -127, 127)


class _Changes:
    """Collects changes step by step."""

    def __init__(self, agents: int) -> None:
        # Node, previous, behavior and state of the last step; -2 differs from all, so the first step is a change.
        self._last = np.full((4, agents), -2, np.int64)
        self._agents = agents
        self._parts: list[Ints] = []

    def take(self, rows: _Rows, first: int, span: slice) -> None:
        """Record the changes in the steps ``span`` of ``rows``, with values as of :class:`Events`.

        first: step of the page at which ``span`` begins. Changes are kept in parts (6, E): agent, step, node, previous,
        behavior, state.
        """
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
        self._last = values[:, -1]

    def events(self) -> tuple[Events, Ints]:
        """Return all changes, and the nodes that are played, ascending, which the changes refer to by index."""
        empty = np.zeros((6, 0), np.int64)
        agent, step, node, previous, behavior, state = np.concatenate([empty, *self._parts], axis=1)
        order = np.lexsort((step, agent))
        played = np.unique(np.concatenate([node, previous]))
        played = played[played >= 0]
        node, previous = (np.where(values < 0, -1, np.searchsorted(played, values)) for values in (node, previous))
        columns = (values[order] for values in (step, node, previous, behavior, state))
        return Events(np.bincount(agent, minlength=self._agents).astype(np.int64), *columns), played


def pack_events(block: Block, events: Events) -> None:
    """Add changes to the block: steps since the agent's previous change, or the page's first step, and the new values.

    Nodes and behaviors are written plus one, as -1 stands for none.
    """
    agent = np.repeat(np.arange(len(events.counts)), events.counts)
    same = np.append(False, agent[1:] == agent[:-1]) if len(agent) else np.zeros(0, bool)
    since = np.where(same, np.diff(events.step, prepend=0), events.step)
    block.add_varints("event_counts", events.counts)
    block.add_varints("event_steps", since)
    block.add_varints("event_nodes", events.node + 1)
    block.add_varints("event_previous", events.previous + 1)
    block.add("event_behaviors", (events.behavior + 1).astype(np.uint8))
    block.add("event_states", events.state.astype(np.uint8))
