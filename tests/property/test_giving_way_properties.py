"""Random small crowds who give way, as the kernels let them and as their slow twin does."""

import numpy as np
import pytest
import shapely
from hypothesis import event, given, settings
from hypothesis import strategies as st

from crowdsim.constants import NONE
from crowdsim.crowd.giving_way.aside_kernels import step_to_wall
from crowdsim.crowd.giving_way.asking import Asking, Standing, Trail
from crowdsim.crowd.giving_way.give_way_kernels import clear_way, step_aside
from crowdsim.crowd.giving_way.moves import moves_of
from crowdsim.crowd.near.neighbors import Neighbors
from crowdsim.crowd.state.components import SLOT_FRAMES
from crowdsim.crowd.state.reservation_kernels import pair_meets
from crowdsim.crowd.state.timelines import NO_BODIES, Chain, Obstacles, Playback, StandingBodies, Timelines
from crowdsim.navmesh.navmesh import NavMesh
from crowdsim.steering.steering import Steering
from crowdsim.steering.walls import build_walls
from tests.reference.aside import step_to_wall_slow
from tests.reference.crowd import FOREVER, discs_along, walking_graph
from tests.reference.giving_way import Scene, give_way, leave_way, moves_in_order, play
from tests.support.kept_meshes import layers_kept
from tests.support.steered import agents

GRAPH = walking_graph()._replace(edge_low=np.full(8, -1.7), edge_high=np.full(8, 1.7))
"""Whoever sets out may turn to either side, so that there are several ways to give way."""
MOVES = moves_of(GRAPH)
RADIUS = 0.3
SLOTS = 30
ENOUGH = 1_000_000
NOWHERE = build_walls([])


def bodies_at(places: np.ndarray, rng: np.random.Generator) -> StandingBodies:
    if not len(places):
        return NO_BODIES
    with Steering(NOWHERE, NOWHERE, leg_radius=0.125) as steering:
        crowd = steering.sort(agents(places, np.zeros(len(places)), np.zeros(len(places), int), rng))
    return StandingBodies(crowd.rows, crowd.starts, crowd.frame, crowd.broadest)


