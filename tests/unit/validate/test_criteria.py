"""Criteria find the figures that made-up runs have, and hold them against their bands."""

from typing import Any

import numpy as np
import pytest

from crowdsim.recording.measured import AreaSeries, Crossings, Measured
from crowdsim.validate import criteria
from crowdsim.validate.criteria import Criterion, Finding
from crowdsim.validate.observed import Observed


def crossings(times: list[float], agents: list[int] | None = None, width: float = 1.0) -> Crossings:
    numbers = np.arange(len(times)) if agents is None else np.array(agents)
    return Crossings(2.0 * width, width, numbers.astype(np.int32), np.array(times), np.ones(len(times), np.bool_))


def area(counts: list[int]) -> AreaSeries:
    return AreaSeries(6.0, np.array(counts, np.int32), np.ones(len(counts), np.float32))


def made_up(count: int = 3, **changes: Any) -> Observed:
    measured = Measured(changes.pop("areas", {}), changes.pop("lines", {}))
    numbers = np.arange(count, dtype=np.float64)
    usual = Observed(
        summary={"obstacle_margin": {"legs": 0.05, "torso": 0.08}, "lines": {}, "areas": {}, "exits": {}},
        measured=measured,
        groups=("a",) * count,
        set_out=10.0 * numbers,
        left=10.0 + numbers,
        speeds=np.ones(count),
        delays=10.0 * numbers,
        crossed={},
        outside=0,
        seconds=1.0,
    )
    return usual._replace(**changes)


def judged(criterion: Criterion, **runs: Observed) -> list[tuple[float, bool]]:
    return [(pytest.approx(finding.value), finding.passed) for finding in criterion(runs)]


def test_a_figure_that_is_not_known_is_not_in_its_band() -> None:
    assert Finding("a", 1.0, "s", 1.0, 1.0, "x").passed
    assert not Finding("a", float("nan"), "s", -np.inf, np.inf, "x").passed
    assert not Finding("a", np.inf, "s", 0.0, 5.0, "x").passed


def test_the_transit_that_is_farthest_off_counts() -> None:
    lines = {"begin": crossings([1.0, 2.0, 3.0]), "end": crossings([31.0, 37.0, 33.0])}
    test = criteria.transit("run", "begin", "end", 26.0, 34.0, "x")
    assert judged(test, run=made_up(lines=lines)) == [(35.0, False)]
    assert judged(test, run=made_up(lines={**lines, "end": crossings([31.0, 33.0, 33.5])})) == [(31.0, True)]
    never = {**lines, "end": crossings([31.0, 33.0])}
    assert not judged(test, run=made_up(lines=never))[0][1], "who does not arrive has no time"


def test_the_first_of_several_crossings_counts() -> None:
    run = made_up(lines={"l": crossings([1.0, 2.0, 3.0, 4.0], [0, 1, 0, 1])})
    np.testing.assert_array_equal(run.times_at("l"), [1.0, 2.0, np.nan])
    np.testing.assert_array_equal(run._replace(groups=("a", "b", "b")).times_at("l", "b"), [2.0, np.nan])


def test_the_last_one_who_leaves_counts_and_who_stays_fails() -> None:
    test = criteria.all_leave("run", 12.0, "x")
    assert judged(test, run=made_up()) == [(12.0, True)]
    assert judged(test, run=made_up(left=np.array([1.0, 2.0, 12.5]))) == [(12.5, False)]
    assert judged(criteria.all_leave("run", 20.0, "x", 12.5), run=made_up()) == [(12.0, False)]
    assert criteria.all_leave("run", 1e6, "x")({"run": made_up(left=np.array([1.0, np.nan, 2.0]))})[0].value == np.inf


def test_walls_are_not_to_be_touched() -> None:
    test = criteria.nobody_in_walls("run", "x")
    assert judged(test, run=made_up()) == [(0.0, True), (0.05, True)]
    assert judged(test, run=made_up(outside=2)) == [(2.0, False), (0.05, True)]
    deep = {"obstacle_margin": {"legs": -0.01}}
    assert judged(test, run=made_up(summary=deep)) == [(0.0, True), (-0.01, False)]


