"""Write pictures of a recording."""

from __future__ import annotations

import os
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path

from crowdsim.playback.moments import telling_time
from crowdsim.playback.scene import Scene
from crowdsim.recording.reader import Recording
from crowdsim.whole_files import whole_file

_SUPERSAMPLE = 2
"""Pixels drawn per pixel of the picture, along each side."""
_ENDINGS = (".png", ".jpg", ".jpeg")


def shot(
    recording: Recording,
    path: str | os.PathLike[str],
    time: float | None = None,
    view: str = "overview",
    size: tuple[int, int] = (1600, 900),
    agent: int | None = None,
    color_by: str = "behavior",
    paths: bool = True,
) -> Path:
    """Write a picture (PNG or JPEG) of ``recording``.

    Parameters
    ----------
    recording : Recording
        Recording to show.
    path : str or path
        Name of the file.
    time : float or None
        Time [s]; by default that of :func:`~crowdsim.playback.moments.telling_time`.
    view : str
        ``overview``, ``top``, or ``follow``, which needs an ``agent``.
    size : (int, int)
        Width and height in pixels.
    agent : int or None
        Agent to follow.
    color_by : str
        ``behavior``, ``group``, ``agent``, ``level`` (captured or steered), or the name of an attribute.
    paths : bool
        Whether planned paths are drawn on the floor.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    CrowdSimError
        If a view, agent, way to color, time, size or file name is invalid.
    DrawingUnavailable
        If this machine cannot draw.
    """
    with whole_file(path, _ENDINGS, "pictures") as written:
        moment = telling_time(recording) if time is None else time
        _draw(recording, [(written, moment)], view, size, agent, color_by, paths)
    return Path(path)


def shots(
    recording: Recording,
    path: str | os.PathLike[str],
    times: Sequence[float],
    view: str = "overview",
    size: tuple[int, int] = (1600, 900),
    agent: int | None = None,
    color_by: str = "behavior",
    paths: bool = True,
) -> list[Path]:
    """Write a picture at each of ``times`` [s], as :func:`shot` does; the scene is built once for all.

    Returns
    -------
    list of Path
        The files: ``path`` with the time before its suffix, as ``walk-12.5.png``, in 6 significant digits, or in as
        many more as tell the times apart.
    """
    path = Path(path)
    enough = (digits for digits in range(6, 17) if len({f"{time:.{digits}g}" for time in times}) >= len(set(times)))
    digits = next(enough, 17)
    names = [path.with_name(f"{path.stem}-{time:.{digits}g}{path.suffix}") for time in times]
    with ExitStack() as stack:
        files = [stack.enter_context(whole_file(each, _ENDINGS, "pictures")) for each in names]
        _draw(recording, list(zip(files, times, strict=True)), view, size, agent, color_by, paths)
    return names


def _draw(
    recording: Recording,
    pictures: Sequence[tuple[Path, float]],
    view: str,
    size: tuple[int, int],
    agent: int | None,
    color_by: str,
    paths: bool,
) -> None:
    """Draw the recording at each time [s] and save the picture to its file, in one scene for all."""
    from PIL import Image

    scene = Scene(recording, size, color_by, supersample=_SUPERSAMPLE, paths=paths)
    try:
        for written, time in pictures:
            scene.look(view, time, agent)
            scene.show_time(time)
            Image.fromarray(scene.picture()).save(written)
    finally:
        scene.close()
