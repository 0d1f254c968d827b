"""Components of a mesh for discs of several radii, remembered."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from crowdsim.navmesh.mesh.mesh_arrays import MeshArrays
from crowdsim.navmesh.paths.component_kernels import label_sides

_KEPT = 8
"""Number of radii whose components are remembered. More take memory, four bytes a half-edge each."""


class ComponentCache:
    """The components of the sides of one unedited mesh, remembered for the radii used last.

    Threads can share it: entries are replaced as a whole, so at worst two threads compute the same.
    """

    def __init__(self) -> None:
        self._entries: tuple[tuple[float, NDArray[np.int32], int], ...] = ()

    def labels(self, mesh: MeshArrays, width: float) -> tuple[NDArray[np.int32], int]:
        """Return the components (3 nt,) int32 of half-edges for a disc of diameter ``width`` [m], and their number.

        They are numbered as by :func:`label_sides`.
        """
        entries = self._entries
        entry = next((entry for entry in entries if entry[0] == width), None)
        if entry is None:
            labels = np.empty(len(mesh.sides), np.int32)
            entry = (width, labels, label_sides(mesh, width, labels))
        others = [other for other in entries if other[0] != width]
        self._entries = (entry, *others[: _KEPT - 1])
        return entry[1], entry[2]
