"""Doors and events: what they come to, and what is said of those that cannot be."""

import pytest
import shapely

from crowdsim.errors import ScenarioError
from crowdsim.scenario.check import check_scenario
from crowdsim.scenario.loader import parse_scenario
from tests.unit.scenario.sample import change

DOOR = "doors: [{name: front, box: {min: [4, 2], max: [4.2, 3]}, top: 2.1}]\n"
CRATE = "insert: {name: crate, box: {min: [1, 1], max: [2, 1.5]}, top: 1}"


def with_events(*events: str, doors: str = DOOR) -> str:
    """The sample with a door at line 13 and the events from line 15 on, one a line."""
    lines = "".join(f"  - {{{event}}}\n" for event in events)
    return change(("motion: {set: default}\n", f"{doors}events:\n{lines}"))


def test_without_events_nothing_changes():
    scenario = parse_scenario(change())
    timetable = scenario.environment.timetable
    assert [solid.name for solid in timetable.fixed] == ["wall", "pole", "bench"]
    assert timetable.movables == timetable.events == ()  # the sample has no doors
    assert timetable.at_start() == timetable.fixed


def test_events_come_in_order_of_time_and_things_keep_where_they_are():
    scenario = parse_scenario(
        with_events(
            "at: 20, open: front",
            "at: 3, move: {name: pole, by: [1, 0.5]}",
            f"at: 1, {CRATE}",
            "at: 10, close: front",
            "at: 4, move: {name: crate, to: [2, 5], rotation: 90}",
            "at: 30, remove: pole",
            "at: 31, move: {name: crate, by: [0, -1]}",
        )
    )
    timetable = scenario.environment.timetable
    assert [solid.name for solid in timetable.fixed] == ["wall", "bench"]
    assert [(movable.name, movable.placing is not None) for movable in timetable.movables] == [
        ("pole", True), ("front", False), ("crate", False),
    ]  # fmt: skip
    assert [(e.at, e.title, e.placing is not None) for e in timetable.events] == [
        (1.0, "insert 'crate'", True),
        (3.0, "move 'pole'", True),
        (4.0, "move 'crate'", True),
        (10.0, "close 'front'", True),
        (20.0, "open 'front'", False),
        (30.0, "remove 'pole'", False),
        (31.0, "move 'crate'", True),
    ]
    there = [event for event in timetable.events if event.placing is not None]
    bounds = [timetable.movables[event.movable].footprint(event.placing).bounds for event in there]
    pole = timetable.movables[0].solids[0].footprint.bounds
    assert bounds[0] == pytest.approx((1, 1, 2, 1.5))
    assert bounds[1] == pytest.approx((pole[0] + 1, pole[1] + 0.5, pole[2] + 1, pole[3] + 0.5))
    assert bounds[2] == pytest.approx((1.75, 4.5, 2.25, 5.5))
    assert bounds[3] == pytest.approx((4, 2, 4.2, 3))
    assert bounds[4] == pytest.approx((1.75, 3.5, 2.25, 4.5))


def test_layers_are_those_of_the_start():
    closed = DOOR.replace("top: 2.1", "top: 2.1, initially: closed")
    leaf = shapely.box(4, 2, 4.2, 3)
    for doors, there in ((DOOR, False), (closed, True)):
        scenario = parse_scenario(with_events(f"at: 1, {CRATE}", doors=doors))
        legs = scenario.environment.layers[0]
        assert legs.free.intersects(leaf.buffer(-0.01)) is not there
        assert legs.free.contains(shapely.Point(1.5, 1.25))


def test_doors_and_what_is_movable_may_change_without_an_event():
    for initially, there in [("closed", True), ("open", False)]:
        doors = DOOR.replace("top: 2.1", f"top: 2.1, initially: {initially}")
        text = with_events("at: 1, remove: bench", doors=doors).replace("name: pole,", "name: pole, movable: true,")
        timetable = parse_scenario(text).environment.timetable
        assert [solid.name for solid in timetable.fixed] == ["wall"]
        assert [(each.name, each.placing is not None) for each in timetable.movables] == [
            ("pole", True), ("bench", True), ("front", there),
        ]  # fmt: skip


def test_bodies_in_3d_meet_closed_doors_that_stay_closed():
    doors = DOOR.replace("top: 2.1", "top: 2.1, initially: closed")
    text = change(("motion: {set: default}\n", f"planner: collision3d\n{doors}"))
    timetable = parse_scenario(text).environment.timetable
    assert "front" in [solid.name for solid in timetable.fixed]
    assert timetable.movables == ()


