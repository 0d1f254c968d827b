"""Ways over intervals are about as short as the shortest over any points of the same sides."""

import math

import numpy as np
import pytest

from crowdsim.jit import kernel
from crowdsim.navmesh.navmesh import NavMesh
from crowdsim.navmesh.paths.interval_kernels import find_way, string_along
from crowdsim.navmesh.paths.region_kernels import REGION, find_regions
from crowdsim.navmesh.paths.tangent_kernels import STRING_NODE
from crowdsim.navmesh.paths.workspace import empty_workspace
from tests.reference.navmesh_reference import random_area
from tests.reference.way_reference import shortest_way
from tests.support.entries import disc_clearance


@kernel
def _search(m, regions, work, start, sx, sy, goal, gx, gy, radius):
    """The last label, the nodes and their number."""
    last, _, _ = find_way(m, regions, work, start, sx, sy, goal, gx, gy, radius, 2.0 * radius, None)
    if last < 0:
        return last, np.empty(0, STRING_NODE), 0
    nodes, count = string_along(m, work.labels, last, sx, sy, gx, gy, radius)
    return last, nodes, count


def _way_length(labels, last, start, goal):
    """Meters from root to root, and over the part of the last side that is seen."""
    label = labels[last]
    root = np.array([label["rx"], label["ry"]])
    ends = np.array([[label["lx"], label["ly"]], [label["px"], label["py"]]])
    over = ends[0] + np.linspace(0.0, 1.0, 2001)[:, None] * (ends[1] - ends[0])
    rest = np.hypot(*(over - root).T) + np.hypot(*(over - goal).T)
    spent = 0.0
    while label["corner"] >= 0:
        before = labels[label["before"]]
        spent += math.dist((before["rx"], before["ry"]), (label["rx"], label["ry"]))
        label = before
    assert (label["rx"], label["ry"]) == start
    return spent + rest.min()


@pytest.mark.parametrize("kind", ["boxes", "walls", "lattice"])
def test_ways_are_about_the_shortest(kind):
    rng = np.random.default_rng(21)
    mesh = NavMesh(random_area(rng, kind, size=9.0, count=25)).arrays
    regions = np.empty(mesh.frame["triangles"][0], REGION)
    find_regions(mesh, regions)
    work = empty_workspace(len(regions))
    ratios = []
    blocked = 0
    for sx, sy, gx, gy in rng.uniform(0.0, 9.0, (120, 4)):
        radius = rng.choice([0.02, 0.1, 0.3, 0.5])
        ends = [disc_clearance(mesh, x, y, 9.0, -1) for x, y in ((sx, sy), (gx, gy))]
        if min(clear for clear, _ in ends) <= radius or ends[0][1] == ends[1][1]:
            continue
        (_, start), (_, goal) = ends
        shortest = shortest_way(mesh, (sx, sy), start, (gx, gy), goal, radius, 2.0 * radius)
        last, nodes, count = _search(mesh, regions, work, start, sx, sy, goal, gx, gy, radius)
        assert (last >= 0) == math.isfinite(shortest)
        if last < 0:
            blocked += 1
            continue
        ratios.append(_way_length(work.labels, last, (sx, sy), (gx, gy)) / shortest)
        assert nodes["vertex"][[0, count - 1]].tolist() == [-1, -1]
        assert (nodes["vertex"][1 : count - 1] >= 0).all()
    assert len(ratios) > 10
    assert blocked > 0
    assert max(ratios) < 1.05
    assert np.mean(ratios) < 1.003
