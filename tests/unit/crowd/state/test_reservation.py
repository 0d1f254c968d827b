"""Reserved timelines against dense sampling, and the nodes that are played against the poses that were promised."""

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from crowdsim.crowd.near.neighbors import Neighbors
from crowdsim.crowd.state.components import BEND, CORE, QUARTERS, RADIUS, REST, SAMPLE, SLOT_FRAMES
from crowdsim.crowd.state.reservation_kernels import (
    append_stop,
    meets_anyone,
    node_is_free,
    pair_meets,
    reserve,
)
from crowdsim.crowd.state.sampling_kernels import sample_chain, sway_behind
from crowdsim.crowd.state.timelines import NO_BODIES, Chain, Obstacles, Playback, Timelines
from crowdsim.crowd.systems.animate import Playing
from crowdsim.crowd.systems.animate_kernels import advance
from crowdsim.motion.graph.playback_kernels import FRAME_TICKS
from crowdsim.navmesh.navmesh import NavMesh
from tests.reference.crowd import (
    FOREVER,
    chain_of,
    discs_along,
    pose_at,
    ticks_one_by_one,
    timelines_meet,
    walking_graph,
    write_bends,
)
from tests.support.kept_meshes import layers_kept

GRAPH = walking_graph()
START = np.array([0.3, -0.2, 0.4])
NOTHING = np.empty((0, 4))
SIDEWAYS = np.array([[0.2, 0.1]])


def natural(clock: int) -> Playback:
    """As captured from the frame ``clock`` on, in steps of a frame."""
    return Playback.natural(clock, 1)


def random_timeline(rng: np.random.Generator):
    steps = rng.normal(0.0, 0.2, (6, 2)) * (rng.random((6, 1)) < 0.7)
    start = int(rng.integers(3))
    gone = FOREVER if rng.random() < 0.6 else int(start + rng.integers(8))
    samples = discs_along(rng.uniform(-0.8, 0.8, 2) + np.cumsum(steps, axis=0), 0.3)
    # Some hold their arms in or go sideways on a part of their way.
    narrow = rng.random(6) < rng.choice([0.0, 0.5, 1.0])
    angle = rng.uniform(-3.0, 3.0)
    samples[narrow, RADIUS] = rng.uniform(0.15, 0.3)
    samples[narrow, CORE:BEND] = rng.choice([0.0, 0.15]) * np.array([np.cos(angle), np.sin(angle)])
    return samples, start, gone


@given(st.integers(0, 10_000))
@settings(max_examples=100, deadline=None, derandomize=True)
def test_two_timelines_meet_exactly_when_dense_sampling_finds_it(seed: int) -> None:
    rng = np.random.default_rng(seed)
    a, b = random_timeline(rng), random_timeline(rng)
    first = max(a[1], b[1])
    found = pair_meets(*a, *b, first, 0.6, True)
    if found != timelines_meet(a, b, first, 0.6):
        # Dense sampling misses a graze between its samples: the exact answer may only be the stricter one.
        assert found
        assert timelines_meet(a, b, first, 0.6, room=2e-3)


def test_two_who_would_touch_between_samples_meet() -> None:
    """Both sway towards each other in the middle of a segment, which no sample shows."""
    walking = discs_along(np.column_stack([0.2 * np.arange(6), np.zeros(6)]), 0.3)
    other = walking + np.array([0.0, 0.604, *[0.0] * (SAMPLE - 2)])
    for each, side in ((walking, 1.0), (other, -1.0)):
        each[3, BEND], each[3, REST] = 0.0025, 0.0001
        each[3, QUARTERS:REST] = [0.0, 0.002 * side, 0.0, 0.0025 * side, 0.0, 0.002 * side]
    assert pair_meets(walking, 0, FOREVER, other, 0, FOREVER, 0, 0.6, True)
    assert not pair_meets(walking, 0, FOREVER, other, 0, FOREVER, 4, 0.6, True), "the segment is over"
    other[:, 1] += 0.0015
    assert not pair_meets(walking, 0, FOREVER, other, 0, FOREVER, 0, 0.6, True)
    other[:, 1] -= 0.0015
    for each in (walking, other):
        each[3, QUARTERS:REST] *= -1.0
    assert not pair_meets(walking, 0, FOREVER, other, 0, FOREVER, 0, 0.6, True), "they sway apart"


