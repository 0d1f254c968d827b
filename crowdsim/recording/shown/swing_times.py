"""Times at which planted feet lift and land after a switch, so that offsets vanish during swings."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from crowdsim.motion.deformed.phase_kernels import STANCE
from crowdsim.recording.columns import RecordedTracks
from crowdsim.recording.levels import Level, levels_of
from crowdsim.recording.shown.steered_stretches import played_phases, read_stretches
from crowdsim.recording.shown.switch_offsets import FADE
from crowdsim.recording.shown.switches import Switches

_SHORTEST_SWING = 0.12
"""Least time left until landing for a foot to lose its offset in this swing [s]; else it waits for the next one."""
_USUAL_SWING = 0.4
"""Duration of a swing whose end is not recorded [s]."""
_STANDS = (4.0, 5.0)
"""Times after a switch at which the left and the right foot take a small step if the body still stands [s]."""
_LITTLE_STEP = 0.5
"""Duration of such a small step [s]."""
LONGEST = max(_STANDS) + _LITTLE_STEP
"""Time after a switch by which both feet have lost their offset in any case [s]."""

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_STANDING, _LATE, _SWINGING, _DONE = 0, 1, 2, 3
"""States of a foot after a switch: planted with its offset; in a swing that began before the switch; in a swing that
removes the offset; without offset."""


class SwingTimes(NamedTuple):
    """Times in the recording of both feet, left first, after n switches.

    Attributes
    ----------
    hold : (n, 2) float64
        Time until which each foot keeps its offset [s].
    end : (n, 2) float64
        Time at which the offset has vanished [s].
    forced : (n, 2) bool
        Whether it vanishes in a small step that is added, because the recorded foot does not lift before.
    cut : (n,) float64
        Time at which the agent disappears [s]; infinite if it stays.
    """

    hold: Floats
    end: Floats
    forced: NDArray[np.bool_]
    cut: Floats


def swing_times_after(recording: RecordedTracks, switches: Switches, some: Ints) -> SwingTimes:
    """Return the times of the feet after the switches ``some`` (n,), rows of ``switches``, at least one."""
    rate = recording.steps_per_second
    # Follow each foot through its states, row by row; rows are steps from the switch on. At first, all feet are held
    # until they take a small step.
    shares, same, gone = _foot_phases(recording, switches, some)
    times = switches.shown[some] / rate
    standing = shares < STANCE
    state = np.where(standing[0], _STANDING, _LATE)
    hold = np.stack([times + seconds for seconds in _STANDS], axis=1)
    end = hold + _LITTLE_STEP
    for row in range(len(shares) - 1):
        known = (same[row] & same[row + 1])[:, None]
        ahead = np.mod(shares[row + 1] - shares[row], 1.0)
        now = (times + row / rate)[:, None]
        lifts = known & standing[row] & ~standing[row + 1]
        lands = known & ~standing[row] & standing[row + 1]
        # Part of the step after which it lifts (phase STANCE) or lands (phase 1), and the time of that.
        part = np.clip(np.where(lifts, STANCE - shares[row], 1.0 - shares[row]) / np.maximum(ahead, 1e-9), 0.0, 1.0)
        at = now + part / rate
        # A planted foot lifts before its small step: its offset vanishes until it lands, or over a usual swing if the
        # landing is not recorded.
        begins = lifts & (state == _STANDING) & (at < hold)
        hold, end = np.where(begins, at, hold), np.where(begins, at + _USUAL_SWING, end)
        # A foot that was swinging at the switch lands: use the rest of that swing if it is long enough.
        in_time = lands & (state == _LATE) & (at - times[:, None] >= _SHORTEST_SWING)
        hold = np.where(in_time, times[:, None], hold)
        end = np.where(in_time, np.minimum(at, times[:, None] + FADE), end)
        # A foot lands whose offset vanishes in this swing: the swing ends. It takes _SHORTEST_SWING at least, as the
        # phase may have jumped over the swing.
        landed = lands & (state == _SWINGING)
        end = np.where(landed, np.maximum(at, hold + _SHORTEST_SWING), end)
        state = np.where(begins, _SWINGING, np.where(in_time | landed, _DONE, state))
        # A late foot that lands too soon keeps its offset and waits for the next swing.
        state = np.where(lands & (state == _LATE), _STANDING, state)
    # Feet that swing at the switch, and whose landing is not recorded, lose their offset with the rest of the body.
    late = state == _LATE
    hold, end = np.where(late, times[:, None], hold), np.where(late, times[:, None] + FADE, end)
    cut = np.where(gone.any(axis=0), times + np.argmax(gone, axis=0) / rate, np.inf)
    return SwingTimes(hold, end, state == _STANDING, cut)


def _foot_phases(
    recording: RecordedTracks, switches: Switches, some: Ints
) -> tuple[Floats, NDArray[np.bool_], NDArray[np.bool_]]:
    """Return the phase (T, n, 2) of each foot in its own cycle, 0 when it lands, in the T steps from each switch on.

    Phases are in [0, 1) cycles. The switches are ``some`` (n,), rows of ``switches``. Also return (T, n) bool: whether
    the agent has stayed on the new level up to each step, and whether it is absent in it. From the step on in which it
    has left that level, or beyond the end of the recording, phases are 0 (left) and 0.5 (right).
    """
    rate = recording.steps_per_second
    shown, agents, steered = switches.shown[some], switches.agents[some], switches.steered[some]
    count = int(np.ceil(LONGEST * rate)) + 1
    rows = slice(int(shown.min()), min(int(shown.max()) + count + 1, recording.steps))
    columns = slice(int(agents.min()), int(agents.max()) + 1)
    stretches = read_stretches(recording, rows, columns, np.arange(columns.stop - columns.start))
    phase, node = recording.phase[rows, columns], recording.node[rows, columns]
    levels = levels_of(recording.state[rows, columns], node, phase)
    played = played_phases(recording, levels, node, recording.frame[rows, columns])
    # Levels as playback shows them.
    for row in range(len(levels)):
        steered_too = recording.switches.steer_in_playback(row + rows.start)
        steered_too = steered_too[(steered_too >= columns.start) & (steered_too < columns.stop)]
        levels[row, steered_too - columns.start] = Level.STEERED
    at = shown - rows.start + np.arange(count)[:, None]
    inside = at < len(played)
    at, column = np.minimum(at, len(played) - 1), agents - columns.start
    level, own = levels[at, column], played[at, column]
    # For steered agents take the phases that are shown, which were adapted to the nodes before: those of the stretch
    # that is shown from the step of the switch on.
    key = stretches.columns * len(played) + stretches.firsts
    found = np.searchsorted(key, column[steered] * len(played) + at[0, steered])
    own[:, steered] = stretches.phases_at(found, np.minimum(at[:, steered], stretches.stops[found] - 1))
    same = inside & (level == np.where(steered, Level.STEERED, Level.CAPTURED))
    same = np.logical_and.accumulate(same, axis=0)
    # The right foot is half a cycle behind the left one.
    shares = np.mod(np.where(same, own, 0.0)[..., None] - np.array([0.0, 0.5]), 1.0)
    return shares, same, level == Level.NOBODY
