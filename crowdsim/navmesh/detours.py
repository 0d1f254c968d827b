"""Many searches between the same two places while obstacles come and go."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
from numpy.typing import NDArray

from crowdsim.navmesh.editing import detour_kernels
from crowdsim.navmesh.editing.detour_kernels import DetourSearch
from crowdsim.navmesh.mesh.address_kernels import places_of
from crowdsim.navmesh.mesh.mesh_arrays import MeshArrays, trimmed
from crowdsim.navmesh.navmesh import NavMesh
from crowdsim.navmesh.paths.component_kernels import label_sides
from crowdsim.navmesh.paths.guide_kernels import GUIDE
from crowdsim.navmesh.paths.paths import Floats

_FARTHER = (1.05, 1.5)
"""Limit of the guide: the length of a short way without obstacles times the first number, plus the second one [m].

Ways of up to about the limit / GREED (see guide_kernels) are known. Longer ones are found as well, but with more
search. Greater values take longer to prepare.
"""


class Detours:
    """A copy of a mesh that one thread may edit, and the paths in it between two places.

    After :meth:`aim`, kernels can insert obstacles into :attr:`mesh` (see :meth:`lent`). Obstacles only make ways
    longer. So the distances from the goal without them, computed once, guide every search: it looks at little more than
    the ways that are as short as the one it finds.

    Parameters
    ----------
    mesh
        The mesh to copy.
    """

    mesh: NavMesh

    def __init__(self, mesh: NavMesh) -> None:
        self.mesh = mesh.with_points(np.empty((0, 2)))
        # A copy with as much room as the mesh has: kernels take their edits of the mesh back from it.
        with self.mesh.edited() as obstacles:
            self._before = MeshArrays(*(array.copy() for array in obstacles.mesh))
        self._places_before = places_of(self._before)
        arrays = trimmed(self._before)
        crossed = int(
            np.count_nonzero((arrays.sides["constraints"].reshape(-1, 3) == 0) & (arrays.cover == 0)[:, None])
        )
        # A hash table of the sides that can be crossed, at most half full, and one row more (see guide_kernels).
        self._guide: NDArray[np.void] = np.zeros((1 << (2 * crossed).bit_length()) + 1, GUIDE)
        detour_kernels.begin_guide(arrays, self._guide)
        # Labels of the sides and their radius, as of `aim`: none yet.
        self._labels = np.empty(0, np.int32)
        self._labelled = -1.0

    def aim(self, start: Floats, goal: Floats, radius: float) -> None:
        """Set the two places, (2,) each [m], and the radius [m] of the following searches; fill the guide for them.

        A disc of the radius should be free at both. The mesh must be as it was at first.
        """
        self._ends = (*map(float, start), *map(float, goal), radius, radius - self.mesh.tolerance(radius))
        arrays = self.mesh.arrays
        # The labels are those of the mesh as it was at first, so they serve all goals for one radius.
        if radius != self._labelled:
            self._labels = np.empty(len(arrays.sides), np.int32)
            label_sides(arrays, 2.0 * self._ends[-1], self._labels)
            self._labelled = radius
        with self.mesh.workspaces.lent(len(arrays.cover)) as work:
            detour_kernels.aim_guide(arrays, self._labels, work, *self._ends, _FARTHER, self._guide)

    @contextmanager
    def lent(self) -> Iterator[DetourSearch]:
        """Yield the search between the places of :meth:`aim`, for kernels that look for detours."""
        mesh = self.mesh
        with mesh.edited() as obstacles, mesh.workspaces.lent(len(obstacles.mesh.cover)) as work:
            yield DetourSearch(obstacles.places, self._places_before, work, self._ends, self._guide)
