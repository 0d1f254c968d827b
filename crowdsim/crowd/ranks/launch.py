"""Tell whether mpiexec has started this process together with others."""

from __future__ import annotations

import os

SIZE_VARIABLES = ("PMI_SIZE", "OMPI_COMM_WORLD_SIZE", "MV2_COMM_WORLD_SIZE")
"""Environment variables in which MPICH and its kin, Open MPI and MVAPICH tell a process how many there are."""


def launched_ranks() -> int:
    """Return how many processes mpiexec has started for this run; 1 without it."""
    for name in SIZE_VARIABLES:
        if os.environ.get(name, "").isdigit():
            return int(os.environ[name])
    return 1
