"""Loading: every kind of error with its exact place, all of them at once, and the values of a good file."""

import pytest

import crowdsim
from crowdsim.errors import CrowdSimError, Problem, ScenarioError
from crowdsim.scenario import semantics
from crowdsim.scenario.loader import builtin_scenarios, load_scenario, parse_scenario
from crowdsim.scenario.schema.schema import DEFAULT_BEHAVIORS
from tests.unit.scenario.sample import TEXT, change, solids_of


def problems_of(text: str, overrides=()) -> list[str]:
    with pytest.raises(ScenarioError) as caught:
        parse_scenario(text, None, overrides)
    assert str(caught.value).splitlines() == [str(problem) for problem in caught.value.problems]
    return str(caught.value).splitlines()


def test_a_good_file_has_its_values_and_defaults():
    scenario = parse_scenario(TEXT)
    assert (scenario.name, scenario.seed, scenario.duration, scenario.steps_per_second) == ("sample", 5, 60.0, 10)
    assert scenario.text == TEXT
    assert scenario.path is None
    assert scenario.behaviors == DEFAULT_BEHAVIORS
    assert scenario.agents[0].interval == 0.0
    assert scenario.agents[0].on_arrival == "leave"
    assert scenario.environment.floor.bounds == (0.0, 0.0, 10.0, 6.0)
    assert [(solid.name, solid.bottom, solid.top) for solid in solids_of(scenario)] == [
        ("wall", 0.0, 2.5),
        ("pole", 0.0, 2.0),
        ("bench", 0.0, 0.45),
    ]
    legs, torso = scenario.environment.layers
    assert (legs.name, legs.low, legs.high, torso.name) == ("legs", 0.10, 2.0, "torso")
    assert torso.free.area - legs.free.area == pytest.approx(0.5)
    assert scenario.area_polygons()["middle"].area == pytest.approx(4.0)
    assert scenario.captures_folder() is None