def test_bodies_in_3d_meet_no_commanded_doors():
    commands = "commands: [{at: 1, close: front}]\n"
    text = change(("motion: {set: default}\n", f"planner: collision3d\n{DOOR}{commands}"))
    with pytest.raises(ScenarioError, match="planner: the planner 'collision3d' supports no events; drop them"):
        parse_scenario(text)


def test_a_name_may_come_again_when_it_is_gone():
    scenario = parse_scenario(
        with_events("at: 1, remove: pole", "at: 2, insert: {name: pole, box: {min: [1, 1], max: [2, 2]}, top: 1}")
    )
    timetable = scenario.environment.timetable
    assert [timetable.movables[event.movable].name for event in timetable.events] == ["pole", "pole"]
    assert timetable.movables[timetable.events[1].movable].solids[0].top == 1.0


@pytest.mark.parametrize(
    ("events", "line"),
    [
        (["at: 1, close: frnt"], "15:20: events.0.close: no door 'frnt'; did you mean 'front'?"),
        (["at: 1, close: pole"], "15:20: events.0.close: 'pole' is an obstacle; list it under 'doors'"),
        (["at: 1, open: front"], "15:19: events.0.open: 'front' is open already, from the start"),
        (
            ["at: 5, close: front", "at: 1, close: front"],
            "15:20: events.0.close: 'front' is closed already, since 1 s",
        ),
        (["at: 1, remove: front"], "15:21: events.0.remove: 'front' is a door; doors open and close"),
        (["at: 1, remove: pol"], "15:21: events.0.remove: no obstacle 'pol'; did you mean 'pole'?"),
        (
            ["at: 1, remove: pole", "at: 2, move: {name: pole, by: [1, 0]}"],
            "16:19: events.1.move: 'pole' is not there at 2 s; it is gone since 1 s",
        ),
        (
            [f"at: 9, {CRATE}", "at: 2, remove: crate"],
            "16:21: events.1.remove: 'crate' is not there at 2 s; it comes at 9 s",
        ),
        (
            [f"at: 30, {CRATE}", "at: 10, remove: crate", f"at: 5, {CRATE}", "at: 2, move: {name: crate, by: [1, 0]}"],
            "18:19: events.3.move: 'crate' is not there at 2 s; it comes at 5 s",
        ),
        (
            ["at: 1, insert: {name: wall, box: {min: [1, 1], max: [2, 2]}, top: 1}"],
            "15:21: events.0.insert: the name 'wall' is taken by something that is there, from the start",
        ),
        (
            ["at: 1, remove: pole, open: front"],
            "15:5: events.0: give exactly one of open, close, insert, move, remove;",
        ),
        (["at: 1"], "15:5: events.0: give exactly one of open, close, insert, move, remove; found none"),
        (["at: -1, remove: pole"], "15:10: events.0.at: must be at least 0"),
        (["at: 1, move: {name: pole}"], "15:19: events.0.move: a move needs 'by', 'to' or 'rotation'"),
        (
            ["at: 1, move: {name: pole, by: [1, 0], to: [1, 1]}"],
            "15:19: events.0.move: give one of 'by' and 'to'",
        ),
        (["at: 1, insert: {nam: crate, top: 1}"], "15:22: events.0.insert.nam: unknown key; did you mean 'name'?"),
        (["at: 1, shut: front"], "15:13: events.0.shut: unknown key"),
    ],
)
def test_an_event_that_cannot_be_is_refused_with_its_line(events, line):
    with pytest.raises(ScenarioError) as caught:
        parse_scenario(with_events(*events))
    problems = [str(problem) for problem in caught.value.problems]
    assert any(problem.startswith(f"<text>:{line}") for problem in problems), problems


def test_doors_and_obstacles_share_their_names():
    with pytest.raises(ScenarioError, match=r"13:16: doors.0.name: the name 'pole' is taken by obstacles.1"):
        parse_scenario(with_events("at: 1, remove: bench", doors=DOOR.replace("front", "pole")))
    with pytest.raises(ScenarioError, match=r"unknown value 'shut'; the values here are: open, closed"):
        parse_scenario(with_events("at: 1, remove: bench", doors=DOOR.replace("top: 2.1", "top: 2.1, initially: shut")))


def test_events_that_come_to_nothing_are_warned_of():
    text = with_events("at: 1, insert: {name: rug, box: {min: [1, 1], max: [2, 2]}, top: 0.02}", "at: 60, remove: pole")
    assert check_scenario(parse_scenario(text)) == [
        "<text>:16:10: events.1.at: the run ends at 60 s, before this happens",
        "<text>:15:21: events.0.insert: 'rug' (0 to 0.02 m) meets no layer (legs 0.1 to 2 m, torso 0.65 to 1.5 m) "
        "and has no effect",
    ]
