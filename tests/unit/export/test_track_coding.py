"""Coded tracks: a slow twin reads the same integers, whatever they are, and those of walking people take few bytes."""

import math

import numpy as np
import pytest

from crowdsim.export.page.tracks.context_kernels import MIXED, MODELS, ROWS
from crowdsim.export.page.tracks.expected_kernels import (
    CYCLE,
    PHASE_STEP,
    PLACE,
    PLAYED_TURN_STEP,
    RATE,
    TURN,
    TURN_STEP,
    cadence,
    direction,
    expected_phase,
)
from crowdsim.export.page.tracks.mixing_kernels import Coder, new_mixer, put_mixed
from crowdsim.export.page.tracks.played_kernels import TOLERANCE, NodeTracks
from crowdsim.export.page.tracks.range_kernels import EVEN, finish, new_state, put_bit, put_number
from crowdsim.export.page.tracks.track_kernels import code_chunk
from crowdsim.jit import kernel
from crowdsim.motion.deformed.phase_kernels import STAND, advance_phases, hip_turn, phase_rate
from crowdsim.motion.graph.playback_kernels import FRAME_TICKS
from tests.reference import track_decoding
from tests.reference.track_decoding import NodeRows, RangeReader, TrackReader, runs

UNITS = np.array([720, 1 << 17, 10, 50_000, 5216, 600, 15, 163, 16], np.int64)
ROUNDED, SLACK = np.zeros(2), np.array([365.0, 167.0])


@kernel
def put_bits(bits, chosen, models, state, out):
    """Code decisions, each by one of the models."""
    for k in range(len(bits)):
        put_bit(state, out, models, chosen[k], bits[k])
    return finish(state, out)


@kernel
def put_numbers(values, models, state, out):
    """Code integers."""
    for k in range(len(values)):
        put_number(state, out, models, 64, 5, values[k])
    return finish(state, out)


@kernel
def expected(values):
    """Return direction and cadence (n, 2), and cadence by the kernels of gaits (n,)."""
    out = np.empty((len(values), 3))
    for k in range(len(values)):
        speed, angle, turning = values[k]
        x, y = speed * math.cos(angle), speed * math.sin(angle)
        hip = hip_turn(x, y)
        out[k, 0] = direction(x, y)
        out[k, 1] = cadence(speed, angle, turning)[0]
        out[k, 2] = phase_rate(speed * math.cos(angle - hip), speed * math.sin(angle - hip), turning)
    return out


def room(count):
    """Bytes for so many decisions, and a state; two for each, and what the end takes."""
    return np.zeros(2 * count + 64, np.uint8), new_state()


@pytest.mark.parametrize("share", [0.0, 0.001, 0.5, 0.97, 1.0])
def test_decisions_come_back_and_take_as_many_bits_as_they_surprise(share):
    rng = np.random.default_rng(1)
    bits = (rng.random(20_000) < share).astype(np.int64)
    chosen = rng.integers(0, 3, len(bits))
    out, state = room(len(bits))
    models = np.full((3, 2), EVEN, np.uint16)
    size = put_bits(bits, chosen, models, state, out)
    reader = RangeReader(out[:size].tobytes())
    assert [reader.bit(model) for model in chosen.tolist()] == bits.tolist()
    entropy = -sum(p * math.log2(p) for p in (share, 1.0 - share) if p)
    assert 8 * size <= 1.05 * entropy * len(bits) + 400


def test_numbers_of_any_size_come_back():
    values = np.array([0, 1, -15, 15, 16, -16, 2**30, -(2**31) + 1, 7, -1] * 20, np.int64)
    out, state = room(20 * len(values))
    size = put_numbers(values, np.full((128, 2), EVEN, np.uint16), state, out)
    reader = RangeReader(out[:size].tobytes())
    assert [reader.number("any", 5) for _ in values] == values.tolist()


@kernel
def put_mixed_numbers(values, contexts, models, mixer, state, out):
    """Code integers, each in three contexts."""
    for k in range(len(values)):
        a, b, c = contexts[k]
        put_mixed(state, out, models, mixer, (a << 5, b << 5, c << 5), (a & 1) << 5, 5, values[k])
    return finish(state, out)


