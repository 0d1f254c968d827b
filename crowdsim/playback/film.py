"""Write a recording as a film."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from crowdsim.errors import CrowdSimError
from crowdsim.playback.scene import Scene
from crowdsim.recording.reader import Recording
from crowdsim.whole_files import whole_file

_CODECS = {"libx264": {"crf": "20", "preset": "veryfast"}, "mpeg4": {"qscale": "3"}}
"""Encoders in order of preference, with settings for a sharp picture."""

_SUPERSAMPLE = 1.5
"""Pixels drawn per pixel of the film, along each side; a higher factor is smoother and slower."""


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
    progress: Callable[[int, int], None] | None = None,
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
    view, agent, color_by
        As for a picture; the view ``follow`` moves with its agent.
    progress : callable or None
        Called with the number of pictures done and their total.

    Raises
    ------
    CrowdSimError
        If a time, rate or size is invalid.
    DrawingUnavailable
        If this machine cannot draw.
    """
    stop = recording.duration if end is None else end
    _check(recording, fps, size, start, stop)
    count = int(np.floor((stop - start) * fps + 1e-9)) + 1
    with whole_file(path, (".mp4",), "films") as written:
        # Multisampling costs as much in software rendering, and loses shadows and thin lines.
        scene = Scene(recording, size, color_by, supersample=_SUPERSAMPLE)
        try:
            _encode(written, _pictures(scene, start + np.arange(count) / fps, view, agent), fps, size, count, progress)
        finally:
            scene.close()
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


def _pictures(scene: Scene, times: np.ndarray, view: str, agent: int | None) -> Iterator[np.ndarray]:
    for time in times:
        scene.show_time(float(time))
        if view == "follow" or time == times[0]:
            scene.look(view, float(time), agent)
        yield scene.picture()


def _encode(
    path: Path,
    pictures: Iterator[np.ndarray],
    fps: int,
    size: tuple[int, int],
    count: int,
    progress: Callable[[int, int], None] | None,
) -> None:
    """Encode ``count`` pictures, (height, width, 3) uint8 each, as a film with the first encoder that PyAV has."""
    import av

    codec = next((name for name in _CODECS if name in av.codecs_available), None)
    if codec is None:
        raise CrowdSimError(f"PyAV has none of the encoders {', '.join(_CODECS)}; install it with 'pip install av'")
    with av.open(str(path), "w", format="mp4") as container:
        stream: Any = container.add_stream(codec, rate=fps, options=_CODECS[codec])
        stream.width, stream.height = size
        stream.pix_fmt = "yuv420p"
        for done, pixels in enumerate(pictures, start=1):
            container.mux(stream.encode(av.VideoFrame.from_ndarray(pixels, format="rgb24")))
            if progress is not None:
                progress(done, count)
        container.mux(stream.encode())
