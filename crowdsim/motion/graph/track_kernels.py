"""Position of an agent on its track: chaining of nodes, and fading of the blend offset between two nodes.

Units are meters and radians; a pose is (x, y, heading). ``graph`` is a
:class:`crowdsim.motion.graph.arrays.GraphArrays`.

``dx``, ``dy`` and ``dheading`` are a blend offset [m, rad].
"""

from crowdsim.geometry.elementary_kernels import cos_sin
from crowdsim.geometry.planar_kernels import compose, wrap_angle
from crowdsim.jit import kernel

BLEND_FRAMES = 12
"""Frames over which the difference between two joined nodes fades out (0.2 s). More: smoother, but feet slide
longer."""


@kernel
def blend_weight(frame):
    """Return the share of the blend offset left after ``frame`` frames: 1 at first, smoothly 0 at BLEND_FRAMES."""
    if frame >= BLEND_FRAMES:
        return 0.0
    u = frame / BLEND_FRAMES
    return 1.0 - u * u * (3.0 - 2.0 * u)


@kernel
def next_origin(graph, edge, twist, x, y, heading):
    """Return the world pose at which the target of ``edge`` starts, after a node that ends at (x, y, heading).

    twist: extra rotation about the planted foot, within the edge's range [rad].
    """
    tx = graph.edge_transform[edge, 0]
    ty = graph.edge_transform[edge, 1]
    px = graph.edge_pivot[edge, 0]
    py = graph.edge_pivot[edge, 1]
    # Turn the target's start about the pivot, in the frame of the source's end; then place it in the world.
    c, s = cos_sin(twist)
    lx = px + c * (tx - px) - s * (ty - py)
    ly = py + s * (tx - px) + c * (ty - py)
    return compose(x, y, heading, lx, ly, graph.edge_transform[edge, 2] + twist)


@kernel
def node_end(graph, node, x, y, heading):
    """Return the world pose of the last track sample of ``node`` if it starts at (x, y, heading)."""
    return compose(x, y, heading, graph.node_motion[node, 0], graph.node_motion[node, 1], graph.node_motion[node, 2])


@kernel
def track_pose(graph, node, frame, x, y, heading, dx, dy, dheading):
    """Return the world track pose of an agent ``frame`` frames into ``node``.

    frame: whole number, 0 to the node's ``node_frames``. (x, y, heading) is the node's origin. (dx, dy, dheading) is
    the blend offset: the end of the node before less this origin, 0 if there is none. It fades out by
    :func:`blend_weight`.
    """
    row = graph.node_track[node] + frame
    px, py, ph = compose(x, y, heading, graph.tracks[row, 0], graph.tracks[row, 1], graph.tracks[row, 2])
    # The faded blend offset keeps the track continuous.
    w = blend_weight(frame)
    return px + w * dx, py + w * dy, wrap_angle(ph + w * dheading)


@kernel
def track_pose_between(graph, node, frame, part, x, y, heading, dx, dy, dheading):
    """Return :func:`track_pose` at ``part`` [0, 1) of the way from ``frame`` to the next frame.

    In the last frame of a node, which has no next one, ``part`` does not count.
    """
    # Interpolate linearly, the heading the shorter way around.
    ax, ay, ah = track_pose(graph, node, frame, x, y, heading, dx, dy, dheading)
    if part <= 0.0 or frame >= graph.node_frames[node]:
        return ax, ay, ah
    bx, by, bh = track_pose(graph, node, frame + 1, x, y, heading, dx, dy, dheading)
    return ax + part * (bx - ax), ay + part * (by - ay), wrap_angle(ah + part * wrap_angle(bh - ah))
