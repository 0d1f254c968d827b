"""Coded tracks: a slow twin reads the same integers, whatever they are, and those of walking people take few bytes."""

import math

import numpy as np
import pytest

from crowdsim.export.page.tracks.range_kernels import EVEN, finish, new_state, put_bit, put_number
from crowdsim.export.page.tracks.track_kernels import MODELS, cadence, code_chunk, direction
from crowdsim.jit import kernel
from crowdsim.motion.deformed.phase_kernels import hip_turn, phase_rate
from tests.reference import track_decoding
from tests.reference.track_decoding import RangeReader, TrackReader, runs

UNITS = np.array([1000, 2048, 10, 5000, 81, 600], np.int64)


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
        out[k, 1] = cadence(speed, angle, turning)
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


def walked(rng, count, steps):
    """Tracks (4, N, T), phases (N, T) of people who push and turn, as far as their rules allow."""
    change = rng.normal(0.0, 12.0, (2, count, steps))
    change *= np.minimum(1.0, 25.0 / np.maximum(np.hypot(*change), 1e-9))
    velocity = np.cumsum(change, axis=2) + 60.0
    places = np.rint(np.cumsum(velocity, axis=2)).astype(np.int64)
    heading = np.rint(np.arctan2(velocity[1], velocity[0]) * 2048 / (2 * np.pi)).astype(np.int64)
    frame = np.cumsum(rng.choice([600, 600, 600, 590, 300], (count, steps)), axis=1)
    phases = np.cumsum(rng.integers(380, 460, (count, steps)), axis=1)
    return np.stack([*places, heading, frame]), phases


@pytest.mark.parametrize("wild", [False, True])
def test_a_slow_twin_reads_the_tracks_of_a_chunk(wild):
    rng = np.random.default_rng(2)
    count, steps = 12, 60
    tracks, phases = walked(rng, count, steps)
    if wild:
        tracks[:, 3:] = rng.integers(-(2**20), 2**20, tracks[:, 3:].shape)
        phases[5:] = rng.integers(-(10**6), 10**6, phases[5:].shape)
    here = np.ones((count, steps), np.uint8)
    here[1, 20:23] = here[2, :] = here[4, 1:] = here[4, 2:4] = 0
    here[4, 4:6] = 1
    steered = here * (np.arange(count) % 3 > 0)[:, None].astype(np.uint8)
    steered[5, 30:] = 0
    node = np.where((here > 0) & (steered == 0), np.arange(steps) // 17, -1).astype(np.int32)
    spans = [(who, first, end) for who in range(count) for there, first, end in runs(here[who]) if there]
    starts = np.cumsum([0, *[end - first for _, first, end in spans]])
    stretches = np.array([(*span, start) for span, start in zip(spans, starts[:-1].tolist(), strict=True)], np.int64)
    shown = np.concatenate([phases[who, first:end] for who, first, end in spans])
    models = np.full((MODELS, 2), EVEN, np.uint16)
    out = np.zeros(24 * (tracks.size + shown.size) + 64, np.uint8)
    size = code_chunk(tracks, here, steered, node, stretches, shown, UNITS, models, new_state(), out)
    reader = TrackReader(out[:size].tobytes(), UNITS)
    for who in range(count):
        read = np.zeros((3, steps), np.int64)
        for there, first, end in runs(here[who]):
            if there:
                read[:, first:end] = reader.track(steered[who, first:end].tolist())
        there = here[who] > 0
        assert (read[:2, there] == tracks[:2, who, there]).all()
        assert ((read[2, there] - tracks[2, who, there]) % UNITS[1] == 0).all()
        for played, first, end in runs(node[who]):
            if played >= 0:
                assert reader.frames(end - first) == tracks[3, who, first:end].tolist()
        for owner, first, end, at in stretches.tolist():
            if owner == who:
                assert reader.phases(tuple(read.tolist()), first, end) == shown[at : at + end - first].tolist()
    if not wild:
        # Of steered people: two accelerations of some 5 bits each, a turn, a phase; models learn for a while.
        assert 8 * size <= 40 * here.sum()


def test_what_is_expected_is_near_what_gaits_do():
    rng = np.random.default_rng(3)
    values = np.column_stack([rng.uniform(0.25, 1.8, 2000), rng.uniform(-3.1, 3.1, 2000), rng.uniform(-2.0, 2.0, 2000)])
    ways, rates, gaits = expected(values).T
    np.testing.assert_allclose(ways, values[:, 1], atol=2e-5)
    walking = (gaits >= 0.45) & (np.abs(np.abs(values[:, 1]) - np.pi / 2) > 0.05)
    assert walking.mean() > 0.8
    np.testing.assert_allclose(rates[walking], gaits[walking], rtol=0.01)
    for (speed, angle, turning), way, rate in zip(values.tolist(), ways.tolist(), rates.tolist(), strict=True):
        assert track_decoding.cadence(speed, angle, turning) == rate
        assert track_decoding.direction(math.cos(angle), math.sin(angle)) == pytest.approx(way, abs=2e-5)