def scene_of(rng: np.random.Generator, spots: np.ndarray, headings: np.ndarray, half: tuple[float, float]) -> Scene:
    """Rows that stand at ``spots`` in a room of ``half`` its length and width, the first of the lowest rank."""
    count = len(spots)
    core = rng.choice([0.0, 0.1])
    timeline = discs_along(np.repeat(spots[:, None], SLOTS, axis=1), RADIUS)
    circles = np.column_stack([spots, np.zeros(count)])
    radii, clock = np.full(count, RADIUS), int(rng.integers(0, 40))
    # Somebody may be about to leave.
    gone = np.where(rng.random(count) < 0.05, clock // SLOT_FRAMES + rng.integers(0, 12, count), FOREVER)
    starts = np.full(count, clock // SLOT_FRAMES)
    everyone = Timelines(timeline, starts, gone, radii, circles, Neighbors.of(spots, circles, radii))
    ways = np.full((count, 6, 2), np.nan)
    if rng.random() < 0.7:
        ways[0] = spots[0] + np.linspace([0.0, 0.0], rng.uniform(-4, 4, 2), 6)
    standing = Standing(
        node=np.zeros(count, np.int32),
        origin=np.column_stack([spots, headings]),
        goal=rng.uniform(-5, 5, (count, 2)),
        way=ways,
        may_move=rng.random(count) < 0.96,
        rank=np.concatenate([[0], rng.permutation(count - 1) + (rng.random() < 0.95)]).astype(np.int64),
    )
    floor = shapely.box(-half[0], -half[1], half[0], half[1])
    obstacles = Obstacles(
        layers=layers_kept(NavMesh(floor)),
        radii=np.array([[RADIUS]]),
        breadths=np.array([[RADIUS - core, core]]),
        kept_free=np.empty((0, 4)),
        distance=0.0,
        bodies=bodies_at(rng.uniform(-2, 2, (int(rng.integers(0, 3)), 2)) if rng.random() < 0.4 else spots[:0], rng),
        agent=NONE,
        body_radius=RADIUS,
        ways=rng.uniform(-3, 3, (int(rng.integers(0, 3)), 4, 2)),
        passages=rng.uniform(-3, 3, (int(rng.integers(0, 2)), 4)),
        off_passages=0.4,
    )
    return Scene(GRAPH, MOVES, floor, obstacles, everyone, standing, clock)


def asking(scene: Scene, tries: int) -> Asking:
    trail = Trail.empty(len(scene.standing.node), SLOTS, max(int(np.diff(MOVES.begin).max()), 1))
    trail.tries[0] = tries
    return Asking(MOVES, scene.standing, trail, trail.tries)


def walk(rng: np.random.Generator, spots: np.ndarray) -> np.ndarray:
    """A timeline of the first that goes straight towards another one for a while, or stands."""
    toward = spots[rng.integers(1, len(spots))] - spots[0] + rng.normal(0.0, 0.2, 2)
    pace = rng.choice([0.0, 0.25], p=[0.1, 0.9]) * toward / np.hypot(*toward)
    slots = np.minimum(np.arange(SLOTS), rng.integers(2, 12))[:, None]
    return discs_along(spots[0] + slots * pace, RADIUS)


def columns_of(everyone: Timelines) -> list[np.ndarray]:
    return [column.copy() for column in everyone[:5]]


def require_the_same(scene: Scene, before: list[np.ndarray], count: int, ask: Asking, found) -> None:
    """The kernel lets those move whom the twin does, and all others own what they had."""
    if found is None:
        assert count == -1
        for column, old in zip(scene.everyone[:5], before, strict=True):
            np.testing.assert_array_equal(column, old)
        return
    assert count == len(found)
    assert list(zip(ask.trail.rows[:count].tolist(), ask.trail.moves[:count].tolist(), strict=True)) == found
    for row, move in found:
        np.testing.assert_allclose(scene.everyone.timeline[row], play(scene, row, move)[0], atol=1e-9)
        assert scene.everyone.gone_slot[row] == FOREVER
    still = np.setdiff1d(np.arange(1, len(before[0])), [row for row, _ in found])
    for column, old in zip(scene.everyone[:5], before, strict=True):
        np.testing.assert_array_equal(column[still], old[still])


def compare(rng: np.random.Generator, scene: Scene, aside: int | None) -> list[tuple[int, int]] | None:
    """Hold the kernels to the twin; returns what both find."""
    before, draft, ask = columns_of(scene.everyone), Chain.empty(20), asking(scene, ENOUGH)
    rest = Playback.natural(scene.clock, 1), draft, ask
    kept = scene._replace(everyone=Timelines(*columns_of(scene.everyone), scene.everyone.near))
    if aside is not None:
        found = leave_way(kept, 0, aside)
        count = step_aside(GRAPH, scene.obstacles, scene.everyone, 0, aside, *rest)
    else:
        want = walk(rng, scene.standing.origin[:, :2])
        gone = scene.clock // SLOT_FRAMES + int(rng.integers(1, 20)) if rng.random() < 0.2 else FOREVER
        found = give_way(kept, 0, want, gone)
        count = clear_way(GRAPH, scene.obstacles, scene.everyone, 0, want, gone, *rest)
        if found is not None:
            np.testing.assert_array_equal(scene.everyone.timeline[0], want)
            assert scene.everyone.gone_slot[0] == gone
    require_the_same(scene, before, count, ask, found)
    return found


@given(st.integers(0, 1_000_000), st.booleans())
@settings(max_examples=300, deadline=None, derandomize=True)
def test_random_crowds_give_way_as_the_twin_says(seed: int, aside: bool) -> None:
    rng = np.random.default_rng(seed)
    count = int(rng.integers(3, 8))
    spots = np.concatenate([np.zeros((1, 2)), rng.uniform(-1.8, 1.8, (count - 1, 2))])
    # Some stand side by side, so that who gives way first leaves room for the other one or does not.
    spots[2] = spots[1] + rng.uniform(-0.9, 0.9, 2)
    scene = scene_of(rng, spots, rng.uniform(-3, 3, count), (rng.uniform(1.7, 4.0), rng.uniform(1.7, 3.0)))
    compare(rng, scene, int(rng.integers(1, count)) if aside else None)


@given(st.integers(0, 1_000_000), st.sampled_from(["file", "heap", "touching", "corner"]), st.booleans())
@settings(max_examples=100, deadline=None, derandomize=True)
def test_crowds_of_no_room_give_way_as_the_twin_says(seed: int, kind: str, aside: bool) -> None:
    """In file before a wall, all on one spot, shoulder to shoulder, and in a corner."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(2, 5))
    along = np.column_stack([np.arange(count), np.zeros(count)])
    half = (2.5, 0.7)
    if kind == "file":
        spots = [-1.0, 0.0] + 0.75 * along
    elif kind == "heap":
        spots, half = np.zeros((count, 2)), (2.0, 2.0)
    elif kind == "touching":
        spots, half = 2.0 * RADIUS * along - [0.6, 0.0], (2.6, 2.0)
    else:
        spots, half = rng.uniform(0.4, 1.4, (count, 2)), (1.71, 1.71)
    compare(rng, scene_of(rng, spots, rng.uniform(-3, 3, count), half), 1 if aside else None)


@pytest.mark.parametrize("seed", [282, 309, 416, 462, 934, 1156, *range(10, 31)])
def test_who_is_to_blame_moves_otherwise(seed: int) -> None:
    """Two side by side have their goals beyond each other, so the best move of the first leaves the other one none.

    In the first six of these crowds only what its moves met says who is to blame.
    """
    rng = np.random.default_rng(seed)
    count = int(rng.integers(3, 5))
    rng.uniform()
    spots = np.array([[0.0, 0.0], [1.0, 0.35], [1.0 + rng.uniform(-0.2, 0.2), -0.35], [0.0, 0.0]])[:count]
    if count > 3:
        spots[3] = rng.uniform(1.4, 2.2), rng.uniform(-1, 1)
    scene = scene_of(rng, spots, rng.uniform(-3, 3, count), (4.0, rng.uniform(1.0, 4)))
    scene.standing.goal[1:3] = [[1, -5], [1, 5]]
    scene.standing.may_move[:] = True
    scene.standing.rank[:] = np.arange(count)
    scene.everyone.gone_slot[:] = FOREVER
    found = compare(rng, scene._replace(obstacles=scene.obstacles._replace(bodies=NO_BODIES)), None)
    if seed in (282, 309, 416, 462, 934, 1156):
        assert found
        assert any(move != moves_in_order(scene, 0, row, False)[0] for row, move in found)


@given(st.integers(0, 1_000_000), st.integers(0, 400))
@settings(max_examples=200, deadline=None, derandomize=True)
def test_who_may_try_few_moves_finds_the_same_or_nothing(seed: int, tries: int) -> None:
    rng = np.random.default_rng(seed)
    spots = np.concatenate([np.zeros((1, 2)), rng.uniform(-1.4, 1.4, (4, 2))])
    scene = scene_of(rng, spots, rng.uniform(-3, 3, 5), (2.5, 2.0))
    before, want = columns_of(scene.everyone), walk(rng, spots)
    kept = scene._replace(everyone=Timelines(*columns_of(scene.everyone), scene.everyone.near))
    ask = asking(scene, tries)
    call = (
        GRAPH,
        scene.obstacles,
        scene.everyone,
        0,
        want,
        FOREVER,
        Playback.natural(scene.clock, 1),
        Chain.empty(20),
        ask,
    )
    count = clear_way(*call)
    assert 0 <= ask.trail.tries[0] <= tries
    require_the_same(scene, before, count, ask, give_way(kept, 0, want, FOREVER) if count >= 0 else None)


@pytest.mark.parametrize("seed", range(3))
def test_who_finds_a_move_meets_nobody(seed: int) -> None:
    """The twin, too, is held to what it is for."""
    rng = np.random.default_rng(seed)
    found = None
    while not found:
        spots = np.concatenate([np.zeros((1, 2)), rng.uniform(-1.6, 1.6, (4, 2))])
        scene = scene_of(rng, spots, rng.uniform(-3, 3, 5), (4.0, 4.0))
        want = walk(rng, spots)
        found = give_way(scene, 0, want, FOREVER)
    slot = scene.clock // SLOT_FRAMES
    owned = {row: scene.timeline(row) for row in range(1, 5)} | {0: (want, slot, FOREVER)}
    owned |= {row: (play(scene, row, move)[0], slot, FOREVER) for row, move in found}
    for row in [0, *(row for row, _ in found)]:
        assert not any(pair_meets(*owned[row], *owned[k], slot, 2 * RADIUS, True) for k in owned if k != row)


@given(st.integers(0, 10_000))
@settings(max_examples=80)
def test_who_waits_steps_to_the_wall_that_the_twin_says(seed: int) -> None:
    rng = np.random.default_rng(seed)
    half = (6.0, float(rng.uniform(0.4, 1.2)))
    count = int(rng.integers(1, 4))
    spots = np.column_stack([0.9 * np.arange(count), rng.uniform(-1, 1, count) * max(half[1] - RADIUS, 0.0)])
    scene = scene_of(rng, spots + rng.normal(0.0, 0.05, (count, 2)), rng.uniform(-3, 3, count), half)
    before, ask = columns_of(scene.everyone), asking(scene, ENOUGH)
    move = step_to_wall_slow(scene._replace(everyone=Timelines(*before, scene.everyone.near)), 0)
    now = Playback.natural(scene.clock, 1)
    steps = step_to_wall(GRAPH, scene.obstacles, scene.everyone, 0, now, Chain.empty(20), ask)
    assert steps == (move != -1)
    event(f"steps: {steps}")
    require_the_same(scene, before, int(steps) or -1, ask, [(0, move)] if steps else None)