@pytest.mark.parametrize(
    ("old", "new", "line"),
    [
        # the schema: keys
        ("seed: 5", "sead: 5", "1:1: seed: this key is required and missing"),
        ("duration: 60.0", "duratoin: 60.0\nduration: 60.0", "4:1: duratoin: unknown key; did you mean 'duration'?"),
        ("seed: 5", "seed: 5\nzzz: 1", "4:1: zzz: unknown key; the keys here are: crowdsim, name, description, seed,"),
        ("    count: 4\n", "", "15:5: agents.0: give 'count' for so many agents, or 'rate' for a source of them"),
        (
            "radius: 0.2}",
            "radius: 0.2, hight: 2}",
            "9:58: obstacles.1.cylinder.hight: unknown key; the keys here are: c",
        ),
        (
            "motion: {set: default}",
            "layers: [{nam: a, low: 0, high: 1}]",
            "13:11: layers.0.nam: unknown key; did you m",
        ),
        # the schema: types
        (
            "crowdsim: 1",
            "crowdsim: 2",
            "1:11: crowdsim: format version 2 is unknown here; this crowdsim reads version 1",
        ),
        ("crowdsim: 1", "crowdsim: true", "1:11: crowdsim: expected a whole number, got true"),
        ("name: sample", "name: 12", "2:7: name: expected text, got the number 12; put it in quotes"),
        ("name: sample", "name: ' a'", "2:7: name: must be one line of text"),
        ("name: sample", "name: ''", "2:7: name: must be one line of text"),
        ("name: sample", f"name: {'a' * 81}", "2:7: name: longer than 80 characters"),
        ("seed: 5", "seed: 5.0", "3:7: seed: expected a whole number, got the number 5.0"),
        ("seed: 5", "seed: '5'", "3:7: seed: expected a whole number, got the text '5'"),
        ("seed: 5", "seed: -1", "3:7: seed: must be at least 0, got -1"),
        ("seed: 5", "seed: 9223372036854775808", "3:7: seed: must be less than 9223372036854775808, got 922337203685"),
        ("duration: 60.0", "duration: true", "4:11: duration: expected a number, got true"),
        ("duration: 60.0", "duration: 60,5", "4:11: duration: expected a number, got the text '60,5'; write a decimal"),
        ("duration: 60.0", "duration: .inf", "4:11: duration: expected a finite number, got inf"),
        ("duration: 60.0", "duration: .nan", "4:11: duration: expected a finite number, got nan"),
        ("duration: 60.0", "duration: 1e999", "4:11: duration: expected a finite number, got inf"),
        ("duration: 60.0", f"duration: 1{'0' * 399}", "4:11: duration: the number 1000"),
        ("duration: 60.0", "duration: 0", "4:11: duration: must be greater than 0"),
        ("duration: 60.0", "duration: 1e7", "4:11: duration: must be at most 1000000"),
        ("duration: 60.0", "duration:", "4:1: duration: expected a number, got nothing"),
        (
            "steps_per_second: 10",
            "steps_per_second: 25",
            "5:19: steps_per_second: 25 does not divide 60; did you mean 20?",
        ),
        ("steps_per_second: 10", "steps_per_second: 0", "5:19: steps_per_second: must be at least 1, got 0"),
        (
            "{rectangle: [0, 0, 10, 6]}",
            "3",
            "6:8: floor: expected a mapping with keys among rectangle, polygon, file, ",
        ),
        ("[0, 0, 10, 6]", "[0, 0, 10]", "6:20: floor.rectangle: expected a list of 4 numbers, got 3"),
        ("[0, 0, 10, 6]", "[0, 0, 10, 6, 1]", "6:20: floor.rectangle: expected a list of 4 numbers, got 5"),
        ("[0, 0, 10, 6]", "[0, 0, ten, 6]", "6:27: floor.rectangle.2: expected a number, got the text 'ten'"),
        ("[0, 0, 10, 6]", "[0, 0, 0, 6]", "6:20: floor.rectangle: a rectangle is [xmin, ymin, xmax, ymax] with xmin b"),
        ("[0, 0, 10, 6]", "[0, 0, 1e6, 6]", "6:27: floor.rectangle.2: must be at most 100000"),
        ("set: default", "set: defualt", "13:15: motion.set: unknown value 'defualt'; did you mean 'default'?"),
        ("set: default", "set: 3", "13:15: motion.set: expected 'default', 'happy' or 'dance', got the number 3"),
        (
            "on_arrival: leave",
            "on_arrival: leav",
            "19:17: agents.0.on_arrival: unknown value 'leav'; did you mean 'leave'?",
        ),
        (
            "on_arrival: leave",
            "on_arrival: vanish",
            "19:17: agents.0.on_arrival: unknown value 'vanish'; the values here are: ",
        ),
        ("on_arrival: leave", "interval: -1", "19:15: agents.0.interval: must be at least 0"),
        ("on_arrival: leave", "start_time: [1]", "19:17: agents.0.start_time: expected a number, got a list"),
        ("count: 4", "count: 0", "16:12: agents.0.count: must be at least 1, got 0"),
        # the schema: parts that belong together
        (
            "rectangle: [0, 0, 10, 6]",
            "",
            "6:8: floor: give exactly one of rectangle, polygon, file, derive; found none",
        ),
        (
            "radius: 1.0}",
            "radius: 1.0}, point: [8, 4]",
            "18:11: agents.0.goal: give exactly one of rectangle, point, circle, polygon, along; found",
        ),
        ("max: [4.2, 2]", "size: [1, 1]", "8:23: obstacles.0.box: a box is given by 'min' and 'max', or by 'center' a"),
        ("max: [4.2, 2]", "max: [3, 2]", "8:23: obstacles.0.box: 'min' must lie below 'max' in x and in y"),
        (
            "box: {min: [4, 0], max: [4.2, 2]}, ",
            "",
            "8:5: obstacles.0: give exactly one of box, cylinder, polygon, wall, plan, mesh; found none",
        ),
        ("top: 2.5", "top: 2.5, bottom: 2.5", "8:5: obstacles.0: 'top' (2.5) must lie above 'bottom' (2.5)"),
        (
            "[[8, 0], [9, 0], [9, 1]]",
            "[[8, 0], [9, 0]]",
            "11:14: obstacles.2.polygon: expected at least 3 entries, got 2",
        ),
        (
            "[[8, 0], [9, 0], [9, 1]]",
            "[[8, 0], [9, 0], [10, 0]]",
            "11:14: obstacles.2.polygon: the outline has no area",
        ),
        (
            "[[8, 0], [9, 0], [9, 1]]",
            "[[6, 0], [8, 2], [8, 0], [6, 2]]",
            "11:14: obstacles.2.polygon: the outline crosses or touches itself (Self-intersection[7 1])",
        ),
        ("[9, 1]]", "[9, .inf]]", "11:35: obstacles.2.polygon.2.1: expected a finite number, got inf"),
        (
            "motion: {set: default}",
            "motion: {set: default, clips: [a]}",
            "13:9: motion: 'clips' chooses among captures;",
        ),
        (
            "motion: {set: default}",
            "layers: [{name: a, low: 1, high: 1}]",
            "13:10: layers.0: 'high' (1.0) must lie above",
        ),
        ("motion: {set: default}", "layers: []", "13:9: layers: expected at least 1 entry, got 0"),
        (
            "count: 4",
            "attributes: {age: {words: {}}}\n    count: 4",
            "16:31: agents.0.attributes.age.words: expected at least 1 entry, got 0",
        ),
        (
            "count: 4",
            "attributes: {age: {words: [a, b]}}\n    count: 4",
            "16:31: agents.0.attributes.age.words: expected a mapping, got a list",
        ),
        ("rectangle: [4, 2, 6, 4]", "point: [4, 2]", "21:5: areas.0: an area needs an extent"),
        (
            "areas:",
            "lines:\n  - {name: a, points: [[1, 1], [1, 1]]}\nareas:",
            "21:23: lines.0.points: two points of a line lie on each other: [1, 1]",
        ),
        (
            "areas:",
            "lines:\n  - {name: a, points: [[1, 1]]}\nareas:",
            "21:23: lines.0.points: expected at least 2 entries, got 1",
        ),
        (
            "[4, 2, 6, 4]",
            "[4, 2, 6, 4], start_time: 5, until: 5",
            "21:5: areas.0: 'until' (5 s) must lie after 'start_time' (5 s)",
        ),
        (
            "[4, 2, 6, 4]",
            "[4, 2, 6, 4], start_time: 60",
            "21:57: areas.0.start_time: the run ends at 60 s, before measuring begins at 60 s",
        ),
        # what the schema cannot see
        ("name: pole", "name: wall", "9:12: obstacles.1.name: the name 'wall' is taken by obstacles.0"),
        ("on_arrival: leave", "interval: 19.999", "4:11: duration: 60 s end before the last of 'guests' starts at 5"),
        ("[1, 1, 3, 4]", "[11, 1, 13, 4]", "17:12: agents.0.start: lies off the floor"),
        ("[1, 1, 3, 4]", "[10, 1, 13, 4]", "17:12: agents.0.start: lies off the floor"),
        ("[1, 1, 3, 4]", "[9.8, 1, 13, 4]", "17:12: agents.0.start: no spot with 0.26 m of free floor around it"),
        (
            "{rectangle: [1, 1, 3, 4]}",
            "{point: [4.1, 1]}",
            "17:12: agents.0.start: lies inside 'wall'; nobody can stand there",
        ),
        (
            "{rectangle: [1, 1, 3, 4]}",
            "{point: [0.2, 1]}",
            "17:12: agents.0.start: no spot with 0.26 m of free floor aro",
        ),
        (
            "{rectangle: [1, 1, 3, 4]}",
            "{point: [1, 1]}",
            "17:12: agents.0.start: 4 agents cannot start at once at one",
        ),
        (
            "[1, 1, 3, 4]",
            "[1, 1, 1.5, 1.5]",
            "17:12: agents.0.start: only 1 of 4 agents found a place to start at once",
        ),
        ("{circle: {center: [8, 4], radius: 1.0}}", "{point: [6, 3]}", "18:11: agents.0.goal: lies inside 'pole'"),
        (
            "on_arrival: leave",
            "on_arrival: stay\n    interval: 1\n  - {name: guests, count: 1, start: {point: [1, 1]}, "
            "goal: {point: [1, 5]}}",
            "21:12: agents.1.name: the name 'guests' is taken by agents.0",
        ),
        (
            "center: [6, 3], radius: 0.2",
            "center: [6, 3], radius: 60",
            "6:8: floor: the floor is empty: obstacles cover all",
        ),
        ("set: default", "captures: nowhere", "13:20: motion.captures: there is no folder nowhere"),
    ],
)
def test_one_error_has_its_place_key_and_remedy(old, new, line):
    lines = problems_of(change((old, new)))
    assert any(found.startswith(f"<text>:{line}") for found in lines), lines


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("", "<text>:1:1: the file is empty"),
        ("# nothing\n", "<text>:1:1: the file is empty"),
        ("hello\n", "<text>:1:1: expected a mapping with keys among crowdsim, name"),
        ("- 1\n", "<text>:1:1: expected a mapping with keys among crowdsim, name"),
        ("crowdsim: 1\n\tname: x\n", "<text>:2:1: a tab cannot indent YAML; use spaces"),
    ],
)
def test_texts_that_are_no_scenario(text, line):
    assert problems_of(text)[0].startswith(line)


