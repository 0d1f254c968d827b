"""The tests: which scenarios each runs, what it requires of them, and the sources."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

from crowdsim.analysis.measured_people import ONE_WAY_SOURCE, ONE_WAY_SPEEDS
from crowdsim.validate import criteria
from crowdsim.validate.criteria import Criterion

FOLDER = Path(__file__).parent / "scenarios"

RIMEA = "RiMEA 4.1.1"
IMO = "IMO MSC.1/Circ.1533"
NIST = "NIST TN 1822"


class Case(NamedTuple):
    """A run of a test: a scenario of FOLDER, by the name of its file without ``.yaml``, with changes ``key=value``."""

    name: str
    scenario: str
    changes: tuple[str, ...] = ()


class Test(NamedTuple):
    """A test of a guideline.

    Attributes
    ----------
    name : str
        Name on the command line.
    title : str
        What it is about.
    source : str
        The guideline, and the number of the test there.
    cases : tuple of Case
        Scenarios that are run.
    criteria : tuple of Criterion
        What is required of the runs.
    meaning : str
        What passing it says about a crowd.
    departs : tuple of str
        Names of figures that lie outside of the guideline's band on purpose; ``meaning`` says why.
    """

    name: str
    title: str
    source: str
    cases: tuple[Case, ...]
    criteria: tuple[Criterion, ...]
    meaning: str
    departs: tuple[str, ...] = ()


class Missing(NamedTuple):
    """A test that is not run, with the reason."""

    source: str
    title: str
    reason: str


_WIDTHS = {
    "0.8 m": ("rimea_12d_080", 1.04, 2.08),
    "1.2 m": ("rimea_12d_120", 1.56, 3.12),
    "2.0 m": ("rimea_12d_200", 2.6, 5.2),
}
"""Scenario and band of the flow [1/s], by width of the bottleneck."""

_AGAINST = (0, 10, 50, 100)  # people who come towards 100 others in a corridor, as in the guideline

_ONE_WAY = (0.5, 1.0, 1.5, 2.0, 2.5, 3.0)
"""Densities in the periodic corridor [1/m2], whose floor has 52 m2."""

_BOTH_WAYS = {1.0: 1.0, 2.0: 0.65}
"""By density of people who walk both ways [1/m2]: the least mean speed [m/s]."""

_CORNER = f"{RIMEA}, test 15: between the straight corridors as long as the inner and the outer wall"

FILE_SPEEDS = (
    (0.0989, 0.9607, 1.483),
    (0.2989, 0.8395, 1.4725),
    (0.4989, 0.7083, 1.3887),
    (0.6989, 0.5978, 1.3053),
    (0.8989, 0.4475, 1.1008),
    (1.0989, 0.3157, 0.8395),
    (1.2989, 0.1872, 0.6077),
)
"""Rows of density in single file [1/m], and the 10 and 90 % quantiles of the speeds measured at it [m/s]."""

_RING = 17.3
"""Length of the ring along the middle of its lane [m]."""

_IN_RING = (4, 8, 13, 16, 20)
"""Numbers of people in the ring."""

_SPLITS = (0.5, 0.55, 0.6)
"""Shares of the people who are sent to the near one of two exits."""

_DOORS = "1.4 to 2.0 persons a second and meter of the doors, and the way"

_FILE_SOURCE = f"{RIMEA}, test 16; Seyfried et al. 2005"


def _one_way(density: float) -> Case:
    """Return the periodic corridor of 52 m2 at a density of people who walk one way [1/m2]."""
    return Case(f"{density:g} /m2", "rimea_04", (f"agents.0.count={round(52 * density)}",))


def _both_ways(density: float) -> Case:
    """Return the periodic corridor at a density [1/m2], with half of the people walking each way."""
    each = round(26 * density)  # half of 52 m2
    return Case(f"both ways, {density:g} /m2", "rimea_04_both", (f"agents.0.count={each}", f"agents.1.count={each}"))


def _straight(name: str, length: float) -> Case:
    """Return the corridor of test 15 without its corner, ``length`` [m] long, with the goal in the 3 m behind it."""
    floor = f"floor={{rectangle: [0, 0, {length + 3:g}, 20]}}"
    return Case(name, "rimea_15", (floor, f"agents.0.goal={{rectangle: [{length:g}, 0, {length + 3:g}, 20]}}"))


def _ring(count: int) -> Case:
    """Return the ring with ``count`` people, as evenly as can be in the four groups of its quarters."""
    shares = [count // 4 + (number < count % 4) for number in range(4)]
    return Case(f"{count} people", "rimea_16", tuple(f"agents.{k}.count={share}" for k, share in enumerate(shares)))


def _ring_band(count: int) -> tuple[float, float]:
    """Return the band of the mean speed of ``count`` people in the ring [m/s], interpolated between FILE_SPEEDS."""
    density, least, most = np.array(FILE_SPEEDS).T
    at = count / _RING
    return float(np.interp(at, density, least)), float(np.interp(at, density, most))


def _split(near: float) -> Case:
    """Return the room with two exits: the share ``near`` of the people, those nearest to the near exit, leave there."""
    border = 0.5 + 14.5 * near  # people start from x = 0.5 to 15 m, as dense on both sides of the border
    counts = round(300 * near), 300 - round(300 * near)
    starts = (0.5, border), (border, 15.0)
    settings = [f"agents.{k}.count={count}" for k, count in enumerate(counts)]
    settings += [f"agents.{k}.start={{rectangle: [{a:g}, 0.5, {b:g}, 19.5]}}" for k, (a, b) in enumerate(starts)]
    return Case(f"{near:.0%} to the near exit", "rimea_11_fixed", tuple(settings))


def _counterflow(count: int) -> Case:
    """Return the corridor with ``count`` people who come the other way; for 0, a scenario without their group."""
    if count == 0:
        return Case("none against", "imo_08_one_way")
    return Case(f"{count} against", "imo_08_both_ways", (f"agents.1.count={count}",))


TESTS = (
    Test(
        "rimea-1",
        "speed in a corridor",
        f"{RIMEA}, test 1; NIST Verif.2.1",
        (Case("corridor", "rimea_01"),),
        (criteria.transit("corridor", "begin", "end", 26.0, 34.0, f"{RIMEA}, test 1: 1.33 m/s less or more 5 %"),),
        "A single person walks at the required speed.",
    ),
    Test(
        "rimea-4",
        "fundamental diagram, one way",
        f"{RIMEA}, test 4",
        tuple(_one_way(density) for density in _ONE_WAY),
        (
            *(
                criteria.speed_at_density(_one_way(density).name, "middle", ONE_WAY_SPEEDS, ONE_WAY_SOURCE)
                for density in _ONE_WAY
            ),
            criteria.speeds_fall(tuple(_one_way(density).name for density in _ONE_WAY), "corridor", f"{RIMEA}, test 4"),
        ),
        "The denser, the slower, as with people. The band is that of the density measured in the area, which differs "
        "a little from the nominal one; speeds are stratified, as the mean of 26 drawn at random varies as much as the "
        "band is wide. Measured bands end at 3.25 /m2. Agents on a periodic floor are always steered.",
    ),
    Test(
        "rimea-4-both",
        "fundamental diagram, both ways",
        f"{RIMEA}, test 4, with people who come the other way",
        tuple(map(_both_ways, _BOTH_WAYS)),
        tuple(
            criteria.speed_in(
                _both_ways(density).name,
                "corridor",
                (least, np.inf),
                "ours; of people in 3.6 m, 5 to 95 % walked at 1.01 to 1.27 m/s at 1 /m2, 0.59 to 0.77 at 2 "
                "(HERMES experiments, Zhang et al. 2012)",
            )
            for density, least in _BOTH_WAYS.items()
        ),
        "People who walk both ways form lanes and go on; nobody is stuck for good.",
    ),
    Test(
        "rimea-5",
        "times of reaction",
        f"{RIMEA}, test 5; IMO 5; NIST Verif.1.1; ISO 20414 test 1",
        (Case("room", "rimea_05"),),
        (
            criteria.on_time("room", 0.5, f"{RIMEA}, test 5"),
            criteria.uniform_delays("room", 10.0, 100.0, "NIST TN 1822, Verif.1.1"),
            criteria.all_leave("room", 130.0, f"{RIMEA}, test 5"),
        ),
        "Agents set out neither early nor late; a distance of 0.3 m counts as having set out.",
    ),
    Test(
        "rimea-6",
        "around a corner",
        f"{RIMEA}, test 6; IMO 6; NIST Verif.2.3; ISO 20414 test 4",
        (Case("corner", "rimea_06"),),
        (
            criteria.all_leave("corner", 60.0, f"{RIMEA}, test 6"),
            criteria.nobody_in_walls("corner", f"{RIMEA}, test 6"),
        ),
        "Nobody cuts the corner through the wall, and nobody gets stuck at it.",
    ),
    Test(
        "rimea-7",
        "speeds of a population",
        f"{RIMEA}, test 7; IMO 7; NIST Verif.2.4",
        (Case("lanes", "rimea_07"),),
        (criteria.speeds_as_drawn("lanes", "begin", "end", 0.03, f"{RIMEA}, test 7; 3 % is ours"),),
        "Agents walk at the speeds that were drawn. They set out two seconds apart, so that few are held up.",
    ),
    Test(
        "rimea-9",
        "a hall with four doors, and with two",
        f"{RIMEA}, test 9; IMO 9",
        (Case("four doors", "rimea_09"), Case("two doors", "rimea_09", ("agents.0.exits=[door 3, door 4]",))),
        (
            criteria.ratio("two doors", "four doors", 1.6, 2.4, f"{RIMEA}, test 9: about twice; band of JuPedSim"),
            criteria.all_leave("four doors", 185.0, _DOORS, 120.0),
            criteria.all_leave("two doors", 365.0, _DOORS, 245.0),
        ),
        "Doors bound how fast a hall empties: with half as many it takes twice as long.",
    ),
    Test(
        "rimea-10",
        "assigned exits",
        f"{RIMEA}, test 10; IMO 10; NIST Verif.3.1",
        (Case("cabins", "rimea_10"),),
        (
            criteria.leaves_through("cabins", {"main": 18, "secondary": 5}, f"{RIMEA}, test 10"),
            criteria.all_leave("cabins", 120.0, f"{RIMEA}, test 10"),
        ),
        "Agents go to the exit assigned to them, even if another one is nearer. There are eight cabins, where the "
        "guideline has twelve.",
    ),
    Test(
        "rimea-11",
        "choice of an exit",
        f"{RIMEA}, test 11",
        (
            Case("chosen", "rimea_11"),
            *map(_split, _SPLITS),
        ),
        (
            criteria.both_exits("chosen", "near", "far", f"{RIMEA}, test 11: both are used, the nearer one more"),
            criteria.close_to_best("chosen", tuple(_split(share).name for share in _SPLITS), 1.15, "ours"),
        ),
        "With a queue at the near exit, some go to the far one. There are 300 people, where the guideline has 1,000. "
        "In the fixed splits, those who stand nearer to the far exit are sent there.",
    ),
    Test(
        "rimea-12",
        "two necks, one behind the other",
        f"{RIMEA}, test 12",
        (Case("necks", "rimea_12"),),
        (
            criteria.queue_before_the_first("necks", ("before the first", "before the second"), f"{RIMEA}, test 12"),
            criteria.no_more_flow_behind("necks", ("first neck", "second neck"), f"{RIMEA}, test 12"),
            criteria.flow("necks", "first neck", 1.4, 2.5, "measured in necks of 1 m: Kretz 2006, Seyfried 2009"),
        ),
        "A flow through a bottleneck also passes a second one of the same width: nobody waits there.",
    ),
    Test(
        "rimea-12d",
        "necks of several widths",
        f"{RIMEA}, test 12d",
        tuple(Case(width, scenario) for width, (scenario, _, _) in _WIDTHS.items()),
        (
            *(
                criteria.flow(width, "neck", least, most, "Kretz 2006, Seyfried 2009, Daamen 2010")
                for width, (_, least, most) in _WIDTHS.items()
            ),
            criteria.flow_grows(tuple(_WIDTHS), "neck", f"{RIMEA}, test 12d"),
            *(criteria.flow_per_meter(width, "neck", 1.3, "ours") for width in _WIDTHS),
        ),
        "The wider a neck, the more come through.",
    ),
    Test(
        "rimea-15",
        "a large crowd around a corner",
        f"{RIMEA}, test 15",
        (Case("corner", "rimea_15"), _straight("short", 50.0), _straight("long", 81.4)),
        (criteria.takes_between("short", "corner", "long", _CORNER),),
        "A crowd uses the width of the corner; if all hugged the inner wall, it would take longer than along the outer "
        "one. Lengths are those of JuPedSim's test, as the text of the guideline was not at hand.",
    ),
    Test(
        "rimea-16",
        "single file in a ring",
        _FILE_SOURCE,
        tuple(_ring(count) for count in _IN_RING),
        tuple(criteria.speed_in(_ring(count).name, "ring", _ring_band(count), _FILE_SOURCE) for count in _IN_RING),
        "The denser the file, the slower. Alone, people walk as those of the experiment did, 1.24 m/s, sd 0.15, at "
        "most 2 sd off; with the usual speeds, 1.34 m/s, sd 0.26, or without the limit of 2 sd, four are sometimes led "
        "by a slow one at 0.88 m/s, and miss their band.",
    ),
    Test(
        "imo-1",
        "the speed that was set",
        f"{IMO}, test 1",
        (Case("corridor", "imo_01"),),
        (criteria.transit("corridor", "begin", "end", 38.0, 42.0, f"{IMO}, test 1: 40 s; less or more 5 % is ours"),),
        "A single person keeps to 1 m/s.",
    ),
    Test(
        "imo-4",
        "flow through an exit",
        f"{IMO}, test 4; NIST Verif.5.2",
        (Case("room", "imo_04"),),
        (
            criteria.flow_over_all("room", "exit", 1.33, f"{IMO}, test 4: over the entire period"),
            criteria.flow("room", "exit", 1.4, 2.5, "measured in necks of 1 m: Kretz 2006, Seyfried 2009"),
        ),
        "The guideline caps the flow at 1.33 /s, for conservative planning; people measured in bottlenecks of 1 m pass "
        "at 1.4 to 2.5 /s. No model can meet both: crowdsim is compared with people.",
        departs=("passages until the last one, room",),
    ),
    Test(
        "imo-8",
        "counterflow in a corridor",
        f"{IMO}, test 8; NIST Verif.2.8; ISO 20414 test 6",
        tuple(_counterflow(count) for count in _AGAINST),
        (
            criteria.times_grow(
                tuple(_counterflow(count).name for count in _AGAINST), "behind the corridor", "people", f"{IMO}, test 8"
            ),
            *(criteria.all_leave(_counterflow(count).name, 400.0, f"{IMO}, test 8") for count in _AGAINST),
        ),
        "The more come towards them, the longer people take; nobody is stuck for good.",
    ),
    Test(
        "nist-2.9",
        "families among others",
        f"{NIST}, Verif.2.9; ISO 20414's counterpart",
        (Case("families", "nist_2_9"),),
        (
            criteria.keeps_together("families", "families", 0.95, f"{NIST}, Verif.2.9; 95 % is ours"),
            criteria.all_leave("families", 240.0, "ours: all arrive"),
        ),
        "A family walks at the speed of its slowest member, and waits for members behind. The slowest of them, at "
        "0.38 m/s, would take 80 s alone.",
    ),
    Test(
        "nist-4.1",
        "an exit that is shut",
        f"{NIST}, Verif.4.1; ISO 20414's counterpart",
        (Case("exits", "nist_4_1"),),
        (
            criteria.leaves_through("exits", {"exit 1": 0, "exit 2": 1}, f"{NIST}, Verif.4.1"),
            criteria.all_leave("exits", 60.0, f"{NIST}, Verif.4.1"),
        ),
        "Agents on their way to an exit that is closed turn to the other one.",
    ),
)

MISSING = (
    Missing(f"{RIMEA}, tests 2, 3 and 13", "speed and queues on stairs", "floors have no stairs yet"),
    Missing(
        f"{RIMEA}, test 8",
        "analysis of parameters",
        "it has no criterion: it asks to report how results depend on parameters",
    ),
    Missing(f"{RIMEA}, test 14", "choice of a route over floors", "there is one floor"),
    Missing(f"{IMO}, tests 2, 3 and 11", "stairs up and down", "floors have no stairs yet"),
    Missing(f"{NIST}, Verif.2.2", "speed on stairs", "floors have no stairs yet"),
    Missing(f"{NIST}, Verif.2.5 and 2.6", "speed in smoke, and people overcome by it", "there is no smoke"),
    Missing(f"{NIST}, Verif.2.7", "elevators", "there is one floor"),
    Missing(f"{NIST}, Verif.2.10", "people in wheelchairs on a ramp", "floors have no ramps, and bodies no wheels"),
    Missing(
        f"{NIST}, Verif.3.2 and 3.3",
        "exits that others use, or that a person knows",
        "agents consider only the queues of others; a known exit is assigned",
    ),
    Missing(f"{NIST}, Verif.5.1", "congestion before stairs", "floors have no stairs yet"),
    Missing("ISO 20414", "tests without a counterpart named above", "its text was not at hand; most are those of NIST"),
)


def find_tests(names: list[str]) -> list[Test]:
    """Return the tests with these names, all if ``names`` is empty; raise KeyError for an unknown name."""
    known = {test.name: test for test in TESTS}
    return [known[name] for name in names] if names else list(TESTS)
