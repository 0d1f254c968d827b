"""Run points in processes of this machine; a process that dies is replaced, and its point is run again."""

from __future__ import annotations

import multiprocessing
import signal
from collections import deque
from collections.abc import Iterator, Sequence
from multiprocessing.connection import Connection, wait
from multiprocessing.context import SpawnProcess
from pathlib import Path

from crowdsim.jit import compiled_kernels
from crowdsim.sweeps.points import Point
from crowdsim.sweeps.running import Keep, Outcome, Runner

TRIES = 3
"""Number of processes that die while they run a point, after which it counts as failed."""

DIED = "the process died; is there too little memory?"


def run_points(
    points: Sequence[Point], jobs: int, recordings: Path | None, keep: Keep
) -> Iterator[tuple[Point, Outcome]]:
    """Run points in processes; yield each point with its outcome as it is done, in any order.

    Parameters
    ----------
    points : sequence of Point
        Points to run.
    jobs : int
        Number of processes.
    recordings : Path or None
        Folder for recordings; None for a temporary one.
    keep : Keep
        Which recordings stay.
    """
    waiting, tries = deque(points), dict.fromkeys(points, 0)
    at_work: dict[Connection, tuple[SpawnProcess, Point]] = {}
    # If no kernel is compiled yet, one process compiles them for all.
    most = jobs if compiled_kernels() else 1
    try:
        while waiting or at_work:
            while waiting and len(at_work) < most:
                _begin(waiting.popleft(), *_start(recordings, keep), at_work)
            # A connection is ready if its process has sent an outcome, or has died.
            for ready in wait(list(at_work)):
                assert isinstance(ready, Connection)
                process, point = at_work.pop(ready)
                try:
                    outcome = ready.recv()
                # The process died.
                except (EOFError, OSError):
                    process.join()
                    ready.close()
                    tries[point] += 1
                    if tries[point] < TRIES:
                        waiting.appendleft(point)
                    else:
                        yield point, Outcome({}, DIED, lasting=False)
                    continue
                most = jobs  # kernels are compiled now
                if waiting:
                    _begin(waiting.popleft(), process, ready, at_work)
                else:
                    _end(process, ready)
                yield point, outcome
    finally:
        for connection, (process, _) in at_work.items():
            process.kill()
            _end(process, connection)


def _start(recordings: Path | None, keep: Keep) -> tuple[SpawnProcess, Connection]:
    """Start a process that runs points by :func:`_work`; return it, and the connection to it."""
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe()
    process = context.Process(target=_work, args=(theirs, recordings, keep), daemon=True)
    process.start()
    # With the other end closed here, reading ends when the process dies.
    theirs.close()
    return process, ours


def _begin(
    point: Point, process: SpawnProcess, connection: Connection, at_work: dict[Connection, tuple[SpawnProcess, Point]]
) -> None:
    """Send a point to a process, and note in ``at_work`` that it is at work on it."""
    at_work[connection] = process, point
    try:
        connection.send(point)
    except (BrokenPipeError, ConnectionResetError):
        return  # it died in between, as reading from it will show


def _end(process: SpawnProcess, connection: Connection) -> None:
    """Close the connection, at which a process ends by itself, and wait for it."""
    connection.close()
    process.join()


def _work(connection: Connection, recordings: Path | None, keep: Keep) -> None:
    """Run the points that ``connection`` gives, and send back their outcomes, until its other side is closed or dies.

    ``recordings`` and ``keep`` are those of :class:`crowdsim.sweeps.running.Runner`.
    """
    # Ctrl-C reaches all processes of a terminal; the one that started this one ends it.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    runner = Runner(recordings, keep)
    while True:
        try:
            point = connection.recv()
        except (EOFError, OSError):
            return
        try:
            connection.send(runner.run(point))
        except (BrokenPipeError, ConnectionResetError):
            return
