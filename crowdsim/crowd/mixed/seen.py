"""Captured agents as steered ones see them: position, velocity, intent, and reserved segments."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from crowdsim.constants import CAPTURE_RATE, STEERING_RATE
from crowdsim.crowd.state.components import BEND, QUARTERS, RADIUS, REST
from crowdsim.crowd.state.itineraries import Itineraries
from crowdsim.crowd.state.timelines import slot_of
from crowdsim.crowd.steered.components import standing_at
from crowdsim.crowd.steered.errands import Errands
from crowdsim.ecs.world import View
from crowdsim.geometry.elementary import cos, hypot, sin
from crowdsim.scenario.people.walkers import Walkers
from crowdsim.steering.guidance.guidance import PLAIN, Guidance
from crowdsim.steering.row_kernels import ROW
from crowdsim.steering.rules import Rules
from crowdsim.steering.stuck_kernels import LASTING, RANK_RANGE
from crowdsim.steering.ways import Others

TRACK_ROOM = 0.015
"""Enlargement of reserved discs for steered bodies [m], as tracks bend between two samples of a timeline. If a body is
farther off its straight motion, the straight pieces between its places after each quarter of the time are reserved,
too."""

PUSHES_AFTER = 2.5
"""Time for which a captured agent is refused before steered ones in its way step aside [s].

It is longer than IMPATIENCE_SECONDS of :mod:`crowdsim.crowd.systems.replan`, so that agents that look for a way around
others do not push: otherwise, agents that come out of a door would go back into it whenever others wait in front of
it."""

_PUSHING = LASTING + RANK_RANGE
"""Rank of an agent that pushes, to which the time for which it is refused is added; above the rank of any steered
agent."""


def seen(
    view: View,
    walks: NDArray[np.bool_],
    velocities: NDArray[np.float64],
    step: int,
    itineraries: Itineraries,
    errands: Errands,
    walkers: Walkers,
    guidance: Guidance,
    breadths: NDArray[np.float64],
) -> Others:
    """Return the captured agents of ``view`` as steered ones see them.

    Parameters
    ----------
    view : View
        The captured agents.
    walks : (m,) bool
        True for those on their way, False for those that stand at a place.
    velocities : (m, 2) float64
        Their velocities [m/s].
    step : int
        Present step.
    itineraries, errands, walkers : Itineraries, Errands, Walkers
        Progress, goals and personal values of all agents.
    guidance : Guidance
        Fields, which give their intents.
    breadths : (B, 2) float64
        Bodies by behavior [m]: see :attr:`crowdsim.crowd.state.assets.Assets.breadths`.
    """
    agents = view.agent.astype(np.int64)
    rows = np.zeros(len(agents), ROW)
    rows["x"], rows["y"], rows["heading"] = view.pose.T
    rows["hx"], rows["hy"] = cos(rows["heading"]), sin(rows["heading"])
    rows["vx"], rows["vy"] = velocities.T
    rows["radius"], rows["half"] = breadths[view.behavior].T
    reached = itineraries.reached[agents]
    rows["goal"] = np.where(walks, errands.goal(agents, reached), standing_at(errands.goal(agents, reached - 1)))
    rows["share"] = walkers.shares[agents]
    rows["id"] = agents
    rows["turn"] = rows["held"] = -1.0  # no section of a plan prescribes them
    # Guidance only says where they want to go: their motion leads them, even if there is no path for steering. Where
    # each would need a way of its own, the straight line to the goal says how far it is.
    goes = np.flatnonzero(rows["goal"] >= 0)
    alone = guidance.own[rows["goal"][goes]]
    guided = rows[goes[~alone]]
    guidance.write(guided, np.full(len(guided), PLAIN, np.int32), lead_out=False)
    rows[goes[~alone]] = guided
    lone = goes[alone]
    away = errands.middles[rows["goal"][lone]] - view.pose[lone, :2]
    rows["togo"][lone] = hypot(*away.T)
    pace = hypot(rows["vx"], rows["vy"])
    rows["speed"] = pace
    # Intent: the direction of guidance, as tracks sway; without guidance, that of the velocity, 0 if it is at rest.
    has_way = (rows["gx"] != 0.0) | (rows["gy"] != 0.0)
    length = np.where(pace > 0.0, pace, 1.0)
    rows["ix"] = np.where(has_way, rows["gx"], rows["vx"] / length)
    rows["iy"] = np.where(has_way, rows["gy"], rows["vy"] / length)
    for course, intent in (("cx", "ix"), ("cy", "iy"), ("ahead", "togo")):
        rows[course][lone] = rows[intent][lone]
    rows["key"] = rows["togo"] + Rules().identity * rows["share"]
    waited = np.where(view.blocked_since >= 0, step - view.blocked_since, 0) / STEERING_RATE
    rows["rank"] = np.where(waited > PUSHES_AFTER, _PUSHING + waited, 0.0)
    segments, owners = _reserved(view, step)
    return Others(rows, segments, owners)


def _reserved(view: View, step: int) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return the segments of reserved timelines from now on, with their discs, and the owner (row) of each.

    Segments are (s, 5): x, y of both ends and radius of the disc [m]; owners are (s,). A timeline has a segment for
    each piece from one sample to the next, one of length 0 at its end, and four more for each piece that bends.
    """
    timeline, bodies = view.timeline[..., :2], view.timeline[..., RADIUS:]
    last = timeline.shape[1] - 1
    first = np.clip(slot_of(step, CAPTURE_RATE // STEERING_RATE) - view.timeline_start, 0, last)
    begins, ends = timeline[:, :-1], timeline[:, 1:]
    ahead = np.arange(last) >= first[:, None]
    # Pieces from the one that holds the present on. Those of length 0 are left out: the ends of their neighbors, or the
    # rests below, take their place.
    pieces = ahead & (begins != ends).any(axis=2)
    walking, slots = np.nonzero(pieces)
    moving = np.concatenate([begins[walking, slots], ends[walking, slots]], axis=1)
    # The last position of each timeline is a segment of length 0, which may be all that is left of it.
    rests = np.concatenate([timeline[:, last], timeline[:, last]], axis=1)
    owners = np.concatenate([walking, np.arange(len(timeline))])
    # Discs that contain the capsules, on each piece as broad as at its broader end.
    discs = bodies[..., 0] + hypot(bodies[..., 1], bodies[..., 2])
    broader = np.maximum(discs[:, :-1], discs[:, 1:])[walking, slots]
    radii = np.concatenate([broader, discs[:, last]]) + TRACK_ROOM
    segments = np.column_stack([np.concatenate([moving, rests]), radii])
    bent = np.flatnonzero(view.timeline[walking, slots, BEND] > TRACK_ROOM)
    if not len(bent):
        return segments, owners
    # Points after each quarter of the time, (b, 5, 2) with both ends: QUARTERS tells how far they are off the straight
    # motion [m]. The body comes off the four pieces between them by up to REST [m], which enlarges their discs instead
    # of TRACK_ROOM.
    share = np.linspace(0.0, 1.0, 5)[:, None]
    points = (1.0 - share) * moving[bent, None, :2] + share * moving[bent, None, 2:]
    points[:, 1:-1] += view.timeline[walking, slots, QUARTERS:REST][bent].reshape(-1, 3, 2)
    wide = np.repeat(broader[bent] + view.timeline[walking, slots, REST][bent], 4)
    pieces = np.column_stack([points[:, :-1].reshape(-1, 2), points[:, 1:].reshape(-1, 2), wide])
    return np.concatenate([segments, pieces]), np.concatenate([owners, np.repeat(walking[bent], 4)])
