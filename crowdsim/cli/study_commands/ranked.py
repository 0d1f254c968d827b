"""``mpiexec -n N crowdsim run``: one run on several processes."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from contextlib import nullcontext
from pathlib import Path

import typer

from crowdsim.cli.errors_shown import describe
from crowdsim.cli.summary import tell_summary
from crowdsim.errors import CrowdSimError
from crowdsim.whole_files import require_writable

_APART = 0.2
"""Time that each rank waits longer than the one before it [s], before it prints an error and ends all ranks: an error
that all have is then printed once."""


def run_on_ranks(
    scenario: str, changes: list[str], file_for: Callable[[str], Path], page: bool, as_json: bool, workers: int
) -> None:
    """Take this process's share in a run; rank 0 shows the progress and the summary, and writes the ``page``.

    ``changes`` are ``key=value`` for keys of the scenario, ``workers`` is the number of threads of each process.
    ``file_for`` returns the recording for the name of a scenario, and raises CrowdSimError if it cannot be written.
    """
    from crowdsim.cli.progress import RunProgress
    from crowdsim.crowd.ranked_run import RankedRun
    from crowdsim.crowd.ranks.mpi_ranks import world_of_ranks
    from crowdsim.scenario.loader import load_scenario

    comm = world_of_ranks()
    rank = comm.Get_rank()
    run, file, failure = None, Path(), None
    try:
        loaded = load_scenario(scenario, changes)
        file = file_for(loaded.name)
        if page:
            require_writable(file.with_suffix(".html"))
        run = RankedRun(loaded, comm, workers)
    except CrowdSimError as error:
        failure = error
    # An error on one rank stops all. The lowest rank with an error raises it; the others exit without a message.
    failed = comm.allgather(None if failure is None else failure.exit_code)
    codes = [code for code in failed if code is not None]
    if codes:
        if failure is not None and next(k for k, code in enumerate(failed) if code is not None) == rank:
            raise failure
        raise typer.Exit(codes[0])
    assert run is not None
    page_file, left = file.with_suffix(".html"), f"{file} was not written"
    shown = RunProgress(run.scenario.name) if rank == 0 else None
    try:
        with shown or nullcontext():
            if shown is not None:
                shown.begin_steps()
            summary = run.run(file, shown.step if shown is not None else None)
            if summary is not None and shown is not None:
                left = f"{file} was written" + (f", {page_file} was not" if page else "")
                shown.end_steps()
                summary = {**summary, "recording": str(file)}
                if page:
                    from crowdsim.export.page.page import write_page
                    from crowdsim.recording.reader import Recording

                    with Recording.open(file) as recording:
                        write_page(recording, page_file)
                    summary["page"] = str(page_file)
    except BaseException as error:  # whatever it is, the others must not wait for this rank
        time.sleep(_APART * rank)
        message, code = describe(error)
        typer.echo(f"{message} (rank {rank} of {comm.Get_size()}; {left})", err=True)
        sys.stderr.flush()
        comm.Abort(code)
        raise
    if summary is not None:
        tell_summary(summary, as_json)
