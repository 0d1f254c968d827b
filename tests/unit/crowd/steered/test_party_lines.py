"""Parties of four and more walk in lines of two or three, at the speed of their slowest one."""

from typing import NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray

from crowdsim.constants import STEERING_RATE
from crowdsim.crowd.steered.components import Errand
from crowdsim.crowd.steered.parties import LINES, LINES_APART
from crowdsim.crowd.steered.steered_crowd import SteeredCrowd
from crowdsim.scenario.loader import parse_scenario
from crowdsim.scenario.schema.agents import MOST_TOGETHER
from tests.support.steered_scenes import steered_scene

SIZES = (4, 5, 6, 8)
SETTLED = 3 * STEERING_RATE
"""Steps after which the parties have lined up."""


class Walk(NamedTuple):
    """What the agents of a crowd do, by step and agent; nan where one is absent or does not walk."""

    x: NDArray[np.float64]
    y: NDArray[np.float64]
    vx: NDArray[np.float64]
    vy: NDArray[np.float64]
    heading: NDArray[np.float64]
    arrivals: NDArray[np.int64]
    pace: NDArray[np.float64]

    def spread(self, agents: slice) -> NDArray[np.float64]:
        """Return the largest distance between two of ``agents`` in each step [m], nan unless all walk."""
        x, y = self.x[:, agents], self.y[:, agents]
        apart = np.hypot(x[:, :, None] - x[:, None], y[:, :, None] - y[:, None])
        return np.asarray(apart.max(axis=(1, 2)))


def walk(text: str, steps: int) -> Walk:
    crowd = SteeredCrowd(parse_scenario(text), 1)
    names = ("x", "y", "vx", "vy", "heading")
    values = {name: np.full((steps, crowd.count), np.nan) for name in names}
    for step in range(steps):
        crowd.advance()
        view = crowd.world.view()
        walks = np.flatnonzero(view.errand == Errand.WALKS)
        for name in names:
            values[name][step, view.agent[walks]] = view.row[name][walks]
        crowd.end_step()
        if crowd.finished:
            break
    arrivals = crowd.arrivals.copy()
    crowd.close()
    return Walk(*values.values(), arrivals, crowd.cast.walkers.speeds)


def parties_in_a_hall(seed: int) -> Walk:
    """A party of each size, each in a lane of its own of a hall of 30 x 40 m."""
    groups = [
        f"name: p{size}, count: {size}, together: {size}, start: {{rectangle: [0.5, {low + 2}, 5, {low + 8}]}}, "
        f"goal: {{rectangle: [28, {low + 1}, 29.5, {low + 9}]}}"
        for size, low in zip(SIZES, range(0, 40, 10), strict=True)
    ]
    return walk(steered_scene(*groups, floor="{rectangle: [0, 0, 30, 40]}", seed=seed), 60 * STEERING_RATE)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_large_parties_are_as_fast_as_their_slowest_one_and_keep_together(seed: int) -> None:
    run = parties_in_a_hall(seed)
    assert (run.arrivals >= 0).all()
    begin = 0
    for size in SIZES:
        party = slice(begin, begin + size)
        begin += size
        spread = run.spread(party)
        steps = np.flatnonzero(~np.isnan(spread))
        steps = steps[steps >= SETTLED]
        assert len(steps) > 80
        way = np.ptp(run.x[steps][:, party], axis=0).mean()
        speed = way * STEERING_RATE / (len(steps) - 1)
        assert speed >= 0.9 * run.pace[party].min()
        # The length of all lines, a bit of delay, and the breadth of three abreast.
        assert spread[steps].max() < (len(LINES[size]) - 1) * LINES_APART + 1.6
        # Nobody looks aside, towards the others.
        vx, vy, heading = (column[steps][:, party] for column in (run.vx, run.vy, run.heading))
        moves = np.hypot(vx, vy) > 0.3
        off = np.abs(np.angle(np.exp(1j * (heading - np.arctan2(vy, vx)))))[moves]
        assert (off < np.radians(35.0)).mean() > 0.98


@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize("size", [4, 8])
def test_a_large_party_comes_through_a_door_and_comes_together_again(size: int, seed: int) -> None:
    floor = (
        "{polygon: [[0,0],[10,0],[10,3.4],[10.3,3.4],[10.3,0],[30,0],[30,8],[10.3,8],[10.3,4.6],[10,4.6],[10,8],[0,8]]}"
    )
    ends = "start: {rectangle: [0.5, 1, 5, 7]}, goal: {rectangle: [28, 0, 30, 8]}"
    group = f"name: a, count: {size}, together: {size}, {ends}"
    run = walk(steered_scene(group, floor=floor, seed=seed), 90 * STEERING_RATE)
    assert (run.arrivals >= 0).all()
    # They are together where the last one is 8 m behind the door.
    behind = run.spread(slice(0, size))[run.x.min(axis=1) > 18.0]
    assert behind[~np.isnan(behind)][0] < (len(LINES[size]) - 1) * LINES_APART + 1.6


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_two_large_parties_pass_each_other_in_a_corridor(seed: int) -> None:
    ends = ("[0.5, 0.5, 5, 3.5]", "[28, 0, 30, 4]"), ("[25, 0.5, 29.5, 3.5]", "[0, 0, 2, 4]")
    groups = [
        f"name: g{k}, count: 4, together: 4, start: {{rectangle: {start}}}, goal: {{rectangle: {goal}}}"
        for k, (start, goal) in enumerate(ends)
    ]
    run = walk(steered_scene(*groups, floor="{rectangle: [0, 0, 30, 4]}", seed=seed), 60 * STEERING_RATE)
    assert (run.arrivals >= 0).all()
    # They lose a quarter of their time at most, with what it takes to line up.
    assert (run.arrivals * run.pace / STEERING_RATE < 1.25 * 30.0).all()


def test_lines_hold_all_members_of_every_size_of_party() -> None:
    assert sorted(LINES) == list(range(4, MOST_TOGETHER + 1))
    for size, lines in LINES.items():
        assert sum(lines) == size
        assert set(lines) <= {2, 3}
