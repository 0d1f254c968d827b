"""A mesh and its workshop by the addresses of their arrays.

To hand over an array takes Python a fifth of a microsecond, and kernels count references to it: for twelve arrays, a
third of an edit of one point. A table of addresses is one array, and nobody counts references to what is behind it.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from crowdsim.jit import array_at, helper
from crowdsim.navmesh.mesh.mesh_arrays import (
    FRAME,
    PROGRESS,
    SEGMENT,
    SIDE,
    SIGHT,
    TO_DO,
    USE,
    VERTEX,
    MeshArrays,
    Workshop,
)


class Layer(Protocol):
    """A mesh that knows where its arrays are, which may be others after an edit."""

    @property
    def places(self) -> NDArray[np.int64]:
        """(5, 2) as of `places_of`."""


def places_of(mesh: MeshArrays, work: Workshop | tuple[()] = ()) -> NDArray[np.int64]:
    """Addresses and lengths (12, 2) of the arrays, which whoever keeps the table has to keep as well.

    (5, 2) without a workshop.
    """
    return np.array([(array.ctypes.data, len(array)) for array in (*mesh, *work)], np.int64)


def layers_of(meshes: Iterable[Layer]) -> NDArray[np.int64]:
    """Addresses (m, 5, 2) of the arrays of layers: one type for any number of them, so that kernels are compiled once.

    They hold as long as the meshes are kept and not edited.
    """
    return np.array([mesh.places for mesh in meshes])


@helper
def mesh_at(places):
    """The mesh at ``places`` (12, 2) or (5, 2)."""
    return MeshArrays(
        array_at(places[0, 0], (places[0, 1],), SIDE),
        array_at(places[1, 0], (places[1, 1],), VERTEX),
        array_at(places[2, 0], (places[2, 1],), np.int64),
        array_at(places[3, 0], (places[3, 1],), np.int64),
        array_at(places[4, 0], (places[4, 1],), FRAME),
    )


@helper
def workshop_at(places):
    """The workshop at ``places`` (12, 2)."""
    return Workshop(
        array_at(places[5, 0], (places[5, 1],), np.int64),
        array_at(places[6, 0], (places[6, 1], 2), np.int64),
        array_at(places[7, 0], (places[7, 1],), TO_DO),
        array_at(places[8, 0], (places[8, 1],), USE),
        array_at(places[9, 0], (places[9, 1],), SEGMENT),
        array_at(places[10, 0], (places[10, 1],), PROGRESS),
        array_at(places[11, 0], (places[11, 1],), SIGHT),
    )
