"""Clearances of the ways in a steered place."""

import numpy as np

import crowdsim
from crowdsim.constants import TRACKING_MARGIN
from crowdsim.crowd.steered.steered_place import _needs_of
from crowdsim.planning.query.requirements import Requirements
from tests.support.guided import BEHAVIORS

STREWN = """\
crowdsim: 1
name: strewn
seed: 3
duration: 150.0
floor: {rectangle: [0.0, 0.0, 16.0, 12.0]}
clutter: {density: normal}
agents:
  - name: east
    count: 30
    start: {rectangle: [0.3, 0.3, 3.0, 11.7]}
    goal: {rectangle: [15.0, 0.3, 15.7, 11.7]}
    locomotion: steered
  - name: west
    count: 30
    start: {rectangle: [13.0, 0.3, 15.7, 11.7]}
    goal: {rectangle: [0.3, 0.3, 1.0, 11.7]}
    locomotion: steered
"""


def test_only_the_narrowest_behavior_keeps_a_margin():
    planned, bodies = (Requirements.of(BEHAVIORS, 2, margin) for margin in (TRACKING_MARGIN, 0.0))
    need = _needs_of(BEHAVIORS, 2)
    # Where a way is at all is decided by the legs, and by the narrowest torso.
    np.testing.assert_array_equal(need.radii[:, 0], planned.radii[:, 0])
    np.testing.assert_array_equal(need.radii[0], planned.radii[0])
    np.testing.assert_array_equal(need.radii[1:, 1], bodies.radii[1:, 1])
    assert (np.diff(need.radii[:, 1]) > 0.0).all()
    np.testing.assert_array_equal(need.costs, planned.costs)


def test_nobody_walks_into_gaps_in_which_two_lock(tmp_path):
    """Without the margin three stood for good here, their legs in gaps of 0.36 to 0.46 m between low things."""
    file = tmp_path / "strewn.yaml"
    file.write_text(STREWN)
    with (
        crowdsim.Simulation(crowdsim.load_scenario(file)) as simulation,
        simulation.run(tmp_path / "strewn.h5") as recording,
    ):
        assert recording.summary["arrived"] == 60
