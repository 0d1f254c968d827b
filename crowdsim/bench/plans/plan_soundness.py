"""Correctness of plans: clearance of their sections in the layers, and collisions of 3D bodies along them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from crowdsim.bench.plans.planner_comparison import PLACES, Ground, ground_of
from crowdsim.bench.plans.posed_bodies import Obstacles, motions_of, posed_along
from crowdsim.bench.registry import Measurement
from crowdsim.constants import TRACKING_MARGIN
from crowdsim.errors import CrowdSimError, PathNotFound
from crowdsim.planning.labels.annotated_path import AnnotatedPath
from crowdsim.planning.query.requirements import Requirements

Floats = NDArray[np.float64]

PLANNERS = ("layered", "greedy_literal")

SECTIONS = 10_000
"""Number of sections checked in all places together."""

DEEP = 0.02
"""Depth to which a body may reach into an obstacle [m]."""

_EVERY = 9
"""One of so many paths is also walked with stiff legs. The number is odd, so that these are of both planners, with and
without the clearance margin."""


def measure(worlds: Path | None = None, sections: int = SECTIONS) -> Measurement:
    """Check ``sections`` sections, shared by the places of :mod:`crowdsim.bench.plans.planner_comparison`.

    A world that is not in the folder ``worlds`` is skipped. Figures with "stiff" are of every ninth path, with legs
    posed as on a straight path. Raise CrowdSimError if a place gives no path.
    """
    rows: list[dict[str, Any]] = []
    for name in PLACES:
        ground = ground_of(name, worlds)
        if ground is None:
            continue
        paths = random_paths(ground, -(-sections // len(PLACES)), seed=4)  # an even share of the sections, rounded up
        if not paths:
            raise CrowdSimError(f"{name}: no path was found for {sections} sections in all places; ask for more")
        motions, obstacles = motions_of(ground.behaviors), Obstacles(ground.solids)
        deep = np.array([obstacles.depths(posed_along(path, motions)).max() for path in paths])
        stiff = np.array([obstacles.depths(posed_along(path, motions, stiff=True)).max() for path in paths[::_EVERY]])
        rows.append(
            {
                "place": name,
                "paths": len(paths),
                "sections": sum(len(path.sections) for path in paths),
                "soundness_worst_m": worst_clearance(ground.layers, needs_of(ground), paths),
                "penetration_worst_m": max(float(deep.max()), 0.0),
                "paths_too_deep": int((deep > DEEP).sum()),
                "stiff_penetration_worst_m": max(float(stiff.max()), 0.0),
                "stiff_share_too_deep": float((stiff > DEEP).mean()),
            }
        )
    names = ("soundness_worst_m", "penetration_worst_m", "stiff_penetration_worst_m")
    figures = {name: max(float(row[name]) for row in rows) for name in names}
    for total in ("sections", "paths", "paths_too_deep"):
        figures[total] = float(sum(row[total] for row in rows))
    return Measurement(rows, figures)


def needs_of(ground: Ground) -> Requirements:
    """Return the clearances that plans on a ground keep, with the tracking margin."""
    return Requirements.of(ground.behaviors, len(ground.meshes), TRACKING_MARGIN)


def random_paths(ground: Ground, count: int, seed: int, least: float = 2.0) -> list[AnnotatedPath]:
    """Return random paths with ``count`` sections or a few more; fewer if 20 tries a section do not give them.

    The ends of a path are ``least`` meters apart or more, and the narrowest behavior that is not turned fits at both.
    Planners take turns, each first with the clearance margin, then without it.
    """
    need = needs_of(ground)
    rng = np.random.default_rng(seed)
    upright = need.radii[np.flatnonzero(~need.turned)[0]]
    planners = [ground.planner(name) for name in PLANNERS]
    x0, y0, x1, y1 = ground.bounds
    paths: list[AnnotatedPath] = []
    sections = tries = 0
    while sections < count and tries < 20 * count:
        ends = rng.uniform((x0, y0), (x1, y1), (2, 2))
        fits = [mesh.clearances(ends, radius) >= radius for mesh, radius in zip(ground.meshes, upright, strict=True)]
        tries += 1
        if not np.all(fits) or np.hypot(*(ends[1] - ends[0])) < least:
            continue
        try:
            turn, which = divmod(len(paths), len(planners))
            path = planners[which].plan(*ends, margin=turn % 2 == 0)
        except PathNotFound:
            continue
        paths.append(path)
        sections += len(path.sections)
    return paths


def worst_clearance(layers: Sequence[shapely.Geometry], need: Requirements, paths: Sequence[AnnotatedPath]) -> float:
    """Return how far a disc of its behavior, swept along a section, leaves a layer's free area at most [m].

    Negative if none does. ``layers`` are the free areas.

    Computed with shapely only, from the polygons that the meshes were made of.
    """
    worst = -np.inf
    boundaries = [layer.boundary for layer in layers]
    for shape in [*layers, *boundaries]:
        shapely.prepare(shape)
    for path in paths:
        for section in path.sections:
            line = section_line(path, section.start, section.end)
            # A line that itself leaves the area counts as if it ran along the boundary.
            for layer, boundary, radius in zip(layers, boundaries, need.radii[section.behavior], strict=True):
                reached = radius if not layer.covers(line) else radius - shapely.distance(boundary, line)
                worst = max(worst, float(reached))
    return worst


def section_line(path: AnnotatedPath, start: float, end: float) -> shapely.LineString:
    """Return the polyline of a path between two arc lengths [m]."""
    inner = path.arc[(path.arc > start) & (path.arc < end)]
    return shapely.LineString(path.at(np.concatenate([[start], inner, [end]])))
