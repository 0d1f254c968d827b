"""The same scenario and seed give the same run to the bit, whatever the number of workers."""

import json

import h5py
import numpy as np

SHORT = ("--json", "--set", "duration=6", "--set", "agents.0.count=4", "--set", "agents.0.interval=1")


def hashing(call):
    """A function that runs the corridor by ``call`` and returns the hash of its state."""

    def run(*options: str) -> str:
        finished = call("run", "corridor", *SHORT, *options)
        assert finished.returncode == 0, finished.stderr
        summary = json.loads(finished.stdout)
        assert summary["characters"] == 4
        assert summary["steps"] > 0
        int(summary["state_hash"], 16)
        return summary["state_hash"]

    return run


def test_the_number_of_workers_does_not_change_the_run(crowdsim_here, tmp_path):
    hashes = [hashing(crowdsim_here)("--workers", workers, "-o", f"{workers}.h5") for workers in ("1", "2", "4")]
    assert len(set(hashes)) == 1
    with h5py.File(tmp_path / "1.h5") as one, h5py.File(tmp_path / "4.h5") as four:
        assert set(one["steps"]) == set(four["steps"])
        for name in one["steps"]:
            np.testing.assert_array_equal(one["steps"][name][:], four["steps"][name][:])


def test_a_second_run_is_the_same_and_another_seed_is_not(crowdsim):
    """In processes of their own, whose addresses and hashes differ."""
    state_hash = hashing(crowdsim)
    assert state_hash("--seed", "3") == state_hash("--seed", "3") != state_hash("--seed", "4")


def test_a_run_prints_one_json_object_and_nothing_else(crowdsim):
    finished = crowdsim("run", "corridor", *SHORT)
    assert finished.stdout.count("\n") == 1
    summary = json.loads(finished.stdout)
    wanted = {"characters", "arrived", "steps", "state_hash", "behavior_share", "closest_pair", "real_time_factor"}
    assert wanted <= summary.keys()
    assert "compiling" not in crowdsim("run", "corridor", *SHORT).stderr
