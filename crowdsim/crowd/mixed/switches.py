"""Changes of level: an agent's track continues, and no two bodies come into contact.

A captured agent owns a reserved timeline, the rest of which touches no steered body as that stands now. So a captured
agent may begin to steer if its body, as it stands now, touches no reserved timeline of others. A steered agent may
become captured if it can reserve a timeline from where it stands now.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from crowdsim.behaviors.entries import Entries, entry_origins, find_entries, find_exits, node_phases
from crowdsim.constants import CAPTURE_RATE, NONE, STEERING_RATE
from crowdsim.crowd.captured_crowd import CapturedCrowd
from crowdsim.crowd.mixed.aims import Aims
from crowdsim.crowd.mixed.levels import Levels
from crowdsim.crowd.state.motion_plan import MotionPlan
from crowdsim.crowd.state.timelines import FASTEST, SLOWEST, Playback
from crowdsim.crowd.steered.components import Errand
from crowdsim.crowd.steered.steered_crowd import SteeredCrowd
from crowdsim.crowd.systems.going_on import Walker
from crowdsim.ecs.world import View
from crowdsim.geometry.elementary import cos, hypot, sin
from crowdsim.motion.deformed.phase_kernels import set_anchors
from crowdsim.motion.graph.track_kernels import node_end
from crowdsim.recording.header import AgentState
from crowdsim.scenario.people.crowd_placement import BODY_DEPTH, BODY_RADIUS
from crowdsim.steering.row_kernels import ROW
from crowdsim.steering.steering import frame_of
from crowdsim.steering.ways import Others, clear_of, listed

CLEAR = 1e-3
"""Gap between a body that begins to steer and what others have reserved [m]."""

AT_LEAST = 2
"""Number of agents that may request captured motion in one step, however few agents there are."""

IN_STEP_WITHIN = 1.0
"""Time that an agent that is to steer waits for a frame in which its feet are as those of a steered agent; then it
steers anyway [s]."""

SHARE = 0.01
"""Share of all agents in the world that may request captured motion in one step, if that is more than AT_LEAST."""

PHASE_OFF = 0.02
"""Largest difference of phase at which a node is entered [cycles]."""

SPEED_OFF = 0.1
"""Largest difference of speed at which a node is entered [m/s]."""

TURNED_OFF = 0.15
"""Largest angle between heading and velocity at which a node is entered [rad]."""

WORTH = 2.5
"""Length of the way left to the goal above which captured motion is requested [m]."""

DAWDLES = (4.0, 0.5)
"""Period [s] and distance [m]: captured motion is taken only if in each such period it gets at least so far. Beside the
post of a door, it may turn on the spot for ten seconds."""

RETRY = 1.0
"""Least time between two requests of an agent for captured motion [s]."""

Ints = NDArray[np.int64]
"""Array of int64."""
Floats = NDArray[np.float64]
"""Array of float64."""


class _Asked(NamedTuple):
    """Search for the captured motion of a steered agent: number of the entry that it begins with, a row of Entries.

    ``origin`` (3,) is the track pose at which the node of that entry would have started: x, y [m], heading [rad].
    """

    entry: int
    origin: Floats


class Switches:
    """Move agents between the worlds of both levels."""

    def __init__(self, captured: CapturedCrowd, steered: SteeredCrowd, levels: Levels, aims: Aims) -> None:
        self._captured, self._steered, self._levels, self._aims = captured, steered, levels, aims
        behavior_set = steered.behavior_set
        self.phases = behavior_set.once("phases", lambda: node_phases(behavior_set))
        self.entries: Entries = behavior_set.once(
            "entries", lambda: find_entries(behavior_set, steered.gaits, self.phases)
        )
        # Entries of the last behavior, which is the preferred one.
        self._preferred = slice(int(self.entries.first[-2]), int(self.entries.first[-1]))
        self.natural_speed = float(self.entries.natural_speed[-1])
        captured.plans.paces.keep(captured.cast.speeds, self.natural_speed)
        self._exits = behavior_set.once("exits", lambda: find_exits(behavior_set, self.entries, self.phases))
        self._asked: dict[int, _Asked] = {}
        # (n,) last step in which each agent was captured and was not to steer.
        self._wanted_since = np.zeros(captured.count, np.int64)
        # (n,) step of the last request of each agent; at first one so long ago that it may request.
        self._tried = np.full(captured.count, -STEERING_RATE * 10, np.int64)
        self.counts = {"steered": 0, "captured": 0}
        """Number of changes so far to each level."""

    # From captured to steered

    def to_steered(self, view: View, wanted: NDArray[np.bool_], velocities: Floats, others: Others) -> int:
        """Let ``wanted`` (m,) captured rows steer from now on, if their feet allow it and it is safe.

        ``velocities`` (m, 2) are those of all m captured rows [m/s]; ``others`` are these rows as steered agents see
        them. Return how many begin to steer. They change over with the next ``apply_changes`` of both worlds, and drop
        their plans.
        """
        rows = self._in_step(view, wanted)
        if not len(rows):
            return 0
        bodies = self._bodies(view, rows, velocities)
        rows, bodies = self._safe(rows, bodies, len(view.agent), others)
        agents = view.agent[rows].astype(np.int64)
        captured, steered = self._captured, self._steered
        # The gait goes on in the phase of the captured pose, from where its rear foot stands, as if the body did not
        # turn (rate 0).
        node_rows = captured.assets.graph.node_track[view.node[rows]] + view.frame[rows]
        reached = captured.itineraries.reached[agents]
        goals = steered.errands.goal(agents, reached)
        bodies["goal"] = goals
        phases, anchors = self.phases[node_rows], view.pose[rows].copy()
        set_anchors(view.pose[rows], velocities[rows], np.zeros(len(rows)), phases, anchors)
        # Appear among the steered agents and disappear from the captured ones, with the next changes of both worlds.
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
        """Return the ``wanted`` (m,) rows whose feet are as a steered agent's, or that have waited IN_STEP_WITHIN."""
        step, agents = self._captured.step_count, view.agent.astype(np.int64)
        self._wanted_since[agents[~wanted]] = step
        frames = self._captured.assets.graph.node_track[view.node] + view.frame
        waited = step - self._wanted_since[agents] >= IN_STEP_WITHIN * STEERING_RATE
        return np.flatnonzero(wanted & (self._exits[frames] | waited))

    def _bodies(self, view: View, rows: Ints, velocities: Floats) -> NDArray[np.void]:
        """Return the records ROW (k,) of captured ``rows`` (k,) of ``view`` that begin to steer.

        ``velocities`` (m, 2) are those of all captured rows [m/s]. Half the core (``half``) is as long as at rest, but
        no body is broader than the smallest disc of its behavior on any layer.
        """
        cast, assets = self._steered.cast, self._captured.assets
        agents = view.agent[rows].astype(np.int64)
        bodies = np.zeros(len(rows), ROW)
        bodies["x"], bodies["y"], bodies["heading"] = view.pose[rows].T
        bodies["hx"], bodies["hy"] = cos(bodies["heading"]), sin(bodies["heading"])
        bodies["vx"], bodies["vy"] = velocities[rows].T
        bodies["radius"] = BODY_RADIUS
        bodies["rest"] = 0.5 * (cast.walkers.breadths[agents] - BODY_DEPTH)
        disc = assets.body_radii[view.behavior[rows]].min(axis=1)
        bodies["half"] = np.minimum(bodies["rest"], np.maximum(disc - bodies["radius"], 0.0))
        bodies["speed"] = cast.walkers.speeds[agents]
        bodies["share"] = cast.walkers.shares[agents]
        bodies["turn"] = bodies["held"] = -1.0
        bodies["id"] = agents
        return bodies

    def _safe(self, rows: Ints, bodies: NDArray[np.void], count: int, others: Others) -> tuple[Ints, NDArray[np.void]]:
        """Return those of captured ``rows`` (k,), and of their ``bodies``, that may steer without touching others.

        They may if they touch no reserved segment of a row that stays captured. ``count`` is the number of all captured
        rows, to which the segments of ``others`` belong; ``bodies`` (k,) are records ROW, one or more.
        """
        frame = frame_of(self._steered.place.bounds)
        ways = listed(others, frame, float((bodies["half"] + bodies["radius"]).max()) + CLEAR)
        # Timelines of rows that leave do not count. A row that has to stay keeps its timeline, which bodies of other
        # rows may touch in turn: repeat until no further row has to stay.
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
        """Let agents that have requested captured motion become captured, if it was found and they can reserve it.

        ``view`` is that of the steered agents. Requests hold for one step: agents that do not change over drop their
        plans and searches.
        """
        captured = self._captured
        asked, self._asked = self._asked, {}
        if not asked:
            return
        rows = {int(agent): row for row, agent in enumerate(view.agent.tolist()) if int(agent) in asked}
        for agent in sorted(asked):
            plan = captured.plans.motions.get(agent)
            found = agent in rows and plan is not None and leads_on(plan, captured.assets.graph.node_frames)
            if not found or not self._enter(view, rows[agent], agent, asked[agent]):
                captured.plans.forget(agent)

    def _enter(self, view: View, row: int, agent: int, asked: _Asked) -> bool:
        """Let a steered agent play the node of its entry and the plan behind it; return False if these are refused.

        On success the agent, ``row`` of ``view``, appears in the captured world at once, and leaves the steered one
        with its next ``apply_changes``.
        """
        captured, state = self._captured, view.row[row]
        node, frame = int(self.entries.node[asked.entry]), int(self.entries.frame[asked.entry])
        itineraries, assets = captured.itineraries, captured.assets
        place = np.array([state["x"], state["y"]])
        radius, stays = assets.personal_radius, bool(itineraries.cast.stays[agent])
        natural = Playback.natural(captured.step_count, assets.frames_per_step)
        # The node is played at the agent's present speed at first, then approaches its own rate.
        share = float(hypot(state["vx"], state["vy"]) / self.entries.speed[asked.entry])
        rate = round(min(max(share, SLOWEST), FASTEST) * natural.rate)
        playback = natural._replace(rate=rate, wanted=int(captured.plans.motions.table.rates[agent]))
        # Not in a row yet (NONE), and without a blend offset, as no node was played before.
        walker = Walker(NONE, agent, node, frame, playback, asked.origin, np.zeros(3), place, radius, stays)
        reserved = captured.choosing.reserving.reserve_entry(captured.world.view(), walker)
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
        # The next agent must see this reservation.
        captured.world.apply_changes()
        self._steered.world.remove(int(view.id[row]))
        self._changed(np.array([agent]), captured.step_count)
        self.counts["captured"] += 1
        return True

    def ask(self, view: View) -> None:
        """Request captured motion for some steered agents that have room, from their positions after the step.

        ``view`` is that of the steered agents. The free speed of agents that walk is set, too.
        """
        captured, levels = self._captured, self._levels
        step = captured.step_count
        agents = view.agent.astype(np.int64)
        state = view.row
        places = np.column_stack((state["x"], state["y"]))
        calm = levels.capture(agents, places, step) & (view.errand == Errand.WALKS) & (state["togo"] > WORTH)
        # An agent with room walks as fast as its captured motion, so that it can change over; others at their own pace.
        walks = view.errand == Errand.WALKS
        played = self._played(agents)
        state["speed"][walks] = np.where(calm, played, view.pace)[walks]
        speed = hypot(state["vx"], state["vy"])
        ahead = state["vx"] * state["hx"] + state["vy"] * state["hy"]
        straight = (np.abs(speed - played) < SPEED_OFF) & (ahead > cos(TURNED_OFF) * speed)
        rested = step - self._tried[agents] >= RETRY * STEERING_RATE
        # No section of its way prescribes that it faces off the way: ``turn`` is -1 if none does so, 0 for straight on.
        rows = np.flatnonzero(calm & straight & rested & (state["turn"] <= 0.0))
        most = max(AT_LEAST, int(SHARE * (len(agents) + captured.world.count)))
        # Agents whose last request is longest ago come first; of several, those with the lowest numbers.
        rows = rows[np.lexsort((agents[rows], self._tried[agents[rows]]))][:most]
        for row in rows.tolist():
            self._ask(view, row)

    def _played(self, agents: Ints | int) -> Floats:
        """Return the speeds at which agents (k,), or one, walk captured while nothing is in the way [m/s]."""
        speeds = self._captured.plans.paces.speeds[agents]
        return np.asarray(np.where(np.isnan(speeds), self.natural_speed, speeds))

    def _ask(self, view: View, row: int) -> None:
        """Request captured motion for a row from the entry of nearest speed whose phase fits; none if no entry fits.

        Only entries of the preferred behavior count, within PHASE_OFF and SPEED_OFF.
        """
        captured, state = self._captured, view.row[row]
        agent = int(view.agent[row])
        self._tried[agent] = captured.step_count
        # Difference of phase on the circle, and of the speed at which the entry would be played.
        off = np.abs(self.entries.phase[self._preferred] - view.phase[row] % 1.0)
        off = np.minimum(off, 1.0 - off)
        pace = float(hypot(state["vx"], state["vy"]))
        share = float(self._played(agent)) / self.natural_speed
        wrong = np.abs(share * self.entries.speed[self._preferred] - pace)
        fits = np.flatnonzero((off < PHASE_OFF) & (wrong < SPEED_OFF))
        if not len(fits):
            return
        entry = int(fits[np.argmin(wrong[fits])]) + self._preferred.start
        pose = np.array([state["x"], state["y"], state["heading"]])
        origin = entry_origins(self.entries, np.array([entry]), pose[None])[0]
        # The search continues from the end of that node.
        node = int(self.entries.node[entry])
        end = np.array(node_end(captured.assets.graph, node, *origin)[:2])
        itineraries = captured.itineraries
        itineraries.reached[agent] = view.reached[row]
        # An agent that is not to stand in the region of its goal need not go to its spot there: see Aims.
        if not itineraries.stands(agent):
            aim = self._aims.place(int(view.goal[row]), int(view.following[row]), pose[:2])
            if aim is not None:
                itineraries.aim(agent, aim)
        captured.plans.request(agent, itineraries.request(agent, end, departure=(node, origin)), walks=True)
        self._asked[agent] = _Asked(entry, origin)

    def _changed(self, agents: Ints, step: int) -> None:
        """Note that agents (k,) change their level in this step."""
        self._levels.changed[agents] = step


def leads_on(plan: MotionPlan, node_frames: NDArray[np.int32]) -> bool:
    """Return True if the motion of a plan never stays in one place for long (DAWDLES).

    ``node_frames`` (nodes,) are the lengths of all nodes of the motion graph [frames].
    """
    seconds, way = DAWDLES
    begins = np.append(0, np.cumsum(node_frames[plan.nodes]))[:-1]
    # For each node, the first one that begins ``seconds`` or more later. Nodes without one in the plan are left out.
    later = np.searchsorted(begins, begins + seconds * CAPTURE_RATE)
    earlier = np.flatnonzero(later < plan.count)
    gone = plan.origins[later[earlier], :2] - plan.origins[earlier, :2]
    return bool((hypot(*gone.T) >= way).all())
