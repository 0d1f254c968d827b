"""Where a character is on its track: node chaining and the fading of the seam between two nodes.

Units are meters and radians; a pose is (x, y, heading).
"""

from crowdsim.geometry.elementary_kernels import cos_sin
from crowdsim.geometry.planar_kernels import compose, wrap_angle
from crowdsim.jit import kernel

BLEND_FRAMES = 12
"""Frames over which the difference between two joined nodes fades out (0.2 s)."""


@kernel
def blend_weight(frame):
    """Share of the old node left ``frame`` frames after a seam: 1 at the seam, smoothly 0 at BLEND_FRAMES."""
    if frame >= BLEND_FRAMES:
        return 0.0
    u = frame / BLEND_FRAMES
    return 1.0 - u * u * (3.0 - 2.0 * u)


@kernel
def next_origin(graph, edge, twist, x, y, heading):
    """World pose at which the target of ``edge`` starts, after a node that ends at (x, y, heading).

    ``twist`` (radians) is the extra rotation about the planted foot, within the edge's range.
    """
    tx = graph.edge_transform[edge, 0]
    ty = graph.edge_transform[edge, 1]
    px = graph.edge_pivot[edge, 0]
    py = graph.edge_pivot[edge, 1]
    c, s = cos_sin(twist)
    lx = px + c * (tx - px) - s * (ty - py)
    ly = py + s * (tx - px) + c * (ty - py)
    return compose(x, y, heading, lx, ly, graph.edge_transform[edge, 2] + twist)


@kernel
def node_end(graph, node, x, y, heading):
    """World pose of the last track sample of ``node`` that starts at (x, y, heading)."""
    return compose(x, y, heading, graph.node_motion[node, 0], graph.node_motion[node, 1], graph.node_motion[node, 2])


@kernel
def track_pose(graph, node, frame, x, y, heading, dx, dy, dheading):
    """World track pose of a character ``frame`` frames into ``node``.

    (x, y, heading) is the node's origin; (dx, dy, dheading) is the seam: the end of the node before
    minus this origin, zero where there was none. It fades out by :func:`blend_weight`.
    """
    row = graph.node_track[node] + frame
    px, py, ph = compose(x, y, heading, graph.tracks[row, 0], graph.tracks[row, 1], graph.tracks[row, 2])
    w = blend_weight(frame)
    return px + w * dx, py + w * dy, wrap_angle(ph + w * dheading)


@kernel
def track_pose_between(graph, node, frame, part, x, y, heading, dx, dy, dheading):
    """:func:`track_pose`, ``part`` [0, 1) of the way from ``frame`` to the next one; the last frame has no next one."""
    ax, ay, ah = track_pose(graph, node, frame, x, y, heading, dx, dy, dheading)
    if part <= 0.0 or frame >= graph.node_frames[node]:
        return ax, ay, ah
    bx, by, bh = track_pose(graph, node, frame + 1, x, y, heading, dx, dy, dheading)
    return ax + part * (bx - ax), ay + part * (by - ay), wrap_angle(ah + part * wrap_angle(bh - ah))
