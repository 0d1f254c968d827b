"""One process of ``crowdsim bench ranks``: ``mpiexec -n N python -m crowdsim.bench.crowds.ranked_steps SCENARIO``."""

from __future__ import annotations

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
from crowdsim.scenario.loader import load_scenario

_SETTLES = 3
"""Number of steps at the beginning that are not counted, in which everybody enters."""


def main(scenario: str) -> None:
    """Run the scenario on all processes; rank 0 prints medians over the steps and the hash of the states as JSON."""
    comm = world_of_ranks()
    run = RankedRun(load_scenario(scenario), comm)
    exchange, steps, exchanged = run.ranks.exchange, [time.perf_counter()], [0.0]

    def timed(*arguments: Any) -> Any:
        begin = time.perf_counter()
        ghosts = exchange(*arguments)
        exchanged[-1] += time.perf_counter() - begin
        return ghosts

    def progress(step: int, limit: int, of: Any) -> None:
        steps.append(time.perf_counter())
        exchanged.append(0.0)

    vars(run.ranks)["exchange"] = timed  # the simulation itself reads no clock
    with tempfile.TemporaryDirectory() as folder:
        summary = run.run(Path(folder) / "run.h5", progress)
    sent = comm.gather(run.ranks.sent)
    if summary is not None:
        times = [after - before for before, after in zip(steps[_SETTLES:-1], steps[_SETTLES + 1 :], strict=True)]
        figures = {
            "step_ms": 1000.0 * statistics.median(times),
            "exchange_ms": 1000.0 * statistics.median(exchanged[_SETTLES:-1]),
            "sent_kb": max(sent) / len(steps) / 1000.0,
            "state_hash": summary["state_hash"],
        }
        typer.echo(json.dumps(figures))


if __name__ == "__main__":
    main(sys.argv[1])
