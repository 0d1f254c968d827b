"""A motion graph drawn with ruler and compass: straights, arcs, turns in place, side steps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from crowdsim.motion.graph.arrays import GraphArrays

Floats = NDArray[np.float64]
SPEED = 1.3
LATERAL, ARMS_HELD, FRONTAL = 0, 1, 2
RADII = np.array([[0.17, 0.17], [0.17, 0.26], [0.17, 0.32]])
FACINGS = np.array([[np.pi / 2, -np.pi / 2], [0.0, np.nan], [0.0, np.nan]])
RANGE = {"C": np.radians(8.0), "Ch": np.radians(8.0), "S": np.radians(4.0), "Sh": np.radians(4.0)}


@dataclass(frozen=True)
class Piece:
    """Movement from one hub pose to another along ``track`` (L + 1, 3)."""

    name: str
    behavior: int
    begin: str
    end: str
    track: Floats
    idle: bool = False


def arc_track(length: float, turn: float) -> Floats:
    """Walk ``length`` meters while turning by ``turn`` radians evenly."""
    frames = max(8, round(60 * length / SPEED))
    u = np.linspace(0.0, 1.0, frames + 1)
    heading = turn * u
    if abs(turn) < 1e-9:
        return np.column_stack([length * u, np.zeros_like(u), heading])
    radius = length / turn
    return np.column_stack([radius * np.sin(heading), radius * (1.0 - np.cos(heading)), heading])


def turn_track(turn: float) -> Floats:
    """Turn on the spot."""
    u = np.linspace(0.0, 1.0, 40 + round(30 * abs(turn)) + 1)
    return np.column_stack([np.zeros_like(u), np.zeros_like(u), turn * u])


def side_track(step: float) -> Floats:
    """Step ``step`` meters to the left (right where negative), facing ahead."""
    u = np.linspace(0.0, 1.0, 37)
    return np.column_stack([np.zeros_like(u), step * u, np.zeros_like(u)])


def swing_track(length: float, begin: float, end: float) -> Floats:
    """Move ``length`` meters straight while the heading relative to that way goes from ``begin`` to ``end``."""
    u = np.linspace(0.0, 1.0, max(30, round(60 * length / SPEED)) + 1)
    c, s = np.cos(-begin), np.sin(-begin)
    return np.column_stack([c * length * u, s * length * u, (end - begin) * u])


def pieces() -> list[Piece]:
    """The whole set: walking free and with arms held, standing, turning, stepping sideways, and the ways between."""
    found = []
    for behavior, c, s in ((FRONTAL, "C", "S"), (ARMS_HELD, "Ch", "Sh")):
        found += [Piece(f"straight {length} {c}", behavior, c, c, arc_track(length, 0.0)) for length in (1.4, 1.0)]
        for degrees in (10, 20, 45, 90, -10, -20, -45, -90):
            found.append(Piece(f"turn {degrees} {c}", behavior, c, c, arc_track(1.4, np.radians(degrees))))
            if abs(degrees) in (20, 45):
                found.append(Piece(f"short turn {degrees} {c}", behavior, c, c, arc_track(1.0, np.radians(degrees))))
        found.append(Piece(f"start {s}", behavior, s, c, arc_track(0.8, 0.0)))
        found.append(Piece(f"stop {c}", behavior, c, s, arc_track(0.7, 0.0)))
        found += [Piece(f"step {length} {s}", behavior, s, s, arc_track(length, 0.0)) for length in (0.3, 0.6)]
        found += [
            Piece(f"turn in place {degrees} {s}", behavior, s, s, turn_track(np.radians(degrees)))
            for degrees in (15, 30, 60, 90, -15, -30, -60, -90, 180)
        ]
        found.append(Piece(f"idle {s}", behavior, s, s, np.zeros((61, 3)), idle=True))
    found.append(Piece("hold arms", FRONTAL, "C", "Ch", arc_track(1.3, 0.0)))
    found.append(Piece("free arms", FRONTAL, "Ch", "C", arc_track(1.3, 0.0)))
    found.append(Piece("hold arms standing", FRONTAL, "S", "Sh", np.zeros((41, 3))))
    found.append(Piece("free arms standing", FRONTAL, "Sh", "S", np.zeros((41, 3))))
    found += [Piece(f"side {step}", LATERAL, "S", "S", side_track(step)) for step in (0.4, 0.2, -0.4, -0.2)]
    for sign in (1, -1):
        found.append(Piece(f"walk to side {sign}", FRONTAL, "C", "S", swing_track(0.7, 0.0, sign * np.pi / 2)))
        found.append(Piece(f"side to walk {sign}", FRONTAL, "S", "C", swing_track(0.8, sign * np.pi / 2, 0.0)))
    return found


def graph_of(parts: list[Piece]) -> GraphArrays:
    """Every piece may follow every piece that ends in the pose it begins in."""
    frames = np.array([len(p.track) - 1 for p in parts], np.int32)
    first = np.concatenate([[0], np.cumsum(frames[:-1] + 1)]).astype(np.int32)
    targets = [[j for j, q in enumerate(parts) if q.begin == p.end] for p in parts]
    degrees = [len(t) for t in targets]
    target = np.concatenate([np.array(t, np.int32) for t in targets])
    source = np.repeat(np.arange(len(parts)), degrees)
    limit = np.array([RANGE[parts[i].end] for i in source])
    wobble = 0.004 * np.column_stack([np.sin(source), np.cos(target), np.sin(source + target)])
    return GraphArrays(
        node_frames=frames,
        node_track=first,
        tracks=np.concatenate([p.track for p in parts]),
        node_motion=np.array([p.track[-1] for p in parts]),
        node_length=np.array([np.linalg.norm(np.diff(p.track[:, :2], axis=0), axis=1).sum() for p in parts]),
        node_behavior=np.array([p.behavior for p in parts], np.int32),
        node_ends_standing=np.array([p.end.startswith("S") for p in parts]),
        node_idle=np.array([p.idle for p in parts]),
        edge_start=np.concatenate([[0], np.cumsum(degrees)]).astype(np.int32),
        edge_target=target,
        edge_transform=wobble,
        edge_pivot=np.tile([0.05, 0.09], (len(target), 1)),
        edge_low=-limit,
        edge_high=limit,
        stop_edge=np.full(len(parts), -1, np.int32),
    )
