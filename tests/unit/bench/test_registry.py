"""Benchmarks by name."""

import json
from dataclasses import asdict

import pytest

from crowdsim.bench import registry
from crowdsim.bench.machine import describe_machine, describe_versions
from crowdsim.bench.registry import Measurement, bench_names, run_bench
from crowdsim.errors import CrowdSimError


def test_an_unknown_name_is_refused_with_the_known():
    with pytest.raises(CrowdSimError, match="startup"):
        run_bench("absent")


def test_every_benchmark_can_be_imported_and_measures():
    import importlib

    for name in bench_names():
        module, _ = registry._BENCHES[name]
        assert callable(importlib.import_module(module).measure)


def test_a_result_carries_machine_versions_rows_and_figures(monkeypatch):
    from crowdsim.bench import startup

    measured = Measurement([{"until": "x", "median_s": 1.0}], {"x_s": 1.0})
    monkeypatch.setattr(startup, "measure", lambda: measured)
    result = json.loads(json.dumps(asdict(run_bench("startup"))))
    assert result["name"] == "startup"
    assert result["rows"] == measured.rows
    assert result["figures"] == measured.figures
    assert result["machine"]["cores"] >= 1
    assert result["versions"]["numba"] != "missing"


def test_machine_and_versions_name_what_ran():
    assert describe_machine()["processor"]
    versions = describe_versions()
    assert {"crowdsim", "python", "numpy", "numba", "shapely"} <= versions.keys()
    assert "missing" not in versions.values()


def test_a_depth_is_refused_where_no_maps_are_built():
    with pytest.raises(CrowdSimError, match="'startup' takes no depth"):
        run_bench("startup", depth={"depth": 3})
