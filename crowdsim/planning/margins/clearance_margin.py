"""Shift a path away from obstacles where there is room.

The cheapest path touches corners at exactly the clearance of its behaviors, but motions follow it only approximately.
Stations along the path may shift to either side; dynamic programming chooses the shifts that minimize length times the
cost of the behavior that fits, plus a price for each station that lacks margin.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from crowdsim.geometry.elementary import hypot
from crowdsim.navmesh.clearance.sweep_kernels import are_free
from crowdsim.navmesh.mesh.address_kernels import layers_of
from crowdsim.planning.labels.annotated_path import AnnotatedPath, arc_lengths
from crowdsim.planning.query.query import Query
from crowdsim.planning.query.requirements import CONTACT_TOLERANCE

STATION = 0.12
"""Largest distance between stations [m]."""

MARGIN = 0.1
"""Clearance beyond the planned one that a path takes if it costs (almost) nothing [m]."""

SHIFTS = MARGIN * np.linspace(-1.0, 1.0, 9)
"""Shifts of a station to the left, negative to the right [m]."""

MARGIN_PRICE = 0.1
"""Price of lacking the whole margin, as a share of the preferred behavior's cost per meter. Higher: wider detours."""

MARGIN_WORTH = 0.03
"""Largest share of the path's cost that the margin may add altogether."""

_CHORD = 0.01
"""Spare clearance of shifted stations for the straight pieces between them [m]."""

_ROOMY = 1e-6
"""Clearance beyond the margin that skips the search at once [m]; covers rounded coordinates."""

_ROUNDS = 4
"""Largest number of attempts; after each, stations whose straight pieces cut a corner keep their places."""

_STAY = len(SHIFTS) // 2
"""Index of no shift in SHIFTS."""


def with_clearance_margin(query: Query, path: AnnotatedPath) -> AnnotatedPath:
    """Return the route with more clearance if there is room: through the middle of gaps, wide around corners.

    It is ``path`` itself if it is too short to shift, if nothing is to be gained, if the shifted path fits no behavior
    somewhere or costs more by a share above MARGIN_WORTH, or if pieces still cut corners after _ROUNDS attempts.
    """
    # Too short: at most one station lies between the ends, which do not shift.
    if path.length < 2.0 * STATION:
        return path
    # One cheap sweep: if the whole path has the margin already, nothing can be gained.
    pieces = np.concatenate([path.points[:-1], path.points[1:]], axis=1)
    layers = layers_of(query.meshes)
    if are_free(layers, query.need.radii.max(axis=0) + MARGIN + _ROOMY, pieces):
        return path
    # Places of each station (n, shifts, 2), along the normal of the chord between its neighbors.
    arc = np.linspace(0.0, path.length, int(np.ceil(path.length / STATION)) + 1)
    along = path.at(arc + STATION) - path.at(arc - STATION)
    normal = np.stack([-along[:, 1], along[:, 0]], axis=1) / hypot(*along.T)[:, None]
    places = path.at(arc)[:, None] + SHIFTS[:, None] * normal[:, None]
    prices = _prices(query, places)
    if prices is None:
        return path
    steps = hypot(*(places[1:, None, :, :] - places[:-1, :, None, :]).transpose(3, 0, 1, 2))
    legs, radius = query.meshes[0], query.need.search_radius - CONTACT_TOLERANCE
    for _ in range(_ROUNDS):
        chosen = _cheapest_shifts(prices, steps)
        if (chosen == _STAY).all():
            return path
        points, first = _shifted(path, arc, places, chosen)
        tight = legs.violations(points, radius)
        if not len(tight):
            roomy = query.annotated(points)
            return roomy if roomy.sections and roomy.cost <= path.cost * (1.0 + MARGIN_WORTH) else path
        # A straight piece between stations cuts a corner there: these stations keep their places.
        at = arc_lengths(points)[first]
        for low, high in tight.tolist():
            begin, end = np.searchsorted(at, [low, high])
            prices[max(begin - 1, 0) : end + 1, np.arange(len(SHIFTS)) != _STAY] = np.inf
    return path


