"""The floor and the solids of a scenario, drawn in its file or read from files that it names."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import shapely
from shapely import MultiPolygon, Polygon

from crowdsim.environment.clutter import draw_clutter, open_ways
from crowdsim.environment.floor_plans import read_floor_plan
from crowdsim.environment.floors import place_on_floor
from crowdsim.environment.layers import AnySolid, dropped_solids, polygons_only, taken_between
from crowdsim.environment.mesh_files import read_mesh_file
from crowdsim.environment.mesh_solid import MeshSolid
from crowdsim.environment.solids import polygon_from_points
from crowdsim.errors import GeometryError, PlaceError
from crowdsim.geometry.polygons import buffered
from crowdsim.scenario.composing.files import Files
from crowdsim.scenario.schema.environment import Mesh, Obstacle
from crowdsim.scenario.schema.schema import ScenarioFields
from crowdsim.yamlfile.document import Complaint
from crowdsim.yamlfile.document import Path as KeyPath

CLUTTER_RADIUS = 0.25
"""Clearance that the way between start and goal keeps from clutter [m]: enough for the narrowest behavior."""

_KEPT_CLEAR = 0.5
"""Distance around starts and goals that is kept free of clutter [m]."""

_CLUTTER_STREAM = 1 << 20
"""Key of the random stream of clutter; keys of other streams begin with the number of a group, which is less."""

_NO_FLOOR = shapely.box(0.0, 0.0, 1.0, 1.0)
"""Stand-in for a floor that could not be read; it is never used, as there are complaints."""


class Site(NamedTuple):
    """Floor and solids of a scenario.

    Attributes
    ----------
    floor : Polygon or MultiPolygon
        The whole floor [m].
    solids : dict of KeyPath to tuple of solids
        Solids by the entry of the file they come from, as ``("obstacles", 2)``, in its order.
    report : list of str
        Assumptions that were made and parts that were left out, one sentence each.
    complaints : list of Complaint
        What could not be read, and is missing in floor and solids; meshes without effect; clutter that has no room.
    """

    floor: Polygon | MultiPolygon
    solids: dict[KeyPath, tuple[AnySolid, ...]]
    report: list[str]
    complaints: list[Complaint]


def doubts_in(report: Iterable[str]) -> list[str]:
    """Return the lines of a report that may explain why the environment is not the intended one."""
    return [line for line in report if "warning: " in line]


def read_site(keys: ScenarioFields, files: Files) -> Site:
    """Make the solids of all obstacles, read the ``files`` they name, and draw the clutter."""
    return _Reader(keys, files).site()


class _Reader:
    """Collects solids by the entry they come from, the report, and complaints."""

    def __init__(self, keys: ScenarioFields, files: Files) -> None:
        self.keys, self.files = keys, files
        self.solids: dict[KeyPath, tuple[AnySolid, ...]] = {}
        self.report: list[str] = []
        self.complaints: list[Complaint] = []
        # Floors that plans of obstacles draw.
        self._drawn: list[Polygon | MultiPolygon] = []

    def site(self) -> Site:
        """Read all obstacles, then the floor, then draw the clutter."""
        for number, obstacle in enumerate(self.keys.obstacles):
            path = ("obstacles", number)
            try:
                self.solids[path] = self._solids(obstacle)
            except (PlaceError, GeometryError) as error:
                self.solids[path] = ()
                self.complaints.append(((*path, "plan" if obstacle.mesh is None else "mesh"), str(error)))
        # A derived floor may lie in the very file that could not be read: do not complain of it too.
        floor = _NO_FLOOR if self.complaints else self._on_floor()
        if self.keys.clutter is not None and not self.complaints:
            self._draw_clutter(floor)
        return Site(floor, self.solids, self.report, self.complaints)

    def _solids(self, obstacle: Obstacle) -> tuple[AnySolid, ...]:
        """Return the solids of an obstacle; if it is a file, with the obstacle's name before the names of its parts."""
        if obstacle.mesh is None and obstacle.plan is None:
            return obstacle.solids()
        found = self._mesh(obstacle.mesh) if obstacle.mesh is not None else self._plan(obstacle)
        return tuple(replace(solid, name=f"{obstacle.name}: {solid.name}") for solid in found)

    def _mesh(self, mesh: Mesh) -> Sequence[AnySolid]:
        """Return the parts of a file of triangles; raise PlaceError or GeometryError if it cannot be read or placed."""
        content = self.files.content(mesh.file)
        scene = read_mesh_file(self.files.folder / mesh.file, content=content, **mesh.model_dump(exclude={"file"}))
        self.report += scene.report
        return scene.solids

    def _plan(self, obstacle: Obstacle) -> Sequence[AnySolid]:
        """Return the walls and outlines of the obstacle's floor plan, and keep the floor that it draws.

        Raise PlaceError if it draws no solids.
        """
        plan = obstacle.plan
        assert plan is not None
        assert obstacle.top is not None
        found = read_floor_plan(
            self.files.folder / plan.file,
            layers=plan.drawing_layers,
            units=plan.units,
            thickness=plan.thickness,
            bottom=obstacle.bottom,
            top=obstacle.top,
        )
        if not found.solids:
            raise PlaceError(f"{plan.file}: draws no walls or obstacles; name it as the floor's 'file' instead")
        self.report += found.report
        if found.floor is not None:
            self._drawn.append(found.floor)
        return found.solids

    def _on_floor(self) -> Polygon | MultiPolygon:
        """Return the floor, and move solids so that it is at height 0.

        Solids that are the floor or a ceiling, or lie below the floor or flat on it, are dropped. On a floor that the
        file draws or names, only meshes are moved and dropped; drawn solids stay.
        """
        given = self.keys.floor
        try:
            floor = self._given_floor()
            # On a floor that is drawn or named, only meshes may contain floors; drawn solids keep their heights.
            placed = [
                (path, solid)
                for path, solids in self.solids.items()
                for solid in solids
                if floor is None or isinstance(solid, MeshSolid)
            ]
            if floor is not None and not placed:
                return floor
            # None: the height of a derived floor is found, too. A given floor lies at 0 unless it has a height.
            height = given.height if floor is None else given.height or 0.0
            placed_solids = place_on_floor([solid for _, solid in placed], floor, height)
        except (PlaceError, GeometryError) as error:
            self.complaints.append((("floor",), str(error)))
            return _NO_FLOOR
        self.report += placed_solids.report
        for path in {path for path, _ in placed}:
            self.solids[path] = ()
        for number, solid in zip(placed_solids.kept, placed_solids.solids, strict=True):
            path = placed[number][0]
            self.solids[path] = (*self.solids[path], solid)
        if floor is not None:
            self._require_effect({path for path, _ in placed}, floor)
        return placed_solids.floor

    def _require_effect(self, paths: set[KeyPath], floor: Polygon | MultiPolygon) -> None:
        """Complain of all meshes at ``paths`` if no part of any is in a layer over the floor: a likely mistake."""
        bands = [layer.band() for layer in self.keys.bands]
        solids = [solid for path in paths for solid in self.solids[path] if not dropped_solids([solid], bands)]
        if not any(solid.footprint.intersects(floor) for solid in solids):
            for path in sorted(paths, key=lambda path: int(path[1])):
                mesh = self.keys.obstacles[int(path[1])].mesh
                assert mesh is not None
                message = (
                    f"{mesh.file}: nothing of it is in a layer over the given floor; check 'units', "
                    "'up' and 'position', and the floor's 'height'"
                )
                doubts = [line for line in doubts_in(self.report) if line.startswith(f"{Path(mesh.file).name}: ")]
                self.complaints.append(((*path, "mesh"), "; ".join([message, *doubts])))

    def _given_floor(self) -> Polygon | MultiPolygon | None:
        """Return the floor that the scenario or a plan draws; None if it is to be derived from obstacles.

        Raise PlaceError or GeometryError if it cannot be read, or its file draws no floor.
        """
        floor = self.keys.floor
        if floor.rectangle is not None:
            return shapely.box(*floor.rectangle)
        if floor.polygon is not None:
            return polygon_from_points(floor.polygon, "floor")
        if floor.file is not None:
            found = read_floor_plan(
                self.files.folder / floor.file,
                content=self.files.content(floor.file),
                floor_layer=floor.drawing_layer,
                units=floor.units,
            )
            if found.floor is None:
                raise PlaceError(f"{floor.file}: draws no floor; name its layer as 'drawing_layer', or give 'derive'")
            self.report += found.report
            return found.floor
        # With meshes, whose parts may lie at any height, the floor is found among all parts instead.
        if self._drawn and not any(obstacle.mesh for obstacle in self.keys.obstacles):
            return polygons_only(shapely.union_all(self._drawn))
        return None

    def _draw_clutter(self, floor: Polygon | MultiPolygon) -> None:
        """Draw clutter off starts, goals and other obstacles; remove those pieces of it that close a group's way."""
        clutter = self.keys.clutter
        assert clutter is not None
        regions = [
            [group.start.shape(), *(shape for _, shape in self.keys.destinations(number))]
            for number, group in enumerate(self.keys.agents)
        ]
        ends = shapely.union_all([buffered(region, _KEPT_CLEAR) for group in regions for region in group])
        standing = [solid for solids in self.solids.values() for solid in solids]
        bare = floor.difference(shapely.union_all([solid.footprint for solid in standing]))
        region = bare if clutter.region is None else bare.intersection(clutter.region.shape())
        # Clutter keeps off the footprints of all solids, but ways may lead under solids above all layers, as lintels.
        bands = [layer.band() for layer in self.keys.bands]
        met = [taken_between(solid, band.low, band.high) for solid in standing for band in bands]
        free = floor.difference(shapely.union_all(met))
        generator = np.random.default_rng(np.random.SeedSequence(self.keys.seed, spawn_key=(_CLUTTER_STREAM,)))
        region = region.difference(ends)
        try:
            drawn = draw_clutter("clutter", region, clutter.density, clutter.sizes, generator)
            kept = open_ways(drawn, free, regions, CLUTTER_RADIUS)
        except GeometryError as error:
            self.complaints.append((("clutter",), str(error)))
            return
        self.solids[("clutter",)] = kept
        share = math.fsum(solid.footprint.area for solid in kept) / region.area
        where = "the floor" if clutter.region is None else "its region"
        self.report.append(
            f"clutter: {len(kept)} obstacles cover {share:.1%} of {where} off starts and goals"
            + (f"; {len(drawn) - len(kept)} were taken away to open ways" if len(kept) < len(drawn) else "")
        )