def test_all_errors_of_a_file_come_at_once_in_its_order():
    text = change(
        ("name: sample", "name: sample\nname: again"),
        ("seed: 5", "sead: 5"),
        ("duration: 60.0", "duration: &d 60.0"),
        ("top: 2.5", "tpo: 2.5"),
        ("count: 4", "count: *d"),
        ("leave", "leev"),
    )
    lines = problems_of(text)
    assert [line.split(": ")[0] + ": " + line.split(": ")[1] for line in lines] == [
        "<text>:1:1: seed",
        "<text>:3:1: name",
        "<text>:4:1: sead",
        "<text>:5:11: duration",
        "<text>:9:53: obstacles.0.tpo",
        "<text>:17:12: agents.0.count",
        "<text>:20:17: agents.0.on_arrival",
    ]


def test_all_contradictions_come_at_once():
    text = change(
        ("name: pole", "name: wall"),
        ("duration: 60.0", "duration: 1"),
        ("on_arrival: leave", "interval: 5"),
        ("[1, 1, 3, 4]", "[21, 1, 23, 4]"),
        ("center: [8, 4], radius: 1.0", "center: [8, 40], radius: 1.0"),
        ("set: default", "captures: nowhere"),
    )
    assert [line.split(": ")[1] for line in problems_of(text)] == [
        "duration",
        "obstacles.1.name",
        "motion.captures",
        "agents.0.start",
        "agents.0.goal",
    ]


