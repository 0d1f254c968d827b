"""Slow twins of the kernels that let agents continue along their plans."""

from __future__ import annotations

import ctypes
from typing import Any

import numpy as np

from crowdsim.constants import NONE
from crowdsim.crowd.giving_way.give_way_kernels import reserve_by_asking
from crowdsim.crowd.near.neighbor_kernels import widen
from crowdsim.crowd.state.reservation_kernels import ROUNDING
from crowdsim.crowd.state.way_kernels import IN_PASSAGE, lay_way, rank_behind, ways_before
from crowdsim.crowd.systems.choose_kernels import (
    ALL_DONE,
    BEHIND,
    EXTENDED,
    NODES_LEFT,
    OTHERWISE,
    STAYS_REFUSED,
    TRIES,
)
from crowdsim.crowd.systems.reserving_kernels import (
    BEHIND_METERS,
    BEHIND_WIDTH,
    LOOKAHEAD,
    WAY_METERS,
    WAY_REACH,
    WAY_ROOM,
    frame_of,
    playback_of,
)
from crowdsim.geometry.elementary import hypot
from crowdsim.recording.header import AgentState


def go_on_in_python(graph: Any, rows: Any, chosen: np.ndarray, begin: int, table: Any, *rest: Any) -> tuple[int, int]:
    """Return the next row that has a plan, or whose node ends; the arguments are those of `go_on`."""
    playback = rest[-1]
    for number in range(begin, len(chosen)):
        row = chosen[number]
        frame, leaves = frame_of(graph, rows, row, playback)
        if (leaves and frame == rows.frame[row]) or table.nodes[rows.agent[row]] >= 0:
            return number, OTHERWISE
    return len(chosen), ALL_DONE


def ask_in_python(
    graph: Any,
    rows: Any,
    refused: np.ndarray,
    begin: int,
    acts: np.ndarray,
    table: Any,
    progress: Any,
    obstacles: Any,
    everyone: Any,
    scratch: Any,
    playback: Any,
    asking: Any,
) -> tuple[int, int, int]:
    """Ask for one row after the other; the arguments and results are those of `ask_in_turn`."""
    for number in range(begin, len(refused)):
        row = refused[number]
        if rows.next_node[row] != NONE:
            continue
        shared = int(min(asking.left[0], TRIES))
        asking.trail.tries[0] = shared
        count = _reserve(graph, rows, row, table, progress, obstacles, everyone, scratch, playback, asking)
        asking.left[0] -= shared - asking.trail.tries[0]
        asking.trail.tries[0] = 0
        if count >= 0:
            _enter(graph, rows, row, table, progress, scratch, playback)
            return number, OTHERWISE, count
        if acts[row]:
            return number, STAYS_REFUSED, 0
    return len(refused), ALL_DONE, 0


