"""Moments at which playback changes from one level to the other: as both feet stand, so that each has a whole swing.

A foot that swings at a switch has only the rest of its swing to reach its place in the new motion. That place is far
away, as people brake when they begin to steer. But a body can be shown as steered along any captured track. So it is
shown as steered somewhat earlier than it was recorded, or for somewhat longer.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from crowdsim.motion.deformed.phase_kernels import BOTH_FEET
from crowdsim.recording.columns import RecordedTracks
from crowdsim.recording.levels import STEPS_AT_ONCE, levels_of
from crowdsim.recording.shown.steered_stretches import IN_STEP, played_phases
from crowdsim.recording.shown.switches import Switches

_EARLY, _EARLIEST = 0.4, 1.0
"""Least and most time by which a switch to steered is shown before the last captured step [s]."""
_LATEST = 0.6
"""Most time by which a switch to captured is shown after the first captured step [s]."""
_SHORT = 1.8
"""Captured time between two steered ones below which it is shown as steered [s]: both switches at one moment."""
_OFF = 0.25
"""Largest distance of a phase from the middle of the nearest time in which both feet stand [cycles]."""

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


def choose_moments(recording: RecordedTracks, switches: Switches) -> Switches:
    """Return the switches with better steps at which they are shown.

    Each is shown in the captured step whose phase is nearest to the middle of a double support. A switch to steered is
    shown less than _EARLY before the last captured step only if no earlier step can be taken. Switches around short
    steered times, and switches without a captured step to choose, keep their ``shown``.
    """
    count = len(switches.steps)
    if not count:
        return switches
    rate, steps, steered = recording.steps_per_second, switches.steps, switches.steered
    # Whether a switch is of the same agent as the one before it, and the steps of the switches before and after it.
    follows = np.append(False, switches.agents[1:] == switches.agents[:-1])
    before, after = np.append(0, steps[:-1]), np.append(steps[1:], 0)
    kept = _keep_their_step(switches, follows, rate)
    # First and last captured step in which each may be shown, of the captured time before a switch to steered or after
    # one to captured; and the last step in which it should be shown.
    low = np.where(steered, steps - 1 - round(_EARLIEST * rate), steps)
    low = np.maximum(low, np.where(follows, before, 0))
    high = np.where(steered, steps - 1, steps + round(_LATEST * rate))
    high = np.where(np.append(follows[1:], False), np.minimum(high, after - 1), high)
    late = np.where(steered, steps - 1 - round(_EARLY * rate), high)
    # A switch to captured that begins a short captured time may be shown in any of its steps.
    short = np.append(follows[1:], False) & ~steered & (after - steps < round(_SHORT * rate)) & ~kept
    high = np.where(short, after - 1, high)
    late = np.where(short, high, late)
    shown, found = switches.shown.copy(), np.zeros(count, np.bool_)
    for first in range(0, recording.steps, STEPS_AT_ONCE):
        mine = np.flatnonzero(~kept & (low >= first) & (low < first + STEPS_AT_ONCE))
        if not len(mine):
            continue
        at, played = _played_from(recording, switches.agents[mine], low[mine], first)
        inside = at <= high[mine, None]
        there = np.isfinite(played) | ~inside
        # Captured without a gap between each step and the switch: from ``low`` on for a switch to captured, up to
        # ``high`` for one to steered, and all the time for a short captured time.
        on, back = np.logical_and.accumulate(there, axis=1), np.logical_and.accumulate(there[:, ::-1], axis=1)[:, ::-1]
        there = np.where(steered[mine, None], back, np.where(short[mine, None], on[:, -1:], on))
        # Distance from the middle of the nearest double support, which comes every half cycle (2 * _OFF). Late steps
        # count as worse than any that is in time.
        off = np.abs(np.mod(played - 0.5 * BOTH_FEET + _OFF, 2.0 * _OFF) - _OFF)
        off = np.where(there & inside, off + np.where(at > late[mine, None], _OFF, 0.0), np.inf)
        best = np.argmin(off, axis=1)
        found[mine] = np.isfinite(off[np.arange(len(mine)), best])
        shown[mine] = np.where(found[mine], low[mine] + best, shown[mine])
    # Both switches of a short captured time at one moment: it is shown as steered throughout.
    both = np.flatnonzero(short & found)
    shown[both + 1] = shown[both]
    return switches._replace(shown=shown)


def _keep_their_step(switches: Switches, follows: NDArray[np.bool_], rate: int) -> NDArray[np.bool_]:
    """Return (S,) which switches are not moved: those around a steered time that is too short to come in step.

    follows: (S,) whether a switch is of the same agent as the one before it. rate: steps per second [1/s]. A gait comes
    in step during IN_STEP after a steered time begins, and again during IN_STEP before it ends. If one of the two
    switches around a short captured time is not moved, neither is the other, as both would be shown at one moment.
    """
    steps, steered = switches.steps, switches.steered
    close = np.flatnonzero(follows[1:] & steered[:-1] & (np.diff(steps) < round(2.0 * IN_STEP * rate)))
    kept = np.zeros(len(steps), np.bool_)
    kept[close] = kept[close + 1] = True
    pairs = np.flatnonzero(follows[1:] & ~steered[:-1] & (np.diff(steps) < round(_SHORT * rate)))
    kept[pairs] = kept[pairs + 1] = kept[pairs] | kept[pairs + 1]
    return kept


def _played_from(recording: RecordedTracks, agents: Ints, low: Ints, first: int) -> tuple[Ints, Floats]:
    """Return the steps (n, K) from ``low`` (n,) on, and the phases of ``agents`` (n,) in them [cycles].

    Phases are nan for agents that are not captured, and beyond the recording. All of ``low`` lie in the STEPS_AT_ONCE
    steps from ``first`` on. K is the largest number of steps to choose from.
    """
    count = round(max(_SHORT, _EARLIEST, _LATEST) * recording.steps_per_second) + 1
    rows = slice(first, min(first + STEPS_AT_ONCE + count, recording.steps))
    columns = slice(int(agents.min()), int(agents.max()) + 1)
    node = recording.node[rows, columns]
    levels = levels_of(recording.state[rows, columns], node, recording.phase[rows, columns])
    played = played_phases(recording, levels, node, recording.frame[rows, columns])
    at = low[:, None] + np.arange(count)
    phases = played[np.minimum(at - first, len(played) - 1), agents[:, None] - columns.start]
    return at, np.where(at < rows.stop, phases, np.nan)
