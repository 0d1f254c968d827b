"""The parts of ``crowdsim run`` that need no run."""

import pytest

from crowdsim.cli.summary import summary_rows
from crowdsim.crowd.report.steered_statistics import CENTER_LIMIT
from crowdsim.errors import CrowdSimError
from crowdsim.whole_files import require_writable, whole_file

SUMMARY = {
    "characters": 3,
    "arrived": 2,
    "waiting": 1,
    "on_the_way": {"guards": [0], "guests": [4, 5, 6, 7, 8, 9], "late": []},
    "not_entered": {"guards": [], "guests": [], "late": [2, 3]},
    "unreachable": {"1": "no path: too narrow"},
    "laps": {"guards": 7},
    "exits": {"north": {"left": 2, "last": 8.25}, "south": {"left": 0, "last": None}},
    "events": [
        {"event": "close 'front'", "at": 4.0, "outcome": "happened", "late": 2.5},
        {"event": "open 'front'", "at": 9.0, "outcome": "happened", "late": 0.0},
        {"event": "insert 'crate'", "at": 11.5, "outcome": "waiting", "late": None},
    ],
    "replans": 5,
    "stands": {"stood": 2, "off_goal_p95": 0.061, "off_goal_most": 0.062, "off_heading_most": 9.7},
    "searches": {
        "asked": 58,
        "sliced": 3,
        "backtracked": 2,
        "recovered": 1,
        "first_movement_ms_median": 3.21,
        "first_movement_ms_p95": 9.0,
    },
    "steps": 300,
    "mean_time": 8.25,
    "state_hash": "00ff00ff00ff00ff",
    "behavior_share": {"frontal": 0.5, "arm_constrained": 0.25, "lateral": 0.25},
    "behavior_share_by_area": {
        "gap": {"frontal": 0.0, "arm_constrained": 0.0, "lateral": 1.0},
        "attic": {"frontal": 0.0},
    },
    "areas": {
        "gap": {"density": 0.5, "density_most": 2.25, "speed": 1.125},
        "attic": {"density": 0.0, "density_most": 0.0, "speed": None},
    },
    "lines": {
        "door": {"to_left": 3, "to_right": 40, "flow": 1.5, "flow_per_m": 1.25},
        "window": {"to_left": 0, "to_right": 1, "flow": None, "flow_per_m": None},
    },
    "closest_pair": 0.7125,
    "obstacle_margin": {"legs": 0.05, "torso": 0.0625},
    "stance_foot_speed": 0.03,
    "lowest_foot": -0.001,
    "real_time_factor": 12.34,
    "recording": "corridor.h5",
}


def test_the_summary_is_shown_with_units():
    rows = dict(summary_rows(SUMMARY))
    assert rows["characters"] == "3"
    assert rows["  on the way at the end"] == "guards 1 (agent 0); guests 6 (agents 4, 5, 6, 7, 8, ...)"
    assert rows["    of these, waiting"] == "1"
    assert rows["  did not enter"] == "late 2 (agents 2, 3)"
    assert rows["mean time to arrive"] == "8.2 s"
    assert rows["share of the way"] == "frontal 50%, arm_constrained 25%, lateral 25%"
    assert rows["  in gap"] == "lateral 100%"
    assert rows["density in gap"] == "0.50 /m2, 2.25 at most; 1.12 m/s"
    assert rows["density in attic"] == "0.00 /m2, 0.00 at most; none"
    assert rows["passages at door"] == "3 to the left, 40 to the right; 1.50 /s, 1.25 /(m s)"
    assert rows["passages at window"] == "0 to the left, 1 to the right"
    assert rows["  in attic"] == "no agent went here"
    assert rows["  no way for agent 1"] == "no path: too narrow"
    assert rows["body to obstacle, torso"] == "0.062 m"
    assert rows["rounds of guards"] == "7"
    assert rows["left through north"] == "2, the last one at 8.2 s"
    assert rows["left through south"] == "0"
    assert rows["events"] == "2 of 3 that were due happened"
    assert rows["  close 'front' at 4 s"] == "2.5 s late: an agent was in the way"
    assert rows["  insert 'crate' at 11.5 s"] == "never: an agent was in the way until the end"
    assert "  open 'front' at 9 s" not in rows
    assert rows["plans made anew for them"] == "5"
    assert rows["state hash"] == "00ff00ff00ff00ff"
    assert rows["stands at goals"] == "2, 6.2 cm off at most, turned 10 degrees off at most"
    assert rows["searches for motion"] == (
        "58, 3 in several slices; 2 turned back behind nodes already played, 1 found motion from there; first"
        " movement after 3.2 ms"
    )


def test_a_run_without_arrivals_or_company_has_a_summary():
    searches = dict.fromkeys(SUMMARY["searches"], 0) | {"asked": 1, "first_movement_ms_median": None}
    nothing = {"events": [], "arrived": 0, "mean_time": None, "closest_pair": None, "searches": searches}
    rows = dict(summary_rows({**SUMMARY, **nothing}))
    assert rows["searches for motion"] == "1"
    assert rows["mean time to arrive"] == "none"
    assert rows["closest two, center to center"] == f"none within {CENTER_LIMIT:g} m"
    assert "  body to body" not in rows


def test_bodies_that_touch_have_a_row():
    rows = dict(summary_rows({**SUMMARY, "closest_bodies": 0.0}))
    assert rows["  body to body"] == "0.000 m"


def test_a_place_that_can_be_written_is_accepted_and_left_untouched(tmp_path):
    require_writable(tmp_path / "new.h5")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("letter", ["a", "é", "市"])
def test_a_name_as_long_as_names_may_be_is_written(tmp_path, letter):
    file = tmp_path / f"{letter * (250 // len(letter.encode()))}.html"
    with whole_file(file, (".html",), "pages") as part:
        part.touch()
    assert list(tmp_path.iterdir()) == [file]


@pytest.mark.parametrize("place", [".", "absent/a.h5", "file/a.h5"])
def test_a_place_that_cannot_be_written_is_refused(tmp_path, place):
    (tmp_path / "file").touch()
    with pytest.raises(CrowdSimError, match="cannot write"):
        require_writable(tmp_path / place)