def test_mixed_numbers_come_back_and_take_as_many_bits_as_the_context_that_tells_most():
    rng = np.random.default_rng(4)
    contexts = np.stack([rng.integers(8 * k, 8 * k + 8, 8000) for k in range(3)], axis=1)
    # The second context tells the number within one; the others tell nothing.
    values = contexts[:, 1] - 12 + rng.integers(0, 2, len(contexts))
    values[::1000] = 2**20
    out, state = room(20 * len(values))
    mixer = new_mixer(24 << 5, 64)
    size = put_mixed_numbers(values, contexts, np.full((64, 2), EVEN, np.uint16), mixer, state, out)
    reader = RangeReader(out[:size].tobytes())
    assert [reader.mixed("any", each, each[0] & 1, 5) for each in contexts.tolist()] == values.tolist()
    assert 8 * size <= 1.15 * len(values) + 1500


FRAMES = np.array([78, 30, 24, 7, 1, 0], np.int32)
FIRST = (np.cumsum(FRAMES + 1) - FRAMES - 1).astype(np.int32)


def walking_nodes():
    """Nodes that walk ahead and turn, each on its own way."""
    rows = np.concatenate(
        [
            np.arange(count + 1)[:, None] * [200 + 20 * number, 5 * number, 30 * number]
            for number, count in enumerate(FRAMES)
        ]
    )
    return NodeTracks(FIRST, FRAMES, rows.astype(np.int64))


def coder(size):
    return Coder(new_state(), np.zeros(size, np.uint8), np.full((MODELS, 2), EVEN, np.uint16), new_mixer(MIXED, ROWS))


def walked(rng, count, steps):
    """Exact tracks (3, N, T), frames (N, T), phases (N, T) of people who push and turn, as far as their rules allow."""
    change = rng.normal(0.0, 9.0, (2, count, steps))
    change *= np.minimum(1.0, 18.0 / np.maximum(np.hypot(*change), 1e-9))
    velocity = np.cumsum(change, axis=2) + 45.0
    places = np.cumsum(velocity, axis=2)
    heading = np.arctan2(velocity[1], velocity[0]) * UNITS[TURN] / (2 * np.pi)
    frame = np.cumsum(rng.choice([600, 600, 600, 590, 300], (count, steps)), axis=1)
    phases = np.cumsum(rng.integers(3800, 4600, (count, steps)), axis=1)
    return np.stack([*places, heading]), frame, phases


@pytest.mark.parametrize("slack", [ROUNDED, SLACK])
@pytest.mark.parametrize("wild", [False, True])
def test_a_slow_twin_reads_the_tracks_of_a_chunk(wild, slack):
    rng = np.random.default_rng(2)
    count, steps = 12, 60
    exact, frame, phases = walked(rng, count, steps)
    if wild:
        exact[:, 3:] = rng.uniform(-(2.0**20), 2.0**20, exact[:, 3:].shape)
        phases[5:] = np.cumsum(rng.integers(0, 10**6, phases[5:].shape), axis=1)
    here = np.ones((count, steps), np.uint8)
    here[1, 20:23] = here[2, :] = here[4, 1:] = here[4, 2:4] = 0
    here[4, 4:6] = 1
    here[3, 7] = here[9, 0] = here[9, 2:4] = 0
    steered = here * (np.arange(count) % 3 > 0)[:, None].astype(np.uint8)
    steered[5, 30:] = steered[7, :1] = steered[8, 1:9] = 0
    # Nodes change, and agent 6 plays one again and again; frames begin anew where they do.
    plays = np.arange(steps) // 13 + np.arange(count)[:, None]
    node = np.where((here > 0) & (steered == 0), plays % len(FRAMES), -1).astype(np.int32)
    node[6] = np.where(node[6] >= 0, 1, -1)
    frame = np.where(np.arange(steps) % 13, frame - frame[:, ::13].repeat(13, axis=1)[:, :steps], 0)
    if wild:
        frame[3:] = rng.integers(0, 2**20, frame[3:].shape)
    spans = [(who, first, end) for who in range(count) for there, first, end in runs(here[who]) if there]
    starts = np.cumsum([0, *[end - first for _, first, end in spans]])
    stretches = np.array([(*span, start) for span, start in zip(spans, starts[:-1].tolist(), strict=True)], np.int64)
    asked = np.concatenate([phases[who, first:end] for who, first, end in spans])
    shown, own = asked.copy(), np.array([0, steps])
    tracks, nodes = np.zeros((4, count, steps), np.int64), walking_nodes()
    tracks[3] = frame
    coding = coder(24 * (tracks.size + shown.size) + 64)
    size = code_chunk(tracks, exact, here, node, nodes, stretches, shown, own, UNITS, slack, coding)
    reader = TrackReader(coding.out[:size].tobytes(), UNITS, NodeRows(FRAMES.tolist(), nodes.rows, FRAME_TICKS))
    for who in range(count):
        read = np.zeros((4, steps), np.int64)
        for there, first, end in runs(here[who]):
            if there:
                read[:, first:end] = reader.track(node[who, first:end].tolist())
        there, played = here[who] > 0, node[who] >= 0
        assert (read[:3, there] == tracks[:3, who, there]).all()
        assert (read[3, played] == frame[who, played]).all()
        off = np.abs(read[:2] - exact[:2, who]).max(axis=0)
        assert (off[there & ~played] <= 0.5).all()
        assert (off[played] <= TOLERANCE + 0.5).all()  # shown within the tolerance, and here rounded
        off = np.abs((read[2] - exact[2, who] + UNITS[TURN] / 2) % UNITS[TURN] - UNITS[TURN] / 2)
        most = 0.5 * UNITS[TURN_STEP] + (0.7 * slack[1] if slack[0] == 0 else slack[0])
        assert (off[there & ~played] <= most).all()
        assert (off[played] <= UNITS[PLAYED_TURN_STEP] + 0.5).all()
        for owner, first, end, at in stretches.tolist():
            if owner == who:
                assert reader.phases(tuple(read[:3].tolist()), first, end) == shown[at : at + end - first].tolist()
    assert np.abs(shown - asked).max() <= 0.5 * UNITS[PHASE_STEP]
    if not wild:
        # Of steered people: two accelerations of some 4 bits each, a turn, a phase; models learn for a while. Others
        # play nodes that have nothing to do with their tracks.
        assert 8 * size <= 50 * here.sum()


