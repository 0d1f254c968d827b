"""The cheapest of many paths beside labels of each on its own, and plans that do not depend on those before."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from crowdsim.constants import TRACKING_MARGIN
from crowdsim.errors import PathNotFound
from crowdsim.planning.candidate_kernels import PIECE, cheapest_path
from crowdsim.planning.fitting_kernels import OWN_SPAN
from crowdsim.planning.labelling_kernels import TERMS
from crowdsim.planning.planner import make_query, plan_path
from tests.property.test_planner_properties import BEHAVIORS, SIZE, ends_in, place
from tests.reference import plan_roadmap


def _cheapest(query, paths, least, known):
    """What the kernel answers, with as much known as ``known`` (pieces, spans, filled) says, which is brought up."""
    points = np.concatenate([np.empty((0, 2)), *paths])
    ends = np.cumsum([len(path) for path in paths])
    lengths = np.array([np.hypot(*np.diff(path, axis=0).T).sum() if len(path) else np.inf for path in paths])
    chosen, cost, sections, known["pieces"], known["spans"] = cheapest_path(
        *query.fitting(), points, ends, lengths, least, known["pieces"], known["spans"], known["filled"]
    )
    return chosen, cost, sections


def _nothing_known(rows):
    return {"pieces": np.zeros(rows, PIECE), "spans": np.empty(1, OWN_SPAN), "filled": np.zeros(2, np.int64)}


@settings(max_examples=25, deadline=None, derandomize=True)
@given(st.integers(0, 10_000), st.sampled_from([3, 20, 32]), st.sampled_from([4, 4096]), st.integers(1, 6))
def test_the_cheapest_path_is_that_of_labels_one_by_one(seed, count, rows, most):
    _, meshes, rooms = place(seed, count)
    rng = np.random.default_rng(seed)
    corners = rng.uniform(0.3, SIZE - 0.3, (8, 2))  # through obstacles, too
    corners[3] = corners[2]  # a piece of no length
    query = make_query(meshes, BEHAVIORS, *ends_in(meshes, seed), rooms=rooms)
    known = _nothing_known(rows)
    for _ in range(3):
        # Few corners, so that most pieces are in several paths; some paths do not exist.
        paths = [corners[rng.integers(0, 8, rng.choice([0, 2, 4, 6]))] for _ in range(most)]
        costs = [
            plan_roadmap.annotate(meshes, query.need, path, TERMS)[1]
            if len(path) and np.ptp(path, axis=0).any()
            else np.inf
            for path in paths
        ]
        paths = [
            path if np.isfinite(cost) or len(path) > 2 else path[:0] for path, cost in zip(paths, costs, strict=True)
        ]
        least = rng.choice([np.inf, 12.0])
        chosen, cost, sections = _cheapest(query, paths, least, known)
        if chosen < 0:
            assert (cost, len(sections)) == (least, 0)
            assert min(costs) >= least - 1e-3
        else:
            assert cost == pytest.approx(min(costs), abs=1e-3)
            assert cost == pytest.approx(costs[chosen], abs=1e-3)
            alone = query.annotated(paths[chosen])
            assert cost == pytest.approx(alone.cost, rel=1e-9)
            np.testing.assert_allclose(sections, np.array(alone.sections), atol=1e-9)


def test_the_first_of_paths_that_cost_the_same_is_taken():
    _, meshes, rooms = place(1, 3)
    ends = ends_in(meshes, 1)
    query = make_query(meshes, BEHAVIORS, *ends, rooms=rooms)
    path = meshes[0].find_path(*ends, query.need.search_radius).points
    known = _nothing_known(64)
    chosen, cost, _ = _cheapest(query, [path[:0], path, path], np.inf, known)
    assert chosen == 1
    assert known["filled"][0] == len(path) - 1  # each piece once
    assert _cheapest(query, [path], cost, known)[0] == -1


@pytest.mark.parametrize("planner", ["greedy", "greedy_literal"])
def test_plans_do_not_depend_on_plans_before(planner):
    _, meshes, rooms = place(4, 32)

    def cost(seed):
        try:
            ends = ends_in(meshes, seed)
            return plan_path(
                meshes, BEHAVIORS, *ends, rooms=rooms, planner=planner, slack=False, margin=TRACKING_MARGIN
            ).cost
        except PathNotFound:
            return np.inf

    asked = range(6)
    first = [cost(seed) for seed in asked]
    assert [cost(seed) for seed in reversed(asked)] == first[::-1]
    assert np.isfinite(first).any()
