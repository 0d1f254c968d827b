"""Switches between levels as playback shows them: jumps of joints, slip of planted feet, changes of speed."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from crowdsim.bench.registry import Measurement
from crowdsim.crowd.simulation import Simulation
from crowdsim.recording.reader import Recording
from crowdsim.scenario.loader import load_scenario

RUNS = (*(("plaza", seed) for seed in range(1, 6)), *(("crossing", seed) for seed in range(1, 4)))
"""Scenarios with seeds."""

LATER = 0.5
"""Time after a switch over which it is measured [s]."""

MOST_JUMP, MOST_SLIP, MOST_SPEED = 0.03, 0.01, 0.1
"""Bars: motion of a joint in FRAME beyond that of both levels [m], slip of a planted foot [m], change of the track's
velocity from one FRAME to the next beyond that of both levels [m/s]. The vertical velocity has no bar of
its own: switches beyond that of the track are counted."""

FRAME = 1.0 / 30.0
"""Time between two pictures [s]."""

_DOWN = 0.005
"""Height of the ball of a foot above its lowest place below which it is planted [m]."""
_STILL = 0.2
"""Speed of the ball of a foot up to which it is planted [m/s]: those that land or lift are faster."""
_BEFORE = 2
"""Pictures before a switch: two motions between three pictures make a change of speed."""

Floats = NDArray[np.float64]


def switch_rows(recording: Recording) -> list[dict[str, float]]:
    """Return the figures of each switch, except those that are not seen or cannot be measured for LATER seconds.

    Left out are switches that are taken back at the same moment, that their agent follows by another one within LATER,
    or around which the agent is absent or the recording begins or ends. ``steered`` is 1 for a switch to steered, else
    0. ``jump`` [m], ``speed`` and ``lift`` [m/s] are those of :func:`beyond_levels`. ``slip`` [m] is the way of a foot
    that the new level has planted, ``own`` [m] that of the same foot on the new level alone.
    """
    found, rate, roles = recording.switches, recording.steps_per_second, recording.header.motion.skeleton.roles
    toes, rows = [roles["left_toe"], roles["right_toe"]], []
    for number, (agent, shown, steered) in enumerate(
        zip(found.agents.tolist(), found.shown.tolist(), found.steered.tolist(), strict=True)
    ):
        time = shown / rate
        if number and found.agents[number - 1] == agent and found.shown[number - 1] == shown:
            continue  # It takes back the one before it at the same moment: the level that is shown stays as it is.
        followed = number + 1 < len(found.agents) and found.agents[number + 1] == agent
        # The agent must be there from shortly before to shortly after what is measured.
        first, last = shown - 2, shown + round((LATER + 0.1) * rate)
        if first < 0 or last >= recording.steps or np.isnan(recording.x[first : last + 1, agent]).any():
            continue
        if followed and found.shown[number + 1] < shown + LATER * rate:
            continue
        times = time + np.arange(-_BEFORE, round(LATER / FRAME) + 1) * FRAME
        bodies, plain = (_joints(recording, times, agent, blended) for blended in (True, False))
        after, alone = bodies[_BEFORE:, toes], plain[_BEFORE:, toes]
        planted = planted_feet(alone)
        jump, speed, lift = beyond_levels(bodies, plain)
        rows.append(
            {
                "steered": float(steered),
                "jump": jump,
                "speed": speed,
                "lift": lift,
                "slip": largest_slip(after, planted),
                "own": largest_slip(alone, planted),
            }
        )
    return rows


def _joints(recording: Recording, times: Floats, agent: int, blended: bool) -> Floats:
    """Return the joints (T, J, 3) [m] of an agent at ``times`` (T,) [s], ``blended`` after a switch or not."""
    return np.array([recording.poses_at(float(time), [agent], blended)[0][0] for time in times], np.float64)


def beyond_levels(shown: Floats, plain: Floats) -> tuple[float, float, float]:
    """Return the largest motion of a joint in a FRAME [m], and change of the root's velocity between two FRAMEs [m/s].

    The change is given twice: along the floor, as that of the track, and along the vertical. Motions and changes that
    the levels have themselves do not count. So each of the three figures is a distance: that of the value shown from
    the segment between the old level's value just before the switch and the new level's value at the same time.
    ``shown`` and ``plain`` (T, J, 3) are joints with and without the blend [m], the root first, the switch at row
    _BEFORE.
    """
    # Row k is the motion from picture k to k + 1, so row _BEFORE - 1 is the last one before the switch.
    moved, own = np.diff(shown, axis=0), np.diff(plain, axis=0)
    jump = _beyond(moved[_BEFORE - 1], moved[_BEFORE:], own[_BEFORE:])
    changed, alone = np.diff(moved[:, 0], axis=0), np.diff(own[:, 0], axis=0)
    # The first change that the new level knows is that after its first motion.
    alone[_BEFORE - 1] = alone[_BEFORE]
    track, vertical = (
        _beyond(changed[_BEFORE - 2, axes], changed[_BEFORE - 1 :, axes], alone[_BEFORE - 1 :, axes]).max() / FRAME
        for axes in (slice(2), slice(2, 3))
    )
    return float(jump.max()), float(track), float(vertical)


def _beyond(old: Floats, values: Floats, new: Floats) -> Floats:
    """Return the distance (T, ...) of ``values`` (T, ..., 3) from the segments from ``old`` (..., 3) to ``new``.

    ``new`` has the shape of ``values``.
    """
    values, new = values - old, new - old
    share = np.sum(values * new, axis=-1) / np.maximum(np.sum(new * new, axis=-1), 1e-12)
    away: Floats = np.linalg.norm(values - np.clip(share, 0.0, 1.0)[..., None] * new, axis=-1)
    return away


def planted_feet(balls: Floats) -> NDArray[np.bool_]:
    """Return which balls of the feet (T, 2, 3) [m] are down and still, (T, 2), in pictures FRAME apart."""
    down = balls[..., 2] < balls[..., 2].min(axis=0) + _DOWN
    still = np.linalg.norm(np.diff(balls[..., :2], axis=0), axis=-1) < _STILL * FRAME
    planted = still & down[1:] & down[:-1]
    # The first picture is like the motion that follows it.
    return np.concatenate([planted[:1], planted])


def largest_slip(balls: Floats, planted: NDArray[np.bool_]) -> float:
    """Return how far a ball of the feet (T, 2, 3) goes from where it came down while it is ``planted`` (T, 2) [m]."""
    farthest = 0.0
    for foot in range(balls.shape[1]):
        since = None
        for place, down in zip(balls[:, foot, :2], planted[:, foot], strict=True):
            since = (place if since is None else since) if down else None
            if since is not None:
                farthest = max(farthest, float(np.linalg.norm(place - since)))
    return farthest


def run_rows(name: str, seed: int) -> list[dict[str, Any]]:
    """Return two rows for a scenario with a seed: the figures of all switches to steered, and of those to captured.

    Figures are nan if there is no such switch; ``over`` counts switches beyond the bar.
    """
    scenario = load_scenario(name, (f"seed={seed}",))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "switches.h5"
        with Simulation(scenario, workers=1) as simulation:
            simulation.run(path)
        with Recording.open(path) as recording:
            switches = switch_rows(recording)
    rows: list[dict[str, Any]] = []
    for steered, to in ((1.0, "steered"), (0.0, "captured")):
        mine = [switch for switch in switches if switch["steered"] == steered]
        row: dict[str, Any] = {"scenario": name, "seed": seed, "to": to, "switches": len(mine)}
        for key, bar in (
            ("jump", MOST_JUMP),
            ("speed", MOST_SPEED),
            ("lift", MOST_SPEED),
            ("slip", MOST_SLIP),
            ("own", MOST_SLIP),
        ):
            values = np.array([switch[key] for switch in mine] or [np.nan])
            parts = (("median", 0.5), ("p90", 0.9), ("worst", 1.0))
            row.update({f"{key}_{part}": round(float(np.quantile(values, share)), 4) for part, share in parts})
            row[f"{key}_over"] = int((values > bar).sum())
        rows.append(row)
    return rows


def measure(runs: Sequence[tuple[str, int]] = RUNS) -> Measurement:
    """Measure the switches of all runs."""
    rows = [row for name, seed in runs for row in run_rows(name, seed)]
    figures = {
        f"{row['scenario']}_{row['seed']}_{row['to']}_{key}": float(value)
        for row in rows
        for key, value in row.items()
        if key not in ("scenario", "seed", "to")
    }
    return Measurement(rows, figures)
