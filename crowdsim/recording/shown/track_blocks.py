"""Tracks of steered agents in blocks of time, with as many samples before and after as their poses depend on.

A block is always read in the same way, so that a pose does not depend on the times requested before.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from crowdsim.geometry.planar import wrap_angle
from crowdsim.motion.deformed.joined_tracks import JoinedTracks, smooth_joined, smoothing_reach, unwrapped
from crowdsim.recording.columns import RecordedTracks
from crowdsim.recording.header import Ends
from crowdsim.recording.shown.steered_stretches import read_stretches

TICKS_PER_SECOND = 10
"""Samples per second that footsteps are planned from, at any rate of the recording [1/s]."""
BLOCK_TICKS = 50
"""Samples (ticks) of a block. Longer blocks are planned less often, but the first picture takes longer."""

_BEFORE, _AFTER = 45, 45
"""Ticks first read before and after a block: two cycles of the slowest steady walk."""
_FARTHEST = 720
"""Largest number of ticks read before a block, for standing bodies: a foot planted even earlier may move once, by the 6
cm that a standing body may be off its feet."""
_CYCLES = 2.25
"""Cycles before and after a block that its poses depend on."""
_SPARE = 5
"""Extra ticks kept beyond these cycles."""
_OF_A_STAND = 15
"""Ticks kept at each end of a stand before a block; the ticks in between have no influence."""
_AGENTS_AT_ONCE = 4096
"""Agents that are read at once: as many as a chunk of the file holds."""

Ints = NDArray[np.int64]


class TrackBlock(NamedTuple):
    """Smoothed tracks of the A bodies that are steered in a block.

    An agent that stops being steered and starts again counts as another body.

    Attributes
    ----------
    agents : (A,) int64
        Agent of each body, ascending.
    firsts, ends : (A,) int64
        Steps of the recording in which each is shown as steered, to before ``ends``, as far as the block has read them.
        They may include captured steps at either end.
    tracks : JoinedTracks
        Samples at ticks.
    zeros : (A,) float64
        Time of the first sample if samples are counted back from the last one, one tick apart [s]. It is later than
        recorded if samples of stands are left out.
    """

    agents: Ints
    firsts: Ints
    ends: Ints
    tracks: JoinedTracks
    zeros: NDArray[np.float64]

    def bodies_at(self, step: int, agents: Ints) -> Ints:
        """Return (n,) the body of each of ``agents``, all of which are steered at ``step``."""
        there = np.flatnonzero((self.firsts <= step) & (step < self.ends))
        found: Ints = there[np.searchsorted(self.agents[there], agents)]
        return found

    def kept(self, bodies: NDArray[np.bool_]) -> TrackBlock:
        """Return the block with the bodies that the mask ``bodies`` (A,) selects."""
        tracks = self.tracks.kept(bodies[self.tracks.bodies])
        # The tracks of other bodies are empty now, so their starts can be left out.
        starts = np.append(tracks.starts[:-1][bodies], tracks.starts[-1])
        rest = JoinedTracks(tracks.samples, starts)
        return TrackBlock(self.agents[bodies], self.firsts[bodies], self.ends[bodies], rest, self.zeros[bodies])


def block_of(step: int, steps_per_second: int) -> int:
    """Return the block that a step of a recording lies in."""
    return step * TICKS_PER_SECOND // steps_per_second // BLOCK_TICKS


def block_steps(block: int, steps_per_second: int) -> tuple[int, int]:
    """Return the first step of a block, and the first one after it."""
    first, end = block * BLOCK_TICKS * steps_per_second, (block + 1) * BLOCK_TICKS * steps_per_second
    return -(-first // TICKS_PER_SECOND), -(-end // TICKS_PER_SECOND)


def read_block(recording: RecordedTracks, block: int) -> TrackBlock:
    """Read the tracks of a block, and smooth them as they are shown."""
    parts = []
    for first in range(0, recording.agent_count, _AGENTS_AT_ONCE):
        agents = np.arange(first, min(first + _AGENTS_AT_ONCE, recording.agent_count))
        before = _BEFORE
        # Footsteps of standing bodies lie far back: read twice as far for these until the samples suffice.
        while len(agents):
            part, lacking = _read_part(recording, agents, block, before)
            if before >= _FARTHEST:
                lacking[:] = False
            again = np.isin(part.agents, part.agents[lacking])
            parts.append(part.kept(~again))
            agents, before = np.unique(part.agents[again]), 2 * before
    return _joined(parts)


def _joined(parts: list[TrackBlock]) -> TrackBlock:
    """Return the bodies of all ``parts`` as one block, sorted by agent and time."""
    agents, firsts, ends = (np.concatenate([part[k] for part in parts]) for k in range(3))
    samples = np.concatenate([part.tracks.samples for part in parts])
    lengths = np.concatenate([part.tracks.lengths for part in parts])
    zeros = np.concatenate([part.zeros for part in parts])
    order = np.lexsort((firsts, agents))
    tracks = JoinedTracks(samples, np.concatenate([[0], np.cumsum(lengths)]).astype(np.int64)).chosen(order)
    return TrackBlock(agents[order], firsts[order], ends[order], tracks, zeros[order])


def _read_part(
    recording: RecordedTracks, agents: Ints, block: int, before: int
) -> tuple[TrackBlock, NDArray[np.bool_]]:
    """Return the bodies of some agents in a block, and (A,) which of them need more samples before.

    ``agents`` (A,) are their numbers, ascending, at least one. ``before`` is the number of ticks to read before the
    block.
    """
    rate = recording.steps_per_second
    first_tick, end_tick = block * BLOCK_TICKS, (block + 1) * BLOCK_TICKS
    low, high = first_tick - before, end_tick + _AFTER
    rows = slice(max(low * rate // TICKS_PER_SECOND, 0), min(-(-high * rate // TICKS_PER_SECOND) + 1, recording.steps))
    columns = slice(int(agents[0]), int(agents[-1]) + 1)
    some = agents - agents[0]
    stretches = read_stretches(recording, rows, columns, some)
    # Only bodies that are shown as steered in the block.
    block_first, block_end = block_steps(block, rate)
    began, left = stretches.firsts + rows.start, stretches.ends + rows.start
    inside = (began < block_end) & (left > block_first)
    stretches, began, left = stretches.chosen(inside), began[inside], left[inside]
    here, begins, stops = stretches.columns, stretches.begins, stretches.stops
    # Resample at ticks, from the one at or before a body's first row to the one at or after its last.
    first_ticks = np.maximum((begins + rows.start) * TICKS_PER_SECOND // rate, low)
    last_ticks = np.minimum(-(-(stops + rows.start - 1) * TICKS_PER_SECOND // rate), high)
    counts = last_ticks - first_ticks + 1
    starts = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
    body = np.repeat(np.arange(len(here)), counts)
    ticks = np.arange(starts[-1]) - starts[body] + first_ticks[body]
    row, rest = np.divmod(ticks * rate - rows.start * TICKS_PER_SECOND, TICKS_PER_SECOND)
    share = rest / TICKS_PER_SECOND
    # Interpolate between the rows before and after each tick.
    now, then = (np.clip(row + k, begins[body], stops[body] - 1) for k in (0, 1))
    samples = np.empty((len(ticks), 4))
    ends = recording.header.ends
    for k, values in enumerate((recording.x, recording.y, recording.heading)):
        table = values[rows, columns][:, some]
        old, new = (table[at, here[body]].astype(np.float64) for at in (now, then))
        way = wrap_angle(new - old) if k == 2 else new - old
        if ends is not None and k == ends.axis:
            way = ends.shorter(way)
        samples[:, k] = old + share * way
    old, new = (stretches.phases_at(body, at) for at in (now, then))
    samples[:, 3] = old + share * (new - old)
    if ends is not None:
        samples[:, ends.axis] = _across(samples[:, ends.axis], starts, ends)
    cut_before = (begins == 0) & (rows.start > 0)
    cut_after = (stops == rows.stop - rows.start) & (rows.stop < recording.steps)
    tracks = smooth_joined(unwrapped(JoinedTracks(samples, starts)))
    keep, lacking = _needed(tracks, ticks, first_ticks, block, cut_before, cut_after)
    kept = tracks.kept(keep)
    # Kept samples count as one tick apart, back from the last one: see TrackBlock.zeros.
    zeros = (np.append(ticks, 0)[_last(keep, tracks)] - kept.lengths + 1) / TICKS_PER_SECOND
    return TrackBlock(agents[here], began, left, kept, zeros), lacking


def _across(places: NDArray[np.float64], starts: Ints, ends: Ends) -> NDArray[np.float64]:
    """Return the coordinates of concatenated tracks along the axis of a periodic floor, continued across its ends [m].

    ``places`` (N,) are the coordinates wrapped into the floor. ``starts`` (A + 1,) are the indices at which the tracks
    begin, and N.
    """
    if not len(places):
        return places
    ways = ends.shorter(np.diff(places, prepend=places[:1]))
    firsts = np.minimum(starts[:-1], len(places) - 1)
    # Sum up the displacements, then shift each track so that it begins where it did.
    gone = np.cumsum(ways)
    return np.asarray(gone + np.repeat(places[firsts] - gone[firsts], np.diff(starts)))


def _needed(
    tracks: JoinedTracks,
    ticks: Ints,
    first_ticks: Ints,
    block: int,
    cut_before: NDArray[np.bool_],
    cut_after: NDArray[np.bool_],
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Return which samples the poses of a block depend on (N,), and which bodies need more samples before (A,).

    ``ticks`` (N,) are those of all samples, ``first_ticks`` (A,) those of the first samples. ``cut_before`` and
    ``cut_after`` (A,) are True if the track begins with the first row read, or ends with the last one, and the
    recording goes on beyond that row.
    """
    body, place, lengths, starts = tracks.bodies, tracks.places, tracks.lengths, tracks.starts
    phase = tracks.samples[:, 3]
    block_first, block_end = block * BLOCK_TICKS, (block + 1) * BLOCK_TICKS
    at_first, at_end = (
        phase[starts[:-1] + np.clip(tick - first_ticks, 0, lengths - 1)] if len(lengths) else np.zeros(0)
        for tick in (block_first, block_end)
    )
    # Keep samples from the last one that is _CYCLES before the block to the first one that is as far after it, and
    # _SPARE more. Smoothing needs ``reach`` samples beyond each end at which the track was cut: do not keep these.
    reach = smoothing_reach()
    earlier = np.bincount(body, phase <= (at_first - _CYCLES)[body], len(lengths)).astype(np.int64)
    lacking = cut_before & (earlier <= reach + _SPARE)
    begin = np.maximum(earlier - 1 - _SPARE, np.where(cut_before, reach, 0))
    before_end = np.bincount(body, phase < (at_end + _CYCLES)[body], len(lengths)).astype(np.int64)
    end = np.minimum(before_end + _SPARE, lengths - np.where(cut_after, reach, 0))
    # Leave out the middle of a stand before the block, in which the phase is equal _OF_A_STAND ticks before and after.
    numbers = np.arange(len(phase))
    old, new = (np.clip(numbers + k, 0, max(len(phase) - 1, 0)) for k in (-_OF_A_STAND, _OF_A_STAND))
    standing = (body[old] == body) & (body[new] == body) & (place >= _OF_A_STAND) & (phase[old] == phase[new])
    standing &= ticks < block_first - _OF_A_STAND
    return (place >= begin[body]) & (place < end[body]) & ~standing, lacking


def _last(keep: NDArray[np.bool_], tracks: JoinedTracks) -> Ints:
    """Return (A,) the last kept sample of each track.

    If a track keeps none, it is the last one kept of the tracks before it. If these keep none either, it is the number
    of all samples, which is no index.
    """
    kept = np.flatnonzero(keep)
    ends = np.searchsorted(kept, tracks.starts[1:])
    last: Ints = np.append(kept, len(keep))[ends - 1]
    return last