def test_people_who_play_nodes_take_few_bits():
    """Nodes begin elsewhere than the ones before end: that takes bits, and the steps between them hardly any."""
    rng = np.random.default_rng(6)
    count, steps, nodes = 20, 300, walking_nodes()
    rows = NodeRows(FRAMES.tolist(), nodes.rows, FRAME_TICKS)
    plain = TrackReader(bytes(8), UNITS, rows)
    to_world = np.array([UNITS[PLACE], UNITS[PLACE], UNITS[TURN] / (2.0 * np.pi)])
    exact, tracks = np.zeros((3, count, steps)), np.zeros((4, count, steps), np.int64)
    node = np.zeros((count, steps), np.int32)
    for who in range(count):
        origin, offset, now, at = rng.uniform(-9e3, 9e3, 3), np.zeros(3), int(rng.integers(3)), 0
        for t in range(steps):
            length = int(FRAMES[now]) * FRAME_TICKS
            if at >= length:
                own, left = rows.at(now, length)
                ended = plain._moved(origin, own * to_world) + left * offset
                origin = plain._moved(ended, rng.normal(0.0, (5.0, 5.0, 100.0)))
                # Some nodes are played twice.
                offset, at, now = ended - origin, at - length, (now + int(rng.integers(1, 3)) * (t % 9 > 0)) % 3
            own, left = rows.at(now, at)
            exact[:, who, t] = plain._moved(origin, own * to_world) + left * offset
            tracks[3, who, t], node[who, t] = at, now
            at += 600 if t % 50 < 40 else 570
    coding, none = coder(24 * tracks.size), np.zeros((0, 4), np.int64)
    own = np.array([0, steps])
    here = np.ones((count, steps), np.uint8)
    size = code_chunk(tracks, exact, here, node, nodes, none, np.zeros(0, np.int64), own, UNITS, ROUNDED, coding)
    begun = np.count_nonzero(np.diff(tracks[3], axis=1) < 0)
    assert 8 * size <= 36 * begun + 0.6 * node.size + 3000
    reader = TrackReader(coding.out[:size].tobytes(), UNITS, rows)
    for who in range(count):
        assert (np.array(reader.track(node[who].tolist())) == tracks[:, who]).all()
    assert np.abs(tracks[:2] - exact[:2]).max() <= TOLERANCE + 0.5
    off = (tracks[2] - exact[2] + UNITS[TURN] / 2) % UNITS[TURN] - UNITS[TURN] / 2
    assert np.abs(off).max() <= UNITS[PLAYED_TURN_STEP] + 0.5


