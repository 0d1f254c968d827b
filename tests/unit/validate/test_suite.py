"""The tests of guidelines can be run, say where they are from, and come out the same every time."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
import shapely
from typer.testing import CliRunner

from crowdsim.analysis.measured_people import ONE_WAY_SPEEDS
from crowdsim.cli.app import app
from crowdsim.crowd.simulation import Simulation
from crowdsim.recording.header import AgentState
from crowdsim.scenario.cast import place_crowd
from crowdsim.scenario.loader import load_scenario
from crowdsim.validate import report
from crowdsim.validate.criteria import Finding
from crowdsim.validate.observed import SET_OUT, observe
from crowdsim.validate.running import Outcome, judge, load_case, run_case
from crowdsim.validate.suite import FILE_SPEEDS, FOLDER, MISSING, TESTS, find_tests

DOCS = Path(__file__).parents[3] / "docs"
PAGES = (DOCS / "validation.md", DOCS / "validation-auto.md")
PLAIN = CliRunner()


def test_every_case_is_a_scenario_and_every_scenario_a_case() -> None:
    used = set()
    for test in TESTS:
        for case in test.cases:
            scenario = load_case(case, 3, "steered")
            assert scenario.seed == 3
            assert scenario.locomotions() == {"steered"}
            used.add(f"{case.scenario}.yaml")
    assert used == {file.name for file in FOLDER.glob("*.yaml")}


def test_names_are_told_from_each_other_and_sources_are_named() -> None:
    assert len({test.name for test in TESTS}) == len(TESTS)
    for test in TESTS:
        assert len({case.name for case in test.cases}) == len(test.cases)
        assert test.source
        assert test.criteria
    assert all(missing.reason for missing in MISSING)


@pytest.mark.parametrize("file", PAGES, ids=lambda file: file.stem)
def test_the_pages_of_the_docs_have_every_test_and_what_is_not_run(file: Path) -> None:
    page = file.read_text(encoding="utf-8")
    assert set(re.findall(r"^## ([\w.-]+):", page, re.M)) == {test.name for test in TESTS}
    for missing in MISSING:
        assert f"| {missing.source} | {missing.title} | {missing.reason} |" in page
    for test in TESTS:
        assert (DOCS / "images" / file.stem / f"{test.name}.png").is_file()


def test_a_run_is_observed_as_a_slow_look_at_its_recording_has_it(tmp_path: Path) -> None:
    scenario = load_scenario(FOLDER / "rimea_06.yaml", ["agents.0.locomotion=steered", "duration=30"])
    with Simulation(scenario).run(tmp_path / "run.h5") as recording:
        seen = observe(scenario, recording, 1.0)
        x, y, present = recording.x[:], recording.y[:], recording.state[:] != AgentState.ABSENT
    cast = place_crowd(scenario)
    assert seen.groups == ("people",) * 20
    assert seen.outside == 0
    for agent in range(20):
        steps = np.flatnonzero(present[:, agent])
        gone = np.hypot(x[:, agent] - cast.starts[agent, 0], y[:, agent] - cast.starts[agent, 1])
        first = next(step for step in steps if gone[step] >= SET_OUT)
        assert seen.set_out[agent] == pytest.approx(first / 10 - SET_OUT / cast.walkers.speeds[agent])
        assert seen.left[agent] == pytest.approx((steps[-1] + 1) / 10)
    assert seen.last == seen.left.max() < 30.0


def test_places_of_crossings_are_on_their_lines(tmp_path: Path) -> None:
    scenario = load_scenario(FOLDER / "rimea_07.yaml", ["agents.0.locomotion=steered"])
    with Simulation(scenario).run(tmp_path / "run.h5") as recording:
        seen = observe(scenario, recording, 1.0)
    for name, at in (("begin", 5.0), ("end", 45.0)):
        places = seen.crossed[name]
        known = np.isfinite(seen.times_at(name))
        assert known.any()
        assert (np.isnan(places).all(axis=1) == ~known).all()
        # They are those of the step before, at most 2.2 m/s times 0.1 s from the line.
        assert np.abs(places[known, 0] - at).max() < 0.25


@pytest.mark.parametrize("locomotion", ["steered", "auto"])
def test_a_test_passes_is_reported_and_comes_out_the_same_again(tmp_path: Path, locomotion: str) -> None:
    test = find_tests(["rimea-1"])[0]
    case = test.cases[0]
    runs = [run_case(case, 2, locomotion, tmp_path / "pictures" / "rimea-1.png"), run_case(case, 2, locomotion)]
    assert runs[0].summary["state_hash"] == runs[1].summary["state_hash"]
    outcome = judge(test, [2], {("rimea-1", case.name, 2): runs[0]})
    assert outcome.passed
    value = outcome.findings[0][0].value
    # As fast as the file says, captured or not.
    assert value == pytest.approx(40.0 / 1.33, rel=0.03)
    (row,) = report.rows_of([outcome])
    assert (row["test"], row["passed"], row["band"]) == ("rimea-1", "1 of 1", "26 to 34")
    found = json.loads(json.dumps(report.as_json([outcome], locomotion)))
    assert found["tests"][0]["figures"][0]["values"] == [value]
    assert found["tests"][0]["passed"] is True
    page = report.as_html([outcome], locomotion, tmp_path / "pictures")
    assert page.count("data:image/png;base64,") == 1
    assert "rimea-1: speed in a corridor, passed" in page
    assert f"| time between the lines [s] | {value:.3g} |" in report.as_markdown([outcome], locomotion, Path("page.md"))


def test_a_test_that_fails_says_so() -> None:
    test = find_tests(["rimea-1"])[0]
    seen = run_case(test.cases[0], 1, "steered")
    lines = {name: line for name, line in seen.measured.lines.items() if name == "begin"}
    lines["end"] = lines["begin"]
    wrong = seen._replace(measured=seen.measured.__class__({}, lines))
    outcome = judge(test, [1], {("rimea-1", "corridor", 1): wrong})
    assert not outcome.passed
    assert report.rows_of([outcome])[0]["passed"] == "0 of 1"
    assert "**failed**" in report.as_markdown([outcome], "steered", Path("page.md"))


def test_a_test_departs_only_in_the_figures_that_it_names() -> None:
    test = find_tests(["imo-4"])[0]
    (name,) = test.departs
    outside, inside = Finding(name, 2.0, "/s", 0.0, 1.33, "x"), Finding("flow, room", 2.0, "/s", 1.4, 2.5, "x")
    hashes = {"room": ("00",)}
    assert Outcome(test, (1,), ((outside,), (inside,)), hashes, 1.0).verdict == "departs"
    assert Outcome(test, (1,), ((outside,), (inside._replace(value=3.0),)), hashes, 1.0).verdict == "failed"
    assert Outcome(test, (1,), ((outside._replace(value=1.0),), (inside,)), hashes, 1.0).verdict == "passed"


TARGETS = {
    "rimea_01_corridor": ("rimea_01", 0),
    "rimea_04_fd_periodic": ("rimea_04", 0),
    "rimea_05_premovement": ("rimea_05", 0),
    "rimea_06_corner": ("rimea_06", 0),
    "rimea_09_hall_4": ("rimea_09", 0),
    "rimea_12_bottleneck": ("rimea_12", 0),
    "rimea_12d_width_080": ("rimea_12d_080", 0),
    "rimea_12d_width_120": ("rimea_12d_120", 0),
    "rimea_12d_width_200": ("rimea_12d_200", 0),
    "imo_08_counterflow_000": ("imo_08_one_way", 0),
    "imo_08_counterflow_050": ("imo_08_both_ways", 0),
    # The hall with two doors shut keeps the niches of these, and the ring's floor has chords of its own.
    "rimea_09_hall_2": ("rimea_09", 2.0),
    "seyfried_ring_2005": ("rimea_16", 0.05),
}
"""Scenario of each target, and by how much their floors differ [m2]."""


@pytest.mark.parametrize("name", TARGETS)
def test_scenarios_are_laid_out_as_their_targets(shared: Path, name: str) -> None:
    target = json.loads((shared / "targets" / f"{name}.json").read_text())
    scenario = load_scenario(FOLDER / f"{TARGETS[name][0]}.yaml")
    floor = scenario.environment.layers[0].free
    differing = shapely.from_wkt(target["walkable_wkt"]).symmetric_difference(floor).area
    assert differing == pytest.approx(TARGETS[name][1], abs=1e-6) or differing < TARGETS[name][1]
    if name == "seyfried_ring_2005":
        return  # its people are spread over the ring by quarters
    for group, wanted in zip(scenario.agents, target["groups"], strict=True):
        start = shapely.from_wkt(wanted["start_wkt"])
        assert group.start.shape().symmetric_difference(start).area < 1e-9
        if name not in ("rimea_04_fd_periodic", "imo_08_counterflow_050"):  # these are swept
            assert group.count == wanted["n"]


def test_every_target_has_its_scenario_and_its_bands(shared: Path) -> None:
    assert {file.stem for file in (shared / "targets").glob("*.json")} == {*TARGETS, "targets"}
    targets = json.loads((shared / "targets" / "targets.json").read_text())
    one_way = {row["rho"]: (row["v_p5"], row["v_p95"]) for row in targets["fd_unidirectional"]["method_C_classic"]}
    assert {density: tuple(band) for density, *band in ONE_WAY_SPEEDS} == one_way
    single_file = [(row[0], row[1], row[3]) for row in targets["rimea16_1d"]["rows"]]
    np.testing.assert_allclose(FILE_SPEEDS, single_file[: len(FILE_SPEEDS)], atol=5e-5)


def test_tests_are_listed_and_unknown_ones_refused(tmp_path: Path) -> None:
    listed = PLAIN.invoke(app, ["validate", "--list", "--json"])
    assert set(json.loads(listed.stdout)) == {test.name for test in TESTS}
    assert "stairs" in PLAIN.invoke(app, ["validate", "--list"]).stdout
    wrong = PLAIN.invoke(app, ["validate", "rimea-99"])
    assert wrong.exit_code != 0
    assert "there is no test 'rimea-99'" in wrong.output
    unnamed = PLAIN.invoke(app, ["validate", "rimea-1", "--html", str(tmp_path / "page.txt")])
    assert "its name has to end with .html" in unnamed.output


def test_the_command_runs_in_processes_of_its_own_and_writes_pages(tmp_path: Path) -> None:
    page, table = tmp_path / "page.html", tmp_path / "table.md"
    command = ["validate", "rimea-1", "--locomotion", "steered", "--seeds", "2", "--json"]
    result = PLAIN.invoke(app, [*command, "--html", str(page), "--markdown", str(table)])
    assert result.exit_code == 0
    found = json.loads(result.stdout)["tests"][0]
    assert found["seeds"] == [1, 2]
    assert len(set(found["state_hashes"]["corridor"])) == 2
    assert "rimea-1" in page.read_text()
    assert "![Ways of corridor](images/table/rimea-1.png)" in table.read_text()
    assert (tmp_path / "images" / "table" / "rimea-1.png").read_bytes()[1:4] == b"PNG"
