"""Write a recording as a film."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from crowdsim.errors import CrowdSimError
from crowdsim.playback.filming.parts import CODECS, Packet, Shooting, encoded_pictures, find_codec
from crowdsim.playback.filming.processes import draw_in_processes
from crowdsim.recording.reader import Recording
from crowdsim.whole_files import whole_file

_LONG = 240
"""Number of pictures from which on a film is made of two parts, also in one process, so that it is the same film."""

Progress = Callable[[int, int], None]


def film(
    recording: Recording,
    path: str | os.PathLike[str],
    fps: int = 30,
    size: tuple[int, int] = (1280, 720),
    start: float = 0.0,
    end: float | None = None,
    view: str = "overview",
    agent: int | None = None,
    color_by: str = "behavior",
    paths: bool = True,
    progress: Progress | None = None,
    processes: int = 1,
) -> Path:
    """Write ``recording`` from ``start`` to ``end`` (default: all of it) [s] as an MP4 in real time.

    The file appears under its name when it is complete.

    Parameters
    ----------
    recording : Recording
        Recording to show.
    path : str or path
        Name of the file.
    fps : int
        Pictures per second.
    size : (int, int)
        Width and height in pixels, even numbers.
    start, end : float
        Times [s].
    view, agent, color_by, paths
        As for a picture, see :func:`~crowdsim.playback.shot.shot`; the view ``follow`` moves with its agent.
    progress : callable or None
        Called with the number of pictures done and their total, several times a second; what it raises ends the film.
    processes : int
        With 2 or more, each half of a film of 240 pictures or more is drawn by a process of its own. A program then
        needs ``if __name__ == "__main__":``, as for all processes that Python spawns.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    CrowdSimError
        If a time, rate, size, view, agent, coloring or file name is invalid, or the disk is full.
    DrawingUnavailable
        If this machine cannot draw.
    """
    stop = recording.duration if end is None else end
    _check(recording, fps, size, start, stop)
    count = int(np.floor((stop - start) * fps + 1e-9)) + 1  # one more than intervals: both ends have a picture
    shooting = Shooting(fps, size, start, view, agent, color_by, paths)
    middle = count // 2 if count >= _LONG else count
    parts = [part for part in (range(middle), range(middle, count)) if part]  # of a short film, the second is empty

    def report(done: int) -> None:
        """Call ``progress`` with the number of pictures done and their total."""
        if progress is not None:
            progress(done, count)

    with whole_file(path, (".mp4",), "films") as written:
        if processes > 1 and len(parts) > 1:
            encoded = draw_in_processes(Path(recording.path), shooting, parts, report)
        else:
            encoded = _drawn_here(recording, shooting, parts, report)
        _write(written, shooting, encoded)
    return Path(path)


def _check(recording: Recording, fps: int, size: tuple[int, int], start: float, end: float) -> None:
    """Raise CrowdSimError if a film of these pictures a second, size [pixels] and times [s] cannot be made."""
    if not 1 <= fps <= 120:
        raise CrowdSimError(f"a film of {fps} pictures a second cannot be made; choose 1 to 120")
    if size[0] % 2 or size[1] % 2:
        raise CrowdSimError(f"a film needs even sides, not {size[0]}x{size[1]}; add a pixel")
    if recording.steps == 0 or not 0.0 <= start <= end <= recording.duration + 1e-9:
        raise CrowdSimError(
            f"{recording.path} lasts from 0 to {recording.duration:g} s; a film cannot go from {start:g} to {end:g} s"
        )


def _drawn_here(
    recording: Recording, shooting: Shooting, parts: list[range], report: Callable[[int], None]
) -> Iterator[list[Packet]]:
    """Draw all parts in this process in turn; yield packets, and call ``report`` with the number of pictures done.

    ``parts`` are numbers of pictures, consecutive from 0.
    """
    for part in parts:
        for done, packets in enumerate(encoded_pictures(recording, shooting, part), start=1):
            yield packets
            if done <= len(part):  # after its pictures, a part yields what was left in the encoder
                report(part.start + done)


def _write(path: Path, shooting: Shooting, encoded: Iterator[list[Packet]]) -> None:
    """Write encoded packets to the film ``path``, in the order in which they come."""
    import av

    codec = find_codec()
    with av.open(str(path), "w", format="mp4") as container:
        # The stream encodes nothing: its settings, equal to those of the parts' encoders, make the header of the file.
        stream: Any = container.add_stream(codec, rate=shooting.fps, options=CODECS[codec])
        stream.width, stream.height = shooting.size
        stream.pix_fmt = "yuv420p"
        stream.thread_count = 1
        for packets in encoded:
            for each in packets:
                packet = av.Packet(each.data)
                packet.stream = stream
                packet.time_base = 1 / Fraction(shooting.fps)
                packet.pts, packet.dts, packet.is_keyframe = each.shown, each.decoded, each.is_key
                packet.duration = 1
                container.mux(packet)
