"""Many searches between the same two places while obstacles come and go."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from crowdsim.errors import PathNotFound
from crowdsim.navmesh.editing import detour_kernels
from crowdsim.navmesh.editing.detour_kernels import DONE, NO_ROOM
from crowdsim.navmesh.paths.guide_kernels import GUIDE
from crowdsim.navmesh.paths.paths import TANGLED, Floats
from crowdsim.navmesh.paths.workspace import workspace

if TYPE_CHECKING:
    from crowdsim.navmesh.navmesh import NavMesh

_FARTHER = (1.05, 1.5)
"""How much longer than without obstacles ways are that the guide knows: a factor, and meters. Longer ones are found all
the same, but more is searched for them; and a guide that knows more takes longer to make."""


@dataclass(frozen=True, eq=False)
class Ways:
    """Paths as of `NavMesh.find_path`, one after the other."""

    points: Floats
    """(m, 2)"""
    ends: NDArray[np.int64]
    """(n,) path i is points[ends[i - 1] : ends[i]]; nothing where there is none."""
    lengths: Floats
    """(n,) meters, infinite where there is none."""

    def __getitem__(self, i: int) -> Floats:
        """The points (k, 2) of path i."""
        return self.points[self.ends[i - 1] if i > 0 else 0 : self.ends[i]]


class Detours:
    """A copy of a mesh that one thread may edit, and the paths in it between two places.

    After :meth:`aim`, obstacles may be put into :attr:`mesh`. They only make ways longer, so the distances from the
    goal without them, worked out once, guide every search: it looks at little more than the ways that are as short as
    the one it finds.
    """

    mesh: NavMesh

    def __init__(self, mesh: NavMesh) -> None:
        self.mesh = mesh.with_points(np.empty((0, 2)))
        with self.mesh.edited() as obstacles:
            self._snapshot = obstacles.snapshot()
        arrays = self._snapshot.mesh
        crossed = int(np.count_nonzero((arrays.sides["cst"].reshape(-1, 3) == 0) & (arrays.wind == 0)[:, None]))
        self._guide: NDArray[np.void] = np.zeros((1 << (2 * crossed).bit_length()) + 1, GUIDE)
        detour_kernels.begin_guide(arrays, self._guide)

    def reset(self) -> bool:
        """Take all obstacles out again that were put in; False where that fails, and another copy is to be made.

        Everything is as it was at first then. Were they taken out one by one, sides whose corners are on one circle
        might lie otherwise, and what is found would depend on what was looked for before.
        """
        with self.mesh.edited() as obstacles:
            return obstacles.restore(self._snapshot)

    def aim(self, start: Floats, goal: Floats, radius: float, length: float) -> None:
        """Look for ways between two places from now on, ``length`` meters long in the mesh, which is as at first."""
        self._ends = (*map(float, start), *map(float, goal), radius, radius - self.mesh.tolerance(radius))
        limit = _FARTHER[0] * length + _FARTHER[1]
        arrays = self.mesh.arrays
        with workspace(len(arrays.wind)) as work:
            detour_kernels.aim_guide(arrays, work, *self._ends, limit, self._guide)

    def around(self, places: Floats) -> Ways:
        """For each of ``places`` (n, 2) the path in the mesh as it is now and with a point obstacle there as well."""
        count = len(places)
        points, ends = np.empty((64 * count, 2)), np.zeros(count, np.int64)
        status, lengths = np.zeros(count, np.int64), np.full(count, np.inf)
        row = 0
        with self.mesh.edited() as obstacles:
            while True:
                with workspace(len(obstacles.mesh.wind)) as work:
                    done, row, points = detour_kernels.plan_detours(
                        obstacles.places, work, *self._ends, self._guide, places, row, points, ends, status, lengths
                    )
                if done == DONE:
                    break
                if done == NO_ROOM:
                    obstacles.make_room()
                else:
                    obstacles.rebuild()
        ways = Ways(points, ends, lengths)
        return self._traced(ways, places, status == TANGLED) if (status == TANGLED).any() else ways

    def _traced(self, ways: Ways, places: Floats, tangled: NDArray[np.bool_]) -> Ways:
        """The same, and where the guided search found a way that it could not trace, the path of an unguided one."""
        pieces, lengths = [ways[i] for i in range(len(places))], ways.lengths.copy()
        for i in np.flatnonzero(tangled):
            handle = self.mesh.insert_obstacle(places[i])
            try:
                path = self.mesh.find_path(self._ends[:2], self._ends[2:4], self._ends[4])
                pieces[i], lengths[i] = path.points, path.length
            except PathNotFound:
                pass
            finally:
                self.mesh.remove(handle)
        return Ways(np.concatenate(pieces), np.cumsum([len(piece) for piece in pieces]), lengths)
