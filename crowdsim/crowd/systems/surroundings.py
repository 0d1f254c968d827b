"""What captured agents keep clear of: walls, movables about to appear, bodies, ways, passages; and neighbors."""

from __future__ import annotations

import numpy as np
import shapely
from numpy.typing import NDArray

from crowdsim.constants import NONE
from crowdsim.crowd.near.neighbors import Neighbors
from crowdsim.crowd.search.plans import Plans
from crowdsim.crowd.state.timelines import NO_BODIES, Obstacles, Playback, StandingBodies, Timelines, slot_of
from crowdsim.crowd.systems.apply_events import KEPT_OFF, reserved_lines
from crowdsim.crowd.systems.going_on import Scratch, Walker
from crowdsim.crowd.systems.reserving_kernels import WAY_ROOM
from crowdsim.ecs.world import View
from crowdsim.environment.layers import polygons_only
from crowdsim.navmesh.mesh.address_kernels import layers_of

PASSAGE_BODIES = 3.0
"""Distance from a narrow passage at which an agent may stop, in radii of its body."""

_NOTHING = np.empty((0, 4))


class Surroundings:
    """What the rows of a step keep clear of."""

    def __init__(self, plans: Plans) -> None:
        self.plans = plans
        self.bodies: StandingBodies = NO_BODIES
        """Bodies of steered agents, which stand still as far as reservations know."""
        self._near: tuple[View, Neighbors] | None = None
        # For a view and bodies: distinct goals of the agents in the world, captured or steered (NONE for agents with
        # several goals), and the number of these agents.
        self._present: tuple[View, StandingBodies, NDArray[np.int64], int] | None = None
        # Revision of the environment and goal for which passages at the goal were found last, and these passages.
        self._at_goal: tuple[int, int, NDArray[np.float64]] = NONE, NONE, _NOTHING

    def begin(self) -> None:
        """Begin a step: forget what was found for the rows of the last one, which have moved since."""
        self._near = self._present = None

    def obstacles(self, view: View, walker: Walker) -> Obstacles:
        """Return what a walker keeps clear of besides other captured agents."""
        return self._obstacles(view, walker, self._kept_free(view, walker))

    def of_any(self, view: View, playback: Playback) -> Obstacles:
        """Return the obstacles from which kernels derive those of each row (`obstacles_of`).

        They are those of a body with a radius of 1 m, so that distances are in radii of the row's body. Outlines of
        movables about to appear are left out.
        """
        # In the world (row 0, not NONE); no steered body is its own (agent NONE); its body has a radius of 1 m.
        walker = Walker(0, NONE, 0, 0, playback, _NOTHING, _NOTHING, _NOTHING, 1.0, False)
        return self._obstacles(view, walker, _NOTHING)

    def with_ways(self, obstacles: Obstacles, scratch: Scratch) -> Obstacles:
        """Return ``obstacles`` with the ways that ``scratch`` holds, in which their body must not stop."""
        ways = scratch.ways[: scratch.ways_count[0]]
        return obstacles._replace(ways=ways, way_width=2.0 * obstacles.body_radius + WAY_ROOM)

    def neighbors(self, view: View) -> Neighbors:
        """Return the rows by cells, for a view that is valid until rows move, enter or leave."""
        if self._near is None or self._near[0] is not view:
            self._near = view, Neighbors.of(view.pose[:, :2], view.timeline_circle, view.body_radius, view.way)
        return self._near[1]

    def everyone(self, view: View) -> Timelines:
        """Return the reserved timelines of all rows."""
        return Timelines.of(view, self.neighbors(view))

    def _obstacles(self, view: View, walker: Walker, kept_free: NDArray[np.float64]) -> Obstacles:
        """Return the obstacles of a walker; ``kept_free`` (M, 4) are segments of outlines not to be entered [m]."""
        assets, environment = self.plans.assets, self.plans.environment
        return Obstacles(
            layers=layers_of(environment.meshes),
            radii=assets.body_radii,
            breadths=assets.breadths,
            kept_free=kept_free,
            distance=walker.body_radius + KEPT_OFF,
            bodies=self.bodies,
            agent=walker.agent,
            body_radius=walker.body_radius,
            passages=self._passages(view, walker),
            off_passages=PASSAGE_BODIES * walker.body_radius,
        )

    def _passages(self, view: View, walker: Walker) -> NDArray[np.float64]:
        """Return the segments (S, 4) across narrow passages in which agents may meet that come from both sides [m].

        An agent that is alone in the world meets no other. Agents that all go to one goal come through each passage
        from one side, as their shortest ways lead through it in one direction; only passages among the places of the
        goal, or near these, are returned then.
        """
        if self._present is None or self._present[0] is not view or self._present[1] is not self.bodies:
            agents = np.union1d(view.agent, self.bodies.rows["id"])
            goals = np.unique(self.plans.itineraries.cast.only_goals[agents])
            self._present = view, self.bodies, goals, len(agents)
        _, _, goals, count = self._present
        # A walker without a row is not counted in the world yet, unless it has been steered until now.
        enters = walker.row == NONE and walker.agent not in self.bodies.rows["id"]
        if count + enters < 2:
            return _NOTHING
        environment, cast = self.plans.environment, self.plans.itineraries.cast
        goal = int(goals[0])
        # With several goals, agents may come from both sides of any passage.
        if len(goals) > 1 or goal == NONE or (enters and cast.only_goals[walker.agent] != goal):
            return environment.passages
        # One goal: only passages near its region, or between its parts (convex hull), count.
        if self._at_goal[:2] != (environment.revision, goal):
            lines = shapely.linestrings(environment.passages.reshape(-1, 2, 2))
            off = shapely.distance(lines, cast.regions[goal].convex_hull)
            near = off < PASSAGE_BODIES * self.plans.assets.personal_radius
            self._at_goal = environment.revision, goal, environment.passages[near]
        return self._at_goal[2]

    def _kept_free(self, view: View, walker: Walker) -> NDArray[np.float64]:
        """Return the outlines (M, 4) of movables about to appear, as segments: x, y of both ends [m].

        Outlines that the walker is near, or has reserved to come near, are left out: it must be free to go away.
        """
        waited_for = self.plans.environment.waited_for
        if not waited_for:
            return _NOTHING
        slot = slot_of(self.plans.step, self.plans.assets.frames_per_step)
        # A walker without a row is at its place; another one, on all that is left of its reserved timeline.
        if walker.row == NONE:
            line = shapely.Point(walker.place)
        else:
            row = slice(walker.row, walker.row + 1)
            line = reserved_lines(view.timeline[row], view.timeline_start[row], slot)[0]
        distance = walker.body_radius + KEPT_OFF
        segments = [_NOTHING]
        for part in (part for outline in waited_for for part in polygons_only(outline).geoms):
            if part.distance(line) >= distance:
                rings = [shapely.get_coordinates(ring) for ring in (part.exterior, *part.interiors)]
                segments += [np.concatenate([ring[:-1], ring[1:]], axis=1) for ring in rings]
        return np.concatenate(segments)
