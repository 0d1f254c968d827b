"""Entities and columns."""

import numpy as np
import pytest

from crowdsim.ecs.world import Column, World


def make_world(capacity: int = 2) -> World:
    return World([Column("position", np.float64, (2,)), Column("age", np.int32, (), 5)], capacity)


def test_spawned_entities_appear_with_the_changes_and_grow_the_columns() -> None:
    world = make_world()
    ids = [world.spawn(position=(i, 2 * i)) for i in range(5)]
    assert world.count == 0
    world.apply_changes()
    assert world.count == 5
    assert world.column("id").tolist() == ids
    assert world.column("position").tolist() == [[i, 2 * i] for i in range(5)]
    assert (world.column("age") == 5).all()


def test_removal_keeps_the_order_and_ids_are_never_reused() -> None:
    world = make_world()
    ids = [world.spawn(position=(i, 0)) for i in range(4)]
    world.apply_changes()
    world.remove(ids[1])
    world.remove(ids[3])
    newcomer = world.spawn(position=(9, 0))
    world.apply_changes()
    assert world.column("id").tolist() == [ids[0], ids[2], newcomer]
    assert world.column("position")[:, 0].tolist() == [0, 2, 9]
    assert newcomer not in ids


def test_a_reused_row_starts_from_the_fill_value() -> None:
    world = make_world()
    first = world.spawn(age=77)
    world.apply_changes()
    world.remove(first)
    world.spawn()
    world.apply_changes()
    assert world.column("age").tolist() == [5]


def test_unknown_columns_are_refused() -> None:
    world = make_world()
    with pytest.raises(KeyError, match="velocity"):
        world.spawn(velocity=1.0)
    with pytest.raises(ValueError, match="differ"):
        World([Column("id", np.int32)])


def test_a_view_shows_the_live_rows_of_all_columns() -> None:
    world = make_world()
    world.spawn()
    world.apply_changes()
    view = world.view()
    view.age += 1
    assert world.column("age").tolist() == [6]
    world.spawn()
    assert len(view.age) == len(world.view().age) == 1
    world.apply_changes()
    assert world.view().age.tolist() == [6, 5]
    with pytest.raises(AttributeError, match="velocity"):
        _ = view.velocity
