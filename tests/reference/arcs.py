"""Slow, obvious twins of chains of arcs."""

import cmath
import itertools
import math

import numpy as np


def arc_length(points) -> float:
    """Return the length of the chain of arcs (n, 3)."""
    return sum(_length(p, q) for p, q in itertools.pairwise(points))


def sampled(points, step: float):
    """Return arc lengths (k,) and places (k, 2) about every ``step`` meters along the chain of arcs (n, 3)."""
    at, places, before = [], [], 0.0
    for p, q in itertools.pairwise(points):
        length = _length(p, q)
        parts = (np.arange(max(1, math.ceil(length / step))) + 0.5) / max(1, math.ceil(length / step))
        at.append(before + parts * length)
        places.append([_place(p, q, part) for part in parts])
        before += length
    return np.concatenate(at), np.concatenate(places)


def _length(p, q) -> float:
    chord, angle = math.dist(p[:2], q[:2]), 4.0 * math.atan(p[2])
    return chord if angle == 0.0 else chord * 0.5 * angle / math.sin(0.5 * angle)


def _place(p, q, part: float):
    """Return the place at ``part`` of an arc by summing unit tangents, whose angle changes at a constant rate."""
    chord, angle = complex(q[0] - p[0], q[1] - p[1]), 4.0 * math.atan(p[2])
    if angle == 0.0:
        z = part * chord
    else:
        z = chord * (cmath.exp(1j * angle * part) - 1.0) / (cmath.exp(1j * angle) - 1.0)
    return p[0] + z.real, p[1] + z.imag
