"""The environment as it is now: meshes that are edited as doors and other movables appear, move and disappear."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray
from shapely.geometry.base import BaseGeometry

from crowdsim.crowd.state.assets import Assets
from crowdsim.crowd.state.passages import narrow_passages
from crowdsim.environment.layers import ClearanceLayer, taken_between
from crowdsim.navmesh.editing.obstacles import Handle
from crowdsim.navmesh.navmesh import NavMesh
from crowdsim.planning.labels.annotated_path import AnnotatedPath
from crowdsim.planning.planner import Planner
from crowdsim.planning.query.behavior_areas import area_growths, area_polygons, grown
from crowdsim.scenario.timetable import Movable, Placing, Timetable, placed

Footprints = tuple[BaseGeometry | None, ...]
"""Area that a movable covers on each layer, None if none."""


@dataclass(frozen=True)
class Edit:
    """One change of the environment.

    ``taken`` is the area on each layer that it covers; None if its movable disappears. ``freed`` is the area on the
    lowest layer that it frees, which contains the freed areas of all other layers; None if it frees none.
    """

    taken: Footprints | None
    freed: BaseGeometry | None


def footprints_of(movable: Movable, layers: Sequence[ClearanceLayer], placing: Placing) -> Footprints:
    """Return the area that a movable at ``placing`` covers on each layer; the lowest contains all others."""
    shapes = [
        placed(shapely.union_all([taken_between(solid, layer.low, layer.high) for solid in movable.solids]), placing)
        for layer in layers
    ]
    shapes[0] = shapely.union_all(shapes)
    return tuple(None if shape.is_empty else shape for shape in shapes)


def state_of(placings: Mapping[int, Placing]) -> bytes:
    """Return numbers and placings of the movables present, for the state hash; empty if there are none."""
    return b"".join(np.array((number, *placings[number])).tobytes() for number in sorted(placings))


@dataclass
class EnvironmentState:
    """Meshes of the layers, legs first, and of the behavior areas (None for a behavior without one).

    Only :meth:`put` changes it. The crowd calls it while no slice of a search runs. All others only read, and none of
    them keeps ``mesh.arrays`` from one step to the next.
    """

    assets: Assets
    timetable: Timetable = field(init=False)
    """What may change, and when."""
    meshes: tuple[NavMesh, ...] = field(init=False)
    """Free area of each layer."""
    areas: tuple[NavMesh | None, ...] = field(init=False)
    """Behavior area of each behavior."""
    edits: list[Edit] = field(default_factory=list)
    """All changes so far."""
    last_edit_step: int = -1
    """Step of the last change, -1 before the first."""
    waited_for: list[BaseGeometry] = field(default_factory=list)
    """Outlines of movables that appear as soon as no agent is there, and that no agent may enter meanwhile."""

    def __post_init__(self) -> None:
        assets = self.assets
        self.timetable = assets.timetable
        free = [layer.free for layer in assets.layers]
        self.meshes = tuple(NavMesh(area) for area in free)
        self.areas = tuple(None if area.is_empty else NavMesh(area) for area in area_polygons(free, assets.behaviors))
        self._planner = Planner(
            self.meshes, assets.behaviors, areas=self.areas, planner=assets.planner, bodies=assets.bodies
        )
        self._growths = area_growths(assets.behaviors, len(free))
        # Revision at which passages were found last, and their segments (S, 4) [m]; None before the first request.
        self._passages: tuple[int, NDArray[np.float64]] | None = None
        # Mesh handles and placings of the movables present, by their numbers.
        self._handles: dict[int, list[tuple[NavMesh, Handle]]] = {}
        self._placings: dict[int, Placing] = {}
        for number, movable in enumerate(self.timetable.movables):
            if movable.placing is not None:
                self._put(number, movable.placing)

    @property
    def revision(self) -> int:
        """Number of edits so far."""
        return len(self.edits)

    @property
    def passages(self) -> NDArray[np.float64]:
        """(S, 4) segments across passages in which two bodies cannot pass each other now: x, y of both ends [m]."""
        if self._passages is None or self._passages[0] != self.revision:
            # No body passes between obstacles of the lowest layer that are closer together than this.
            narrowest = 2.0 * float(self.assets.body_radii[:, 0].min())
            found = narrow_passages(self.meshes[0], narrowest, self.assets.passing_width)
            self._passages = self.revision, found
        return self._passages[1]

    def route(self, start: ArrayLike, goal: ArrayLike) -> AnnotatedPath:
        """Plan a path from ``start`` to ``goal`` (x, y) [m] in the present environment; PathNotFound without one."""
        return self._planner.plan(start, goal)

    def placing(self, movable: int) -> Placing | None:
        """Return the placing of a movable; None while it is absent."""
        return self._placings.get(movable)

    def footprints(self, movable: int, placing: Placing) -> Footprints:
        """Return the area that a movable at ``placing`` covers on each layer; the lowest contains all others."""
        return footprints_of(self.timetable.movables[movable], self.assets.layers, placing)

    def put(self, movable: int, placing: Placing | None, step: int) -> Edit:
        """Place a movable at ``placing``, or remove it (None), in all meshes, in ``step``; return the change.

        No slice of a search may be running.
        """
        before = self._placings.get(movable)
        freed = None if before is None else self.footprints(movable, before)[0]
        self._put(movable, placing)
        edit = Edit(None if placing is None else self.footprints(movable, placing), freed)
        self.edits.append(edit)
        self.last_edit_step = step
        return edit

    def state(self) -> bytes:
        """Return numbers and placings of all movables present, for the state hash; empty if there are none."""
        return state_of(self._placings)

    def _put(self, movable: int, placing: Placing | None) -> None:
        """Remove the obstacles of a movable from all meshes, and insert them at ``placing`` unless that is None."""
        for mesh, handle in self._handles.pop(movable, ()):
            mesh.remove(handle)
        if placing is None:
            self._placings.pop(movable, None)
            return
        self._placings[movable] = placing
        taken = self.footprints(movable, placing)
        pairs = list(zip(self.meshes, taken, strict=True))
        for area, growths in zip(self.areas, self._growths, strict=True):
            # Only behaviors with an area have a mesh to be edited.
            if area is not None:
                # A behavior area gets one obstacle for all layers: the lowest footprint, which contains the others,
                # grown by the most that the behavior needs on an upper layer that the movable is on.
                widest = max(
                    (g for g, t in zip(growths.tolist(), taken[1:], strict=True) if t is not None), default=0.0
                )
                pairs.append((area, taken[0] and grown(taken[0], widest)))
        self._handles[movable] = [(mesh, mesh.insert_obstacle(shape)) for mesh, shape in pairs if shape is not None]
