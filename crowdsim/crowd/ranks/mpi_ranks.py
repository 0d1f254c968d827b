"""Exchange between the ranks that mpiexec has started: the methods of ``protocol.Ranks``, through MPI."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from crowdsim.crowd.ranks.launch import launched_ranks
from crowdsim.crowd.ranks.messages import GHOST, RowMessage, ghosts_of, migrant_type
from crowdsim.crowd.ranks.partition import Regions, cells_of
from crowdsim.crowd.ranks.protocol import Ghosts
from crowdsim.ecs.records import opaque
from crowdsim.ecs.world import World
from crowdsim.errors import CrowdSimError
from crowdsim.steering.row_kernels import CELL


def world_of_ranks() -> Any:
    """Return MPI's communicator of all processes.

    Raises
    ------
    CrowdSimError
        If mpi4py or an MPI library is missing, or mpiexec is that of another library.
    """
    try:
        from mpi4py import MPI
    except (ImportError, RuntimeError) as error:
        raise CrowdSimError(
            f"a run on several processes needs mpi4py and an MPI library: pip install 'crowdsim[mpi]' ({error})"
        ) from None
    comm = MPI.COMM_WORLD
    if comm.Get_size() != launched_ranks():
        raise CrowdSimError(
            f"mpiexec has started {launched_ranks()} processes, but the MPI library that mpi4py loads "
            f"({library_name()}) knows of {comm.Get_size()}; use the mpiexec of that library"
        )
    return comm


def library_name() -> str:
    """Return name and version of the MPI library that mpi4py loads."""
    from mpi4py import MPI

    return " ".join(str(MPI.Get_library_version()).splitlines()[0].strip("\0 ").split())


class MpiRanks:
    """All processes of a run, each with its region of the floor."""

    def __init__(self, comm: Any, regions: Regions) -> None:
        self.comm, self.regions = comm, regions
        self.rank: int = comm.Get_rank()
        self.size: int = comm.Get_size()
        self.sent = 0
        """Bytes sent to neighbors so far."""
        self._neighbors = regions.neighbors(self.rank)

    def any(self, here: bool) -> bool:
        """Return True if ``here`` is true in any process."""
        return bool(self.sum(np.array([here], np.int64))[0])

    def sum(self, counts: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the sums of ``counts`` over all processes, element by element."""
        total = np.zeros_like(counts)
        self.comm.Allreduce(np.ascontiguousarray(counts), total)
        return total

    def most(self, values: NDArray[Any]) -> NDArray[Any]:
        """Return the largest ``values`` of all processes, element by element."""
        from mpi4py import MPI

        largest = np.zeros_like(values)
        self.comm.Allreduce(np.ascontiguousarray(values), largest, MPI.MAX)
        return largest

    def together(self, rows: NDArray[Any]) -> tuple[NDArray[Any], slice]:
        """Return the rows (k, ...) of all processes, in the order of ranks, and which of them are those of this one."""
        from mpi4py import MPI

        # Rows travel as bytes, as MPI does not know records: lengths and offsets are numbers of bytes.
        counts = np.zeros(self.size, np.int64)
        self.comm.Allgather(np.array([len(rows)], np.int64), counts)
        ends = np.cumsum(counts)
        bytes_each = rows.dtype.itemsize * int(np.prod(rows.shape[1:]))
        mine = np.frombuffer(np.ascontiguousarray(rows).tobytes(), np.uint8)
        parts = ((counts * bytes_each).tolist(), ((ends - counts) * bytes_each).tolist())
        flat = np.empty(int(ends[-1]) * bytes_each, np.uint8)
        self.comm.Allgatherv([mine, MPI.BYTE], [flat, parts, MPI.BYTE])
        everybody = flat.view(rows.dtype).reshape(int(ends[-1]), *rows.shape[1:])
        end = int(ends[self.rank])
        return everybody, slice(end - len(rows), end)

    def swap(self, rows: NDArray[Any], owners: NDArray[np.int32]) -> NDArray[Any]:
        """Hand each of ``rows`` (k,) over to its owner (k,), and return what this process is given, by sender."""
        from mpi4py import MPI

        # Rows travel as bytes, ``width`` each: ``counts`` rows go to each rank, and ``coming`` rows come from each.
        width = rows.dtype.itemsize
        counts = np.bincount(owners, minlength=self.size)
        coming = np.empty_like(counts)
        self.comm.Alltoall(counts, coming)
        starts, begins = (width * (np.cumsum(each) - each) for each in (counts, coming))
        # Numbers of ranks are sorted fast as 16 bits.
        outgoing = opaque(rows)[np.argsort(owners.astype(np.uint16), kind="stable")]
        taken = np.empty(int(coming.sum()), rows.dtype)
        self.comm.Alltoallv(
            [outgoing.view(np.uint8), ((width * counts).tolist(), starts.tolist()), MPI.BYTE],
            [taken.view(np.uint8), ((width * coming).tolist(), begins.tolist()), MPI.BYTE],
        )
        return taken

    def holds(self, places: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Return which places (k, 2) [m] are in the region of this process."""
        return self.regions.within(self.rank, *cells_of(*places.T))

    def around(self, rows: NDArray[Any], places: NDArray[np.float64], reach: float) -> NDArray[Any]:
        """Return ROW of all agents within ``reach`` [m] of one of ``places`` (k, 2), and maybe of some farther away.

        ``rows`` (ROW[n]) are the agents of this process; all processes give the same ``places``, at least one.
        """
        # Mark the cells within reach of a place, in a grid of the cells around all places; then take the agents there.
        # In ``near``, (left, bottom) is the cell of index 0; ``lines`` and ``up`` are rows of cells.
        cells = int(np.ceil(reach / CELL))
        columns, lines = cells_of(*places.T)
        left, bottom = int(columns.min()) - cells, int(lines.min()) - cells
        near = np.zeros((int(columns.max()) + cells - left + 1, int(lines.max()) + cells - bottom + 1), np.bool_)
        for i in range(-cells, cells + 1):
            for j in range(-cells, cells + 1):
                near[columns + i - left, lines + j - bottom] = True
        at, up = cells_of(rows["x"], rows["y"])
        at, up = at - left, up - bottom
        inside = (at >= 0) & (at < near.shape[0]) & (up >= 0) & (up < near.shape[1])
        inside[inside] = near[at[inside], up[inside]]
        return self.together(rows[inside])[0]

    def exchange(
        self, world: World, exits: NDArray[np.int32], came: NDArray[np.bool_], leaves: NDArray[np.bool_]
    ) -> Ghosts:
        """Hand over the agents that have left the region, take in others, and return those near it as ghosts.

        Parameters
        ----------
        world : World
            Rows of the agents in the region; gets the rows of others, and loses those handed over.
        exits : (n,) int32
            Number of the goal that is the exit of each agent of the run, NONE for none; gets those of agents taken in.
        came : (rows,) bool
            Rows of ``world`` that have entered in this step.
        leaves : (rows,) bool
            Rows that leave the world in this step; they are not handed over.

        Returns
        -------
        Ghosts
            Agents of other ranks near the region, those just handed over among them.
        """
        from mpi4py import MPI

        message = RowMessage(self.regions, self.rank, world, exits, came, leaves)
        outgoing = [message.to(rank) for rank in self._neighbors]
        self.sent += sum(map(len, outgoing))
        sends = [
            self.comm.Isend([content, MPI.BYTE], rank) for rank, content in zip(self._neighbors, outgoing, strict=True)
        ]
        # Agents handed over are near the region, too.
        kept = message.hand_over()
        found = [kept]
        taken = migrant_type(world)
        for rank in self._neighbors:
            status = MPI.Status()
            arriving = self.comm.Mprobe(rank, status=status)
            content = bytearray(status.Get_count(MPI.BYTE))
            arriving.Recv([content, MPI.BYTE])
            # A message is the number of agents to take in, these agents, and the ghosts; see `RowMessage.to`.
            count = int.from_bytes(content[:8], "little")
            end = 8 + count * taken.itemsize
            migrants = np.frombuffer(content[8:end], taken)
            world.put_in(migrants["columns"])
            exits[migrants["columns"]["agent"]] = migrants["exit"]
            found.append(np.frombuffer(content[end:], GHOST))
        MPI.Request.Waitall(sends)
        return ghosts_of(np.concatenate(found))