def test_between_the_discs_of_a_capsule_it_is_as_broad() -> None:
    """A narrow body passes a sideways one half way between the middle and the end of its core."""
    sideways = discs_along(np.zeros((40, 2)), 0.15)
    sideways[:, CORE] = 0.15
    passing = discs_along(np.column_stack([np.full(40, 0.075), np.linspace(-2.0, -0.29, 40)]), 0.15)
    assert pair_meets(passing, 0, FOREVER, sideways, 0, FOREVER, 0, 0.1, True)
    passing[:, 1] -= 0.013
    assert not pair_meets(passing, 0, FOREVER, sideways, 0, FOREVER, 0, 0.1, True)


def test_a_body_that_turns_from_a_side_step_to_a_walk_is_as_broad_as_a_disc_around_both() -> None:
    """Beside another one, 0.72 m from it along its core, it may turn and walk on: it was taken for 0.15 m longer."""
    turning = discs_along(np.column_stack([np.linspace(0.0, 0.6, 6), np.zeros(6)]), 0.302)
    turning[0, RADIUS], turning[0, CORE + 1] = 0.154, 0.148
    beside = discs_along(np.tile([0.0, 0.72], (6, 1)), 0.302)
    assert not pair_meets(turning, 0, FOREVER, beside, 0, FOREVER, 0, 0.604, True)
    beside[:, 1] = 0.6
    assert pair_meets(turning, 0, FOREVER, beside, 0, FOREVER, 0, 0.604, False)
    # A disc narrower than the capsule is long does not make it shorter.
    turning[1:, RADIUS] = 0.2
    beside[:, 1] = 0.45
    beside[:, RADIUS] = 0.16
    assert pair_meets(turning, 0, FOREVER, beside, 0, FOREVER, 0, 0.1, False)


def test_two_as_near_as_they_bend_may_part() -> None:
    standing = discs_along(np.zeros((6, 2)), 0.3)
    parting = discs_along(np.column_stack([0.601 + 0.1 * np.arange(6), np.zeros(6)]), 0.3)
    parting[0, BEND], parting[0, REST] = 0.004, 0.003
    assert not pair_meets(parting, 0, FOREVER, standing, 0, FOREVER, 0, 0.6, True)
    assert pair_meets(parting, 0, FOREVER, standing, 0, FOREVER, 0, 0.6, False)


def test_those_who_stand_too_close_may_part_but_not_approach() -> None:
    standing = discs_along(np.zeros((4, 2)), 0.3)
    parting = discs_along(np.column_stack([0.5 + 0.1 * np.arange(4), np.zeros(4)]), 0.3)
    approaching = discs_along(np.column_stack([0.5 - 0.1 * np.arange(4), np.zeros(4)]), 0.3)
    assert not pair_meets(parting, 0, FOREVER, standing, 0, FOREVER, 0, 0.6, True)
    assert pair_meets(approaching, 0, FOREVER, standing, 0, FOREVER, 0, 0.6, True)
    assert pair_meets(parting, 0, FOREVER, standing, 0, FOREVER, 0, 0.6, False), "no one enters that close"


def test_whoever_is_gone_is_in_no_ones_way() -> None:
    crossing = discs_along(np.column_stack([np.linspace(-2, 2, 9), np.zeros(9)]), 0.25)
    standing = discs_along(np.zeros((9, 2)), 0.25)
    assert pair_meets(crossing, 0, FOREVER, standing, 0, FOREVER, 0, 0.5, True)
    assert not pair_meets(crossing, 0, FOREVER, standing, 0, 2, 0, 0.5, True)


