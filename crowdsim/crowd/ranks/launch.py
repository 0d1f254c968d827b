"""Find out if mpiexec has started this process together with others, and if mpiexec can do that here."""

from __future__ import annotations

import os
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path
from shutil import which
from typing import NamedTuple

INSTALL = "pip install 'crowdsim[mpi]' mpich"
"""Command that installs what runs on several processes need."""

SIZE_VARIABLES = ("PMI_SIZE", "OMPI_COMM_WORLD_SIZE", "MV2_COMM_WORLD_SIZE")
"""Environment variables with the number of processes: of MPICH and libraries made from it, Open MPI, and MVAPICH."""


def launched_ranks() -> int:
    """Return how many processes mpiexec has started for this run, by its environment variables; 1 without mpiexec."""
    for name in SIZE_VARIABLES:
        if os.environ.get(name, "").isdigit():
            return int(os.environ[name])
    return 1


def find_mpiexec() -> str | None:
    """Return the path of mpiexec, the one beside this Python or else the one that a shell finds; None without one."""
    beside = Path(sys.executable).parent / "mpiexec"
    return str(beside) if beside.exists() else which("mpiexec")


class MpiFound(NamedTuple):
    """What a trial of MPI found.

    Attributes
    ----------
    library : str or None
        Name of the MPI library in which two processes have met; None if they have not.
    mpiexec : str or None
        Path of the program that starts them.
    remedy : str or None
        What is wrong, and what to do; None if two processes have met.
    """

    library: str | None
    mpiexec: str | None
    remedy: str | None


_TRIAL = """
from mpi4py import MPI
name = " ".join(MPI.Get_library_version().splitlines()[0].strip(" \\0").split())
both = MPI.COMM_WORLD.allgather(name)
if MPI.COMM_WORLD.Get_rank() == 0:
    print(len(both), both[0], sep="\\t", flush=True)
"""
_TRIAL_SECONDS = 60.0


def try_mpi() -> MpiFound:
    """Start two processes with mpiexec, and find out if they meet.

    These are other processes than this one, because MPI may end a process in which it does not work.
    """
    mpiexec = find_mpiexec()
    if find_spec("mpi4py") is None or mpiexec is None:
        missing = "mpiexec" if mpiexec is None else "mpi4py"
        return MpiFound(None, mpiexec, f"{missing} is missing; for runs on several processes: {INSTALL}")
    command = [mpiexec, "-n", "2", sys.executable, "-c", _TRIAL]
    # This process may have been started by mpiexec itself; the two must not take its environment for theirs.
    alone = {name: value for name, value in os.environ.items() if name not in SIZE_VARIABLES}
    try:
        tried = subprocess.run(command, env=alone, capture_output=True, text=True, timeout=_TRIAL_SECONDS)
    except (OSError, subprocess.TimeoutExpired) as error:
        return MpiFound(None, mpiexec, f"{mpiexec} does not start two processes ({error}); {INSTALL}")
    met = [line.split("\t") for line in tried.stdout.splitlines() if "\t" in line]
    if tried.returncode or not met:
        told = " ".join(tried.stderr.split())[:300] or f"exit code {tried.returncode}"
        return MpiFound(None, mpiexec, f"{mpiexec} does not start two processes: {told}")
    # Started by the mpiexec of another library, each process believes that it is alone.
    size, library = met[0]
    if size != "2":
        return MpiFound(None, mpiexec, f"{mpiexec} is not that of the library that mpi4py loads ({library})")
    return MpiFound(library, mpiexec, None)
