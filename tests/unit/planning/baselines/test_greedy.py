"""The published planner in one kernel beside the one step by step."""

import numpy as np
import pytest

from crowdsim.errors import PathNotFound
from crowdsim.navmesh.editing.detour_kernels import LOST, NO_ROOM
from crowdsim.planning.baselines import greedy
from crowdsim.planning.baselines.greedy import MeshCopies, plan_greedy, plan_step_by_step
from crowdsim.planning.baselines.greedy_kernels import plan_around
from crowdsim.planning.planner import Planner
from tests.property.test_planner_properties import BEHAVIORS, ends_in, place


def _queries(count):
    for seed in range(count):
        _, meshes, rooms = place(seed, 32)
        try:
            query = Planner(meshes, BEHAVIORS, areas=rooms).query(*ends_in(meshes, seed))
            meshes[0].find_path(*query.ends, query.need.search_radius)
        except PathNotFound:
            continue
        yield query


def test_the_kernel_does_what_is_done_step_by_step():
    ratios, gains = [], []
    for query in _queries(40):
        best = plan_step_by_step(query, query.annotated)
        found = plan_greedy(query, MeshCopies(query.meshes[0]))
        assert (found is None) == (best is None)
        if found is None:
            continue
        again = query.annotated(found.points)
        assert found.cost == pytest.approx(again.cost, rel=1e-9)
        np.testing.assert_allclose(np.array(found.sections), np.array(again.sections), atol=1e-9)
        assert len(query.meshes[0].violations(found.points, query.need.search_radius)) == 0
        ratios.append(found.cost / best.cost)
        direct = query.meshes[0].find_path(*query.ends, query.need.search_radius)
        gains.append(best.cost < query.annotated(direct.points).cost)
    # Searches without the guide find other ways now and then.
    assert len(ratios) > 20
    assert sum(gains) > 5
    assert np.mean(np.abs(np.array(ratios) - 1.0) < 1e-6) > 0.9
    assert np.mean(ratios) == pytest.approx(1.0, abs=0.02)


@pytest.mark.parametrize("status", [NO_ROOM, LOST])
def test_where_the_kernel_gives_up_plans_are_made_step_by_step(monkeypatch, status):
    query = list(_queries(10))[1]  # where searches without a guide find the same
    expected = plan_step_by_step(query, query.annotated)

    def give_up(*arguments):
        plan_around(*arguments)
        return status, np.inf, np.empty((0, 2)), np.empty((0, 3))

    monkeypatch.setattr(greedy, "plan_around", give_up)
    copies = MeshCopies(query.meshes[0])
    found = plan_greedy(query, copies)
    assert found.cost == expected.cost
    monkeypatch.undo()
    assert plan_greedy(query, copies).cost == pytest.approx(expected.cost, rel=0.05)


def test_plans_do_not_depend_on_plans_before():
    _, meshes, rooms = place(4, 32)
    shared = Planner(meshes, BEHAVIORS, areas=rooms, planner="greedy_literal")

    def cost(seed):
        try:
            return shared.plan(*ends_in(meshes, seed), margin=False).cost
        except PathNotFound:
            return np.inf

    asked = range(6)
    first = [cost(seed) for seed in asked]
    assert [cost(seed) for seed in reversed(asked)] == first[::-1]
    assert np.isfinite(first).any()
