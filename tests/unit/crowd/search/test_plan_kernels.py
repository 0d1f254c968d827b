"""Blend offsets of chains that searches find."""

from __future__ import annotations

import numpy as np
import pytest

from crowdsim.crowd.search.plan_kernels import measure_offsets
from tests.reference.crowd import chain_of, walking_graph

GRAPH = walking_graph()


@pytest.mark.parametrize("heading", [0.0, 1.3, -3.0])
@pytest.mark.parametrize("seed", range(4))
def test_offsets_are_those_of_the_slow_chain(heading: float, seed: int) -> None:
    nodes = [1, 2, 2, 3]
    origins, expected = chain_of(GRAPH, nodes, np.array([0.3, -0.2, heading]))
    # Nodes begin where a search puts them, turned and off their ends.
    off = np.random.default_rng(seed).uniform(-0.4, 0.4, (len(nodes), 3))
    origins, expected = origins + off, expected[1:].copy()
    for k, node in enumerate(nodes[:-1]):
        x, y = GRAPH.node_motion[node, :2]
        c, s = np.cos(origins[k, 2]), np.sin(origins[k, 2])
        expected[k, :2] = origins[k, :2] + [c * x - s * y, s * x + c * y] - origins[k + 1, :2]
        expected[k, 2] += off[k, 2] - off[k + 1, 2]
    found = np.empty((len(nodes) - 1, 3))
    measure_offsets(GRAPH.node_motion, np.array(nodes, np.int32), origins, found)
    assert found[:, :2] == pytest.approx(expected[:, :2], abs=1e-12)
    assert np.cos(found[:, 2] - expected[:, 2]) == pytest.approx(1.0, abs=1e-12)
    assert (np.abs(found[:, 2]) <= np.pi).all()


def test_a_chain_of_one_node_has_no_offsets() -> None:
    found = np.full((0, 3), np.nan)
    measure_offsets(GRAPH.node_motion, np.array([1], np.int32), np.zeros((1, 3)), found)
    assert found.shape == (0, 3)
