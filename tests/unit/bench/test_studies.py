"""The benchmark of sweeps, with few points."""

from crowdsim.bench.studies import measure


def test_sweeps_and_calls_are_timed_and_a_killed_sweep_ends_with_the_same_table() -> None:
    found = measure(points=4, calls=1, killed_points=3, kills=2)
    assert [row["points"] for row in found.rows] == [1, 4, 1]
    assert found.figures["kills"] >= 1
    assert found.figures["sweep_times_run"] > 0.0
    assert 0.0 < found.rows[1]["cpu_s_a_point"] < 600.0
