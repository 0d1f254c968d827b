"""Slow, obvious twins of the crowd's kernels."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np

from crowdsim.crowd.state.components import BEND, CORE, QUARTERS, RADIUS, REST, SAMPLE, SLOT_FRAMES
from crowdsim.crowd.state.reservation_kernels import ELBOW_ROOM
from crowdsim.crowd.state.timelines import Playback
from crowdsim.geometry.planar import compose, wrap_angle
from crowdsim.motion.graph.arrays import GraphArrays
from crowdsim.motion.graph.track_kernels import BLEND_FRAMES

FOREVER = int(np.iinfo(np.int64).max)


def walking_graph() -> GraphArrays:
    """Return four nodes: 0 idle, 1 start, 2 stride (curving left), 3 stop; 1.2 m/s, one behavior."""
    lengths = np.array([30, 40, 60, 36], np.int32)
    tracks = []
    for node, frames in enumerate(lengths):
        u = np.arange(frames + 1) / 60.0
        x = {0: 0 * u, 1: 0.9 * u**2, 2: 1.2 * u, 3: 1.2 * u - 1.0 * u**2}[node]
        heading = 0.15 * u if node == 2 else 0 * u
        tracks.append(np.column_stack([x, 0.05 * x**2 if node == 2 else 0 * x, heading]))
    first = np.concatenate([[0], np.cumsum([len(t) for t in tracks])[:-1]]).astype(np.int32)
    edges = {0: [0, 1], 1: [2, 3], 2: [2, 3], 3: [0]}
    targets = [target for node in range(4) for target in edges[node]]
    count = len(targets)
    transforms = np.zeros((count, 3))
    transforms[:, 0] = 0.01
    transforms[:, 2] = 0.02
    return GraphArrays(
        node_frames=lengths,
        node_track=first,
        tracks=np.concatenate(tracks),
        node_motion=np.array([t[-1] for t in tracks]),
        node_length=np.array([np.hypot(*np.diff(t[:, :2], axis=0).T).sum() for t in tracks]),
        node_behavior=np.zeros(4, np.int32),
        node_ends_standing=np.array([True, False, False, True]),
        node_idle=np.array([True, False, False, False]),
        edge_start=np.cumsum([0] + [len(edges[node]) for node in range(4)]).astype(np.int32),
        edge_target=np.array(targets, np.int32),
        edge_transform=transforms,
        edge_pivot=np.zeros((count, 2)),
        edge_low=np.full(count, -0.1),
        edge_high=np.full(count, 0.1),
        stop_edge=np.array([-1, 3, 5, -1], np.int32),
    )


def chain_of(graph: GraphArrays, nodes: list[int], start: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return origins and blend offsets (n, 3) of nodes joined by their first matching edges, without extra rotation."""
    origins, blend_offsets = [start], [np.zeros(3)]
    for before, node in pairwise(nodes):
        row = range(graph.edge_start[before], graph.edge_start[before + 1])
        edge = next(e for e in row if graph.edge_target[e] == node)
        end = compose(origins[-1], graph.node_motion[before])
        origins.append(compose(end, graph.edge_transform[edge]))
        blend_offset = end - origins[-1]
        blend_offset[2] = wrap_angle(blend_offset[2])
        blend_offsets.append(blend_offset)
    return np.array(origins), np.array(blend_offsets)


def pose_at(
    graph: GraphArrays, nodes: list[int], origins: np.ndarray, blend_offsets: np.ndarray, frame: float
) -> np.ndarray:
    """Return the track pose ``frame`` frames after the start of a chain; after its end, the last pose."""
    if frame % 1.0:
        before, after = (pose_at(graph, nodes, origins, blend_offsets, int(frame) + k) for k in range(2))
        turn = wrap_angle(after[2] - before[2])
        return before + frame % 1.0 * np.array([*(after - before)[:2], turn])
    frame = int(frame)
    for node, origin, blend_offset in zip(nodes, origins, blend_offsets, strict=True):
        length = int(graph.node_frames[node])
        if frame < length or node is nodes[-1]:
            at = min(frame, length)
            pose = compose(origin, graph.tracks[graph.node_track[node] + at])
            u = min(at / BLEND_FRAMES, 1.0)
            return pose + (1.0 - u * u * (3.0 - 2.0 * u)) * blend_offset
        frame -= length
    raise AssertionError("a chain has at least one node")


def ticks_one_by_one(playback: Playback, steps: int) -> list[int]:
    """Return the ticks of a chain that are played after 0, 1, 2, ... steps, from the shown frame on."""
    rate, ticks, played = playback.rate, playback.part, [playback.part]
    for _ in range(steps):
        change = playback.wanted - rate
        rate += max(min(change, playback.ramp), -playback.ramp)
        ticks += rate
        played.append(ticks)
    return played