def test_problems_carry_their_parts():
    with pytest.raises(ScenarioError) as caught:
        parse_scenario(change(("seed: 5", "seed: x")))
    message = "expected a whole number, got the text 'x'"
    assert caught.value.problems == [Problem("<text>", 3, 7, "seed", message)]
    assert isinstance(caught.value, CrowdSimError)


def test_behaviors_are_those_of_the_library(tmp_path, monkeypatch):
    for name in ("frontal", "lateral"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "behavior.yaml").touch()
    monkeypatch.setattr(semantics, "library_folder", lambda kind: tmp_path)
    good = change(("motion: {set: default}", "behaviors: [lateral, frontal]"))
    assert parse_scenario(good).behaviors == ("lateral", "frontal")
    lines = problems_of(change(("motion: {set: default}", "behaviors: [fontal, lateral, lateral, crawl]")))
    assert lines == [
        "<text>:13:13: behaviors.0: unknown behavior 'fontal'; did you mean 'frontal'?",
        "<text>:13:30: behaviors.2: 'lateral' is named twice",
        "<text>:13:39: behaviors.3: unknown behavior 'crawl'; the library has: frontal, lateral",
    ]


def test_captures_are_found_beside_the_scenario(tmp_path):
    folder = tmp_path / "mocap"
    folder.mkdir()
    for name in ("16_12.bvh", "16_11.bvh", "17_03.bvh"):
        (folder / name).touch()
    file = tmp_path / "mine.yaml"
    walks = "\nbehaviors: [frontal]\n"
    file.write_text(change(("set: default", "captures: mocap, clips: ['17*', '1*.bvh']")) + walks)
    scenario = load_scenario(file)
    assert scenario.captures_folder() == folder
    assert scenario.motion.clips == ("17*", "1*.bvh")
    file.write_text(change(("set: default", "captures: mocap, clips: ['x*', '../*', '**x', '/etc/*']")) + walks)
    with pytest.raises(ScenarioError) as caught:
        load_scenario(file)
    assert [problem.key for problem in caught.value.problems] == [f"motion.clips.{n}" for n in range(4)]
    assert str(caught.value).startswith(f"{file}:13:35: motion.clips.0: no file in {folder} matches x*")
    file.write_text(change(("set: default", "captures: mocap")))
    assert load_scenario(file).behaviors == ("lateral", "arm_constrained", "frontal")
    for path in folder.iterdir():
        path.unlink()
    with pytest.raises(ScenarioError, match=r"motion.captures: no file in .*mocap matches \*.bvh, \*.amc"):
        load_scenario(file)


def test_overrides_replace_values_in_order():
    scenario = parse_scenario(
        TEXT, None, ["agents.0.count=3", "seed=8", "seed=9", "floor={rectangle: [0, 0, 9, 6]}", "motion.set=default"]
    )
    assert (scenario.agents[0].count, scenario.seed) == (3, 9)
    assert scenario.environment.floor.bounds == (0.0, 0.0, 9.0, 6.0)
    assert scenario.text == TEXT


