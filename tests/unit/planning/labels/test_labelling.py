import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from crowdsim.planning.labels.labelling import label_path
from crowdsim.planning.labels.labelling_kernels import MIN_SECTION, TERMS, label_cells
from tests.reference.plan_labelling import cheapest, cost_of

COSTS = np.array([3.0, 1.1, 1.0])
TURNED = np.array([True, False, False])
NOTHING = np.empty((0, 2))


def intervals(*pairs):
    return np.array(pairs, dtype=float).reshape(-1, 2)


def run_kernel(cuts, widest, costs=COSTS, turned=TURNED):
    shape = (len(cuts), len(costs), len(costs) + 1)
    best, chosen = np.empty(shape), np.empty((2, *shape), dtype=np.int32)
    labels = np.full(len(widest), -1, dtype=np.int32)
    cost = label_cells(cuts, widest, costs, turned, TERMS, best, chosen[0], chosen[1], labels)
    return labels, cost


@settings(max_examples=50, deadline=None, derandomize=True)
@given(
    st.lists(
        st.tuples(st.sampled_from([0.1, 0.3, 0.6, 0.7, 1.3, 2.0, 4.0]), st.integers(0, 2)), min_size=1, max_size=7
    ),
    st.lists(st.booleans(), min_size=3, max_size=3),
)
def test_kernel_finds_the_cheapest_of_all_labellings(cells, turned):
    lengths, widest = zip(*cells, strict=True)
    cuts = np.concatenate([[0.0], np.cumsum(lengths)])
    widest = np.array(widest, dtype=np.int32)
    labels, cost = run_kernel(cuts, widest, turned=np.array(turned))
    expected = cheapest(cuts, widest, COSTS, turned)
    assert cost == pytest.approx(expected, abs=1e-9)
    assert cost_of(tuple(labels.tolist()), cuts, widest, COSTS, turned) == pytest.approx(cost, abs=1e-9)


def test_unobstructed_path_is_one_preferred_section():
    sections, cost = label_path([NOTHING] * 3, COSTS, TURNED, 5.0)
    assert sections == ((2, 0.0, 5.0),)
    assert cost == pytest.approx(5.0)


def test_nothing_fits_somewhere():
    assert label_path([intervals((1, 2))] * 3, COSTS, TURNED, 5.0) == ((), np.inf)


def test_sliver_is_lengthened_evenly_toward_the_narrower():
    sections, _ = label_path([NOTHING, NOTHING, intervals((4.9, 5.1))], COSTS, TURNED, 10.0)
    assert [s.behavior for s in sections] == [2, 1, 2]
    assert sections[1].start == pytest.approx(5.0 - MIN_SECTION / 2)
    assert sections[1].end == pytest.approx(5.0 + MIN_SECTION / 2)


def test_sliver_at_an_end_stays_on_the_path():
    sections, _ = label_path([NOTHING, NOTHING, intervals((0.0, 0.1))], COSTS, TURNED, 10.0)
    assert [tuple(s) for s in sections] == [(1, 0.0, pytest.approx(MIN_SECTION)), (2, pytest.approx(MIN_SECTION), 10.0)]


def test_island_of_room_is_not_worth_two_changes():
    sections, _ = label_path([NOTHING, NOTHING, intervals((2, 4), (5, 8))], COSTS, TURNED, 10.0)
    assert [s.behavior for s in sections] == [2, 1, 2]


def test_turned_sections_close_to_each_other_become_one():
    sections, _ = label_path([NOTHING, *[intervals((4, 5), (6.5, 8))] * 2], COSTS, TURNED, 12.0)
    assert [tuple(s) for s in sections] == [(2, 0.0, 4.0), (0, 4.0, 8.0), (2, 8.0, 12.0)]


def test_turned_section_reaches_over_a_tight_stretch_to_where_the_body_can_turn():
    sections, _ = label_path([NOTHING, intervals((4, 5)), intervals((3, 5), (5.5, 7))], COSTS, TURNED, 12.0)
    assert [tuple(s) for s in sections] == [(2, 0.0, 3.0), (0, 3.0, 7.0), (2, 7.0, 12.0)]


def test_path_of_no_length():
    sections, cost = label_path([NOTHING] * 3, COSTS, TURNED, 0.0)
    assert sections == ((2, 0.0, 0.0),)
    assert cost == 0.0
