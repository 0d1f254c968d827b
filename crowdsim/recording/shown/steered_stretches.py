"""Stretches of steps in which agents are steered, with their gaits extended over captured steps before and after.

A pose depends on track and phase for a cycle or two around it. Captured steps have a track; the phase is extended over
them at the rate of the nodes they play. Around a switch the steered gait runs a little faster or slower until it is in
phase with the nodes, so that swinging feet do not have to catch up at once.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from crowdsim.constants import NONE
from crowdsim.recording.columns import RecordedTracks
from crowdsim.recording.levels import Level, levels_of

CONTINUED = 2.0
"""Time before and after a stretch over which it is extended [s]: about two cycles."""
_QUICKEST = 2.4
"""Phase rate above which the phase of a node jumps, as it may while the body stands [cycles/s]."""
_JUMP = 0.25
"""Phase difference of two frames above which the phase jumps between them [cycles]. Walking advances it by far less."""
IN_STEP = 0.8
"""Time after a switch, and before one, over which a steered gait gets in phase with the nodes [s]."""
_OUT_OF_STEP = 0.2
"""Largest phase difference that is corrected [cycles]. Larger ones occur while bodies stand, and no foot swings."""
_USUAL = 0.9
"""Phase rate assumed if an agent is steered for a single step [cycles/s]."""

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


class Stretches(NamedTuple):
    """S stretches in a part (rows, columns) of a recording, sorted by column, then by time.

    Attributes
    ----------
    columns : (S,) int64
        Column of the agent in the part.
    firsts, ends : (S,) int64
        Rows in which the agent is shown as steered, to before ``ends``; some at either end may be captured.
    begins, stops : (S,) int64
        Rows for which track and phase are known, to before ``stops``.
    starts : (S,) int64
        Index in ``phases`` of each stretch's first row.
    phases : (N,) float64
        Phases of all these rows [cycles], stretch after stretch.
    """

    columns: Ints
    firsts: Ints
    ends: Ints
    begins: Ints
    stops: Ints
    starts: Ints
    phases: Floats

    def chosen(self, some: NDArray[np.bool_]) -> Stretches:
        """Return the stretches that the mask ``some`` (S,) selects."""
        columns, firsts, ends, begins, stops, starts = (values[some] for values in self[:-1])
        return Stretches(columns, firsts, ends, begins, stops, starts, self.phases)

    def phases_at(self, stretches: Ints, rows: Ints) -> Floats:
        """Return the phases (n,) of ``stretches`` (n,) in ``rows`` (n,) [cycles]."""
        at: Floats = self.phases[self.starts[stretches] + rows - self.begins[stretches]]
        return at


def read_stretches(recording: RecordedTracks, rows: slice, columns: slice, some: Ints) -> Stretches:
    """Return all stretches of some agents in ``rows``, the steps to read.

    ``columns`` is a range of agents, of which ``some`` (n,) are taken, as indices from the start of the range. In the
    result, rows count from the first of ``rows``, and columns are indices into ``some``.
    """
    phase = recording.phase[rows, columns][:, some].astype(np.float64)
    state = recording.state[rows, columns][:, some]
    node = recording.node[rows, columns][:, some]
    levels = levels_of(state, node, phase)
    steered = levels == Level.STEERED
    here, firsts, ends = _runs(steered)
    # If no agent can be captured, or none is steered, there is nothing to extend: the stretches are the runs of steered
    # rows.
    if not recording.header.motion.mixed or not len(here):
        counts = ends - firsts
        starts = np.cumsum(counts) - counts
        rows_of = np.arange(counts.sum()) - np.repeat(starts - firsts, counts)
        return Stretches(here, firsts, ends, firsts, ends, starts, phase[rows_of, np.repeat(here, counts)])
    rate = recording.steps_per_second
    frame = recording.frame[rows, columns][:, some]
    played = played_phases(recording, levels, node, frame)
    gone = np.cumsum(phase_advances(levels, phase, played, rate), axis=0)
    # Extend each stretch by CONTINUED, but not beyond the rows in which the agent is present.
    numbers = np.arange(len(levels))[:, None]
    absent = levels == Level.NOBODY
    since = np.maximum.accumulate(np.where(absent, numbers, -1), axis=0) + 1
    until = np.minimum.accumulate(np.where(absent, numbers, len(levels))[::-1], axis=0)[::-1]
    reach = round(CONTINUED * rate)
    begins = np.maximum(firsts - reach, since[firsts, here])
    stops = np.minimum(ends + reach, until[firsts, here])
    counts = stops - begins
    starts = np.cumsum(counts) - counts
    rows_of = np.arange(counts.sum()) - np.repeat(starts - begins, counts)
    of = np.repeat(here, counts)
    at_first = np.repeat(firsts, counts)
    phases = phase[at_first, of] + (gone[rows_of, of] - gone[at_first, of])
    # Steered rows keep their recorded phase; extended rows add up the advances of the nodes.
    own = steered[rows_of, of] & (rows_of >= at_first) & (rows_of < np.repeat(ends, counts))
    phases = np.where(own, phase[rows_of, of], phases)
    # For now, stretches are shown from the last captured row before to the first one after, in which the phases must
    # meet those of the nodes.
    stretches = Stretches(here, np.maximum(firsts - 1, begins), ends, begins, stops, starts, phases)
    stretches = _in_step(stretches, played, rows_of - at_first, np.repeat(ends, counts) - rows_of, rate)
    # Then they are shown from switch to switch, as playback shows switches. NONE, for an edge without a switch, finds
    # the 0 at the end, which is not used.
    shown = np.append(recording.switches.shown, 0) - rows.start
    agents = columns.start + some[here]
    first, end = (recording.switches.at(agents, edges + rows.start) for edges in (firsts, ends))
    return stretches._replace(
        firsts=np.maximum(np.where(first == NONE, firsts, shown[first]), begins),
        ends=np.minimum(np.where(end == NONE, ends, shown[end]), stops),
    )


def _in_step(stretches: Stretches, played: Floats, since: Ints, until: Ints, rate: int) -> Stretches:
    """Return the stretches with the phases of the nodes at both switches, up to whole cycles; their own after IN_STEP.

    If the phases differ by more than _OUT_OF_STEP at a switch, or no node is played there, they stay as they are. Short
    stretches have their own phases in their middle only. No phase goes back.

    ``played`` (rows, columns) are the phases of nodes, as of :func:`played_phases`; ``rate`` the steps per second.
    ``since`` (N,) is the number of rows from the first steered row of a stretch to that of each phase, ``until`` (N,)
    from there to the first captured row after the stretch. In extended rows, ``since`` is below 0 before the stretch,
    and ``until`` is 0 or below 0 after it.
    """
    counts = stretches.stops - stretches.begins
    # Rows that a correction takes: at most half of the stretch, so that those of both ends do not meet.
    most = np.minimum(IN_STEP * rate, 0.5 * (stretches.ends - stretches.firsts))
    phases = stretches.phases.copy()
    # At either end of a stretch: phase difference to the node, less whole cycles, times 1 - smoothstep of the distance
    # ``far`` from that end [rows]. Rows beyond the end get the whole difference.
    for meeting, far in ((stretches.firsts, since + 1), (stretches.ends, until)):
        row = np.minimum(meeting, stretches.stops - 1)
        off = played[row, stretches.columns] - stretches.phases_at(np.arange(len(row)), row)
        off -= np.rint(off)
        off = np.where(np.isfinite(off) & (np.abs(off) <= _OUT_OF_STEP), off, 0.0)
        u = np.clip(far / np.repeat(most, counts), 0.0, 1.0)
        phases += np.repeat(off, counts) * (1.0 - u * u * (3.0 - 2.0 * u))
    # The correction may make phases of a standing body decrease: hold them at their maximum so far. Offsets above
    # all advances [cycles] separate the stretches in the running maximum.
    rising = phases - np.repeat(phases[stretches.starts], counts)
    apart = max(1000.0, np.max(rising, initial=0.0) - np.min(rising, initial=0.0) + 1.0)
    rising += apart * np.repeat(np.arange(len(counts)), counts)
    lost = np.maximum.accumulate(rising) - rising
    return stretches._replace(phases=np.where(lost > 0.0, phases + lost, phases))


def played_phases(
    recording: RecordedTracks, levels: NDArray[np.int8], node: NDArray[np.int32], frame: NDArray[np.float32]
) -> Floats:
    """Return the phases of the frames that captured agents play, in [0, 1) cycles; nan for all others.

    ``levels``, ``node`` and ``frame``, and the phases, are arrays of one shape. ``frame`` may lie between two frames.
    If the phase jumps between them, as it may while a body stands, the nearer frame gives it.
    """
    motion = recording.header.motion
    captured = levels == Level.CAPTURED
    node, frame = np.where(captured, node, 0), np.where(captured, frame, 0.0).astype(np.float64)
    whole = np.floor(frame).astype(np.int64)
    rows = motion.node_first[node].astype(np.int64) + whole
    before, after = (
        motion.pool_phases[some].astype(np.float64) for some in (rows, rows + (whole < motion.node_frames[node]))
    )
    # Interpolate along the shorter arc, but not across a jump by about half a cycle, in which a foot would swing.
    share, arc = frame - whole, np.mod(after - before + 0.5, 1.0) - 0.5
    share = np.where(np.abs(arc) > _JUMP, np.rint(share), share)
    phases = np.mod(before + share * arc, 1.0)
    return np.where(captured, phases, np.nan)


def phase_advances(levels: NDArray[np.int8], phase: Floats, played: Floats, rate: int) -> Floats:
    """Return the advance of phases (rows, N) from the row before [cycles], on any level; 0 in the first row.

    ``levels``, ``phase`` and ``played`` are (rows, N). ``phase`` holds the phases of steered agents, ``played`` those
    of captured ones in [0, 1); both are nan for others. Across a switch the phase advances as in the steered step next
    to it, or at _USUAL if there is none. It does not advance if the phase of a node jumps, nor from or to a row in
    which the agent is NOBODY. ``rate`` is in steps per second.
    """
    ahead = np.zeros(levels.shape)
    # Levels of a row and the one before: 3 both steered, 2 becomes steered, 1 becomes captured, 0 both captured. Absent
    # agents (-1) also give some of these; they are set to 0 below.
    both = levels[1:] * 2 + levels[:-1]
    steered = np.diff(phase, axis=0)
    usual = _USUAL / rate
    # Advances of steered rows from the row before, and to the row after.
    before = np.full(levels.shape, usual)
    before[1:] = np.where(np.isfinite(steered), steered, usual)
    after = np.append(before[1:], np.full((1, levels.shape[1]), usual), axis=0)
    nodes = np.mod(played[1:] - played[:-1], 1.0)
    nodes = np.where(nodes <= _QUICKEST / rate, nodes, 0.0)
    ahead[1:] = np.select(
        [both == 3, both == 2, both == 1, both == 0], [before[1:], after[1:], before[:-1], nodes], 0.0
    )
    present = (levels[1:] != Level.NOBODY) & (levels[:-1] != Level.NOBODY)
    ahead[1:] = np.where(present, ahead[1:], 0.0)
    return ahead


def _runs(there: NDArray[np.bool_]) -> tuple[Ints, Ints, Ints]:
    """Return column, first row, and row after the last of all runs of True in the columns of ``there`` (rows, columns).

    Runs are sorted by column, then by row.
    """
    edge = np.zeros((1, there.shape[1]), bool)
    changes = np.diff(np.concatenate([edge, there, edge]).astype(np.int8), axis=0).T
    columns, firsts = np.nonzero(changes > 0)
    return columns, firsts, np.nonzero(changes < 0)[1]
