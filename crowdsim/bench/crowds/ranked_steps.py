"""One process of ``crowdsim bench ranks``: ``mpiexec -n N python -m crowdsim.bench.crowds.ranked_steps SCENARIO``."""

from __future__ import annotations

import itertools
import json
import statistics
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import typer

from crowdsim.crowd.ranked_run import RankedRun
from crowdsim.crowd.ranks.mpi_ranks import world_of_ranks
from crowdsim.crowd.simulation import Simulation
from crowdsim.scenario.loader import load_scenario

_SETTLES = 3
"""Number of steps at the beginning that are not counted, in which all agents enter."""


class CountedCalls:
    """MPI's communicator, whose calls are counted: they mostly wait for other processes, and spin while they wait.

    Waiting until messages are sent (``MPI.Request.Waitall``), and taking those that have come (``Recv`` of a message),
    are not calls of the communicator: they count as work.
    """

    def __init__(self, comm: Any) -> None:
        self._comm, self._inside = comm, 0.0

    def work(self) -> float:
        """Return the CPU time of this process so far outside of these calls [s]."""
        return time.process_time() - self._inside

    def __getattr__(self, name: str) -> Any:
        """Return a method of the communicator, whose CPU time is added up."""
        called = getattr(self._comm, name)

        def counted(*arguments: Any, **named: Any) -> Any:
            """Call the method, and add its CPU time to that inside of calls."""
            begin = time.process_time()
            try:
                return called(*arguments, **named)
            finally:
                self._inside += time.process_time() - begin

        return counted


def main(scenario: str) -> None:
    """Run the scenario on all processes, as ``crowdsim run`` does; rank 0 prints times and the state hash as JSON.

    ``step_ms`` is the median time of a step. ``run_ms`` is a mean: the time from the first step counted until the
    recording is written, divided by the number of steps; several processes join the recording from their parts at the
    end. ``work_ms`` is the CPU time of the busiest process over the same time, divided in the same way, without its
    calls of MPI's communicator: on a busy machine it says more than times of a clock. ``exchange_ms`` is the median
    time of the exchange of ghosts in rank 0, ``sent_kb`` the mean of what the process that sends most sends in a step
    [kB]. The first _SETTLES steps count in none of these.
    """
    comm = CountedCalls(world_of_ranks())
    loaded = load_scenario(scenario)
    marks, work, exchanged, sent = [time.perf_counter()], [comm.work()], [0.0], [0]
    run: RankedRun | None = None

    def progress(*_: Any) -> None:
        """Note time, CPU time and bytes sent at the end of a step, and begin to add up the exchange of the next one."""
        marks.append(time.perf_counter())
        work.append(comm.work())
        exchanged.append(0.0)
        sent.append(0 if run is None else run.ranks.sent)

    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "run.h5"
        if comm.Get_size() == 1:
            with Simulation(loaded, workers=1).run(file, progress) as recording:
                summary: dict[str, Any] | None = recording.summary
        else:
            run = RankedRun(loaded, comm)
            exchange = run.ranks.exchange

            def timed(*arguments: Any) -> Any:
                """Exchange ghosts, and add the time to that of the present step."""
                begin = time.perf_counter()
                ghosts = exchange(*arguments)
                exchanged[-1] += time.perf_counter() - begin
                return ghosts

            vars(run.ranks)["exchange"] = timed  # the simulation itself reads no clock
            summary = run.run(file, progress)
    ended = time.perf_counter()
    # Entry k of marks, work and sent is the end of step k, from 1 on. The last entry of exchanged is of no step.
    counted = marks[_SETTLES:]
    most_work = max(comm.allgather((comm.work() - work[_SETTLES]) / (len(counted) - 1)))
    most_sent = max(comm.allgather((sent[-1] - sent[_SETTLES]) / (len(counted) - 1)))
    if summary is not None:
        figures = {
            "step_ms": 1000.0 * statistics.median(b - a for a, b in itertools.pairwise(counted)),
            "run_ms": 1000.0 * (ended - counted[0]) / (len(counted) - 1),
            "work_ms": 1000.0 * most_work,
            "exchange_ms": 1000.0 * statistics.median(exchanged[_SETTLES:-1]),
            "sent_kb": most_sent / 1000.0,
            "state_hash": summary["state_hash"],
        }
        typer.echo(json.dumps(figures))


if __name__ == "__main__":
    main(sys.argv[1])
