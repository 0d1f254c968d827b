"""What captured characters keep clear of: walls, what is about to come, bodies, ways, passages; and who is near."""

from __future__ import annotations

import numpy as np
import shapely
from numpy.typing import NDArray

from crowdsim.constants import NONE
from crowdsim.crowd.near.neighbors import Neighbors
from crowdsim.crowd.search.plans import Plans
from crowdsim.crowd.state.components import SLOT_FRAMES
from crowdsim.crowd.state.timelines import NO_BODIES, Obstacles, Playback, StandingBodies, Timelines
from crowdsim.crowd.systems.apply_events import KEPT_OFF, reserved_lines
from crowdsim.crowd.systems.choose_kernels import WAY_ROOM
from crowdsim.crowd.systems.going_on import Room, Walker
from crowdsim.ecs.world import View
from crowdsim.environment.layers import polygons_only

PASSAGE_BODIES = 3.0
"""How far off a narrow passage one stops, in radii."""

_NOTHING = np.empty((0, 4))


class Surroundings:
    """What the rows of a step keep clear of."""

    def __init__(self, plans: Plans) -> None:
        self.plans = plans
        self.bodies: StandingBodies = NO_BODIES
        """Those of steered characters, which stand as far as reservations know."""
        self._near: tuple[View, Neighbors] | None = None

    def begin(self) -> None:
        """Begin a step, in which rows have moved."""
        self._near = None

    def obstacles(self, view: View, walker: Walker) -> Obstacles:
        """What a walker keeps clear of beside other captured characters."""
        return self._obstacles(view, walker, self._kept_free(view, walker))

    def of_any(self, view: View, playback: Playback) -> Obstacles:
        """What kernels make the obstacles of each row of: distances in radii of its body."""
        anybody = Walker(0, NONE, 0, 0, playback, _NOTHING, _NOTHING, _NOTHING, 1.0, False)
        return self._obstacles(view, anybody, _NOTHING)

    def with_ways(self, obstacles: Obstacles, room: Room) -> Obstacles:
        """Obstacles with the ways that were noted last in ``room``, which their body keeps off."""
        ways = room.ways[: room.ways_count[0]]
        return obstacles._replace(ways=ways, way_width=2.0 * obstacles.body_radius + WAY_ROOM)

    def neighbors(self, view: View) -> Neighbors:
        """The rows by cells, of a view that lasts until they move, come or go."""
        if self._near is None or self._near[0] is not view:
            self._near = view, Neighbors.of(view.pose[:, :2], view.timeline_circle, view.body_radius, view.way)
        return self._near[1]

    def everyone(self, view: View) -> Timelines:
        """What all rows have reserved."""
        return Timelines.of(view, self.neighbors(view))

    def _obstacles(self, view: View, walker: Walker, kept_free: NDArray[np.float64]) -> Obstacles:
        assets, environment = self.plans.assets, self.plans.environment
        # Who is alone hinders nobody.
        alone = len(view.agent) == (walker.row != NONE)
        return Obstacles(
            layers=tuple(mesh.arrays for mesh in environment.meshes),
            radii=assets.body_radii,
            breadths=assets.breadths,
            kept_free=kept_free,
            distance=walker.body_radius + KEPT_OFF,
            bodies=self.bodies,
            agent=walker.agent,
            body_radius=walker.body_radius,
            passages=_NOTHING if alone else environment.passages,
            off_passages=PASSAGE_BODIES * walker.body_radius,
        )

    def _kept_free(self, view: View, walker: Walker) -> NDArray[np.float64]:
        """Outlines (M, 4) of what is about to come and that a character must not enter: it is not there already."""
        waited_for = self.plans.environment.waited_for
        if not waited_for:
            return _NOTHING
        slot = self.plans.step * self.plans.assets.frames_per_step // SLOT_FRAMES
        line = shapely.Point(walker.place) if walker.row == NONE else reserved_lines(view, slot)[walker.row]
        distance = walker.body_radius + KEPT_OFF
        segments = [_NOTHING]
        for part in (part for outline in waited_for for part in polygons_only(outline).geoms):
            if part.distance(line) >= distance:
                rings = [shapely.get_coordinates(ring) for ring in (part.exterior, *part.interiors)]
                segments += [np.concatenate([ring[:-1], ring[1:]], axis=1) for ring in rings]
        return np.concatenate(segments)
