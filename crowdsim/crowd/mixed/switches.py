"""Characters go over from one level to the other, where their track goes on and nobody comes to touch anybody.

Who is captured owns a reserved timeline; from now on it touches no steered body as that stands. So a captured character
may steer if its body, where it is now, touches no other reserved timeline; and a steered one may become captured if a
timeline can be reserved from there.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from crowdsim.behaviors.entries import Entries, entry_origins, find_entries, find_exits, node_phases
from crowdsim.constants import NONE, STEERING_RATE
from crowdsim.crowd.captured_crowd import CapturedCrowd
from crowdsim.crowd.mixed.levels import Levels
from crowdsim.crowd.state.timelines import FASTEST, SLOWEST, Playback
from crowdsim.crowd.steered.components import Errand
from crowdsim.crowd.steered.steered_crowd import SteeredCrowd
from crowdsim.crowd.systems.going_on import Walker
from crowdsim.ecs.world import View
from crowdsim.geometry.elementary import cos, hypot, sin
from crowdsim.motion.deformed.phase_kernels import set_anchors
from crowdsim.motion.graph.track_kernels import node_end
from crowdsim.recording.header import AgentState
from crowdsim.scenario.crowd_placement import BODY_DEPTH
from crowdsim.steering.row_kernels import ROW
from crowdsim.steering.steering import frame_of
from crowdsim.steering.ways import Others, clear_of, listed

CLEAR = 1e-3
"""Room between a body that begins to steer and what others have reserved [m]."""

AT_LEAST = 2
"""Characters that may ask for captured motion in one step, however few there are."""

IN_STEP_WITHIN = 1.0
"""Time within which who wants to steer comes to a frame in which its feet are where steered ones stand, or does without
[s]."""

SHARE = 0.01
"""The same as a share of all who are in the world."""

PHASE_OFF = 0.02
"""Difference of phase at which a node is entered, at most [cycles]."""

SPEED_OFF = 0.1
"""Difference of speed, at most [m/s]."""

TURNED_OFF = 0.15
"""Angle between where a body faces and where it goes at which it may enter a node, at most [rad]."""

WORTH = 2.5
"""Way to go from which on captured motion is worth its search [m]."""

RETRY = 1.0
"""Time after a search in vain until the next one [s]."""

Ints = NDArray[np.int64]
Floats = NDArray[np.float64]


class _Asked(NamedTuple):
    """A search for the captured motion of a steered character: the entry it begins with, and the origin of its node."""

    entry: int
    origin: Floats


class Switches:
    """Moves characters between the worlds of both levels.

    counts: how many steered and became captured so far.
    """

    def __init__(self, captured: CapturedCrowd, steered: SteeredCrowd, levels: Levels) -> None:
        self._captured, self._steered, self._levels = captured, steered, levels
        behavior_set = steered.behavior_set
        self.phases = node_phases(behavior_set)
        self.entries: Entries = find_entries(behavior_set, steered.gaits, self.phases)
        self._preferred = slice(int(self.entries.first[-2]), int(self.entries.first[-1]))
        self.natural_speed = float(self.entries.natural_speed[-1])
        captured.plans.paces.keep(captured.cast.speeds, self.natural_speed)
        self._played = np.nan_to_num(captured.plans.paces.speeds, nan=self.natural_speed)
        self._exits = find_exits(behavior_set, self.entries, self.phases)
        self._asked: dict[int, _Asked] = {}
        self._wanted_since = np.zeros(captured.count, np.int64)
        self._tried = np.full(captured.count, -STEERING_RATE * 10, np.int64)
        self.counts = {"steered": 0, "captured": 0}

    # From captured to steered

    def to_steered(self, view: View, wanted: NDArray[np.bool_], velocities: Floats, others: Others) -> int:
        """Let those captured rows that are ``wanted`` steer from now on, as far as it is safe; returns how many do.

        ``velocities``: (m, 2) of the rows [m/s]; ``others``: the rows as steered ones see them.
        """
        rows = self._in_step(view, wanted)
        if not len(rows):
            return 0
        bodies = self._bodies(view, rows, velocities)
        rows, bodies = self._safe(rows, bodies, len(view.agent), others)
        agents = view.agent[rows].astype(np.int64)
        captured, steered = self._captured, self._steered
        node_rows = captured.assets.graph.node_track[view.node[rows]] + view.frame[rows]
        reached = captured.itineraries.reached[agents]
        goals = steered.errands.goal(agents, reached)
        bodies["goal"] = goals
        phases, anchors = self.phases[node_rows], view.pose[rows].copy()
        set_anchors(view.pose[rows], velocities[rows], np.zeros(len(rows)), phases, anchors)
        steered.world.spawn_many(
            len(rows),
            agent=agents,
            state=AgentState.MOVING,
            behavior=view.behavior[rows],
            row=bodies,
            errand=Errand.WALKS,
            goal=goals,
            reached=reached,
            go_step=captured.step_count,
            pace=steered.cast.walkers.speeds[agents],
            phase=phases,
            anchor=anchors,
        )
        steered.errands.count_visits(captured.itineraries.reached)
        captured.world.remove(*view.id[rows].tolist())
        for agent in agents.tolist():
            captured.plans.forget(agent)
        self._changed(agents, captured.step_count)
        self.counts["steered"] += len(rows)
        return len(rows)

    def _in_step(self, view: View, wanted: NDArray[np.bool_]) -> Ints:
        """Those of ``wanted`` rows whose feet are where steered ones stand, or who have waited for that long enough."""
        step, agents = self._captured.step_count, view.agent.astype(np.int64)
        self._wanted_since[agents[~wanted]] = step
        frames = self._captured.assets.graph.node_track[view.node] + view.frame
        waited = step - self._wanted_since[agents] >= IN_STEP_WITHIN * STEERING_RATE
        return np.flatnonzero(wanted & (self._exits[frames] | waited))

    def _bodies(self, view: View, rows: Ints, velocities: Floats) -> NDArray[np.void]:
        """Records (ROW) of captured rows as they begin to steer: no body reaches beyond the disc that it had."""
        cast, assets = self._steered.cast, self._captured.assets
        agents = view.agent[rows].astype(np.int64)
        bodies = np.zeros(len(rows), ROW)
        bodies["x"], bodies["y"], bodies["heading"] = view.pose[rows].T
        bodies["hx"], bodies["hy"] = cos(bodies["heading"]), sin(bodies["heading"])
        bodies["vx"], bodies["vy"] = velocities[rows].T
        bodies["radius"] = 0.5 * BODY_DEPTH
        bodies["rest"] = 0.5 * (cast.walkers.breadths[agents] - BODY_DEPTH)
        disc = assets.body_radii[view.behavior[rows]].min(axis=1)
        bodies["half"] = np.minimum(bodies["rest"], np.maximum(disc - bodies["radius"], 0.0))
        bodies["speed"] = cast.walkers.speeds[agents]
        bodies["share"] = cast.walkers.shares[agents]
        bodies["turn"] = bodies["held"] = -1.0
        bodies["id"] = agents
        return bodies

    def _safe(self, rows: Ints, bodies: NDArray[np.void], count: int, others: Others) -> tuple[Ints, NDArray[np.void]]:
        """Those of some captured rows that touch what nobody else has reserved who stays captured."""
        frame = frame_of(self._steered.place.bounds)
        ways = listed(others, frame, float((bodies["half"] + bodies["radius"]).max()) + CLEAR)
        # Who has to stay keeps its timeline, which others may touch.
        while len(rows):
            leaves = np.zeros(count, np.bool_)
            leaves[rows] = True
            clear = clear_of(ways, frame, bodies, CLEAR, rows, leaves)
            if clear.all():
                break
            rows, bodies = rows[clear], bodies[clear]
        return rows, bodies

    # From steered to captured

    def to_captured(self, view: View) -> None:
        """Let those go over whose search has found a motion from where they are, if they can reserve its beginning."""
        captured = self._captured
        asked, self._asked = self._asked, {}
        if not asked:
            return
        rows = {int(agent): row for row, agent in enumerate(view.agent.tolist()) if int(agent) in asked}
        for agent in sorted(asked):
            plan = captured.plans.motions.get(agent)
            entry = asked[agent]
            if agent in rows and plan is not None and self._enter(view, rows[agent], agent, entry):
                continue
            captured.plans.forget(agent)

    def _enter(self, view: View, row: int, agent: int, asked: _Asked) -> bool:
        """Let a steered character play the node that its search begins with, if that can be reserved."""
        captured, state = self._captured, view.row[row]
        node, frame = int(self.entries.node[asked.entry]), int(self.entries.frame[asked.entry])
        itineraries, assets = captured.itineraries, captured.assets
        place = np.array([state["x"], state["y"]])
        radius, stays = assets.personal_radius, bool(captured.cast.stays[agent])
        natural = Playback.natural(captured.step_count, assets.frames_per_step)
        # The node begins exactly as fast as the character is, and goes over to its own rate.
        share = float(hypot(state["vx"], state["vy"]) / self.entries.speed[asked.entry])
        rate = round(min(max(share, SLOWEST), FASTEST) * natural.rate)
        playback = natural._replace(rate=rate, wanted=int(captured.plans.motions.table.rates[agent]))
        walker = Walker(NONE, agent, node, frame, playback, asked.origin, np.zeros(3), place, radius, stays)
        reserved = captured.choosing.reserve_entry(captured.world.view(), walker)
        if reserved is None:
            return False
        itineraries.reached[agent] = view.reached[row]
        plan = captured.plans.motions[agent]
        captured.world.spawn(
            agent=agent,
            state=AgentState.MOVING,
            pose=np.array([state["x"], state["y"], state["heading"]]),
            behavior=assets.graph.node_behavior[node],
            node=node,
            frame=frame,
            origin=asked.origin,
            plan_digest=plan.digest,
            body_radius=radius,
            goal=itineraries.goal(agent),
            rank=captured.plans.rank(agent),
            turn=captured.plans.rank(agent),
            stays=stays,
            awaiting_plan=captured.searches.is_under_way(agent),
            **reserved,
        )
        # The next one reserves beside it.
        captured.world.apply_changes()
        self._steered.world.remove(int(view.id[row]))
        self._changed(np.array([agent]), captured.step_count)
        self.counts["captured"] += 1
        return True

    def ask(self, view: View) -> None:
        """Ask for captured motion for some steered characters that have room, from where the step has brought them."""
        captured, levels = self._captured, self._levels
        step = captured.step_count
        agents = view.agent.astype(np.int64)
        state = view.row
        places = np.column_stack((state["x"], state["y"]))
        calm = levels.capture(agents, places, step) & (view.errand == Errand.WALKS) & (state["togo"] > WORTH)
        # Who has room walks as fast as its captured motion does, so that it can go over.
        walks = view.errand == Errand.WALKS
        played = self._played[agents]
        state["speed"][walks] = np.where(calm, played, view.pace)[walks]
        speed = hypot(state["vx"], state["vy"])
        ahead = state["vx"] * state["hx"] + state["vy"] * state["hy"]
        straight = (np.abs(speed - played) < SPEED_OFF) & (ahead > cos(TURNED_OFF) * speed)
        rested = step - self._tried[agents] >= RETRY * STEERING_RATE
        rows = np.flatnonzero(calm & straight & rested & (state["turn"] <= 0.0))
        most = max(AT_LEAST, int(SHARE * (len(agents) + captured.world.count)))
        # Those first who have waited longest.
        rows = rows[np.lexsort((agents[rows], self._tried[agents[rows]]))][:most]
        for row in rows.tolist():
            self._ask(view, row)

    def _ask(self, view: View, row: int) -> None:
        captured, state = self._captured, view.row[row]
        agent = int(view.agent[row])
        self._tried[agent] = captured.step_count
        off = np.abs(self.entries.phase[self._preferred] - view.phase[row] % 1.0)
        off = np.minimum(off, 1.0 - off)
        pace = float(hypot(state["vx"], state["vy"]))
        share = self._played[agent] / self.natural_speed
        wrong = np.abs(share * self.entries.speed[self._preferred] - pace)
        fits = np.flatnonzero((off < PHASE_OFF) & (wrong < SPEED_OFF))
        if not len(fits):
            return
        entry = int(fits[np.argmin(wrong[fits])]) + self._preferred.start
        pose = np.array([state["x"], state["y"], state["heading"]])
        origin = entry_origins(self.entries, np.array([entry]), pose[None])[0]
        node = int(self.entries.node[entry])
        end = np.array(node_end(captured.assets.graph, node, *origin)[:2])
        itineraries = captured.itineraries
        itineraries.reached[agent] = view.reached[row]
        captured.plans.request(agent, itineraries.request(agent, end, departure=(node, origin)), walks=True)
        self._asked[agent] = _Asked(entry, origin)

    def _changed(self, agents: Ints, step: int) -> None:
        self._levels.changed[agents] = step
