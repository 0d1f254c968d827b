"""``crowdsim motion coverage``: what turns a set of motions can follow."""

import json

import pytest


def test_the_table_is_printed_and_drawn(crowdsim_here, tmp_path):
    done = crowdsim_here("motion", "coverage", "default", "--json", "--picture", "turns.png", "--depth", "2.5m")
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    rows = {row.pop("turn"): row for row in result["percent"]}
    assert {"straight", "left, 1 m", "right, 1 m"} <= set(rows)
    assert rows["straight"]["0.5 m"] == 100.0
    assert min(row["0.5 m"] for row in rows.values()) == 100.0
    assert max(row["0.2 m"] for row in rows.values()) < 100.0, "no walk fits there, its arms swing"
    assert all(0.0 <= percent <= 100.0 for row in rows.values() for percent in row.values())
    assert result["maps"]["entries"] > 1000
    assert (tmp_path / "turns.png").stat().st_size > 10_000


@pytest.mark.parametrize("depth", ["0", "-2", "2.5", "m", "deep"])
def test_a_depth_that_is_none_is_refused(crowdsim_here, depth):
    done = crowdsim_here("motion", "coverage", "default", "--depth", depth)
    assert done.returncode == 2
    assert "neither nodes, as 4, nor meters, as 3.5m" in done.stderr


def test_what_is_neither_a_folder_nor_a_set_is_bad_input(crowdsim_here):
    done = crowdsim_here("motion", "coverage", "no_such_set")
    assert done.returncode == 2
    assert "neither a folder of captures nor one of" in done.stderr
