"""Records are copied whole, with the same content as field by field."""

import numpy as np
import pytest

from crowdsim.ecs.records import joined, opaque

KIND = np.dtype([("x", np.float64), ("place", np.float32, (2,)), ("kind", np.int8)], align=True)


def some(count: int, seed: int) -> np.ndarray:
    draw = np.random.default_rng(seed)
    records = np.zeros(count, KIND)
    records["x"], records["place"], records["kind"] = (
        draw.random(count),
        draw.random((count, 2)),
        draw.integers(9, size=count),
    )
    return records


@pytest.mark.parametrize(("first", "second"), [(5, 3), (0, 4), (4, 0), (0, 0)])
def test_joined_records_are_those_of_numpy(first, second):
    a, b = some(first, 1), some(second, 2)
    np.testing.assert_array_equal(joined(a, b), np.concatenate((a, b)))
    assert joined(a, b).dtype == KIND


def test_an_opaque_view_writes_through_and_leaves_numbers_as_they_are():
    records, others = some(6, 3), some(6, 4)
    keep = np.array([True, False, True, True, False, False])
    wanted = others[keep]
    opaque(records)[:3] = opaque(others)[keep]
    np.testing.assert_array_equal(records[:3], wanted)
    numbers = np.arange(4.0)
    assert opaque(numbers) is numbers
