"""The place that a scenario describes: its floor and everything that stands on it."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import shapely
from shapely import Polygon

from crowdsim.environment.clutter import draw_clutter, open_ways
from crowdsim.environment.solids import Solid
from crowdsim.errors import GeometryError, Problem

if TYPE_CHECKING:
    from crowdsim.scenario.scenario import Scenario

CLUTTER_RADIUS = 0.25
"""Meters of clearance that the way between start and goal keeps from clutter: enough for the narrowest behavior."""

_KEPT_CLEAR = 0.5
"""Meters around starts and goals in which no clutter stands."""

_CLUTTER_STREAM = 1 << 20


class Site(NamedTuple):
    """Floor and solids, with what could not be used.

    owners: for each solid, the path of the entry of the file it comes from. problems: what keeps it from being whole.
    """

    floor: Polygon
    solids: tuple[Solid, ...]
    owners: tuple[tuple[str | int, ...], ...]
    problems: tuple[Problem, ...]


def read_site(scenario: Scenario) -> Site:
    """Make the solids of all obstacles, and draw the clutter among them."""
    floor = scenario.floor.shape()
    solids: list[Solid] = []
    owners: list[tuple[str | int, ...]] = []
    problems: list[Problem] = []
    for number, obstacle in enumerate(scenario.obstacles):
        made = obstacle.solids()
        solids += made
        owners += [("obstacles", number)] * len(made)
    if scenario.clutter is not None:
        try:
            drawn = _clutter(scenario, floor, solids)
        except GeometryError as error:
            problems.append(scenario.problem(("clutter",), str(error)))
        else:
            solids += drawn
            owners += [("clutter",)] * len(drawn)
    return Site(floor, tuple(solids), tuple(owners), tuple(problems))


def _clutter(scenario: Scenario, floor: Polygon, solids: list[Solid]) -> tuple[Solid, ...]:
    assert scenario.clutter is not None
    regions = [[group.start.shape(), group.goal.shape()] for group in scenario.agents]
    ends = shapely.union_all([region.buffer(_KEPT_CLEAR) for group in regions for region in group])
    free = floor.difference(shapely.union_all([solid.footprint for solid in solids]))
    region = free if scenario.clutter.region is None else free.intersection(scenario.clutter.region.shape())
    generator = np.random.default_rng(np.random.SeedSequence(scenario.seed, spawn_key=(_CLUTTER_STREAM,)))
    drawn = draw_clutter(
        "clutter", region.difference(ends), scenario.clutter.share(), scenario.clutter.sizes, generator
    )
    return open_ways(drawn, free, regions, CLUTTER_RADIUS)
