"""Draw parts of a film in processes of their own."""

from __future__ import annotations

import multiprocessing
import os
import signal
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from multiprocessing.connection import Connection, wait
from multiprocessing.context import SpawnProcess
from pathlib import Path

from crowdsim.errors import CrowdSimError
from crowdsim.playback.filming.parts import Packet, Shooting, encoded_pictures
from crowdsim.recording.reader import Recording

_THREADS = "OPENBLAS_NUM_THREADS"
_LOOK_SECONDS = 0.2
"""Longest time between two calls of ``report`` [s], also if no picture is done."""


def draw_in_processes(
    recording: Path, shooting: Shooting, parts: Sequence[range], report: Callable[[int], None]
) -> Iterator[list[Packet]]:
    """Draw each part of a film in a process of its own; yield lists of packets, some empty, in the order of the film.

    Parameters
    ----------
    recording : Path
        Recording to show.
    shooting : Shooting
        What is filmed.
    parts : sequence of range
        Numbers of the pictures of each part.
    report : callable
        Called several times a second with the number of pictures that are done; what it raises ends all processes.

    Raises
    ------
    CrowdSimError
        If a process cannot draw, or dies.
    """
    done, present = 0, 0
    held: list[list[Packet]] = [[] for _ in parts]
    at_work: dict[Connection, tuple[SpawnProcess, int]] = {}
    try:
        for part, pictures in enumerate(parts):
            process, connection = _start(recording, shooting, pictures)
            at_work[connection] = process, part
        while at_work:
            for ready in wait(list(at_work), _LOOK_SECONDS):
                assert isinstance(ready, Connection)
                process, part = at_work[ready]
                packets = _received(ready)
                if packets is None:
                    del at_work[ready]
                    _end(process, ready)
                else:
                    held[part] += packets
                    done += 1
            working = {part for _, part in at_work.values()}
            # Yield in the order of the film: of the first part still at work, what it has sent so far. Packets of later
            # parts are held until it is done.
            while present < len(parts):
                yield held[present]
                held[present] = []
                if present in working:
                    break
                present += 1
            # Each part sends one message more than it has pictures, the rest of its encoder.
            report(min(done, sum(map(len, parts))))
    finally:
        for connection, (process, _) in at_work.items():
            process.kill()
            _end(process, connection)


def _received(connection: Connection) -> list[Packet] | None:
    """Return the next packets of a process, or None at the end of its part.

    Raise the error that it sent, or CrowdSimError if it died.
    """
    try:
        message = connection.recv()
    except (EOFError, OSError):
        raise CrowdSimError(
            "a process that draws a part of the film died; is there too little memory? A smaller --size takes less"
        ) from None
    if isinstance(message, Exception):
        raise message
    packets: list[Packet] | None = message
    return packets


def _start(recording: Path, shooting: Shooting, pictures: range) -> tuple[SpawnProcess, Connection]:
    """Start a process that draws ``pictures``; return it, and the connection to it."""
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe()
    process = context.Process(target=_work, args=(theirs, recording, shooting, pictures), daemon=True)
    with _one_thread():
        process.start()
    # With the other end closed here, reading ends when the process dies.
    theirs.close()
    return process, ours


@contextmanager
def _one_thread() -> Iterator[None]:
    """Let processes that start inside the block multiply matrices with one thread: more threads would compete."""
    before = os.environ.get(_THREADS)
    os.environ[_THREADS] = "1"
    try:
        yield
    finally:
        if before is None:
            del os.environ[_THREADS]
        else:
            os.environ[_THREADS] = before


def _end(process: SpawnProcess, connection: Connection) -> None:
    """Close the connection, and wait for the end of a process that is done or was killed."""
    connection.close()
    process.join()


def _work(connection: Connection, path: Path, shooting: Shooting, pictures: range) -> None:
    """Send the packets of ``pictures``, picture by picture, then None; or the error that ends the drawing."""
    # Ctrl-C reaches all processes of a terminal; the one that started this one ends it.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        with Recording.open(path) as recording:
            for packets in encoded_pictures(recording, shooting, pictures):
                connection.send(packets)
        connection.send(None)
    except (BrokenPipeError, ConnectionResetError):  # the process that started this one has ended
        return
    except (CrowdSimError, OSError) as error:
        connection.send(error)
