"""The benchmark of many characters, on a few for some seconds."""

import json

import numpy as np
import pytest

from crowdsim.bench import crowd


@pytest.fixture(scope="module")
def measured():
    return crowd.measure(characters=12, seconds=5.0, run_seconds=4.0, requests=3)


def test_characters_walk_and_some_arrive(measured):
    rows = {row["what"]: row for row in measured.rows}
    assert set(rows) == {"playing, after all asked at once", "playing", "run"}
    # In these 15 s most of the twelve arrive once, whatever the places drawn; at most times half of them walk.
    assert measured.figures["playing_walking_at_the_end"] >= 1
    assert rows["playing"]["arrivals"] >= 4
    assert rows["run"]["asked"] >= 12
    assert all(0.0 < row["frame_ms_median"] <= row["frame_ms_p95"] <= row["frame_ms_most"] for row in measured.rows)


def test_figures_are_plain_numbers(measured):
    assert json.loads(json.dumps(measured.figures)) == measured.figures
    assert not np.isnan(list(measured.figures.values())).any()
    told = {"first_movement_ms_median", "at_once_frame_ms_p99", "playing_frame_ms_p95", "run_cpu_ms_mean"}
    assert told <= set(measured.figures)