def circles_of(timelines: np.ndarray) -> np.ndarray:
    """Circles around the first positions of timelines (N, K, 13) that hold all of them."""
    tracks = timelines[..., :2]
    reach = np.hypot(*(tracks - tracks[:, :1]).transpose(2, 0, 1)).max(axis=1)
    return np.column_stack([tracks[:, 0], reach])


def timelines_of(timelines: np.ndarray, starts: np.ndarray, gones: np.ndarray, radii: np.ndarray) -> Timelines:
    circles = circles_of(timelines)
    near = Neighbors.of(timelines[:, 0, :2], circles, radii)
    return Timelines(timelines, starts, gones, radii, circles, near)


def test_meets_anyone_skips_itself_and_finds_the_far_traveler() -> None:
    timelines = discs_along(np.zeros((3, 5, 2)), 0.3)
    timelines[1, :, 0] = 9.0
    timelines[2, :, 0] = [12, 9, 6, 3, 0.4]
    starts, gones, radii = np.zeros(3, np.int64), np.full(3, FOREVER), np.full(3, 0.3)
    everyone = timelines_of(timelines, starts, gones, radii)
    assert meets_anyone(0, timelines[0], 0, FOREVER, 0, 0.3, everyone)
    timelines[2, :, 0] += 0.5
    everyone = timelines_of(timelines, starts, gones, radii)
    assert not meets_anyone(0, timelines[0], 0, FOREVER, 0, 0.3, everyone)


@given(st.integers(0, 10_000), st.integers(0, 6))
def test_circles_dismiss_nobody_who_is_met(seed: int, slot: int) -> None:
    rng = np.random.default_rng(seed)
    tracks = rng.uniform(-4, 4, (6, 1, 2)) + np.cumsum(rng.normal(0, 0.5, (6, 5, 2)), axis=1)
    starts, radii = rng.integers(0, 4, 6), rng.uniform(0.2, 0.5, 6)
    timelines = discs_along(tracks, 0.9 * radii[:, None])
    gones = np.where(rng.random(6) < 0.3, starts + 5, FOREVER)
    met = any(
        pair_meets(timelines[0], 0, FOREVER, timelines[k], starts[k], gones[k], slot, radii[0] + radii[k], True)
        for k in range(1, 6)
        if gones[k] > slot
    )
    everyone = timelines_of(timelines, starts, gones, radii)
    found = meets_anyone(0, timelines[0], 0, FOREVER, slot, radii[0], everyone)
    assert found == met


