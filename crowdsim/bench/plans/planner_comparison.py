"""Costs of plans by planner, for any start and goal at which the narrowest behavior fits, in four places.

``layered`` is compared with the published planner. In places where most plans are straight, the mean ratio is near one
for any planner; it is therefore also given without the queries that the published planner answers with the widest
behavior alone.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from crowdsim.behaviors.behavior import Behavior
from crowdsim.bench.places.environment import prepare as prepare_world
from crowdsim.constants import TRACKING_MARGIN
from crowdsim.crowd.state.assets import load_behaviors, prepare
from crowdsim.crowd.state.environment import EnvironmentState
from crowdsim.environment.layers import AnySolid
from crowdsim.errors import PathNotFound
from crowdsim.navmesh.navmesh import NavMesh
from crowdsim.planning.labels.annotated_path import AnnotatedPath
from crowdsim.planning.planner import Planner
from crowdsim.planning.query.behavior_areas import area_polygons
from crowdsim.planning.query.requirements import Requirements
from crowdsim.scenario.loader import load_scenario

Floats = NDArray[np.float64]

QUERIES = 250
PLACES = ("normal", "dense", "small_house", "apartment")
ALIKE = 1e-6
"""Relative difference up to which costs count as equal."""

_WORLD = "small_house"


class Ground(NamedTuple):
    """A place for plans.

    Attributes
    ----------
    meshes : tuple of NavMesh
        Mesh of each layer.
    areas : tuple of NavMesh or None
        Mesh of the area of each behavior.
    behaviors : tuple of Behavior
        Behaviors to plan with.
    layers : tuple of shapely geometry
        Free area of each layer [m].
    solids : tuple of solids
        All obstacles.
    """

    meshes: tuple[NavMesh, ...]
    areas: tuple[NavMesh | None, ...]
    behaviors: tuple[Behavior, ...]
    layers: tuple[shapely.Geometry, ...]
    solids: tuple[AnySolid, ...]

    @property
    def bounds(self) -> tuple[float, ...]:
        """Return its bounding box (x0, y0, x1, y1) [m]."""
        return tuple(self.layers[0].bounds)

    def planner(self, name: str = "layered") -> Planner:
        """Return a planner of this name for the place."""
        return Planner(self.meshes, self.behaviors, areas=self.areas, planner=name)


def measure(queries: int = QUERIES, worlds: Path | None = None) -> tuple[dict[str, str], dict[str, float]]:
    """Return a sentence on each place, and figures; a world that is not in the folder ``worlds`` is skipped."""
    words: dict[str, str] = {}
    figures: dict[str, float] = {}
    ratios = []
    for name in PLACES:
        ground = ground_of(name, worlds)
        if ground is None:
            words[name] = f"not measured: there is no {name}.glb; give its folder with --worlds FOLDER"
            continue
        costs, wide = compare(ground, queries)
        literal = costs[:, 0] / costs[:, 1]
        bent = literal[~wide] if (~wide).any() else literal
        own = {
            "layered_over_literal_max": float(literal.max()),
            "layered_over_literal_mean": float(literal.mean()),
            "layered_over_literal_mean_not_wide": float(bent.mean()),
            "layered_above_literal_share": float((literal > 1.0 + ALIKE).mean()),
        }
        figures |= {f"{key}_{name}": value for key, value in own.items()}
        words[name] = (
            f"{len(costs)} queries; over literal: mean {literal.mean():.3f} ({bent.mean():.3f} where not all wide), "
            f"most {literal.max():.3f}; above it: {100.0 * own['layered_above_literal_share']:.1f} %"
        )
        ratios.append(literal)
    every = np.concatenate(ratios)
    figures["layered_over_literal_max"] = float(every.max())
    figures["layered_over_literal_mean"] = float(every.mean())
    figures["layered_above_literal_share"] = float((every > 1.0 + ALIKE).mean())
    return words, figures


def ground_of(name: str, worlds: Path | None = None) -> Ground | None:
    """Return one of PLACES: clutter with density ``name``, a built-in scenario, or a world of the folder ``worlds``.

    Return None if the world is not in the folder.
    """
    if name != _WORLD:
        clutter = name in ("normal", "dense")
        scenario = load_scenario("clutter", [f"clutter.density={name}"]) if clutter else load_scenario(name)
        place = EnvironmentState(prepare(scenario))
        free = tuple(layer.free for layer in place.assets.layers)
        return Ground(place.meshes, place.areas, place.assets.behaviors, free, place.assets.timetable.fixed)
    folder = worlds or Path(os.environ.get("CROWDSIM_SHARED", "../shared")) / "worlds"
    if not (folder / f"{name}.glb").is_file():
        return None
    world = prepare_world(folder / f"{name}.glb", {})
    behaviors = load_behaviors(load_scenario("clutter")).behaviors
    free = tuple(layer.free for layer in world.layers)
    areas = tuple(None if area.is_empty else NavMesh(area) for area in area_polygons(free, behaviors))
    return Ground(world.meshes, areas, behaviors, free, tuple(world.place.solids))


def random_queries(ground: Ground, count: int, seed: int) -> list[Floats]:
    """Return ``count`` pairs (2, 2) of places at which the narrowest behavior fits [m], connected or not."""
    need = Requirements.of(ground.behaviors, len(ground.meshes), TRACKING_MARGIN)
    rng = np.random.default_rng(seed)
    x0, y0, x1, y1 = ground.bounds
    found: list[Floats] = []
    while len(found) < count:
        ends = rng.uniform((x0, y0), (x1, y1), (2, 2))
        fits = [m.clearances(ends, radius) >= radius for m, radius in zip(ground.meshes, need.radii[0], strict=True)]
        if np.all(fits):
            found.append(ends)
    return found


def compare(ground: Ground, count: int, seed: int = 1) -> tuple[Floats, NDArray[np.bool_]]:
    """Return costs (n, 2) of layered and greedy_literal for up to ``count`` queries that the second answers.

    Costs of layered are infinite if it finds no path. Also return (n,) whether the second's path uses the widest
    behavior alone.
    """
    # Some queries have no answer: try three times as many as are wanted.
    costs, wide = [], []
    layered_planner, literal_planner = ground.planner(), ground.planner("greedy_literal")
    for ends in random_queries(ground, 3 * count, seed):
        literal = _plan(literal_planner, ends)
        if literal is None:
            continue
        layered = _plan(layered_planner, ends)
        costs.append([np.inf if layered is None else layered.cost, literal.cost])
        wide.append({section.behavior for section in literal.sections} <= {len(ground.behaviors) - 1})
        if len(costs) == count:
            break
    return np.array(costs), np.array(wide)


def _plan(planner: Planner, ends: Floats) -> AnnotatedPath | None:
    """Return the path between the ``ends`` (2, 2) [m] without a clearance margin; None if there is none."""
    try:
        return planner.plan(ends[0], ends[1], margin=False)
    except PathNotFound:
        return None
