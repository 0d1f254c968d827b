"""Criteria: each returns a function that takes the observed runs of a test and returns figures with their bands.

``case`` is the name of a run. ``least`` and ``most`` are the ends of the band, in the unit of the figure; ``source``
says where the band is from. Lines, areas and groups are those that the scenario names. All times are those of the
simulation. A figure that is unknown is nan, which is in no band.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from crowdsim.geometry.elementary import hypot
from crowdsim.validate.observed import Observed

Runs: TypeAlias = Mapping[str, Observed]
"""Runs of a test with one seed, by the names of its cases."""


class Finding(NamedTuple):
    """A figure and the band in which it must lie.

    Attributes
    ----------
    what : str
        Name of the figure.
    value : float
        Its value; nan if it is unknown, infinite if it is a time that never came.
    unit : str
        Its unit.
    least, most : float
        The band.
    source : str
        Source of the band.
    """

    what: str
    value: float
    unit: str
    least: float
    most: float
    source: str

    @property
    def passed(self) -> bool:
        """Return whether the figure is within its band, whose ends belong to it; nan is not."""
        return bool(self.least <= self.value <= self.most)


Criterion: TypeAlias = Callable[[Runs], Sequence[Finding]]
"""Judges the runs of a test with one seed: returns its figures, always the same ones in the same order."""


def transit(case: str, begin: str, end: str, least: float, most: float, source: str) -> Criterion:
    """Check the times that agents take between two lines [s]: the figure is the time farthest from the band's middle.

    It is nan if an agent does not cross both lines.
    """

    def judge(runs: Runs) -> list[Finding]:
        times = runs[case].times_at(end) - runs[case].times_at(begin)
        return [Finding("time between the lines", _worst(times, least, most), "s", least, most, source)]

    return judge


def all_leave(case: str, most: float, source: str, least: float = 0.0) -> Criterion:
    """Check the time at which the last agent leaves [s], infinite if an agent stays."""
    return lambda runs: [Finding(f"last one out, {case}", runs[case].last, "s", least, most, source)]


def nobody_in_walls(case: str, source: str) -> Criterion:
    """Check that no center leaves the free floor, and that the smallest gap of a body to a wall is -0.001 m or more.

    The millimeter is for rounding. The first figure counts positions over all steps.
    """

    def judge(runs: Runs) -> list[Finding]:
        run = runs[case]
        margins = run.summary["obstacle_margin"].values()  # by layer [m]
        return [
            Finding("centers off the floor", float(run.outside), "", 0.0, 0.0, source),
            Finding("body to wall, least", min(margins), "m", -0.001, np.inf, source),
        ]

    return judge


def on_time(case: str, tolerance: float, source: str) -> Criterion:
    """Check that every agent sets out at the delay drawn for it, at most ``tolerance`` [s] earlier or later."""

    def judge(runs: Runs) -> list[Finding]:
        off = np.abs(runs[case].set_out - runs[case].delays).max()
        return [Finding("set out off the time drawn, most", float(off), "s", 0.0, tolerance, source)]

    return judge


def uniform_delays(case: str, first: float, last: float, source: str) -> Criterion:
    """Check that drawn delays are uniform from ``first`` to ``last`` [s]: p of a Kolmogorov-Smirnov test is >= 0.05."""

    def judge(runs: Runs) -> list[Finding]:
        from scipy.stats import kstest

        chance = float(kstest(runs[case].delays, "uniform", (first, last - first)).pvalue)
        return [Finding("Kolmogorov-Smirnov p of the times", chance, "", 0.05, 1.0, source)]

    return judge


def speeds_as_drawn(case: str, begin: str, end: str, tolerance: float, source: str) -> Criterion:
    """Check the speeds of agents who walk straight from one line to another against their drawn speeds.

    Two relative differences must be at most ``tolerance``: the median over agents, and that of the two mean speeds.
    """

    def judge(runs: Runs) -> list[Finding]:
        run = runs[case]
        ways = hypot(*(run.crossed[end] - run.crossed[begin]).T)
        walked = ways / (run.times_at(end) - run.times_at(begin))
        off = np.abs(walked / run.speeds - 1.0)
        return [
            Finding("speed walked off that drawn, median", float(np.median(off)), "", 0.0, tolerance, source),
            Finding(
                "the same, mean speeds", float(abs(walked.mean() / run.speeds.mean() - 1.0)), "", 0.0, tolerance, source
            ),
        ]

    return judge


def ratio(more: str, less: str, least: float, most: float, source: str) -> Criterion:
    """Check the time until all have left the case ``more``, divided by the same time of the case ``less``."""
    return lambda runs: [
        Finding(f"time, {more} / {less}", _ratio(runs[more].last, runs[less].last), "", least, most, source)
    ]


def queue_before_the_first(case: str, areas: tuple[str, str], source: str) -> Criterion:
    """Check that more agents wait before the first of two bottlenecks: by the peak, and by the ten largest counts.

    ``areas`` are those before the first and before the second bottleneck. In the second one, the peak must be less by
    at least 1, and the mean of the ten largest counts by at least 0.1.
    """

    def judge(runs: Runs) -> list[Finding]:
        first, second = (np.sort(runs[case].measured.areas[name].count)[::-1][:10] for name in areas)
        return [
            Finding("most before the second neck", float(second[0]), "", 0.0, float(first[0]) - 1.0, source),
            Finding("ten largest counts there, mean", float(second.mean()), "", 0.0, float(first.mean()) - 0.1, source),
        ]

    return judge


def flow(case: str, line: str, least: float, most: float, source: str) -> Criterion:
    """Check the flow across a line [1/s], between the first and the last tenth of the passages."""
    return lambda runs: [Finding(f"flow, {case}", flow_of(runs[case], line), "/s", least, most, source)]


def flow_over_all(case: str, line: str, most: float, source: str) -> Criterion:
    """Check the number of agents over the time at which the last one first crosses a line [1/s]: ``most`` or less.

    The figure is nan if an agent never crosses the line.
    """

    def judge(runs: Runs) -> list[Finding]:
        last = float(runs[case].times_at(line).max())
        value = len(runs[case].groups) / last
        return [Finding(f"passages until the last one, {case}", value, "/s", 0.0, most, source)]

    return judge


def keeps_together(case: str, group: str, least: float, source: str) -> Criterion:
    """Check the share of time in which members of a group's parties have another member within 1.5 m.

    It must be ``least`` or more.
    """

    def judge(runs: Runs) -> list[Finding]:
        share = runs[case].summary["together"][group]
        value = float("nan") if share is None else float(share)
        return [Finding("time within 1.5 m of another one of the party", value, "", least, 1.0, source)]

    return judge


def no_more_flow_behind(case: str, lines: tuple[str, str], source: str) -> Criterion:
    """Check that the flow at the second line is at most 0.05 /s above the flow at the first."""

    def judge(runs: Runs) -> list[Finding]:
        first, second = (flow_of(runs[case], line) for line in lines)
        return [Finding("flow at the first neck less that at the second", first - second, "/s", -0.05, np.inf, source)]

    return judge


def flow_grows(cases: Sequence[str], line: str, source: str) -> Criterion:
    """Check that the flow grows from case to case [1/s]: the smallest difference must not be below 0."""

    def judge(runs: Runs) -> list[Finding]:
        flows = [flow_of(runs[case], line) for case in cases]
        return [Finding("flow, least growth with the width", float(np.diff(flows).min()), "/s", 0.0, np.inf, source)]

    return judge


def flow_per_meter(case: str, line: str, least: float, source: str) -> Criterion:
    """Check the flow across a line, divided by its length on the free floor [1/(m s)]: ``least`` or more."""

    def judge(runs: Runs) -> list[Finding]:
        value = flow_of(runs[case], line) / runs[case].measured.lines[line].width
        return [Finding(f"flow for each meter, {case}", value, "/(m s)", least, np.inf, source)]

    return judge


def times_grow(cases: Sequence[str], line: str, group: str, source: str) -> Criterion:
    """Check that the time at which the last of a group crosses a line grows from case to case [s].

    The smallest difference must not be below 0. Each time is a figure too, which fails only if an agent never crosses.
    """

    def judge(runs: Runs) -> list[Finding]:
        times = np.array([float(runs[case].times_at(line, group).max()) for case in cases])
        findings = [
            Finding(f"last one across, {case}", time, "s", 0.0, np.inf, source)
            for case, time in zip(cases, times.tolist(), strict=True)
        ]
        return [*findings, Finding("least growth", float(np.diff(times).min()), "s", 0.0, np.inf, source)]

    return judge


def speed_in(case: str, area: str, band: tuple[float, float], source: str) -> Criterion:
    """Check the mean speed in an area [m/s] against ``band``, its least and greatest value."""

    def judge(runs: Runs) -> list[Finding]:
        value = runs[case].summary["areas"][area]["speed"]
        return [Finding(f"speed, {case}", float("nan") if value is None else value, "m/s", *band, source)]

    return judge


def speed_at_density(case: str, area: str, bands: Sequence[tuple[float, float, float]], source: str) -> Criterion:
    """Check the mean speed in an area [m/s] against the band of the density measured there.

    ``bands`` holds rows of density [1/m2], least and greatest speed [m/s], by ascending density. Bands between two
    rows are interpolated; below the first and above the last density, the bands of these rows count.
    """
    densities, least, most = np.array(bands).T

    def judge(runs: Runs) -> list[Finding]:
        seen = runs[case].summary["areas"][area]
        value, density = (float("nan") if seen[key] is None else float(seen[key]) for key in ("speed", "density"))
        low, high = (float(np.interp(density, densities, each)) for each in (least, most))
        return [Finding(f"speed, {case}", value, "m/s", low, high, source)]

    return judge


def speeds_fall(cases: Sequence[str], area: str, source: str) -> Criterion:
    """Check that the mean speed in an area falls from case to case [m/s]: the smallest fall must not be below 0."""

    def judge(runs: Runs) -> list[Finding]:
        speeds = [runs[case].summary["areas"][area]["speed"] for case in cases]
        falls = -np.diff(np.array([np.nan if speed is None else speed for speed in speeds]))
        return [Finding(f"speed in the {area}, least fall", float(falls.min()), "m/s", 0.0, np.inf, source)]

    return judge


def takes_between(short: str, case: str, long: str, source: str) -> Criterion:
    """Check that a case takes at least as long as ``short`` and at most as long as ``long`` [s].

    This must hold for two figures: the time at which the last agent leaves, and the mean over all agents.
    """

    def judge(runs: Runs) -> list[Finding]:
        last = [runs[each].last for each in (short, case, long)]
        mean = [float(runs[each].left.mean()) for each in (short, case, long)]
        return [
            Finding(f"last one out, {case}", last[1], "s", last[0], last[2], source),
            Finding(f"mean time, {case}", mean[1], "s", mean[0], mean[2], source),
        ]

    return judge


def leaves_through(case: str, assigned: Mapping[str, int], source: str) -> Criterion:
    """Check that exactly the ``assigned`` number of agents leaves through each exit."""

    def judge(runs: Runs) -> list[Finding]:
        used = runs[case].summary["exits"]
        return [
            Finding(f"left through {name}", float(used[name]["left"]), "", float(count), float(count), source)
            for name, count in assigned.items()
        ]

    return judge


def both_exits(case: str, near: str, far: str, source: str) -> Criterion:
    """Check that the far exit is used, and the near one by as many agents or more."""

    def judge(runs: Runs) -> list[Finding]:
        used = {name: float(runs[case].summary["exits"][name]["left"]) for name in (near, far)}
        return [Finding(f"left through {far}", used[far], "", 1.0, used[near], source)]

    return judge


def close_to_best(case: str, fixed: Sequence[str], share: float, source: str) -> Criterion:
    """Check the time until all have left, divided by that of the best fixed split of agents among exits.

    ``fixed`` are the cases with a fixed split; ``share`` is the greatest ratio.
    """

    def judge(runs: Runs) -> list[Finding]:
        best = min(runs[split].last for split in fixed)
        return [Finding("time, chosen / best fixed split", _ratio(runs[case].last, best), "", 0.0, share, source)]

    return judge


def flow_of(run: Observed, line: str) -> float:
    """Return the flow across a line [1/s], as :func:`~crowdsim.recording.measured.flow_of`; nan if it has none."""
    value = run.summary["lines"][line]["flow"]
    return float("nan") if value is None else float(value)


def _ratio(more: float, less: float) -> float:
    """Return the quotient of the times ``more`` and ``less`` [s].

    It is nan if one of them is infinite, because agents stayed, or if ``less`` is 0.
    """
    return more / less if np.isfinite(more) and np.isfinite(less) and less > 0.0 else float("nan")


def _worst(values: NDArray[np.float64], least: float, most: float) -> float:
    """Return that of ``values`` (n,), n > 0, which is farthest from the middle of a band; nan if any value is nan."""
    off = np.abs(values - 0.5 * (least + most))
    return float("nan") if np.isnan(off).any() else float(values[int(np.argmax(off))])
