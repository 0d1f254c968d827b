"""Regions cover the plane once, hold about as many each, and reach as far as a step reads."""

import numpy as np
import pytest

from crowdsim.crowd.ranks.messages import GHOST, RowMessage, migrant_type
from crowdsim.crowd.ranks.partition import cells_of, divide, expected_places, halo_of
from crowdsim.crowd.ranks.protocol import ONE_RANK
from crowdsim.crowd.steered.components import COLUMNS
from crowdsim.ecs.world import World
from crowdsim.errors import CrowdSimError
from crowdsim.scenario.cast import place_crowd
from crowdsim.scenario.loader import parse_scenario
from crowdsim.steering.row_kernels import ROW
from crowdsim.steering.rules import Rules

HALL = """\
crowdsim: 1
name: hall
seed: 1
duration: 10.0
floor: {rectangle: [0, 0, 40, 10]}
exits:
  - {name: west, rectangle: [0, 1, 1, 4]}
  - {name: east, rectangle: [39, 1, 40, 4]}
agents:
  - {name: free, locomotion: steered, count: 5, start: {rectangle: [3, 1, 5, 4]}, exits: all}
  - {name: told, locomotion: steered, count: 5, start: {rectangle: [3, 1, 5, 4]}, exits: {east: 1}}
  - {name: later, locomotion: steered, count: 5, start: {rectangle: [3, 6, 5, 9]}, exits: all, on_call: true}
"""

STREET = (0.0, 0.0, 100.0, 10.0)


@pytest.mark.parametrize("count", [1, 2, 3, 5, 8])
def test_each_place_is_in_one_region(count: int) -> None:
    rng = np.random.default_rng(count)
    expected = rng.uniform((0, 0), (100, 10), (4000, 2))
    regions = divide(expected, STREET, count, 3)
    places = rng.uniform((-50, -50), (150, 60), (1000, 2))
    held = np.array([regions.within(rank, *cells_of(*places.T)) for rank in range(count)])
    assert (held.sum(axis=0) == 1).all()
    assert (held.argmax(axis=0) == regions.owner(places)).all()
    share = np.bincount(regions.owner(expected), minlength=count) / len(expected)
    assert np.abs(share - 1.0 / count).max() < 0.02


def test_people_are_expected_on_the_way_to_their_exit() -> None:
    """To the nearest one, if none is assigned; those who come only if a command adds them are not expected."""
    cast = place_crowd(parse_scenario(HALL))
    middles = np.array([goal.representative_point().coords[0] for goal in cast.goals])
    places = expected_places(cast, middles)
    assert (places[:, 1] < 5.0).all(), "those on call start at the top"
    nearest, assigned = places[: len(places) // 2], places[len(places) // 2 :]
    assert (nearest[:, 0] < 5.0).all()
    assert (assigned[:, 0] > 3.0).all()


def test_a_small_place_is_refused() -> None:
    with pytest.raises(CrowdSimError, match="too small for so many ranks"):
        divide(np.zeros((1, 2)), (0.0, 0.0, 8.0, 4.0), 4, 3)


def test_the_halo_is_what_a_step_reads() -> None:
    assert halo_of(Rules(), 2.0, 0.3) == 3
    assert halo_of(Rules(reach=4.5), 2.0, 0.3) == 5
    # Fast and broad bodies: 2 x 0.5 + 2 x (1.0 + 0.125 + 0.5) = 4.25 m.
    assert halo_of(Rules(), 10.0, 0.5) == 5


def test_messages_hold_migrants_once_and_ghosts_where_they_matter() -> None:
    regions = divide(np.random.default_rng(0).uniform((0, 0), (100, 10), (1000, 2)), STREET, 2, 3)
    edge = float(regions.boxes[0, 2])
    world = World(COLUMNS)
    rows = np.zeros(4, ROW)
    rows["x"], rows["y"] = edge + np.array([-50.0, -2.9, -0.5, 0.2]), 5.0
    world.spawn_many(4, agent=np.arange(4), row=rows)
    world.apply_changes()
    none = np.zeros(4, np.bool_)
    message = RowMessage(regions, 0, world, np.array([5, 6, 7, 8], np.int32), none, none)
    content = message.to(1)
    kind = migrant_type(world)
    migrants = np.frombuffer(content[8 : 8 + kind.itemsize], kind)
    assert migrants["columns"]["agent"].tolist() == [3]
    assert migrants["exit"].tolist() == [8]
    assert np.frombuffer(content[8 + kind.itemsize :], GHOST)["id"].tolist() == [1, 2]
    assert message.hand_over()["id"].tolist() == [3]
    assert sorted(world.column("agent").tolist()) == [0, 1, 2]


def test_alone_there_is_nobody_to_tell() -> None:
    rows = np.zeros(3, ROW)
    found, mine = ONE_RANK.together(rows)
    assert found is rows
    assert len(rows[mine]) == 3
    assert ONE_RANK.holds(np.zeros((2, 2))).all()