def test_errors_of_headings_cancel_within_a_second():
    """Bodies show smoothed headings: single ones may be off by 1 degree, smoothed ones by a fifth of that."""
    rng = np.random.default_rng(5)
    exact, _, phases = walked(rng, 40, 200)
    exact[2] += np.cumsum(rng.choice([-2600.0, 0.0, 0.0, 700.0], exact[2].shape), axis=1)
    spread = np.ones((40, 200), np.uint8), np.full((40, 200), -1, np.int32), walking_nodes()
    none, own, tracks = np.zeros((0, 4), np.int64), np.array([0, 200]), np.zeros((4, 40, 200), np.int64)
    code_chunk(tracks, exact, *spread, none, phases.ravel(), own, UNITS, SLACK, coder(24 * tracks.size))
    off = (tracks[2] - exact[2] + UNITS[TURN] / 2) % UNITS[TURN] - UNITS[TURN] / 2
    assert np.abs(off).max() <= SLACK[0]
    window = np.hanning(11)[1:-1] / np.hanning(11).sum()
    smooth = np.array([np.convolve(row, window, "valid") for row in off])
    assert np.percentile(np.abs(smooth), 99) <= 0.2 * SLACK[0]


@kernel
def walked_phases(x, y, heading, units):
    """Return phases that the rules of pages expect along a track, from a stand on."""
    phases = np.empty(len(x), np.int64)
    phases[0] = 3000
    ax, ay, left = x[0], y[0], heading[0]
    for t in range(1, len(x)):
        away = math.sqrt(float((x[t] - ax) ** 2 + (y[t] - ay) ** 2)) / units[PLACE]
        phases[t] = expected_phase(phases[t - 1], x, y, heading, t, away, left, units)[0]
        if (2 * phases[t - 1] - 26000) // units[CYCLE] < (2 * phases[t] - 26000) // units[CYCLE]:
            ax, ay, left = x[t], y[t], heading[t]
    return phases


def test_phases_are_expected_as_gaits_advance_them():
    """A body sets off, walks, turns, steps aside, creeps and stands: its phases are those of a simulation."""
    speeds = np.repeat([0.0, 0.9, 1.3, 0.05, 0.0, 0.23, 0.4, 0.0], 25)
    turns = np.repeat([0.0, 0.02, 0.0, 0.2, 0.0, 0.0, -0.1, 0.0], 25)
    aside = np.repeat([0.0, 0.0, 0.5, 0.0, 0.0, 1.5, 0.0, 0.0], 25)
    heading = np.cumsum(turns)
    places = np.cumsum(0.1 * speeds[:, None] * np.stack([np.cos(heading + aside), np.sin(heading + aside)], axis=1), 0)
    units = UNITS.copy()
    units[PLACE], units[TURN] = 1_000_000, 1 << 30
    whole = np.rint(places * units[PLACE]).astype(np.int64)
    turned = np.rint(heading * units[TURN] / (2 * np.pi)).astype(np.int64)
    found = walked_phases(whole[:, 0].copy(), whole[:, 1].copy(), turned, units)
    phase, anchor, expected = np.array([STAND]), np.array([[*places[0], heading[0]]]), [STAND]
    for t in range(1, len(places)):
        velocity = (places[t] - places[t - 1])[None] * units[RATE]
        turn = np.array([(heading[t] - heading[t - 1]) * units[RATE]])
        advance_phases(np.array([[*places[t], heading[t]]]), velocity, turn, 0.1, phase, anchor)
        expected.append(float(phase[0]))
    np.testing.assert_allclose(found / units[CYCLE], expected, rtol=0.0, atol=0.01)
    assert expected[-1] > 8.0


def test_what_is_expected_is_near_what_gaits_do():
    rng = np.random.default_rng(3)
    values = np.column_stack([rng.uniform(0.25, 1.8, 2000), rng.uniform(-3.1, 3.1, 2000), rng.uniform(-2.0, 2.0, 2000)])
    ways, rates, gaits = expected(values).T
    np.testing.assert_allclose(ways, values[:, 1], atol=2e-5)
    walking = (gaits >= 0.45) & (np.abs(np.abs(values[:, 1]) - np.pi / 2) > 0.05)
    assert walking.mean() > 0.8
    np.testing.assert_allclose(rates[walking], gaits[walking], rtol=0.01)
    for (speed, angle, turning), way, rate in zip(values.tolist(), ways.tolist(), rates.tolist(), strict=True):
        assert track_decoding.cadence(speed, angle, turning)[0] == rate
        assert track_decoding.direction(math.cos(angle), math.sin(angle)) == pytest.approx(way, abs=2e-5)
