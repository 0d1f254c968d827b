"""Many searches between the same two places while obstacles come and go."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from crowdsim.errors import PathNotFound
from crowdsim.navmesh.paths import detour_kernels
from crowdsim.navmesh.paths.guide_kernels import GUIDE
from crowdsim.navmesh.paths.paths import FOUND, TANGLED, Floats
from crowdsim.navmesh.paths.workspace import workspace

if TYPE_CHECKING:
    from crowdsim.navmesh.navmesh import NavMesh

_FARTHER = (1.02, 0.5)
"""How much longer than without obstacles ways are that the guide knows: a factor, and meters. Longer ones are found all
the same, but more is searched for them; and a guide that knows more takes longer to make."""


class Detours:
    """A copy of a mesh that one thread may edit, and the paths in it between two places.

    After :meth:`aim`, obstacles may be put into :attr:`mesh` and removed again. They only make ways longer, so the
    distances from the goal without them, worked out once, guide every search: it looks at little more than the ways
    that are as short as the one it finds.
    """

    mesh: NavMesh

    def __init__(self, mesh: NavMesh) -> None:
        self.mesh = mesh.with_points(np.empty((0, 2)))
        sides = 3 * int(self.mesh.arrays.frame["triangles"][0])
        self._guide: NDArray[np.void] = np.zeros((1 << (2 * sides).bit_length()) + 1, GUIDE)

    def aim(self, start: Floats, goal: Floats, radius: float, length: float) -> None:
        """Look for ways between two places from now on, which is ``length`` meters long in the mesh as it is."""
        self._ends = (*map(float, start), *map(float, goal), radius, radius - self.mesh.tolerance(radius))
        limit = _FARTHER[0] * length + _FARTHER[1]
        arrays = self.mesh.arrays
        with workspace(len(arrays.wind)) as work:
            detour_kernels.make_guide(arrays, work, *self._ends, limit, self._guide)

    def path(self) -> tuple[Floats | None, float]:
        """The points (n, 2) of a path in the mesh as it is now, as of `NavMesh.find_path`, and its meters.

        None and infinite where there is no path.
        """
        arrays = self.mesh.arrays
        with workspace(len(arrays.wind)) as work:
            status, points, length = detour_kernels.plan_guided(arrays, work, *self._ends, self._guide)
        if status == FOUND:
            return points, length
        if status == TANGLED:
            try:
                path = self.mesh.find_path(self._ends[:2], self._ends[2:4], self._ends[4])
                return path.points, path.length
            except PathNotFound:
                pass
        return None, np.inf
