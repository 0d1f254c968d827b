"""Many searches between the same two places while obstacles come and go."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import NDArray

from crowdsim.navmesh.editing import detour_kernels
from crowdsim.navmesh.editing.address_kernels import places_of
from crowdsim.navmesh.mesh.mesh_arrays import MeshArrays, overwrite
from crowdsim.navmesh.navmesh import NavMesh
from crowdsim.navmesh.paths.checked_kernels import CHECK, Checked
from crowdsim.navmesh.paths.component_kernels import label_sides
from crowdsim.navmesh.paths.guide_kernels import GUIDE
from crowdsim.navmesh.paths.paths import Floats

_FARTHER = (1.05, 1.5)
"""How much longer than without obstacles ways are that the guide knows: a factor, and meters. Longer ones are found all
the same, but more is searched for them; and a guide that knows more takes longer to make."""

_PIECES = 2048
_DOTS = 128
"""Room for pieces of paths whose checks are remembered, and for obstacles that are put in."""


class Detours:
    """A copy of a mesh that one thread may edit, and the paths in it between two places.

    After :meth:`aim`, kernels may put obstacles into :attr:`mesh` (see :meth:`lent`). They only make ways longer, so
    the distances from the goal without them, worked out once, guide every search: it looks at little more than the ways
    that are as short as the one it finds.
    """

    mesh: NavMesh

    def __init__(self, mesh: NavMesh) -> None:
        self.mesh = mesh.with_points(np.empty((0, 2)))
        with self.mesh.edited() as obstacles:
            self._snapshot = obstacles.snapshot()
            self._before = MeshArrays(*(array.copy() for array in obstacles.mesh))
        self._places_before = places_of(self._before)
        arrays = self._snapshot.mesh
        crossed = int(np.count_nonzero((arrays.sides["cst"].reshape(-1, 3) == 0) & (arrays.wind == 0)[:, None]))
        self._guide: NDArray[np.void] = np.zeros((1 << (2 * crossed).bit_length()) + 1, GUIDE)
        detour_kernels.begin_guide(arrays, self._guide)
        self._labels = np.empty(0, np.int32)
        self._labelled = -1.0
        self._checked = Checked(np.zeros(_PIECES, CHECK), np.zeros(3, np.int64), np.empty((_DOTS, 2)))

    def reset(self) -> bool:
        """Take all obstacles out again that were put in; False where that fails, and another copy is to be made.

        Everything is as it was at first then. Were they taken out one by one, sides whose corners are on one circle
        might lie otherwise, and what is found would depend on what was looked for before.
        """
        with self.mesh.edited() as obstacles:
            overwrite(self._before, self._snapshot.mesh)
            return obstacles.restore(self._snapshot)

    def aim(self, start: Floats, goal: Floats, radius: float) -> None:
        """Look for ways between two places in the mesh from now on, which is as it was at first."""
        self._ends = (*map(float, start), *map(float, goal), radius, radius - self.mesh.tolerance(radius))
        arrays = self.mesh.arrays
        if radius != self._labelled:
            self._labels = np.empty(len(arrays.sides), np.int32)
            label_sides(arrays, 2.0 * self._ends[-1], self._labels)
            self._labelled = radius
        with self.mesh.workspaces.lent(len(arrays.wind)) as work:
            detour_kernels.aim_guide(arrays, self._labels, work, *self._ends, _FARTHER, self._guide)
        self._checked.numbers[:] = self._checked.numbers[0] + 1, 0, 0

    @contextmanager
    def lent(self) -> Iterator[tuple[Any, ...]]:
        """What kernels that look for detours take first: places of the mesh and of its copy, and the rest.

        That is workspace, checks, ends and guide. They may put obstacles into the mesh, its copy and the checks, as
        dots there.
        """
        mesh = self.mesh
        with mesh.edited() as obstacles, mesh.workspaces.lent(len(obstacles.mesh.wind)) as work:
            yield obstacles.places, self._places_before, work, self._checked, self._ends, self._guide