def test_times_of_reaction_are_those_drawn() -> None:
    test = criteria.on_time("run", 0.5, "x")
    assert judged(test, run=made_up()) == [(0.0, True)]
    assert judged(test, run=made_up(set_out=np.array([0.0, 9.0, 20.2]))) == [(1.0, False)]
    assert not judged(test, run=made_up(set_out=np.array([0.0, np.nan, 20.2])))[0][1]
    uniform = criteria.uniform_delays("run", 0.0, 90.0, "x")
    even = made_up(10, delays=np.linspace(4.5, 85.5, 10))
    assert judged(uniform, run=even)[0][1]
    assert not judged(uniform, run=even._replace(delays=np.linspace(0.0, 20.0, 10)))[0][1]


def test_speeds_walked_are_those_drawn() -> None:
    test = criteria.speeds_as_drawn("run", "begin", "end", 0.03, "x")
    # The second one walks at an angle: 24 m along and 32 m across.
    crossed = {"begin": np.zeros((3, 2)), "end": np.array([[40.0, 0.0], [24.0, 32.0], [40.0, 0.0]])}
    speeds = np.array([1.0, 2.0, 0.5])
    lines = {"begin": crossings([0.0, 1.0, 2.0]), "end": crossings([40.0, 21.0, 82.0])}
    assert judged(test, run=made_up(lines=lines, speeds=speeds, crossed=crossed)) == [(0.0, True), (0.0, True)]
    slow = judged(test, run=made_up(lines=lines, speeds=speeds * 1.1, crossed=crossed))
    assert [passed for _, passed in slow] == [False, False]


def test_a_ratio_needs_everybody_to_leave() -> None:
    test = criteria.ratio("two", "four", 1.6, 2.4, "x")
    four, two = made_up(left=np.array([10.0])), made_up(left=np.array([20.0]))
    assert judged(test, two=two, four=four) == [(2.0, True)]
    assert judged(test, two=four, four=two) == [(0.5, False)]
    assert not judged(test, two=made_up(left=np.array([np.nan])), four=four)[0][1]
    best = criteria.close_to_best("two", ("four", "other"), 1.15, "x")
    assert judged(best, two=two, four=four, other=made_up(left=np.array([18.0]))) == [(2.0, False)]
    assert judged(best, two=two, four=made_up(left=np.array([40.0])), other=made_up(left=np.array([18.0])))[0][1]


def test_the_queue_is_before_the_first_neck() -> None:
    test = criteria.queue_before_the_first("run", ("first", "second"), "x")
    many, few = area([*range(20), 18, 18]), area([3, 4, 5, *([4] * 9)])
    assert [passed for _, passed in judged(test, run=made_up(areas={"first": many, "second": few}))] == [True, True]
    assert [passed for _, passed in judged(test, run=made_up(areas={"first": few, "second": many}))] == [False, False]
    assert [passed for _, passed in judged(test, run=made_up(areas={"first": few, "second": few}))] == [False, False]


def flows(**lines: float | None) -> dict[str, Any]:
    return {"lines": {name: {"flow": value} for name, value in lines.items()}}


def test_flows_lie_in_bands_grow_and_do_not_grow_behind() -> None:
    run = made_up(summary=flows(one=1.5, two=1.4), lines={"one": crossings([1.0], width=1.25)})
    assert judged(criteria.flow("run", "one", 1.4, 2.0, "x"), run=run) == [(1.5, True)]
    assert judged(criteria.flow("run", "two", 1.45, 2.0, "x"), run=run) == [(1.4, False)]
    assert judged(criteria.no_more_flow_behind("run", ("one", "two"), "x"), run=run) == [(0.1, True)]
    assert judged(criteria.no_more_flow_behind("run", ("two", "one"), "x"), run=run) == [(-0.1, False)]
    assert judged(criteria.flow_per_meter("run", "one", 1.3, "x"), run=run) == [(1.2, False)]
    runs = {name: made_up(summary=flows(l=value)) for name, value in (("a", 1.0), ("b", 1.5), ("c", 1.4))}
    assert judged(criteria.flow_grows(("a", "b"), "l", "x"), **runs) == [(0.5, True)]
    assert judged(criteria.flow_grows(("a", "b", "c"), "l", "x"), **runs) == [(-0.1, False)]
    assert not judged(criteria.flow("run", "one", 0.0, 9.0, "x"), run=made_up(summary=flows(one=None)))[0][1]


