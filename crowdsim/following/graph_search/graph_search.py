"""A* on a motion graph with collision tests or in a channel, and inverse branch kinematics (2011 paper, sections 5, 6).

This is the search of both papers with which motion maps are compared, and one that arrives at a place exactly.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray

from crowdsim.constants import NONE
from crowdsim.errors import MotionError
from crowdsim.following.follower.follow_kernels import FOUND
from crowdsim.following.follower.path_follower import FollowStatus
from crowdsim.following.graph_search import graph_search_kernels as columns
from crowdsim.following.graph_search.channel import Channel, make_channel
from crowdsim.following.graph_search.probes import Probes
from crowdsim.geometry.elementary import distance, hypot
from crowdsim.geometry.planar import compose
from crowdsim.motion.graph.arrays import GraphArrays
from crowdsim.navmesh.mesh.heap_kernels import HEAP_ROW
from crowdsim.navmesh.mesh.mesh_arrays import MeshArrays
from crowdsim.navmesh.navmesh import NavMesh

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class SearchOptions:
    """Requirements and limits of a search.

    goal_tolerance: largest distance from the goal at which a node may end [m] (d in the papers).
    heading_tolerance: for goals with a heading [rad].
    on_the_way: True if it is enough that a node passes within the tolerance, as for the path follower.
    end_standing: True if the last node must end standing.
    branch_kinematics: True to bend branches that end near the goal so that they reach it.
    bend_reach: distance from the goal within which that is tried [m] (d_o).
    arrival: largest distance from the goal at which a bent branch may end [m] (d_i).
    heading_lever: weight of a heading error when bending, for goals with a heading [m/rad].
    weight: weight of the distance to the goal against the distance walked, at least 1. With 1 the shortest motion is
    found; with more, a motion is found sooner that is at most this many times as long as the shortest.
    place_grain, heading_grain: distances within which two ends of one node count as the same [m], [rad].
    budget: nodes expanded before the search gives up.
    """

    goal_tolerance: float = 0.1
    heading_tolerance: float = float(np.radians(15.0))
    on_the_way: bool = False
    end_standing: bool = False
    branch_kinematics: bool = True
    bend_reach: float = 0.5
    arrival: float = 0.001
    heading_lever: float = 0.4
    weight: float = 1.0
    place_grain: float = 0.1
    heading_grain: float = float(np.radians(15.0))
    budget: int = 20_000


@dataclass(frozen=True)
class SearchResult:
    """Nodes of the motion graph in order: a solution, or the chain that came nearest to the goal.

    nodes, edges: (K,) int32, each node and the edge taken into it, -1 for the first. twists: (K,) extra rotation at
    that edge [rad]. origins: (K, 3) world pose at the start of each node. length: of all nodes and blend offsets [m].
    gap: distance from the last end to the goal [m]. bent: True if branch kinematics made the solution. expansions:
    nodes expanded. collision_tests: discs tested on a mesh.
    """

    status: FollowStatus
    nodes: NDArray[np.int32]
    edges: NDArray[np.int32]
    twists: Floats
    origins: Floats
    length: float
    gap: float
    bent: bool
    expansions: int
    collision_tests: int


class _Rules(NamedTuple):
    """Options of the search for kernels: as of `SearchOptions`, and where bodies are tested."""

    in_channel: bool
    in_meshes: bool
    goal_tolerance: float
    heading_tolerance: float
    on_the_way: bool
    end_standing: bool
    bend_reach: float
    arrival: float
    heading_lever: float
    weight: float
    place_grain: float
    heading_grain: float
    budget: int


class _Space(NamedTuple):
    """Probes, and the channel and meshes in which they are tested.

    counters: (COUNTERS,), see :mod:`~crowdsim.following.graph_search.graph_search_kernels`. hints: (2,) a triangle near
    the last place on each mesh, -1 for none.
    """

    probes: Probes
    channel: Channel
    legs: MeshArrays
    torso: MeshArrays
    counters: NDArray[np.int64]
    hints: NDArray[np.int64]


class _Tree(NamedTuple):
    """Search nodes: those that wait in the queue, and those that are laid, at most ``budget``.

    heap: (w,) HEAP_ROW of :mod:`crowdsim.navmesh.mesh.heap_kernels`, the queue; its items are rows of ``waiting``.
    waiting: (w, 2). link: (budget, 3) and place: (budget, PLACE_COLUMNS), rows of laid nodes; for the columns see
    :mod:`~crowdsim.following.graph_search.graph_search_kernels`. closed: (2^k,) hash set of
    the laid ones, 0 in free slots.
    """

    heap: NDArray[np.void]
    waiting: NDArray[np.int32]
    link: NDArray[np.int32]
    place: Floats
    closed: NDArray[np.int64]


class _Chain(NamedTuple):
    """Joints to be bent, at most J, and the pose that they carry.

    joint: (J, 2) places [m]. limit: (J, 2) least and greatest turn [rad]. turn: (J,) present turn [rad]. end: (3,) x, y
    [m], heading [rad].
    """

    joint: Floats
    limit: Floats
    turn: Floats
    end: Floats


class _Out(NamedTuple):
    """Solution of at most K nodes: step (K, 2), node and edge into it; place (K, 4), origin and twist [m, rad]."""

    step: NDArray[np.int32]
    place: Floats


def search_graph(
    graph: GraphArrays,
    probes: Probes,
    start_pose: ArrayLike,
    start_node: int,
    goal: ArrayLike,
    *,
    channel: Channel | None = None,
    meshes: tuple[MeshArrays, MeshArrays] | None = None,
    options: SearchOptions | None = None,
) -> SearchResult:
    """Find a short motion from a pose to a place by A* over the unrolled graph. Safe to call from several threads.

    Parameters
    ----------
    graph, probes: motion graph, and the places at which a body is tested in each of its nodes.
    start_pose: (3,) x, y [m] and heading [rad] at which the first node starts.
    start_node: the first node, which is being played already and not tested; -1 to choose one.
    goal: x, y [m], or x, y and a heading [rad].
    channel: region that the body must not leave.
    meshes: kernel arrays of the legs' and the torso's mesh, on which every probe must be free. Without channel and
    meshes nothing is tested; with both, both apply.
    options: requirements and limits.

    Raises
    ------
    MotionError: if shapes do not match or a number is out of range.
    """
    options = options or SearchOptions()
    nodes = len(graph.node_frames)
    start = np.array(start_pose, np.float64)
    target = _as_goal(goal)
    if start.shape != (3,) or not np.isfinite(start).all():
        raise MotionError(f"a search starts at x, y and a heading, all finite, not at {start}")
    if not NONE <= start_node < nodes <= columns.MOST_NODES or len(probes.first) != nodes + 1:
        raise MotionError(
            f"start node {start_node} and probes of {len(probes.first) - 1} nodes do not fit a graph of {nodes} nodes "
            f"(at most {columns.MOST_NODES})"
        )
    if not options.weight >= 1.0:
        raise MotionError(f"the weight of the distance to the goal must be at least 1, not {options.weight}")
    if options.budget < 1 or not (options.place_grain >= 0.001 and options.heading_grain >= 0.02):
        raise MotionError("a search needs a budget of at least 1 node, and grains of at least 0.001 m and 0.02 rad")
    # The kernel writes nodes, edges and places of the solution to ``out``.
    rules = _rules(options, channel, meshes)
    space = _space(probes, channel, meshes)
    out = _Out(np.empty((rules.budget + 1, 2), np.int32), np.empty((rules.budget + 1, 4)))
    status, count, expanded = columns.search(
        graph, space, rules, start, int(start_node), target, _tree(graph, rules.budget), _chain(), out
    )
    found = out.step[:count]
    origins = out.place[:count, :3].copy()
    end = compose(origins[-1], graph.node_motion[found[-1, 0]]) if count else start
    return SearchResult(
        status=FollowStatus(status),
        nodes=found[:, 0].copy(),
        edges=found[:, 1].copy(),
        twists=out.place[:count, 3].copy(),
        origins=origins,
        length=_length(graph, found[:, 0], origins),
        gap=distance(end[:2], target[:2]),
        bent=status == FOUND and bool(space.counters[columns.BENT]),
        expansions=int(expanded),
        collision_tests=int(space.counters[columns.COLLISION_TESTS]),
    )


def _length(graph: GraphArrays, nodes: NDArray[np.int32], origins: Floats) -> float:
    """Return the length of nodes (K,) that begin at origins (K, 3): their tracks and the jumps between them [m]."""
    blend_offsets = compose(origins[:-1], graph.node_motion[nodes[:-1]])[:, :2] - origins[1:, :2]
    return float(graph.node_length[nodes].sum() + hypot(*blend_offsets.T).sum())


def _as_goal(goal: ArrayLike) -> Floats:
    """Return the goal as (3,) x, y [m] and heading [rad], nan if it has none.

    Raise MotionError if it is of another shape, or has numbers that are not finite.
    """
    given = np.array(goal, np.float64)
    if given.shape not in ((2,), (3,)) or not np.isfinite(given).all():
        raise MotionError(f"a goal is x, y or x, y and a heading, all finite, not {given}")
    return given if len(given) == 3 else np.append(given, np.nan)


def _rules(options: SearchOptions, channel: Channel | None, meshes: tuple[MeshArrays, MeshArrays] | None) -> _Rules:
    """Return the options in the form that kernels read; without branch kinematics ``bend_reach`` is 0: never bend."""
    return _Rules(
        in_channel=channel is not None,
        in_meshes=meshes is not None,
        goal_tolerance=float(options.goal_tolerance),
        heading_tolerance=float(options.heading_tolerance),
        on_the_way=bool(options.on_the_way),
        end_standing=bool(options.end_standing),
        bend_reach=float(options.bend_reach) if options.branch_kinematics else 0.0,
        arrival=float(options.arrival),
        heading_lever=float(options.heading_lever),
        weight=float(options.weight),
        place_grain=float(options.place_grain),
        heading_grain=float(options.heading_grain),
        budget=int(options.budget),
    )


def _tree(graph: GraphArrays, budget: int) -> _Tree:
    """Return empty arrays of the largest size possible; memory that is never written is never taken.

    All nodes may wait at first, and each of the ``budget`` nodes that are laid adds its edges. The last array is a hash
    table, with a power of two of slots of which at most a quarter is used.
    """
    room = len(graph.node_frames) + budget * int(np.diff(graph.edge_start).max(initial=0))
    return _Tree(
        np.empty(room, HEAP_ROW),
        np.empty((room, 2), np.int32),
        np.empty((budget, 3), np.int32),
        np.empty((budget, columns.PLACE_COLUMNS)),
        np.zeros(1 << (4 * budget).bit_length(), np.int64),
    )


def _space(probes: Probes, channel: Channel | None, meshes: tuple[MeshArrays, MeshArrays] | None) -> _Space:
    """Return channel and meshes in the form that kernels read, with stand-ins for those not given."""
    nowhere = _nowhere()
    counters, hints = np.zeros(columns.COUNTERS, np.int64), np.full(2, NONE, np.int64)
    return _Space(probes, channel or nowhere[0], *(meshes or nowhere[1]), counters, hints)


def _chain() -> _Chain:
    """Return empty arrays for the joints to be bent."""
    most = columns.MOST_BENT
    return _Chain(np.empty((most, 2)), np.empty((most, 2)), np.empty(most), np.empty(3))


@cache
def _nowhere() -> tuple[Channel, tuple[MeshArrays, MeshArrays]]:
    """Return a channel and meshes that stand in for those not given; kernels never read them."""
    arrays = NavMesh(shapely.box(0.0, 0.0, 1.0, 1.0)).arrays
    return make_channel([(0.0, 0.0), (1.0, 0.0)], 0.1), (arrays, arrays)
