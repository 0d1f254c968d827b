"""Turns at narrow passages, looked up one by one with shapely."""

import itertools

import numpy as np
import shapely

from crowdsim.constants import NONE
from crowdsim.crowd.giving_way.turns import TurnRows, Turns
from crowdsim.crowd.giving_way.turns_kernels import IN_METERS, KEPT_METERS, ORDER_METERS, OUT_METERS, RANKS
from crowdsim.crowd.state.components import FREE, LAST
from crowdsim.crowd.state.passages import Passages


def is_left(segment: np.ndarray, place: np.ndarray) -> bool:
    ring = shapely.LinearRing([segment[:2], segment[2:], place])
    return bool(ring.is_ccw)


def side_of_way(way: np.ndarray, passages: Passages) -> int:
    """Return twice the passage that a way leads through first, plus 1 from left to right; NONE if there is none."""
    for start, end in itertools.pairwise(way):
        piece = shapely.LineString([start, end])
        met = []
        for c in range(len(passages.begin) - 1):
            for segment in passages.segments[passages.begin[c] : passages.begin[c + 1]]:
                line = shapely.LineString(segment.reshape(2, 2))
                if piece.length and piece.crosses(line):
                    met.append(
                        (shapely.Point(start).distance(piece.intersection(line)), 2 * c + is_left(segment, start))
                    )
        if met:
            return int(min(met)[1])
    return NONE


def off(passages: Passages, passage: int, place: np.ndarray) -> tuple[float, bool]:
    """Return the distance of a place from a passage, and whether it is left of the nearest segment."""
    segments = passages.segments[passages.begin[passage] : passages.begin[passage + 1]]
    away = [shapely.Point(place).distance(shapely.LineString(segment.reshape(2, 2))) for segment in segments]
    return min(away), is_left(segments[int(np.argmin(away))], place)


def sides(rows: TurnRows, passages: Passages, step: int) -> list[tuple[int, float]]:
    """Return the side of each row, and its distance from the passage; -1 once the way through is reserved."""
    found = []
    for row, was in enumerate(rows.side.tolist()):
        way = rows.way[row]
        planless = bool(np.isnan(way).any())
        if rows.turn[row] == LAST:
            found.append((NONE, np.nan))
            continue
        wanted = NONE if planless else side_of_way(way, passages)
        answer = NONE, np.nan
        if wanted != NONE:
            answer = wanted, off(passages, wanted // 2, rows.pose[row, :2])[0]
        elif was != NONE and rows.retry_step[row] <= step:
            away, left = off(passages, was // 2, rows.pose[row, :2])
            stands_before = left == bool(was % 2)
            ends_before = off(passages, was // 2, rows.timeline[row, -1, :2])[1] == bool(was % 2)
            if not ends_before and (stands_before or away < OUT_METERS):
                answer = was, -1.0
            elif ends_before and planless and away < KEPT_METERS:
                answer = was, away
        found.append(answer)
    return found


def decide(
    rows: TurnRows, turns: Turns, step: int, hold: int
) -> tuple[list[int], list[int], list[tuple[int, int, int]]]:
    """Return the open direction of each passage and the step since which the other waits; lead, gate, rank of rows."""
    holders, since = turns.holder.tolist(), turns.since.tolist()
    found = {
        row: (FREE, NONE, int(rows.turn[row] if rows.lead[row] != FREE else rows.rank[row]))
        for row in range(len(rows.side))
    }
    for c in range(len(holders)):
        here = [row for row in found if rows.side[row] != NONE and rows.side[row] // 2 == c]
        waiting = [[row for row in here if rows.side[row] % 2 == way and turns.away[row] >= 0.0] for way in (0, 1)]
        everyone = waiting[0] + waiting[1]
        first = min((int(rows.turn[row]) for row in everyone), default=None)
        if holders[c] == NONE or not waiting[holders[c]]:
            since[c] = step
            holders[c] = NONE if first is None else int(first not in [int(rows.turn[row]) for row in waiting[0]])
        elif not waiting[1 - holders[c]]:
            since[c] = step
        elif step - since[c] > hold:
            holders[c], since[c] = 1 - holders[c], step
        for row in here if first is not None else []:
            turn, away = int(rows.turn[row]), float(turns.away[row])
            if away < 0.0:
                found[row] = min(first, turn), NONE, min(first, turn)
            elif row in waiting[holders[c]] or away < IN_METERS:
                lead = first + 1 + min(int(away / ORDER_METERS), RANKS - 1)
                found[row] = lead, NONE, lead
            else:
                lead = max(turn, first + RANKS + 1)
                found[row] = lead, c, lead
    return holders, since, [found[row] for row in sorted(found)]
