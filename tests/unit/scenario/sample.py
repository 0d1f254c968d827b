"""A small scenario whose lines the tests know."""

from crowdsim.environment.layers import AnySolid
from crowdsim.scenario.scenario import Scenario

TEXT = """\
crowdsim: 1
name: sample
seed: 5
duration: 60.0
steps_per_second: 10
floor: {rectangle: [0, 0, 10, 6]}
obstacles:
  - {name: wall, box: {min: [4, 0], max: [4.2, 2]}, top: 2.5}
  - {name: pole, cylinder: {center: [6, 3], radius: 0.2}, top: 2.0}
  - name: bench
    polygon: [[8, 0], [9, 0], [9, 1]]
    top: 0.45
motion: {set: default}
agents:
  - name: guests
    count: 4
    start: {rectangle: [1, 1, 3, 4]}
    goal: {circle: {center: [8, 4], radius: 1.0}}
    on_arrival: leave
areas:
  - {name: middle, rectangle: [4, 2, 6, 4]}
"""


def change(*pairs: tuple[str, str]) -> str:
    """The sample with each first text, which must occur once, replaced by the second."""
    text = TEXT
    for old, new in pairs:
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    return text


def solids_of(scenario: Scenario) -> list[AnySolid]:
    """What stands on the floor where it is drawn, in the order of the file; doors are not among it."""
    return [solid for solids in scenario.environment.solids.values() for solid in solids]
