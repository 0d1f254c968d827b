"""The benchmark of navigation meshes, on a small map."""

import json

import numpy as np
import pytest
import shapely

from crowdsim.bench.places import navmesh
from crowdsim.bench.places.navmesh_maps import BenchMap, clutter, read_maps
from crowdsim.bench.registry import run_bench
from crowdsim.errors import CrowdSimError


def test_generated_clutter_is_free_at_its_queries_and_the_same_every_time():
    one, other = (clutter(60, 15.0, 0.25, 40, seed=3) for _ in range(2))
    assert one.area.equals(other.area)
    np.testing.assert_array_equal(one.queries, other.queries)
    assert len(one.obstacles) == 60
    room = shapely.box(0, 0, 15, 15)
    assert all(room.contains_properly(obstacle) for obstacle in one.obstacles)
    assert all(obstacle.equals(obstacle.convex_hull) for obstacle in one.obstacles)
    points = shapely.points(one.queries.reshape(-1, 2))
    assert shapely.distance(points, one.area.boundary).min() >= 0.25
    assert shapely.contains(one.area, points).all()
    assert np.isnan(one.optimum).all()


def test_a_small_map_gives_rows_of_the_same_columns(monkeypatch):
    monkeypatch.setattr(navmesh, "_EDITS", 5)
    monkeypatch.setattr(navmesh, "_RANDOM", 20)
    where = clutter(12, 8.0, 0.2, 10)
    straight = np.hypot(*(where.queries[:, 2:] - where.queries[:, :2]).T)
    table = navmesh._Table()
    navmesh.measure_map(table, BenchMap("tiny", where.area, where.obstacles, 0.2, where.queries, straight))
    keys = {tuple(row) for row in table.rows}
    assert keys == {("map", "what", "radius", "median_us", "p95_us", "ratio", "found", "violations")}
    rows = {row["what"]: row for row in table.rows}
    assert len(rows) == len(table.rows)
    assert {"build, own", "build, triangle", "clearance", "reachable", "locate"} <= rows.keys()
    for optimality in ("fast", "best"):
        assert rows[f"path, {optimality}"]["violations"] == 0
        assert 0 < rows[f"path, {optimality}"]["found"] <= 10
        assert rows[f"path, {optimality}"]["ratio"] >= 1.0
    assert table.figures["tiny_path_fast_violations"] == 0
    assert json.loads(json.dumps(table.figures)) == table.figures
    assert all(value >= 0 for value in table.figures.values())


def test_violations_are_counted_by_shapely():
    from crowdsim.navmesh.navmesh import NavMesh

    where = clutter(12, 8.0, 0.2, 10)
    paths = NavMesh(where.area).find_paths(where.queries[:, :2], where.queries[:, 2:], 0.1)
    found = np.flatnonzero(paths.status == 0)
    wider = BenchMap("tiny", where.area, where.obstacles, 0.15, where.queries, where.optimum)
    distances = [shapely.LineString(paths[int(i)].points).distance(where.area.boundary) for i in found]
    expected = np.count_nonzero(np.array(distances) < 0.15 - 1e-5)
    assert 0 < expected == navmesh._violations(wider, paths, found)


def test_maps_are_read_or_refused(tmp_path, shared):
    maps = read_maps(shared / "oracles" / "maps")
    assert [where.name for where in maps] == ["clutter_200", "clutter_2000", "apartment_24"]
    assert all(where.queries.shape == (len(where.optimum), 4) for where in maps)
    assert all(np.nanmin(where.optimum) > 0.0 for where in maps)


def test_wrong_maps_are_refused(tmp_path):
    with pytest.raises(CrowdSimError, match=r"clutter_200\.json: cannot be read"):
        run_bench("navmesh", tmp_path)
    (tmp_path / "clutter_200.json").write_text('{"name": "clutter_200"}')
    with pytest.raises(CrowdSimError, match=r"no map of a benchmark.*obstacles"):
        run_bench("navmesh", tmp_path)
    (tmp_path / "clutter_200.json").write_text("{")
    with pytest.raises(CrowdSimError, match="no map of a benchmark"):
        run_bench("navmesh", tmp_path)
    with pytest.raises(CrowdSimError, match="'startup' takes no maps"):
        run_bench("startup", tmp_path)