def test_an_override_mends_what_the_file_has_wrong():
    assert parse_scenario(change(("seed: 5", "seed: x")), None, ["seed=1"]).seed == 1


def test_an_override_can_add_a_key_and_what_holds_it():
    text = change(("motion: {set: default}\n", ""))
    assert parse_scenario(text, None, ["description=short", "motion.set=default"]).description == "short"


@pytest.mark.parametrize(
    ("override", "line"),
    [
        ("agents.0.count=x", "--set agents.0.count: expected a whole number, got the text 'x'"),
        ("agents.0.cuont=3", "--set agents.0.cuont: unknown key; did you mean 'count'?"),
        ("agents.1.count=3", "--set agents.1.count: '1' is no entry of the list agents; it has 0 to 0"),
        ("agents.guests.count=3", "--set agents.guests.count: 'guests' is no entry of the list agents; it has 0 to 0"),
        ("seed.x=3", "--set seed.x: seed has no entries to set"),
        (
            "agents.0.start={rectangle: [1, 1]}",
            "--set agents.0.start: agents.0.start.rectangle: expected a list of 4 num",
        ),
        ("agents.0.start={point: [20, 1]}", "--set agents.0.start: lies off the floor"),
        ("seed", "--set seed: expected path=value, such as agents.0.count=4"),
        ("=3", "--set =3: expected path=value"),
        ("a..b=3", "--set a..b=3: expected path=value"),
        ("seed=[", "--set seed: not YAML: "),
        ("seed=*a", "--set seed: aliases are not allowed"),
        ("seed=", "--set seed: expected a whole number, got nothing"),
        ("steps_per_second=59", "--set steps_per_second: 59 does not divide 60; did you mean 60?"),
    ],
)
def test_errors_of_overrides_name_the_override(override, line):
    assert problems_of(TEXT, [override])[0].startswith(line)


def test_files_that_cannot_be_read(tmp_path):
    with pytest.raises(ScenarioError, match=r"corrdor: there is no such file.*did you mean 'corridor'"):
        load_scenario("corrdor")
    with pytest.raises(ScenarioError, match=r"no such file.*the built-in scenarios are: apartment, bottleneck, "):
        load_scenario(tmp_path / "qqqqqq.yaml")
    with pytest.raises(ScenarioError, match="folder"):
        load_scenario(tmp_path)
    file = tmp_path / "latin.yaml"
    file.write_bytes("crowdsim: 1\nname: ä".encode() + b"\xe9\n")
    with pytest.raises(ScenarioError, match=r"latin.yaml:2:8: this is not UTF-8 text"):
        load_scenario(file)
    file.write_bytes(b"#" * 1_000_001)
    with pytest.raises(ScenarioError, match="larger than 1 MB"):
        load_scenario(file)
    file.write_text("\ufeff" + TEXT, encoding="utf-8")
    assert load_scenario(file).name == "sample"


def test_a_file_comes_before_a_built_in_of_its_name(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert load_scenario("doorway").name == load_scenario("doorway.yaml").name == "doorway"
    (tmp_path / "doorway.yaml").write_text(TEXT)
    assert load_scenario("doorway.yaml").name == "sample"
    assert load_scenario("doorway").path == builtin_scenarios()["doorway"]


def test_the_loader_is_part_of_the_package():
    assert crowdsim.load_scenario is load_scenario


def test_bad_files_end_in_a_typed_error_or_the_right_value(shared):
    """Each bad file as the first entries of a scenario: its keys are unknown, its values strict."""
    for file in sorted((shared / "faults" / "yaml").glob("*.yaml")):
        with pytest.raises(ScenarioError):
            parse_scenario(TEXT + file.read_text())
    for name, line in {"inf": "duration: .inf", "nan": "duration: .nan", "sci": "duration: 1e-2"}.items():
        text = change(("duration: 60.0", line))
        if name == "sci":
            assert parse_scenario(text).duration == 0.01
        else:
            assert "finite" in problems_of(text)[0]
    assert parse_scenario(change(("seed: 5", "seed: 0123"))).seed == 123
    assert parse_scenario(change(("name: sample", "name: no"))).name == "no"


def test_what_is_neither_a_path_nor_an_override_is_refused():
    with pytest.raises(CrowdSimError, match="expected the path or the name of a scenario, got None"):
        load_scenario(None)
    with pytest.raises(CrowdSimError, match=r"expected overrides as texts like 'agents.0.count=4', got 3"):
        load_scenario("corridor", [3])
