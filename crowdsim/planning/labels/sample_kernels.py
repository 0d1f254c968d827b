"""Samples of a path at equal steps, with the direction of motion and the behavior of each."""

from crowdsim.geometry.elementary_kernels import atan2
from crowdsim.jit import helper, kernel

_BORDER = 1e-9
"""Distance from a border of two sections within which a sample belongs to both [m]."""


@helper
def _piece_at(lengths, where, piece):
    """Return the last piece of a polyline, from ``piece`` on, that begins at or before the arc length ``where`` [m].

    ``lengths`` (n,) are the arc lengths of its points. Piece i begins at point i; n - 1 stands for the last point.
    """
    while piece + 1 < len(lengths) and lengths[piece + 1] <= where:
        piece += 1
    return piece


@helper
def _point_at(points, lengths, piece, where):
    """Return the point (x, y) at arc length ``where`` on ``piece``; beyond an end of the polyline, that end.

    ``points`` (n, 2) and ``lengths`` (n,) are its points and the arc lengths there [m].
    """
    if piece == len(lengths) - 1 or where <= lengths[piece]:
        return points[piece, 0], points[piece, 1]
    away, whole = where - lengths[piece], lengths[piece + 1] - lengths[piece]
    x, y = points[piece, 0], points[piece, 1]
    return (points[piece + 1, 0] - x) / whole * away + x, (points[piece + 1, 1] - y) / whole * away + y


@kernel
def sample_path(points, lengths, starts, labels, reach, pose, arc, behavior):
    """Fill the samples of a path: pose (m, 3), arc (m,) and behavior (m,) int32, as of `PathSamples`.

    points (n, 2) and lengths (n,): the polyline and the arc length at each point [m]. starts (s,) [m] and labels (s,)
    int32: where its sections begin, and their behaviors. reach: half length of the chord that gives the direction of
    motion at a sample [m].
    """
    count = len(arc)
    whole = lengths[-1]
    step = whole / (count - 1)
    # Pieces of the polyline at the sample and at both ends of its chord, and sections just before and behind it.
    here = back = ahead = 0
    before = after = 0
    for i in range(count):
        at = whole if i == count - 1 else i * step
        here = _piece_at(lengths, at, here)
        back = _piece_at(lengths, at - reach, back)
        ahead = _piece_at(lengths, at + reach, ahead)
        arc[i] = at
        pose[i, 0], pose[i, 1] = _point_at(points, lengths, here, at)
        # Direction of the chord, which smooths corners.
        bx, by = _point_at(points, lengths, back, at - reach)
        ax, ay = _point_at(points, lengths, ahead, at + reach)
        pose[i, 2] = atan2(ay - by, ax - bx)
        # At a border of two sections, a sample belongs to both and takes the narrower behavior, the one of less index.
        while before + 1 < len(starts) and starts[before + 1] <= at - _BORDER:
            before += 1
        while after + 1 < len(starts) and starts[after + 1] <= at + _BORDER:
            after += 1
        behavior[i] = min(labels[before], labels[after])
