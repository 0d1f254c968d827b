"""The environment as it is now: meshes that are edited as doors open and close and things come, move and go."""

from __future__ import annotations

from collections.abc import Sequence
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
from crowdsim.scenario.timetable import Movable, Placing, placed

Footprints = tuple[BaseGeometry | None, ...]
"""What a thing takes of each layer, None where it takes nothing."""


@dataclass(frozen=True)
class Edit:
    """What one change took and what it gave back; None where the thing was, or is, not there."""

    taken: Footprints | None
    freed: BaseGeometry | None


def footprints_of(movable: Movable, layers: Sequence[ClearanceLayer], placing: Placing) -> Footprints:
    """What a movable takes of each layer where it stands so; the lowest holds what any of them does."""
    shapes = [
        placed(shapely.union_all([taken_between(solid, layer.low, layer.high) for solid in movable.solids]), placing)
        for layer in layers
    ]
    shapes[0] = shapely.union_all(shapes)
    return tuple(None if shape.is_empty else shape for shape in shapes)


@dataclass
class EnvironmentState:
    """Meshes of the layers, legs first, and of the behavior areas (None where a behavior has none).

    Only :meth:`put` changes it, which the crowd calls between two steps while no search runs; everyone else reads, and
    nobody keeps ``mesh.arrays`` from one step to the next. edits: all that changed so far; revision: how many they are.
    waited_for: outlines of things that are to come as soon as nobody is there, and that nobody may enter meanwhile.
    """

    assets: Assets
    meshes: tuple[NavMesh, ...] = field(init=False)
    areas: tuple[NavMesh | None, ...] = field(init=False)
    edits: list[Edit] = field(default_factory=list)
    last_edit_step: int = -1
    waited_for: list[BaseGeometry] = field(default_factory=list)

    def __post_init__(self) -> None:
        assets = self.assets
        free = [layer.free for layer in assets.layers]
        self.meshes = tuple(NavMesh(area) for area in free)
        self.areas = tuple(None if area.is_empty else NavMesh(area) for area in area_polygons(free, assets.behaviors))
        self._planner = Planner(
            self.meshes, assets.behaviors, areas=self.areas, planner=assets.planner, bodies=assets.bodies
        )
        self._growths = area_growths(assets.behaviors, len(free))
        self._passages: tuple[int, NDArray[np.float64]] | None = None
        self._handles: list[list[tuple[NavMesh, Handle]]] = [[] for _ in self.assets.timetable.movables]
        self._placings: list[Placing | None] = [None] * len(self.assets.timetable.movables)
        for number, movable in enumerate(self.assets.timetable.movables):
            if movable.placing is not None:
                self._put(number, movable.placing)

    @property
    def revision(self) -> int:
        """How many edits there were."""
        return len(self.edits)

    @property
    def passages(self) -> NDArray[np.float64]:
        """(S, 4) segments across passages in which two bodies cannot pass each other, as they are now."""
        if self._passages is None or self._passages[0] != self.revision:
            self._passages = self.revision, narrow_passages(self.meshes[0], self.assets.passing_width)
        return self._passages[1]

    def route(self, start: ArrayLike, goal: ArrayLike) -> AnnotatedPath:
        """A path for whoever goes from ``start`` to ``goal`` (x, y) now; PathNotFound where there is none."""
        return self._planner.plan(start, goal)

    def placing(self, movable: int) -> Placing | None:
        """Where a movable stands; None while it is absent."""
        return self._placings[movable]

    def footprints(self, movable: int, placing: Placing) -> Footprints:
        """What a movable takes of each layer where it stands so; the lowest holds what any of them does."""
        return footprints_of(self.assets.timetable.movables[movable], self.assets.layers, placing)

    def put(self, movable: int, placing: Placing | None, step: int) -> Edit:
        """Let a movable stand at ``placing``, or take it away (None), in all meshes; no search may be under way."""
        before = self._placings[movable]
        freed = None if before is None else self.footprints(movable, before)[0]
        self._put(movable, placing)
        edit = Edit(None if placing is None else self.footprints(movable, placing), freed)
        self.edits.append(edit)
        self.last_edit_step = step
        return edit

    def state(self) -> bytes:
        """Where everything stands, for the state hash; nothing where nothing can change."""
        absent = (np.nan,) * 6
        rows: list[NDArray[np.float64]] = [np.array(placing or absent) for placing in self._placings]
        return b"".join(row.tobytes() for row in rows)

    def _put(self, movable: int, placing: Placing | None) -> None:
        for mesh, handle in self._handles[movable]:
            mesh.remove(handle)
        self._handles[movable] = []
        self._placings[movable] = placing
        if placing is None:
            return
        taken = self.footprints(movable, placing)
        pairs = list(zip(self.meshes, taken, strict=True))
        for area, growths in zip(self.areas, self._growths, strict=True):
            if area is not None:
                # What grows covers what does not.
                widest = max(
                    (g for g, t in zip(growths.tolist(), taken[1:], strict=True) if t is not None), default=0.0
                )
                pairs.append((area, taken[0] and grown(taken[0], widest)))
        self._handles[movable] = [(mesh, mesh.insert_obstacle(shape)) for mesh, shape in pairs if shape is not None]
