"""Points of sweeps, what is kept of them, and their table."""

import csv
import io
import json
import math
from types import SimpleNamespace

import pytest
from scipy import stats

from crowdsim.errors import CrowdSimError, ScenarioError
from crowdsim.sweeps.engine import engine
from crowdsim.sweeps.picture import draw_sweep
from crowdsim.sweeps.points import Point, points_of, read_seeds, read_setting
from crowdsim.sweeps.running import Outcome, Runner
from crowdsim.sweeps.store import Store
from crowdsim.sweeps.sweep import sweep
from crowdsim.sweeps.table import means_of, table_of, usual_figures
from crowdsim.version import __version__


def test_points_are_all_combinations_with_the_seeds_innermost():
    points = points_of("doorway", "1-2", ["agents.0.count=2,3", "duration=10,20"])
    assert len(points) == 8
    assert [point.seed for point in points[:2]] == [1, 2]
    assert points[0].overrides == ["agents.0.count=2", "duration=10", "seed=1"]
    assert [dict(point.settings)["agents.0.count"] for point in points] == ["2"] * 4 + ["3"] * 4
    assert points_of("doorway")[0].overrides == ["seed=3"]


def test_the_name_depends_on_text_changes_and_seed():
    point = Point("a", "/x", (("k", "1"),), 1)
    names = {point.name, point._replace(text="b").name, point._replace(settings=(("k", "2"),)).name}
    names |= {point._replace(seed=2).name, point._replace(settings=()).name}
    assert len(names) == 5
    assert point._replace(file="/y").name == point.name
    assert len(point.name) == 64


@pytest.mark.parametrize(
    ("text", "seeds"), [("1-3", [1, 2, 3]), ("7", [7]), ("1,3,5-6,3", [1, 3, 5, 6]), (" 2 , 4 ", [2, 4])]
)
def test_seeds_are_read(text, seeds):
    assert read_seeds(text) == seeds


@pytest.mark.parametrize("text", ["", "a", "3-1", "1-", "-1", "1.5", "1-99999999999", "9" * 5000, f"1-{'9' * 5000}"])
def test_wrong_seeds_are_refused(text):
    with pytest.raises(CrowdSimError, match="--seeds"):
        read_seeds(text)


def test_commas_in_brackets_and_quotes_belong_to_a_value():
    assert read_setting("a.b=1,2") == ("a.b", ["1", "2"])
    key, values = read_setting("floor={rectangle: [0, 0, 4, 4]},{rectangle: [0, 0, 5, 5]}")
    assert (key, values) == ("floor", ["{rectangle: [0, 0, 4, 4]}", "{rectangle: [0, 0, 5, 5]}"])
    assert read_setting("name='a,b',c") == ("name", ["'a,b'", "c"])
    assert read_setting("key=],1,[2,3]") == ("key", ["]", "1", "[2,3]"])


@pytest.mark.parametrize("text", ["a", "=1", "a=", "a=1,,2"])
def test_wrong_settings_are_refused(text):
    with pytest.raises(CrowdSimError, match="expected KEY=v1,v2"):
        read_setting(text)


def test_settings_given_twice_and_seeds_among_them_are_refused():
    with pytest.raises(CrowdSimError, match="given twice"):
        points_of("doorway", None, ["duration=1", "duration=2"])
    with pytest.raises(CrowdSimError, match="--seeds"):
        points_of("doorway", None, ["seed=1,2"])
    with pytest.raises(ScenarioError):
        points_of("no such scenario")


def a_point(value: str, seed: int) -> Point:
    return Point("text", "/file.yaml", (("width", value),), seed)


def test_a_store_gives_back_what_it_keeps_and_forgets_what_is_damaged(tmp_path):
    point, outcome = a_point("1", 1), Outcome({"t95": 1.5, "arrived": 3, "none": None})
    with Store(tmp_path / "sweep") as store:
        assert store.done(point) is None
        store.keep(point, outcome)
        store.keep(a_point("1", 2), Outcome({}, "the process died", lasting=False))
        assert store.done(point) == outcome
        assert store.done(a_point("1", 2)) is None
        (store.points / ".left-behind.json").write_text("{", encoding="utf-8")
        with pytest.raises(CrowdSimError, match="another sweep works"), Store(tmp_path / "sweep"):
            pass
    with Store(tmp_path / "sweep") as store:
        assert store.done(point) == outcome
        assert sorted(file.name for file in store.points.iterdir()) == [f"{point.name}.json"]
        (store.points / f"{point.name}.json").write_text('{"figures": ', encoding="utf-8")
        assert store.done(point) is None
    (tmp_path / "file").write_text("", encoding="utf-8")
    with pytest.raises(CrowdSimError, match="no folder"):
        Store(tmp_path / "file")


def test_points_of_another_state_of_the_code_are_run_again(tmp_path, monkeypatch):
    points = points_of("doorway", "1-2", ["duration=12"])
    notes: list[str] = []
    sweep(points, tmp_path, note=notes.append)
    assert sweep(points, tmp_path, note=notes.append).done_before == 2
    assert notes == []
    file = tmp_path / "points" / f"{points[0].name}.json"
    held = json.loads(file.read_text(encoding="utf-8"))
    held["figures"]["steps"] = 7
    file.write_text(json.dumps(held | {"engine": "0.0.9 0123456789abcdef"}), encoding="utf-8")
    again = sweep(points, tmp_path, note=notes.append)
    assert again.done_before == 1
    assert again.rows[0][1].figures["steps"] == again.rows[1][1].figures["steps"] != 7
    assert len(notes) == 1
    assert "1 points in" in notes[0]
    assert "run again" in notes[0]


