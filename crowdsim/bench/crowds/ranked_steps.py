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
"""Number of steps at the beginning that are not counted, in which everybody enters."""


def main(scenario: str) -> None:
    """Run the scenario on all processes, as ``crowdsim run`` does; rank 0 prints times and the state hash as JSON.

    ``step_ms`` is the median of a step. ``run_ms`` is the time of a step from the first one counted until the recording
    is written: one process writes it while it steps, several join their parts at the end.
    """
    comm = world_of_ranks()
    loaded = load_scenario(scenario)
    marks, exchanged, sent = [time.perf_counter()], [0.0], 0

    def progress(*_: Any) -> None:
        marks.append(time.perf_counter())
        exchanged.append(0.0)

    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "run.h5"
        if comm.Get_size() == 1:
            with Simulation(loaded, workers=1).run(file, progress) as recording:
                summary: dict[str, Any] | None = recording.summary
        else:
            run = RankedRun(loaded, comm)
            exchange = run.ranks.exchange

            def timed(*arguments: Any) -> Any:
                begin = time.perf_counter()
                ghosts = exchange(*arguments)
                exchanged[-1] += time.perf_counter() - begin
                return ghosts

            vars(run.ranks)["exchange"] = timed  # the simulation itself reads no clock
            summary = run.run(file, progress)
            sent = run.ranks.sent
    ended = time.perf_counter()
    most_sent = max(comm.allgather(sent))
    if summary is not None:
        counted = marks[_SETTLES:]
        figures = {
            "step_ms": 1000.0 * statistics.median(b - a for a, b in itertools.pairwise(counted)),
            "run_ms": 1000.0 * (ended - counted[0]) / (len(counted) - 1),
            "exchange_ms": 1000.0 * statistics.median(exchanged[_SETTLES:-1]),
            "sent_kb": most_sent / (len(marks) - 1) / 1000.0,
            "state_hash": summary["state_hash"],
        }
        typer.echo(json.dumps(figures))


if __name__ == "__main__":
    main(sys.argv[1])