def _prices(query: Query, places: NDArray[np.float64]) -> NDArray[np.float64] | None:
    """Return the cost per meter (n, shifts) at each of ``places`` (n, shifts, 2); None if every station has the margin.

    Only stations near one that lacks margin may shift. Their places cost the least sum, over the behaviors that fit, of
    a behavior's cost and the price of the margin that it lacks. If no behavior fits, a shifted place costs infinity,
    and a station's own place as much as the narrowest behavior. Own places of the other stations cost as much as the
    preferred behavior. Their shifted places cost infinity, and so do those of both ends of the path.
    """
    need = query.need
    reach = need.radii.max(axis=0) + MARGIN
    roomy = np.ones(len(places), np.bool_)
    for mesh, limit in zip(query.meshes, reach.tolist(), strict=True):
        roomy &= mesh.clearances(places[:, _STAY], limit) >= limit
    if roomy.all():
        return None
    # Stations within three of one that lacks margin may have to shift as well.
    close = np.flatnonzero(np.lib.stride_tricks.sliding_window_view(np.pad(~roomy, 3), 7).any(axis=1))
    room = np.full((len(close), len(SHIFTS), need.count), np.inf)
    for layer, mesh in enumerate(query.meshes):
        clear = mesh.clearances(places[close].reshape(-1, 2), float(reach[layer]))
        room = np.minimum(room, clear.reshape(len(close), -1, 1) - need.radii[:, layer])
    # A station that stays is on the path, which touches by at most the tolerance; a shifted one must leave room for the
    # straight line between two stations.
    least = np.where(np.arange(len(SHIFTS)) == _STAY, -2.0 * CONTACT_TOLERANCE, _CHORD)[:, None]
    lack = need.costs[-1] * MARGIN_PRICE * (1.0 - np.clip(room / MARGIN, 0.0, 1.0))
    prices = np.full(places.shape[:2], np.inf)
    prices[:, _STAY] = need.costs[-1]
    prices[close] = np.where(room >= least, need.costs + lack, np.inf).min(axis=2)
    # The path itself is always possible, at worst with the narrowest behavior. Its ends do not shift.
    stays = prices[:, _STAY]
    stays[np.isinf(stays)] = need.costs[0]
    prices[[0, -1]] = np.where(np.arange(len(SHIFTS)) == _STAY, prices[[0, -1]], np.inf)
    return prices


def _cheapest_shifts(prices: NDArray[np.float64], steps: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return indices (n,) of the shifts with the least sum of length times mean price, by Bellman's recursion.

    prices: (n, shifts) cost per meter at each place of each station, infinite if a place may not be taken; the first
    and the last station stay. steps: (n - 1, shifts, shifts) distance from each place of a station (second axis) to
    each place of the next one (third axis) [m].
    """
    before = np.full(steps.shape[:2], _STAY)
    # The first station's shifted places have infinite prices, so all may begin at 0.
    total = np.zeros(len(SHIFTS))
    every = np.arange(len(SHIFTS))
    # Between two stations that can only stay there is nothing to choose.
    free = np.isfinite(prices).sum(axis=1) > 1
    pieces = np.flatnonzero(free[:-1] | free[1:])
    costs = 0.5 * (prices[pieces, :, None] + prices[pieces + 1, None, :]) * steps[pieces]
    # total: least cost up to station k by its place; before[k]: the place of station k on the way to each place of the
    # next one.
    for k, cost in zip(pieces.tolist(), costs, strict=True):
        sums = cost + total[:, None]
        best = before[k] = sums.argmin(axis=0)
        total = sums[best, every]
    chosen = np.full(len(prices), _STAY)
    for k in range(len(before) - 1, -1, -1):
        chosen[k] = before[k, chosen[k + 1]]
    return chosen


def _shifted(
    path: AnnotatedPath, arc: NDArray[np.float64], places: NDArray[np.float64], chosen: NDArray[np.int64]
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return the path through its shifted stations, and the indices of its points that are stations.

    Between two stations that do not shift, it is the path itself. arc: (n,) arc length of each station [m]. places: (n,
    shifts, 2) where it may be [m]. chosen: (n,) index of its shift.
    """
    stays = chosen == _STAY
    # own: the station at or before each vertex of the path. kept: vertices between two stations that stay, unless one
    # of these is the vertex itself.
    own = np.searchsorted(arc, path.arc, side="right") - 1
    own = np.minimum(own, len(arc) - 2)
    kept = stays[own] & stays[own + 1] & (path.arc > arc[own] + 1e-9) & (path.arc < arc[own + 1] - 1e-9)
    points = np.concatenate([places[np.arange(len(arc)), chosen], path.points[kept]])
    order = np.argsort(np.concatenate([arc, path.arc[kept]]), kind="stable")
    rank = np.empty(len(order), np.int64)
    rank[order] = np.arange(len(order))
    return np.ascontiguousarray(points[order]), rank[: len(arc)]


def joined(pieces: list[NDArray[np.float64]]) -> NDArray[np.float64]:
    """Concatenate polylines (n, 2) [m] and drop points that repeat the one before."""
    points = np.concatenate(pieces)
    keep = np.append(True, hypot(*np.diff(points, axis=0).T) > 1e-9)
    return np.ascontiguousarray(points[keep])