def discs_along(tracks: np.ndarray, radius: float) -> np.ndarray:
    """Return timeline samples (..., 13) of an agent that follows tracks (..., 2) as a disc [m]."""
    samples = np.zeros((*tracks.shape[:-1], SAMPLE))
    samples[..., :2], samples[..., RADIUS] = tracks, radius
    return samples


def write_bends(timeline: np.ndarray, clock: int, half: float, pose: Callable[[int], np.ndarray]) -> None:
    """Write to each sample (K, 13) how far a body comes off its straight motion to the next one, at any later frame.

    ``pose(frame)`` is where it is ``frame`` frames after the clock, ``half`` the half length of its core.
    """
    timeline[:, BEND:] = 0.0
    frames = np.arange(SLOT_FRAMES + 1)
    for k, (here, there) in enumerate(pairwise(timeline)):
        offs, turned = np.zeros((len(frames), 2)), np.zeros(len(frames))
        for inside in frames[1:-1]:
            later = (clock // SLOT_FRAMES + k) * SLOT_FRAMES + inside - clock
            if later > 0:
                straight = here + inside / SLOT_FRAMES * (there - here)
                x, y, heading = pose(int(later))
                core = half * np.array([-np.sin(heading), np.cos(heading)])
                offs[inside], turned[inside] = [x, y] - straight[:2], np.hypot(*(core - straight[CORE : CORE + 2]))
        quarters = frames[:: SLOT_FRAMES // 4]
        pieces = np.column_stack([np.interp(frames, quarters, offs[quarters, axis]) for axis in range(2)])
        timeline[k, BEND] = (np.hypot(*offs.T) + turned).max()
        timeline[k, QUARTERS:REST] = offs[quarters[1:-1]].ravel()
        timeline[k, REST] = (np.hypot(*(offs - pieces).T) + turned).max()


def discs_at(timeline, slot: float) -> tuple[np.ndarray, float]:
    """Return the centers (41, 2) of a body's discs at a slot, and their radius, that of the broader sample beside.

    Between a capsule and a disc it is a disc around both.
    """
    samples, start, _ = timeline
    u = np.clip(slot - start, 0, len(samples) - 1)
    low = int(np.floor(u))
    high = min(low + 1, len(samples) - 1)
    at = samples[low] + (u - low) * (samples[high] - samples[low])
    radius = max(samples[low, RADIUS], samples[high, RADIUS]) if u > low else samples[low, RADIUS]
    cores = np.hypot(*samples[[low, high], CORE : CORE + 2].T)
    if u > low and (cores == 0.0).sum() == 1:
        at[CORE : CORE + 2], radius = 0.0, (samples[[low, high], RADIUS] + cores).max()
    return at[:2] + np.linspace(-1.0, 1.0, 41)[:, None] * at[CORE : CORE + 2], float(radius)


def timelines_meet(a, b, first_slot: int, at_rest: float, room: float = 0.0) -> bool:
    """Return whether the gap of two timelines (samples (K, 13), start, gone) is ever less than ``room``.

    Sampled densely. A pair that already overlaps, or is already nearer at rest, counts only if it gets worse.
    """

    def gap(slot: float) -> float:
        mine, my_radius = discs_at(a, slot)
        its, its_radius = discs_at(b, slot)
        return float(np.linalg.norm(mine[:, None] - its, axis=-1).min() - my_radius - its_radius)

    last = max(a[1] + len(a[0]), b[1] + len(b[0]))
    if first_slot >= min(a[2], b[2]):
        return False
    now = np.linalg.norm(discs_at(a, first_slot)[0][20] - discs_at(b, first_slot)[0][20])
    rest = np.linalg.norm(a[0][-1, :2] - b[0][-1, :2])
    if min(a[2], b[2]) == FOREVER and rest < min(at_rest + ELBOW_ROOM, now - 1e-6):
        return True
    least = min(gap(first_slot) - 1e-6, 0.0) + room
    for slot in np.arange(first_slot, last, 0.01):
        if np.floor(slot) >= min(a[2], b[2]):
            return False
        if gap(slot) < least:
            return True
    return False


def off_way(way: np.ndarray, point: np.ndarray) -> tuple[float, np.ndarray]:
    """Return the distance from a point to a polyline (P, 2), and the nearest of its segments as a vector."""
    best = np.inf, np.zeros(2)
    for a, b in pairwise(way):
        along = b - a
        share = np.clip((point - a) @ along / max(along @ along, 1e-300), 0.0, 1.0)
        best = min(best, (float(np.linalg.norm(a + share * along - point)), along), key=lambda entry: entry[0])
    return best