@pytest.mark.parametrize(("frame", "clock"), [(0, 0), (7, 31), (39, 100)])
def test_a_sampled_chain_is_where_the_chain_will_be(frame: int, clock: int) -> None:
    nodes = [1, 2, 2, 3]
    origins, blend_offsets = chain_of(GRAPH, nodes, START)
    out = np.zeros((40, SAMPLE))
    chain = Chain(np.array(nodes, np.int32), origins, blend_offsets)
    ended = sample_chain(GRAPH, chain, 4, SIDEWAYS, frame, natural(clock), out)
    total = int(GRAPH.node_frames[nodes].sum())
    assert (ended - 1) * SLOT_FRAMES < clock + total - frame <= ended * SLOT_FRAMES
    share = clock % SLOT_FRAMES / SLOT_FRAMES
    now = (1.0 - share) * out[0, :2] + share * out[1, :2]
    for k, found in enumerate(out):
        later = max((clock // SLOT_FRAMES + k) * SLOT_FRAMES, clock) - clock
        x, y, heading = pose_at(GRAPH, nodes, origins, blend_offsets, frame + later)
        core = -0.1 * np.sin(heading), 0.1 * np.cos(heading)
        place = now if k == 0 else found[:2]
        assert [*place, *found[RADIUS:BEND]] == pytest.approx([x, y, 0.2, *core], abs=1e-12)
    bent = out.copy()
    write_bends(bent, clock, 0.1, lambda later: pose_at(GRAPH, nodes, origins, blend_offsets, frame + later))
    assert out[:, BEND:] == pytest.approx(bent[:, BEND:], abs=1e-12)
    assert out[:, BEND].max() > 5.0 * out[:, REST].max() > 0.0


@pytest.mark.parametrize("wanted", [0.6, 0.83, 1.15])
@pytest.mark.parametrize("step_frames", [2, 6])
def test_a_chain_played_slower_or_faster_is_where_it_was_promised(step_frames: int, wanted: float) -> None:
    nodes = [1, 2, 2, 3]
    origins, blend_offsets = chain_of(GRAPH, nodes, START)
    step = 5 * SLOT_FRAMES // step_frames
    playback = Playback.natural(step, step_frames)
    playback = playback._replace(part=20, wanted=int(wanted * playback.rate))
    out = np.zeros((60, SAMPLE))
    assert (
        sample_chain(GRAPH, Chain(np.array(nodes, np.int32), origins, blend_offsets), 4, SIDEWAYS, 3, playback, out) > 0
    )
    played = ticks_one_by_one(playback, 60 * SLOT_FRAMES // step_frames)
    for k, found in enumerate(out):
        x, y, _ = pose_at(
            GRAPH, nodes, origins, blend_offsets, 3 + played[k * SLOT_FRAMES // step_frames] / FRAME_TICKS
        )
        assert found[:2] == pytest.approx([x, y], abs=1e-12)
    assert out[-1] == pytest.approx(out[-2], abs=0.0), "it stands in the end"


def test_the_first_sample_is_as_broad_as_now_and_short_nodes_count() -> None:
    behaviors = np.array([0, 0, 1, 0], np.int32)
    frames = GRAPH.node_frames.copy()
    frames[2] = SLOT_FRAMES - 2
    graph = GRAPH._replace(node_behavior=behaviors, node_frames=frames)
    breadths = np.array([[0.2, 0.0], [0.3, 0.1]])
    chain = Chain(np.array([2, 3], np.int32), *chain_of(graph, [2, 3], START))
    out = np.zeros((40, SAMPLE))
    # The first node ends just now.
    clock = 10 * SLOT_FRAMES
    assert sample_chain(graph, chain, 2, breadths, int(frames[2]), natural(clock), out) > 0
    assert out[0, RADIUS] == 0.3
    assert out[1, RADIUS] == 0.2
    # The second begins a frame behind a sample and ends before the next.
    chain = Chain(np.array([1, 2, 3], np.int32), *chain_of(graph, [1, 2, 3], START))
    clock = 10 * SLOT_FRAMES - (int(frames[1]) - 1) % SLOT_FRAMES
    assert sample_chain(graph, chain, 3, breadths, 0, natural(clock), out) > 0
    assert 0.4 in out[:, RADIUS], "a disc that holds the capsule"


def test_a_chain_longer_than_its_timeline_is_refused() -> None:
    chain = Chain(np.array([2, 2, 2], np.int32), *chain_of(GRAPH, [2, 2, 2], START))
    assert sample_chain(GRAPH, chain, 3, SIDEWAYS, 0, natural(0), np.zeros((10, SAMPLE))) == -1


def test_the_stop_behind_a_chain_follows_the_stop_edges() -> None:
    chain = Chain.empty(4)
    chain.nodes[:2] = 1, 2
    chain.origins[:2], chain.blend_offsets[:2] = chain_of(GRAPH, [1, 2], START)
    assert append_stop(GRAPH, chain, 2) == 3
    wanted_origins, wanted_offsets = chain_of(GRAPH, [1, 2, 3], START)
    assert chain.nodes[:3].tolist() == [1, 2, 3]
    assert chain.origins[:3] == pytest.approx(wanted_origins, abs=1e-12)
    assert chain.blend_offsets[:3] == pytest.approx(wanted_offsets, abs=1e-12)
    assert append_stop(GRAPH, Chain(*(rows[:2] for rows in chain)), 2) == -1


@pytest.mark.parametrize("frames", [1, 2, 5])
@pytest.mark.parametrize("wanted", [1.0, 0.6, 1.15])
def test_advancing_plays_a_chain_frame_by_frame(frames: int, wanted: float) -> None:
    chain = [1, 2, 3]
    origins, blend_offsets = chain_of(GRAPH, chain, START)
    playback = Playback.natural(0, frames)
    playback = playback._replace(wanted=int(wanted * playback.rate))
    rows = Playing(
        node=np.array([1], np.int32),
        previous=np.array([-1], np.int32),
        frame=np.array([0], np.int32),
        part=np.array([0], np.int32),
        rate=np.array([playback.rate], np.int32),
        wanted_rate=np.array([playback.wanted], np.int32),
        origin=START[None].copy(),
        blend_offset=np.zeros((1, 3)),
        next_node=np.array([-1], np.int32),
        next_origin=np.zeros((1, 3)),
        next_blend_offset=np.zeros((1, 3)),
        next_cursor=np.array([-1], np.int32),
        cursor=np.array([0], np.int32),
        behavior=np.zeros(1, np.int32),
        pose=np.zeros((1, 3)),
    )
    place = 0
    steps = int(GRAPH.node_frames[chain].sum() / (0.5 * frames))
    for ticks in ticks_one_by_one(playback, steps)[1:]:
        if rows.next_node[0] < 0 and place + 1 < len(chain):
            place += 1
            rows.next_node[0], rows.next_origin[0] = chain[place], origins[place]
            rows.next_blend_offset[0], rows.next_cursor[0] = blend_offsets[place], place
        advance(GRAPH, playback.ramp, rows)
        assert rows.pose[0] == pytest.approx(
            pose_at(GRAPH, chain, origins, blend_offsets, ticks / FRAME_TICKS), abs=1e-12
        )
    assert (rows.node[0], rows.previous[0], rows.cursor[0]) == (3, 2, 2)
    assert rows.frame[0] == GRAPH.node_frames[3]


def reserved(
    other: tuple[float, float] | np.ndarray,
    room: shapely.Polygon | None = None,
    kept_free: np.ndarray = NOTHING,
    passages: np.ndarray = NOTHING,
    strict: bool = False,
):
    """What a walker that starts at START along three strides may reserve where ``other`` stands, or walks (48, 2).

    Returns (nodes taken, gone slot, timeline).
    """
    plan = [1, 2, 2, 2]
    chain = Chain.empty(12)
    chain.nodes[:4] = plan
    chain.origins[:4], chain.blend_offsets[:4] = chain_of(GRAPH, plan, START)
    mesh = NavMesh(room or shapely.box(-5, -5, 10, 10))
    timelines = discs_along(np.zeros((2, 48, 2)), 0.3)
    timelines[0, :, :2] = START[:2]
    timelines[1, :, :2] = other
    out = np.zeros((48, SAMPLE))
    radii, breadths = np.array([[0.2, 0.3]]), np.array([[0.3, 0.0]])
    obstacles = Obstacles(layers_kept(mesh, mesh), radii, breadths, kept_free, 0.35, NO_BODIES, 0, 0.3)
    obstacles = obstacles._replace(passages=passages, off_passages=0.6)
    starts, gones, radii = np.zeros(2, np.int64), np.full(2, FOREVER), np.full(2, 0.3)
    everyone = timelines_of(timelines, starts, gones, radii)
    draft = Chain.empty(12)
    taken, gone, _ = reserve(GRAPH, obstacles, everyone, 0, 0, natural(0), chain, draft, 1, 3, False, strict, out)
    return taken, gone, out[:, :2]


def walked(taken: int) -> tuple[np.ndarray, np.ndarray]:
    """Track positions at the slots of START, ``taken`` strides and the stop behind them; and where that ends."""
    nodes = [1, *[2] * taken, 3]
    origins, blend_offsets = chain_of(GRAPH, nodes, START)
    path = np.array([pose_at(GRAPH, nodes, origins, blend_offsets, k * SLOT_FRAMES)[:2] for k in range(48)])
    return path, path[-1]


def test_one_stride_is_reserved_with_the_stop_behind_it() -> None:
    taken, gone, timeline = reserved((50.0, 50.0))
    assert (taken, gone) == (1, FOREVER)
    assert timeline == pytest.approx(walked(1)[0], abs=1e-12)


def test_a_stop_in_a_narrow_passage_is_taken_only_without_another_place_and_never_if_strict() -> None:
    ends = [walked(taken)[1] for taken in (1, 2, 3)]
    # Passages, as points, at the ends of the first strides: far from where the walker starts.
    narrow = [np.array([[*end, *end] for end in ends[:count]]).reshape(-1, 4) for count in (0, 1, 3)]
    assert [reserved((50.0, 50.0), passages=passages)[0] for passages in narrow] == [1, 2, 1]
    assert [reserved((50.0, 50.0), passages=passages, strict=True)[0] for passages in narrow] == [1, 2, 0]


@settings(deadline=None)
@given(st.integers(0, 10_000))
def test_as_few_strides_are_reserved_as_meet_nobody(seed: int) -> None:
    rng = np.random.default_rng(seed)
    steps = rng.normal(0.0, 0.3, (48, 2)) * (rng.random((48, 1)) < rng.choice([0.0, 0.3]))
    other = discs_along(START[:2] + rng.uniform(-2.5, 2.5, 2) + np.cumsum(steps, axis=0), 0.3)
    free = []
    for count in (1, 2, 3):
        nodes = [1, *[2] * count, 3]
        mine = np.zeros((48, SAMPLE))
        chain = Chain(np.array(nodes, np.int32), *chain_of(GRAPH, nodes, START))
        sample_chain(GRAPH, chain, count + 2, np.array([[0.3, 0.0]]), 0, natural(0), mine)
        if not pair_meets(mine, 0, FOREVER, other, 0, FOREVER, 0, 0.6, True):
            free.append(count)
    assert reserved(other[:, :2])[0] == min(free, default=0)


def test_more_strides_are_reserved_where_someone_stands_in_the_place_to_stop() -> None:
    place = walked(1)[1] + np.array([0.2, -0.65])
    taken, _, timeline = reserved(tuple(place))
    assert taken > 1
    assert timeline == pytest.approx(walked(taken)[0], abs=1e-12)
    assert np.hypot(*(timeline - place).T).min() >= 0.6


def test_nothing_is_reserved_through_someone_who_stands() -> None:
    assert reserved(tuple(walked(3)[0][9]))[0] == 0


@pytest.mark.parametrize(("off", "free"), [(0.199, False), (0.2005, True)])
def test_a_corner_passed_between_two_samples_counts(off: float, free: bool) -> None:
    """The body passes the corner in frame 10; frames 8 and 12, which are tested, are 4 mm farther away from it."""
    x, y, _ = pose_at(GRAPH, [2], np.zeros((1, 3)), np.zeros((1, 3)), 10)
    corner = shapely.Polygon([(x, y + off), (x + 0.2, y + off + 0.9), (x - 0.2, y + off + 0.9)])
    mesh = NavMesh(shapely.box(-5, -5, 10, 10).difference(corner))
    breadths = np.array([[0.2, 0.0]])
    obstacles = Obstacles(layers_kept(mesh), breadths[:, :1], breadths, NOTHING, 0.0, NO_BODIES, 0, 0.2)
    assert node_is_free(GRAPH, 2, np.zeros(3), np.zeros(3), obstacles, np.full(1, -1)) == free


@pytest.mark.parametrize("offset", [0.0, 0.3])
@pytest.mark.parametrize("seed", range(20))
def test_a_node_is_free_where_each_of_its_frames_is(seed: int, offset: float) -> None:
    """Near a wall, and in the open, where one look at the surroundings is enough."""
    rng = np.random.default_rng(seed)
    origin = np.array([0.0, 0.0, rng.uniform(-np.pi, np.pi)])
    blend_offset = offset * np.array([*rng.uniform(-1.0, 1.0, 2), 0.0])
    wall = shapely.box(rng.uniform(0.2, 2.5), -1.0, 3.0, 1.0)
    mesh = NavMesh(shapely.box(-5, -5, 5, 5).difference(wall))
    frames = range(int(GRAPH.node_frames[2]) + 1)
    places = [pose_at(GRAPH, [2], origin[None], blend_offset[None], frame)[:2] for frame in frames]
    gap = min(shapely.Point(*place).distance(wall) for place in places)
    for radius in (0.99 * gap, 1.01 * gap):
        breadths = np.array([[radius, 0.0]])
        obstacles = Obstacles(layers_kept(mesh), breadths[:, :1], breadths, NOTHING, 0.0, NO_BODIES, 0, radius)
        free = node_is_free(GRAPH, 2, origin, blend_offset, obstacles, np.full(1, -1))
        assert free == (radius < gap)


def test_a_standing_body_sways() -> None:
    tracks = GRAPH.tracks.copy()
    idle = int(GRAPH.node_track[0])
    tracks[idle + 10, :2] = 0.003, 0.004
    tracks[idle + 20, 2] = 0.02
    graph = GRAPH._replace(tracks=tracks)
    assert sway_behind(graph, 3, 0.0) == pytest.approx(0.005)
    assert sway_behind(graph, 3, 0.5) == pytest.approx(0.01)
    assert sway_behind(graph, 1, 0.5) == 0.0, "nobody stands behind this node"
    chain = Chain(np.array([3], np.int32), START[None], np.zeros((1, 3)))
    out = np.zeros((40, SAMPLE))
    ended = sample_chain(graph, chain, 1, SIDEWAYS, 0, natural(0), out)
    assert out[ended:, [BEND, REST]] == pytest.approx(0.005)
    # Somebody who passes keeps off by that much.
    passing = discs_along(np.column_stack([np.linspace(-2.0, 2.0, 40), np.full(40, 0.504)]), 0.3)
    standing = discs_along(np.zeros((40, 2)), 0.2)
    assert not pair_meets(passing, 0, FOREVER, standing, 0, FOREVER, 0, 0.5, True)
    standing[:, [BEND, REST]] = 0.005
    assert pair_meets(passing, 0, FOREVER, standing, 0, FOREVER, 0, 0.5, True)


def test_a_wall_behind_the_stop_asks_for_a_stride_more_or_refuses() -> None:
    end = walked(1)[1]
    post = shapely.Point(end).buffer(0.25)
    assert reserved((50.0, 50.0), room=shapely.box(-5, -5, 10, 10).difference(post))[0] != 1


def test_nothing_is_reserved_into_what_is_kept_free_and_more_nodes_do_not_help() -> None:
    end = walked(1)[1]
    bar = shapely.box(end[0] + 0.3, -3.0, end[0] + 0.4, 3.0)
    ring = shapely.get_coordinates(bar)
    assert reserved((50.0, 50.0), kept_free=np.concatenate([ring[:-1], ring[1:]], axis=1))[0] == 0
    away = np.concatenate([ring[:-1], ring[1:]], axis=1) + [9.0, 0.0, 9.0, 0.0]
    assert reserved((50.0, 50.0), kept_free=away)[0] == 1