def _plan(table: Any, agent: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return nodes (n,), origins and blend offsets (n, 3), and rates (n,) of an agent's plan."""
    count = int(table.nodes[agent])
    nodes, origins, blend_offsets, rates = (int(place) for place in table.places[agent])
    return (
        np.ctypeslib.as_array((ctypes.c_int32 * count).from_address(nodes)),
        np.ctypeslib.as_array((ctypes.c_double * (3 * count)).from_address(origins)).reshape(count, 3),
        np.ctypeslib.as_array((ctypes.c_double * (3 * count)).from_address(blend_offsets)).reshape(count, 3),
        np.ctypeslib.as_array((ctypes.c_int64 * count).from_address(rates)),
    )


def _ends_last_goal(table: Any, progress: Any, agent: int) -> bool:
    places = int(progress.rounds[agent]) * int(progress.goals[agent])
    return int(progress.reached[agent]) + int(table.passes[agent]) + 1 == places


def _rank_at(rank: int, place: np.ndarray, passages: np.ndarray, reach: float) -> int:
    """Return the rank of a row that comes to rest at a place (2,), from that which it has or would have elsewhere."""
    rank += IN_PASSAGE if rank < 0 else 0
    for passage in passages.reshape(-1, 2, 2):
        along = passage[1] - passage[0]
        share = np.clip((place - passage[0]) @ along / (along @ along), 0.0, 1.0)
        if 0 <= rank < IN_PASSAGE and hypot(*(place - passage[0] - share * along)) < reach:
            return rank - IN_PASSAGE
    return rank


def _reserve(
    graph: Any, rows: Any, row: int, table: Any, progress: Any, obstacles: Any, everyone: Any, scratch: Any, *last: Any
) -> int:
    """Reserve for one row, with others that give way; return their number, -1 if no reservation is possible."""
    playback, asking = last
    agent, following = int(rows.agent[row]), int(rows.cursor[row]) + 1
    nodes, origins, blend_offsets, rates = _plan(table, agent)
    near, reach = everyone.near, float(rows.body_radius[row])
    lay_way(origins, following, rows.timeline[row, -1], WAY_METERS, rows.way[row])
    behind = rank_behind(row, rows.way, rows.rank, BEHIND_WIDTH, BEHIND_METERS, near)
    rest = rows.timeline[row, -1, :2].copy()
    behind += IN_PASSAGE if behind < 0 else 0
    rows.rank[row] = _rank_at(min(int(rows.turn[row]), behind), rest, obstacles.passages, reach)
    scratch.ways_count[0] = ways_before(row, rows.way, rows.rank, WAY_REACH, near, scratch.ways)
    ways = scratch.ways[: scratch.ways_count[0]]
    radius = float(rows.body_radius[row])
    mine = obstacles._replace(
        agent=agent,
        body_radius=radius,
        ways=ways,
        way_width=2.0 * radius + WAY_ROOM,
        off_passages=obstacles.off_passages * radius,
    )
    ahead = slice(following, following + LOOKAHEAD)
    available = len(nodes[ahead])
    chain, timeline = scratch.chain, np.empty_like(scratch.timeline)
    for laid, own, planned in (
        (chain.nodes, rows.node[row], nodes),
        (chain.origins, rows.origin[row], origins),
        (chain.blend_offsets, rows.blend_offset[row], blend_offsets),
    ):
        laid[0] = own
        laid[1 : available + 1] = planned[ahead]
    leaves = bool(table.arrives[agent]) and following + available == len(nodes)
    leaves = leaves and _ends_last_goal(table, progress, agent) and not rows.stays[row]
    frame, _ = frame_of(graph, rows, row, playback)
    played = playback_of(graph, rows, row, playback, int(rates[following]))
    taken, gone, count = reserve_by_asking(
        graph, mine, everyone, row, frame, played, chain, scratch.draft, 1, available, leaves, timeline, asking
    )
    if not taken:
        return -1
    tracks = timeline[:, :2]
    rows.timeline[row] = timeline
    rows.timeline_circle[row] = *tracks[0], hypot(*(tracks - tracks[0]).T).max() + ROUNDING
    rows.timeline_start[row] = played.clock // played.slot_frames
    rows.gone_slot[row] = gone
    rows.part[row], rows.rate[row], rows.wanted_rate[row] = played.part, played.rate, played.wanted
    rows.reserved[row] = following + taken - 1
    rows.rank[row] = _rank_at(int(rows.rank[row]), timeline[-1, :2], obstacles.passages, reach)
    widen(near, row, rows.timeline_circle[row])
    lay_way(origins, following + taken, timeline[-1], WAY_METERS, rows.way[row])
    return int(count)


def _enter(graph: Any, rows: Any, row: int, table: Any, progress: Any, scratch: Any, playback: Any) -> None:
    """Let one row enter its next node, and note what the caller has to do for that."""
    agent, following = int(rows.agent[row]), int(rows.cursor[row]) + 1
    nodes, origins, blend_offsets, _ = _plan(table, agent)
    scratch.may_move[row] = False
    scratch.extended[0] = row
    scratch.counts[EXTENDED] = 1
    rows.frame[row], _ = frame_of(graph, rows, row, playback)
    rows.state[row] = AgentState.MOVING
    rows.blocked_since[row] = NONE
    rows.next_node[row], rows.next_cursor[row] = nodes[following], following
    rows.next_origin[row], rows.next_blend_offset[row] = origins[following], blend_offsets[following]
    # Each row is reported: Python looks itself whether a search ends or begins.
    scratch.behind[0] = row
    scratch.counts[BEHIND] = 1 if rows.awaiting_plan[row] or len(nodes) - following <= NODES_LEFT else 0
