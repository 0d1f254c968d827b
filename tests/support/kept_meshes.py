"""Meshes that kernels read at their addresses, kept until the tests of a process end."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from crowdsim.navmesh.mesh.address_kernels import layers_of
from crowdsim.navmesh.navmesh import NavMesh

_KEPT: list[NavMesh] = []


def layers_kept(*meshes: NavMesh) -> NDArray[np.int64]:
    """Return the addresses (m, 5, 2) of meshes that nothing else keeps."""
    _KEPT.extend(meshes)
    return layers_of(meshes)
