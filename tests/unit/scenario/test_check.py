"""Warnings of groups that no behavior brings to their goal."""

from pathlib import Path

import numpy as np
import pytest

from crowdsim.behaviors.behavior import Behavior
from crowdsim.constants import TRACKING_MARGIN
from crowdsim.scenario.check import check_ways
from crowdsim.scenario.loader import parse_scenario

TEXT = """\
crowdsim: 1
name: rooms
seed: 1
duration: 60.0
floor: {rectangle: [0, 0, 10, 4]}
obstacles:
  - {name: below, box: {min: [5, 0], max: [6, 1.7]}, top: 2.5}
  - {name: above, box: {min: [5, 2.3], max: [6, 4]}, top: 2.5}
agents:
  - {name: guests, count: 1, start: {rectangle: [1, 1, 2, 3]}, goal: {point: [8, 2]}}
"""
WIDE_PASSAGE = 0.3 - TRACKING_MARGIN
"""Radius of the widest body that passes the gap of 0.6 m [m]."""


def behavior(name: str, legs: float, torso: float, cost: float = 1.0) -> Behavior:
    return Behavior(name, "", (0.0,), (), cost, 1.0, "#1f77b4", np.array([legs, torso]), Path())


NARROW = behavior("narrow", 0.15, 0.15, 2.0)
WIDE = behavior("wide", 0.15, 0.30)


def test_a_gap_that_is_too_narrow_for_every_behavior_is_named_with_group_and_goal() -> None:
    (warning,) = check_ways(parse_scenario(TEXT), [WIDE])
    assert "agents.0.goal: no way from the start of 'guests' to here is wide enough for any behavior (wide)" in warning
    assert ":10:" in warning


def test_a_gap_that_one_behavior_passes_is_a_way() -> None:
    assert check_ways(parse_scenario(TEXT), [NARROW, WIDE]) == []


@pytest.mark.parametrize(("off", "count"), [(-0.01, 0), (0.01, 1)])
def test_bodies_keep_the_margin_of_plans(off: float, count: int) -> None:
    passing = behavior("passing", WIDE_PASSAGE + off, WIDE_PASSAGE + off)
    assert len(check_ways(parse_scenario(TEXT), [passing])) == count


def test_a_door_that_is_shut_at_first_is_a_way() -> None:
    door = "doors:\n  - {name: gap, box: {min: [5, 1.7], max: [6, 2.3]}, top: 2.2, initially: closed}\n"
    assert check_ways(parse_scenario(TEXT + door), [NARROW]) == []


def test_the_first_place_out_of_reach_is_told() -> None:
    goals = "goals: [{point: [1, 3.5]}, {point: [8, 2]}, {point: [9, 2]}]"
    (warning,) = check_ways(parse_scenario(TEXT.replace("goal: {point: [8, 2]}", goals)), [WIDE])
    assert "agents.0.goals.1: no way" in warning


def test_one_exit_within_reach_is_enough() -> None:
    exits = "exits:\n  - {name: near, rectangle: [0, 0, 0.3, 1]}\n  - {name: far, rectangle: [9, 0, 10, 1]}\n"
    text = TEXT.replace("goal: {point: [8, 2]}", "exits: all") + exits
    assert check_ways(parse_scenario(text), [WIDE]) == []
    (warning,) = check_ways(parse_scenario(text.replace("exits: all", "exits: [far]")), [WIDE])
    assert "agents.0.exits" in warning
