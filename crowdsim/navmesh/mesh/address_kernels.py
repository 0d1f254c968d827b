"""A mesh and its workshop, given to kernels as one table of array addresses.

To pass the arrays one by one would take a good part of the time of a small edit, as Python checks the type of each one
and kernels count references to it. A table of addresses is a single array, and nothing counts references to the arrays
behind it.
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
    """A mesh that gives the addresses of its arrays; an edit may change these addresses."""

    @property
    def places(self) -> NDArray[np.int64]:
        """Return the addresses (5, 2) int64 of the arrays, as :func:`places_of` makes them."""


def places_of(mesh: MeshArrays, work: Workshop | tuple[()] = ()) -> NDArray[np.int64]:
    """Return the address and the length of each array: (12, 2) int64, or (5, 2) without a workshop.

    The addresses are valid only while the caller keeps the arrays alive.
    """
    return np.array([(array.ctypes.data, len(array)) for array in (*mesh, *work)], np.int64)


def layers_of(meshes: Iterable[Layer]) -> NDArray[np.int64]:
    """Return the addresses (m, 5, 2) int64 of the arrays of ``meshes``.

    The type is the same for any number of meshes, so kernels are compiled once. The addresses are valid as long as the
    meshes are kept and not edited.
    """
    return np.array([mesh.places for mesh in meshes])


@helper
def mesh_at(places):
    """Return the mesh (MeshArrays) whose arrays are at ``places``, int64, as :func:`places_of` makes them.

    Each row is the address and the number of items of an array: (12, 2) with a workshop, (5, 2) without one.
    """
    # Rows 0 to 4 are the fields of MeshArrays, in their order.
    return MeshArrays(
        array_at(places[0, 0], (places[0, 1],), SIDE),
        array_at(places[1, 0], (places[1, 1],), VERTEX),
        array_at(places[2, 0], (places[2, 1],), np.int64),
        array_at(places[3, 0], (places[3, 1],), np.int64),
        array_at(places[4, 0], (places[4, 1],), FRAME),
    )


@helper
def workshop_at(places):
    """Return the workshop (Workshop) whose arrays are at ``places``, (12, 2) int64, as :func:`places_of` makes them."""
    # Rows 5 to 11 are the fields of Workshop, in their order.
    return Workshop(
        array_at(places[5, 0], (places[5, 1],), np.int64),
        array_at(places[6, 0], (places[6, 1], 2), np.int64),
        array_at(places[7, 0], (places[7, 1],), TO_DO),
        array_at(places[8, 0], (places[8, 1],), USE),
        array_at(places[9, 0], (places[9, 1],), SEGMENT),
        array_at(places[10, 0], (places[10, 1],), PROGRESS),
        array_at(places[11, 0], (places[11, 1],), SIGHT),
    )
