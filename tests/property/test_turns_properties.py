"""Random rows at random passages take turns in kernels as in their slow twin."""

import numpy as np
import pytest
from hypothesis import event, given, settings
from hypothesis import strategies as st

from crowdsim.constants import NONE
from crowdsim.crowd.giving_way.turns import TurnRows, Turns
from crowdsim.crowd.giving_way.turns_kernels import OFF_METERS, find_sides, gate_distance, off_passage, take_turns
from crowdsim.crowd.state.components import FREE, LAST
from crowdsim.crowd.state.passages import Passages
from tests.reference.turns import decide, off, sides


def passages_of(rng: np.random.Generator, count: int) -> Passages:
    """Doors of one or two parallel segments, crossed from the right to the left or the other way round."""
    segments, begin = [], [0]
    for _ in range(count):
        middle, angle = rng.uniform(-5, 5, 2), rng.uniform(0, 2 * np.pi)
        along = np.array([np.cos(angle), np.sin(angle)])
        for k in range(int(rng.integers(1, 3))):
            place = middle + 0.2 * k * np.array([-along[1], along[0]])
            segments.append([*(place - along / 2), *(place + along / 2)])
        begin.append(len(segments))
    return Passages(np.array(segments).reshape(-1, 4), np.array(begin))


def rows_of(rng: np.random.Generator, count: int, passages: int) -> TurnRows:
    way = rng.uniform(-6, 6, (count, 1, 2)) + np.cumsum(rng.normal(0.0, 1.2, (count, 5, 2)), axis=1)
    way[rng.random(count) < 0.3] = np.nan
    side = np.where(rng.random(count) < 0.6, rng.integers(0, 2 * passages, count), NONE)
    lead = np.where(side == NONE, FREE, rng.integers(0, 640, count))
    turn = 64 * rng.permutation(count).astype(np.int64)
    return TurnRows(
        pose=rng.uniform(-6, 6, (count, 3)),
        timeline=rng.uniform(-6, 6, (count, 4, 13)),
        way=way,
        turn=np.where(rng.random(count) < 0.1, LAST, turn),
        retry_step=rng.integers(0, 70, count),
        rank=np.maximum(turn - rng.integers(0, 100, count), 0),
        side=side.astype(np.int32),
        lead=lead.astype(np.int64),
        gate=np.full(count, NONE, np.int32),
    )


@given(seed=st.integers(0, 10_000_000), count=st.integers(1, 12), doors=st.integers(1, 3))
@settings(max_examples=200)
def test_rows_take_turns_as_their_twin_says(seed: int, count: int, doors: int) -> None:
    rng = np.random.default_rng(seed)
    passages, rows = passages_of(rng, doors), rows_of(rng, count, doors)
    turns = Turns.of(doors)._replace(away=np.zeros(count))
    turns.holder[:] = rng.integers(-1, 2, doors)
    turns.since[:] = rng.integers(0, 50, doors)
    wanted = sides(rows, passages, 60)
    find_sides(rows, turns, *passages, 60)
    assert rows.side.tolist() == [side for side, _ in wanted]
    has = rows.side != NONE
    assert turns.away[has] == pytest.approx([away for side, away in wanted if side != NONE])
    holders, since, found = decide(rows, turns, 60, 30)
    take_turns(rows, turns, passages.begin, 60, 30)
    assert (turns.holder.tolist(), turns.since.tolist()) == (holders, since)
    assert list(zip(rows.lead.tolist(), rows.gate.tolist(), rows.rank.tolist(), strict=True)) == found
    event(f"{int((rows.gate != NONE).sum() > 0)} gates, {int((turns.away[has] < 0).any())} come out")


@given(seed=st.integers(0, 10_000_000))
@settings(max_examples=100)
def test_who_waits_keeps_off_a_passage_but_need_not_move_away(seed: int) -> None:
    rng = np.random.default_rng(seed)
    passages = passages_of(rng, 2)
    here, there = rng.uniform(-7, 7, (2, 2))
    away, left = off_passage(*passages, 1, *here)
    assert (away, left) == (pytest.approx(off(passages, 1, here)[0]), off(passages, 1, here)[1])
    kept = gate_distance(*passages, 1, here, there)
    nearest = min(away, off(passages, 1, there)[0])
    assert kept == pytest.approx(OFF_METERS if nearest > OFF_METERS + 0.05 else max(nearest - 0.05, 0.0))
