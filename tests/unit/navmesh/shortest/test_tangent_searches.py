"""The search that keeps one arrival at an arc says what it may have lost; the one that keeps all is never longer."""

import math

import numpy as np
import pytest
import shapely

from crowdsim.jit import kernel
from crowdsim.navmesh.navmesh import NavMesh
from crowdsim.navmesh.shortest.complete_search_kernels import search_all, string_of_arrival
from crowdsim.navmesh.shortest.end_kernels import stand_at
from crowdsim.navmesh.shortest.tangent_graph import RadiusGraph
from crowdsim.navmesh.shortest.tangent_search_kernels import search_tangents


@kernel
def _search_both(m, graph, scratch, sx, sy, gx, gy, disc):
    start = stand_at(m, sx, sy, disc.least)
    goal = stand_at(m, gx, gy, disc.least)
    if start.triangle < 0 or goal.triangle < 0:
        return np.inf, np.inf, np.inf, 0
    _, one, lost = search_tangents(m, graph, scratch, start, goal, disc, np.inf)
    arrivals, last, every = search_all(m, graph, scratch, start, goal, disc, np.inf)
    bends = string_of_arrival(graph, arrivals, last, start, goal, disc.radius).size - 2 if last >= 0 else 0
    return one, lost, every, bends


@pytest.mark.parametrize("radius", [0.25, 0.3])
def test_what_the_search_with_one_arrival_loses_it_tells(radius):
    corners = np.arange(1.0, 5.0, 1.0 + 2.0 * radius)
    holes = [shapely.box(x, y, x + 1.0, y + 1.0) for x in corners for y in corners]
    mesh = NavMesh(shapely.box(0.0, 0.0, 6.0, 6.0).difference(shapely.union_all(holes)))
    graph = RadiusGraph(mesh.arrays, radius, radius - mesh.tolerance(radius), 1)
    rng = np.random.default_rng(1)
    places = [mesh.nearest_free(point, radius) for point in rng.uniform(0.0, 6.0, (300, 2))]
    found = 0
    with graph.scratch() as scratch:
        for start, goal in zip(places[::2], places[1::2], strict=True):
            one, lost, every, bends = _search_both(mesh.arrays, graph.arrays, scratch, *start, *goal, graph.disc)
            length = mesh.find_paths([start], [goal], radius, "best").lengths[0]
            if length <= math.dist(start, goal) + 1e-9:  # the straight way is not the business of these searches
                continue
            assert every == np.inf if np.isnan(length) else length == pytest.approx(every, abs=1e-9)
            assert every <= one + 1e-9
            assert every >= min(one, lost) - 1e-9
            assert (bends > 0) == (every < np.inf)
            found += every < np.inf
    assert found > 100
