"""A* on a motion graph with collision tests or within a channel, and inverse branch kinematics (2011 paper, 5 and 6).

The search of both papers that motion maps are measured against, and the one that reaches a place exactly.
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
    """What a search holds to.

    goal_tolerance: meters from the goal within which a node must end (the papers' d).
    heading_tolerance: radians, for goals with a heading.
    on_the_way: whether it is enough that a node passes within the tolerance, as the path follower asks.
    end_standing: whether the last node must end standing.
    branch_kinematics: whether branches that end near the goal are bent to reach it.
    bend_reach: meters from the goal within which that is tried (d_o).
    arrival: meters from the goal within which a bent branch must end (d_i).
    heading_lever: meters a radian, by which bending weighs an error of heading, for goals with one.
    weight: of the distance to the goal against that walked. With 1 a plain search finds the shortest motion; with more
        it finds one that is longer by that factor at most, sooner.
    place_grain, heading_grain: meters and radians within which two ends of one node count as the same.
    budget: nodes expanded until the search gives up.
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

    nodes, edges: (K,) int32, edge taken into each node, -1 for the first. twists: (K,) radians of extra rotation at
    that edge. origins: (K, 3) world pose where each node starts. length: meters along all of them. gap: meters from
    the last one's end to the goal. bent: whether branch kinematics made the solution. expansions: nodes expanded.
    collision_tests: discs tested on a mesh. channel_tests: places tested in the channel. bends: chains bent.
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
    channel_tests: int
    bends: int


class _Rules(NamedTuple):
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
    """What a body is tested in, with its probes, what is counted, and a hint of each mesh, (2,) int64."""

    probes: Probes
    channel: Channel
    legs: MeshArrays
    torso: MeshArrays
    counters: NDArray[np.int64]
    hints: NDArray[np.int64]


class _Tree(NamedTuple):
    """Nodes that wait in a queue, in the order of ``heap``; rows of those that were laid; the closed set of these."""

    heap: NDArray[np.void]
    waiting: NDArray[np.int32]
    link: NDArray[np.int32]
    place: Floats
    closed: NDArray[np.int64]


class _Chain(NamedTuple):
    joint: Floats
    limit: Floats
    turn: Floats
    end: Floats


class _Out(NamedTuple):
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
    """Find a short motion from a pose to a place by A* over the graph unrolled.

    Parameters
    ----------
    graph, probes: the motion graph, and where a body is tested in each of its nodes.
    start_pose: (3,) where the first node starts. start_node: that node, taken as being played already and not tested;
        -1 to choose one.
    goal: x, y in meters, or x, y and a heading.
    channel: what the body must stay within. meshes: kernel arrays of the legs' and the torso's mesh, where every
        probe must be free. With neither the floor is open; with both, both hold.

    Raises
    ------
    MotionError: where numbers do not fit.

    Safe to call from several threads at once.
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
        raise MotionError(f"a search weighs the distance to the goal by 1 or more, not {options.weight}")
    if options.budget < 1 or not (options.place_grain >= 0.001 and options.heading_grain >= 0.02):
        raise MotionError("a search needs a budget of one node, and grains of a millimeter and 0.02 radians, or more")
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
        channel_tests=int(space.counters[columns.CHANNEL_TESTS]),
        bends=int(space.counters[columns.BENDS]),
    )


def _length(graph: GraphArrays, nodes: NDArray[np.int32], origins: Floats) -> float:
    """Meters along the tracks of a chain of nodes and across the seams between them."""
    seams = compose(origins[:-1], graph.node_motion[nodes[:-1]])[:, :2] - origins[1:, :2]
    return float(graph.node_length[nodes].sum() + hypot(*seams.T).sum())


def _as_goal(goal: ArrayLike) -> Floats:
    """(3,) x, y and heading, nan where any will do."""
    given = np.array(goal, np.float64)
    if given.shape not in ((2,), (3,)) or not np.isfinite(given).all():
        raise MotionError(f"a goal is x, y or x, y and a heading, all finite, not {given}")
    return given if len(given) == 3 else np.append(given, np.nan)


def _rules(options: SearchOptions, channel: Channel | None, meshes: tuple[MeshArrays, MeshArrays] | None) -> _Rules:
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
    """Room for the most that can happen; what is never touched takes no memory."""
    room = len(graph.node_frames) + budget * int(np.diff(graph.edge_start).max(initial=0))
    return _Tree(
        np.empty(room, HEAP_ROW),
        np.empty((room, 2), np.int32),
        np.empty((budget, 3), np.int32),
        np.empty((budget, columns.PLACE_COLUMNS)),
        np.zeros(1 << (4 * budget).bit_length(), np.int64),
    )


def _space(probes: Probes, channel: Channel | None, meshes: tuple[MeshArrays, MeshArrays] | None) -> _Space:
    nowhere = _nowhere()
    counters, hints = np.zeros(columns.COUNTERS, np.int64), np.full(2, NONE, np.int64)
    return _Space(probes, channel or nowhere[0], *(meshes or nowhere[1]), counters, hints)


def _chain() -> _Chain:
    most = columns.MOST_BENT
    return _Chain(np.empty((most, 2)), np.empty((most, 2)), np.empty(most), np.empty(3))


@cache
def _nowhere() -> tuple[Channel, tuple[MeshArrays, MeshArrays]]:
    """What stands in for a channel or meshes that are not given, and is never looked at."""
    arrays = NavMesh(shapely.box(0.0, 0.0, 1.0, 1.0)).arrays
    return make_channel([(0.0, 0.0), (1.0, 0.0)], 0.1), (arrays, arrays)
