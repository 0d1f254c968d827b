"""Feet of captured bodies as recordings show them: the bars of planted feet."""

from pathlib import Path

import pytest

from crowdsim.bench.motions.planted_feet import measure
from crowdsim.errors import CrowdSimError


@pytest.mark.parametrize("name", ["corridor", "clutter"])
def test_planted_feet_of_the_built_in_set_drift_by_less_than_a_centimeter(name: str) -> None:
    (row,) = measure(names=(name,)).rows
    assert row["stances"] > 100
    assert row["most_cm"] <= 1.0
    assert row["added_most_cm"] <= 0.5


def test_a_folder_without_captures_is_refused(tmp_path: Path) -> None:
    with pytest.raises(CrowdSimError):
        measure(tmp_path)