def test_counterflow_takes_longer_the_more_there_is_of_it() -> None:
    test = criteria.times_grow(("a", "b"), "l", "people", "x")
    runs = {
        name: made_up(groups=("people", "people", "others"), lines={"l": crossings([1.0, last, 99.0])})
        for name, last in (("a", 50.0), ("b", 60.0))
    }
    assert judged(test, **runs) == [(50.0, True), (60.0, True), (10.0, True)]
    assert judged(test, a=runs["b"], b=runs["a"])[2] == (-10.0, False)
    lost = made_up(groups=("people", "people", "others"), lines={"l": crossings([1.0], [0])})
    assert not judged(test, a=runs["a"], b=lost)[2][1]


def test_speeds_in_areas_and_counts_at_exits() -> None:
    run = made_up(summary={"areas": {"ring": {"speed": 0.75}}, "exits": {"n": {"left": 18}, "f": {"left": 5}}})
    assert judged(criteria.speed_in("run", "ring", (0.5, 0.8), "x"), run=run) == [(0.75, True)]
    empty = made_up(summary={"areas": {"ring": {"speed": None, "density": None}}})
    assert not judged(criteria.speed_in("run", "ring", (0.5, 0.8), "x"), run=empty)[0][1]
    bands = ((0.5, 1.0, 1.5), (1.5, 0.5, 0.9))
    test = criteria.speed_at_density("run", "ring", bands, "x")
    assert not judged(test, run=empty)[0][1]
    (finding,) = test({"run": made_up(summary={"areas": {"ring": {"speed": 0.8, "density": 1.0}}})})
    assert (finding.least, finding.most, finding.passed) == (pytest.approx(0.75), pytest.approx(1.2), True)
    assert judged(criteria.leaves_through("run", {"n": 18, "f": 6}, "x"), run=run) == [(18.0, True), (5.0, False)]
    assert judged(criteria.both_exits("run", "n", "f", "x"), run=run) == [(5.0, True)]
    assert judged(criteria.both_exits("run", "f", "n", "x"), run=run) == [(18.0, False)]


def test_the_flow_over_all_counts_until_the_last_one() -> None:
    lines = {"exit": crossings([1.0, 2.0, 4.0])}
    test = criteria.flow_over_all("run", "exit", 0.8, "x")
    assert judged(test, run=made_up(lines=lines)) == [(0.75, True)]
    assert judged(test, run=made_up(lines={"exit": crossings([1.0, 2.0, 3.0])})) == [(1.0, False)]
    assert not judged(test, run=made_up(lines={"exit": crossings([1.0, 2.0])}))[0][1], "somebody stayed"


def test_parties_are_held_to_their_share_of_time_together() -> None:
    test = criteria.keeps_together("run", "pairs", 0.95, "x")
    for share, passed in ((0.96, True), (0.94, False), (None, False)):
        (found,) = test({"run": made_up(summary={"together": {"pairs": share}})})
        assert found.passed == passed


def test_speeds_fall_from_case_to_case() -> None:
    test = criteria.speeds_fall(("a", "b", "c"), "corridor", "x")

    def seen(speed: float | None) -> Observed:
        return made_up(summary={"areas": {"corridor": {"speed": speed}}})

    assert judged(test, a=seen(1.2), b=seen(1.0), c=seen(0.9)) == [(0.1, True)]
    assert judged(test, a=seen(1.2), b=seen(0.9), c=seen(0.95)) == [(-0.05, False)]
    assert not judged(test, a=seen(1.2), b=seen(None), c=seen(0.9))[0][1]


def test_a_corner_takes_a_time_between_those_of_two_corridors() -> None:
    test = criteria.takes_between("short", "corner", "long", "x")
    short, long = made_up(left=np.array([8.0, 9.0, 10.0])), made_up(left=np.array([18.0, 19.0, 20.0]))
    assert judged(test, short=short, corner=made_up(left=np.array([9.0, 10.0, 14.0])), long=long) == [
        (14.0, True),
        (11.0, True),
    ]
    slow = made_up(left=np.array([9.0, 10.0, 21.0]))
    assert [passed for _, passed in judged(test, short=short, corner=slow, long=long)] == [False, True]
    stays = made_up(left=np.array([9.0, 10.0, np.nan]))
    assert [passed for _, passed in judged(test, short=short, corner=stays, long=long)] == [False, False]
