"""How far plans are from what they promise: clearances of sections in the layers, bodies posed in 3D along them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely
from numpy.typing import NDArray

from crowdsim.crowd.place import Place
from crowdsim.environment.layers import AnySolid
from crowdsim.environment.solids import Solid
from crowdsim.errors import PathNotFound
from crowdsim.motion.body_capsules import Capsules
from crowdsim.planning.annotated_path import AnnotatedPath
from crowdsim.planning.planner import plan_path
from crowdsim.planning.requirements import Requirements

Floats = NDArray[np.float64]

PLANNERS = ("layered", "greedy", "greedy_literal")

_ON_AXIS = np.linspace(0.0, 1.0, 5)
"""Places on the axis of a capsule that are tested."""


def random_paths(place: Place, count: int, seed: int, least: float = 2.0) -> list[AnnotatedPath]:
    """Paths with ``count`` sections or a few more: ends where some behavior that needs no turn fits, planners by turns,
    with slack and without.
    """
    setting = place.setting
    rng = np.random.default_rng(seed)
    upright = setting.need.radii[np.flatnonzero(~setting.need.turned)[0]]
    x0, y0, x1, y1 = setting.layers[0].free.bounds
    paths: list[AnnotatedPath] = []
    sections = tries = 0
    while sections < count and tries < 20 * count:
        ends = rng.uniform((x0, y0), (x1, y1), (2, 2))
        fits = [mesh.clearances(ends, radius) >= radius for mesh, radius in zip(place.meshes, upright, strict=True)]
        tries += 1
        if not np.all(fits) or np.hypot(*(ends[1] - ends[0])) < least:
            continue
        try:
            path = plan_path(
                place.meshes, setting.behaviors, *ends, rooms=place.rooms,
                planner=PLANNERS[len(paths) % len(PLANNERS)], slack=len(paths) % 2 == 0,
            )  # fmt: skip
        except PathNotFound:
            continue
        paths.append(path)
        sections += len(path.sections)
    return paths


def worst_clearance(layers: Sequence[shapely.Geometry], need: Requirements, paths: Sequence[AnnotatedPath]) -> float:
    """Meters by which a disc swept along a section reaches into what a layer's free area leaves; negative for not.

    By shapely alone, from the polygons that meshes were made of.
    """
    worst = -np.inf
    boundaries = [layer.boundary for layer in layers]
    for shape in [*layers, *boundaries]:
        shapely.prepare(shape)
    for path in paths:
        for section in path.sections:
            line = section_line(path, section.start, section.end)
            for layer, boundary, radius in zip(layers, boundaries, need.radii[section.behavior], strict=True):
                reached = radius if not layer.covers(line) else radius - shapely.distance(boundary, line)
                worst = max(worst, float(reached))
    return worst


def section_line(path: AnnotatedPath, start: float, end: float) -> shapely.LineString:
    """The polyline between two arc lengths."""
    inner = path.arc[(path.arc > start) & (path.arc < end)]
    return shapely.LineString(path.at(np.concatenate([[start], inner, [end]])))


def worst_penetration(
    solids: Sequence[AnySolid], cycles: Sequence[Capsules], strides: Floats, facings: Floats,
    path: AnnotatedPath, spacing: float = 0.05, lowest: float = 0.1,
) -> float:  # fmt: skip
    """Meters by which bodies posed every ``spacing`` along a path reach into upright solids; negative where clear.

    cycles: of each behavior, over ``strides`` (B,) meters; facings: (B,) radians. Solids that end below ``lowest`` are
    walked over, and meshes are left out. By distances of places on the bones' axes from outlines and heights.
    """
    samples = path.sample(spacing)
    axes = []
    radii = []
    for (x, y, bearing), arc, behavior in zip(samples.pose, samples.arc, samples.behavior, strict=True):
        frames = cycles[behavior].ends
        ends = frames[int(arc / strides[behavior] * len(frames)) % len(frames)]
        cos, sin = np.cos(bearing + facings[behavior]), np.sin(bearing + facings[behavior])
        points = ends[:, 0, None] + _ON_AXIS[:, None] * (ends[:, 1] - ends[:, 0])[:, None]
        turned = np.stack([cos * points[..., 0] - sin * points[..., 1], sin * points[..., 0] + cos * points[..., 1]])
        axes.append(np.stack([turned[0] + x, turned[1] + y, points[..., 2]], axis=-1).reshape(-1, 3))
        radii.append(np.repeat(cycles[behavior].radii, len(_ON_AXIS)))
    places, reach = np.concatenate(axes), np.concatenate(radii)
    worst = -float(reach.max())
    for solid in solids:
        if not isinstance(solid, Solid) or solid.top <= lowest:
            continue
        x0, y0, x1, y1 = solid.footprint.bounds
        x, y, z = places.T
        near = (x > x0 - reach) & (x < x1 + reach) & (y > y0 - reach) & (y < y1 + reach) & (z < solid.top + reach)
        if near.any():
            worst = max(worst, float((reach[near] - distances(solid, places[near])).max()))
    return worst


def distances(solid: Solid, places: Floats) -> Floats:
    """Distances (n,) of places (n, 3) from an upright solid, negative inside."""
    points = shapely.points(places[:, :2])
    rim = shapely.distance(solid.footprint.boundary, points)
    beside = np.where(shapely.contains_xy(solid.footprint, places[:, 0], places[:, 1]), -rim, rim)
    above = np.maximum(solid.bottom - places[:, 2], places[:, 2] - solid.top)
    outside = np.hypot(np.maximum(beside, 0.0), np.maximum(above, 0.0))
    return np.where((beside < 0.0) & (above < 0.0), np.maximum(beside, above), outside)
