"""What many paths cost beside labels of each on its own; the planner in one kernel beside the one step by step."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from crowdsim.constants import TRACKING_MARGIN
from crowdsim.errors import PathNotFound
from crowdsim.jit import kernel
from crowdsim.navmesh.editing.detour_kernels import LOST, NO_ROOM
from crowdsim.planning.baselines import greedy
from crowdsim.planning.baselines.candidate_kernels import nothing_known, path_cost
from crowdsim.planning.baselines.greedy import MeshCopies, plan_greedy, plan_step_by_step
from crowdsim.planning.baselines.greedy_kernels import plan_around
from crowdsim.planning.labels.labelling_kernels import TERMS
from crowdsim.planning.planner import Planner
from tests.property.test_planner_properties import BEHAVIORS, SIZE, ends_in, place
from tests.reference import plan_roadmap


@kernel
def _costs(layers, radii, costs, turned, terms, points, ends, lengths, limits, out):
    """Fill ``out`` (n,) with what paths cost, one after the other; the sections of the last, and how many are known."""
    known = nothing_known(layers, costs.size)
    first = 0
    sections = np.empty((0, 3))
    for i in range(ends.size):
        out[i], sections, known = path_cost(
            layers, radii, costs, turned, terms, points, first, ends[i], lengths[i], limits[i], known
        )
        first = ends[i]
    return sections, known.filled[0]


def _costs_of(query, paths, limits):
    points = np.concatenate([np.empty((0, 2)), *paths])
    ends = np.cumsum([len(path) for path in paths])
    lengths = np.array([np.hypot(*np.diff(path, axis=0).T).sum() if len(path) else np.inf for path in paths])
    out = np.empty(len(paths))
    return (out, *_costs(*query.fitting(), points, ends, lengths, np.asarray(limits, float), out))


@settings(max_examples=25, deadline=None, derandomize=True)
@given(st.integers(0, 10_000), st.sampled_from([3, 20, 32]), st.integers(1, 12))
def test_paths_cost_what_labels_of_each_say(seed, count, most):
    _, meshes, rooms = place(seed, count)
    rng = np.random.default_rng(seed)
    corners = rng.uniform(0.3, SIZE - 0.3, (8, 2))  # through obstacles, too
    corners[3] = corners[2]  # a piece of no length
    query = Planner(meshes, BEHAVIORS, rooms=rooms).query(*ends_in(meshes, seed))
    # Few corners, so that most pieces are in several paths; some paths do not exist.
    paths = [corners[rng.integers(0, 8, rng.choice([0, 2, 4, 6]))] for _ in range(most)]
    paths = [path if len(path) and np.ptp(path, axis=0).any() else path[:0] for path in paths]
    expected = [plan_roadmap.annotate(meshes, query.need, path, TERMS)[1] if len(path) else np.inf for path in paths]
    limits = rng.choice([np.inf, 12.0, 30.0], most)
    found, sections, _ = _costs_of(query, paths, limits)
    for k in range(most):
        if np.isfinite(found[k]):
            assert found[k] < limits[k]
            assert found[k] == pytest.approx(expected[k], abs=1e-3)
            assert found[k] == pytest.approx(query.annotated(paths[k]).cost, rel=1e-9)
        else:
            assert expected[k] >= limits[k] - 1e-3
    if np.isfinite(found[-1]):
        np.testing.assert_allclose(sections, np.array(query.annotated(paths[-1]).sections), atol=1e-9)
    else:
        assert len(sections) == 0


def test_what_is_known_makes_room_and_tests_each_piece_once():
    _, meshes, rooms = place(1, 3)
    ends = ends_in(meshes, 1)
    query = Planner(meshes, BEHAVIORS, rooms=rooms).query(*ends)
    path = meshes[0].find_path(*ends, query.need.search_radius).points
    cost = query.annotated(path).cost
    costs, _, pieces = _costs_of(query, [path[:0], path, path, path], [np.inf, np.inf, 0.999999 * cost, 2.0 * cost])
    np.testing.assert_allclose(costs, [np.inf, cost, np.inf, cost])
    assert pieces == len(path) - 1
    fine = np.column_stack([np.interp(np.linspace(0, 1, 3000), np.linspace(0, 1, len(path)), xy) for xy in path.T])
    costs, _, _ = _costs_of(query, [path, fine, path], [np.inf] * 3)
    np.testing.assert_allclose(costs, [cost, query.annotated(fine).cost, cost])


def _queries(count):
    for seed in range(count):
        _, meshes, rooms = place(seed, 32)
        try:
            query = Planner(meshes, BEHAVIORS, rooms=rooms).query(*ends_in(meshes, seed))
            meshes[0].find_path(*query.ends, query.need.search_radius)
        except PathNotFound:
            continue
        yield query


@pytest.mark.parametrize("keep_blockers", [True, False])
def test_the_kernel_does_what_is_done_step_by_step(keep_blockers):
    ratios, gains = [], []
    for query in _queries(40):
        best = plan_step_by_step(query, keep_blockers, query.annotated, keep_blockers)
        found = plan_greedy(query, MeshCopies(query.meshes[0]), keep_blockers)
        assert (found is None) == (not best.sections)
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
    expected = plan_step_by_step(query, True, query.annotated, True)

    def give_up(*arguments):
        plan_around(*arguments)
        return status, np.inf, np.empty((0, 2)), np.empty((0, 3))

    monkeypatch.setattr(greedy, "plan_around", give_up)
    copies = MeshCopies(query.meshes[0])
    found = plan_greedy(query, copies, True)
    assert found.cost == expected.cost
    monkeypatch.undo()
    assert plan_greedy(query, copies, True).cost == pytest.approx(expected.cost, rel=0.05)


@pytest.mark.parametrize("planner", ["greedy", "greedy_literal"])
def test_plans_do_not_depend_on_plans_before(planner):
    _, meshes, rooms = place(4, 32)

    shared = Planner(meshes, BEHAVIORS, rooms=rooms, planner=planner, margin=TRACKING_MARGIN)

    def cost(seed):
        try:
            return shared.plan(*ends_in(meshes, seed), slack=False).cost
        except PathNotFound:
            return np.inf

    asked = range(6)
    first = [cost(seed) for seed in asked]
    assert [cost(seed) for seed in reversed(asked)] == first[::-1]
    assert np.isfinite(first).any()


def test_one_section_after_the_other_is_as_good_as_all_at_once():
    looked = {True: 0, False: 0}
    costs = {True: [], False: []}
    for query in _queries(40):
        for one_by_one in (True, False):

            def annotate(points, query=query, one_by_one=one_by_one):
                looked[one_by_one] += 1
                return query.annotated(points)

            costs[one_by_one].append(plan_step_by_step(query, True, annotate, one_by_one).cost)
    ratios = np.array(costs[True]) / np.array(costs[False])
    assert np.nanmean(ratios) < 1.02
    assert looked[True] < 0.8 * looked[False]