def test_the_engine_is_its_version_its_code_and_its_behaviors(monkeypatch, tmp_path):
    found = engine.__wrapped__()
    assert found == engine()
    assert found.startswith(f"{__version__} ")
    monkeypatch.setattr("crowdsim.sweeps.engine.library_folder", lambda name: tmp_path)
    assert engine.__wrapped__() != found
    none = engine.__wrapped__()
    (tmp_path / "clip.bvh").write_text("HIERARCHY", encoding="utf-8")
    assert engine.__wrapped__() != none


@pytest.mark.parametrize(
    ("cause", "lasting"), [(OSError(28, "No space left on device"), False), (ValueError("no number"), True)]
)
def test_a_point_that_failed_on_a_full_disk_is_run_again(monkeypatch, cause, lasting):
    def fail(*_):
        raise CrowdSimError("cannot") from cause

    monkeypatch.setattr("crowdsim.sweeps.running.parse_scenario", fail)
    assert Runner().run(a_point("1", 1)) == Outcome({}, "cannot", lasting)


def test_a_worker_of_another_state_of_the_code_runs_nothing(monkeypatch):
    distributed = pytest.importorskip("distributed")
    from crowdsim.sweeps.dask_cluster import run_here

    monkeypatch.setattr(distributed, "get_worker", lambda: SimpleNamespace(address="tcp://there:1"))
    outcome = run_here(a_point("1", 1), "0.0.9 0123456789abcdef")
    assert not outcome.lasting
    assert (
        outcome.error
        == f"the worker tcp://there:1 has crowdsim {engine()}, not 0.0.9 0123456789abcdef; give all the same"
    )


def rows_of_two_widths():
    rows = [
        (a_point(width, seed), Outcome({"t95": float(width) * seed, "steps": 5}))
        for width in "12"
        for seed in (1, 2, 4)
    ]
    return [*rows, (a_point("3", 1), Outcome({}, 'no way, "at all"'))]


def test_the_table_has_a_row_for_each_point_and_errors_too():
    rows = rows_of_two_widths()
    read = list(csv.DictReader(io.StringIO(table_of(rows))))
    assert list(read[0]) == ["width", "seed", "error", "t95", "steps", "point"]
    assert [row["t95"] for row in read] == ["1.0", "2.0", "4.0", "2.0", "4.0", "8.0", ""]
    assert read[-1]["error"] == 'no way, "at all"'
    assert read[0]["point"] == rows[0][0].name


def test_means_have_students_band():
    means = means_of(rows_of_two_widths(), "t95")
    assert [dict(mean.settings)["width"] for mean in means] == ["1", "2"]
    low, high = stats.t.interval(0.95, 2, 7 / 3, stats.sem([1.0, 2.0, 4.0]))
    assert means[0][1:] == pytest.approx((3, 7 / 3, low, high))
    (single,) = means_of(rows_of_two_widths()[:1], "t95")
    assert single.mean == 1.0
    assert math.isnan(single.low)


def test_a_picture_is_drawn_of_any_sweep():
    rows = rows_of_two_widths()
    assert usual_figures(rows) == ["t95"]
    figure = draw_sweep(rows, ["t95"])
    assert "1 of 7 runs failed" in figure.get_suptitle()
    assert draw_sweep(rows[-1:], []).axes[0].texts
    named = [
        (point._replace(settings=(("kind", value), ("n", "1"))), outcome)
        for value in ("a", "b")
        for point, outcome in rows[:3]
    ]
    # Without figures there is no curve, and no legend, which would warn.
    assert draw_sweep(named, []).axes[0].get_legend() is None
    labels = [label.get_text() for label in draw_sweep(named, ["t95"]).axes[0].get_xticklabels()]
    assert labels == ["a", "b"]


def test_a_curve_has_one_color_in_all_panels_and_in_the_legend():
    rows = []
    for width in ("1", "2"):
        for people in ("10", "90"):
            point = a_point(width, 1)._replace(settings=(("width", width), ("people", people)))
            # One figure is not known for one of the two curves.
            figures = {"mean_time": 3.0} if people == "10" else {"mean_time": 4.0, "t95": 5.0}
            rows.append((point, Outcome(figures)))
    first, second = draw_sweep(rows, ["t95", "mean_time"]).axes
    legend = {text.get_text(): line.get_color() for text, line in zip(*entries(first.get_legend()), strict=True)}
    assert list(legend) == ["people 10", "people 90"]
    for panel in (first, second):
        assert {line.get_label(): line.get_color() for line in panel.lines if line.get_label() in legend} == legend
    assert [len(line.get_xdata()) for line in first.lines if line.get_label() == "people 10"] == [0]


def entries(legend):
    return legend.get_texts(), legend.get_lines()


def test_kept_summaries_are_plain_json(tmp_path):
    with Store(tmp_path) as store:
        store.keep(a_point("1", 1), Outcome({"t95": 0.1 + 0.2}))
    (file,) = (tmp_path / "points").iterdir()
    held = json.loads(file.read_text(encoding="utf-8"))
    assert held.pop("engine") == engine()
    assert held == {"settings": {"width": "1"}, "seed": 1, "error": "", "figures": {"t95": 0.1 + 0.2}}
