"""One picture of a recording."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from crowdsim.errors import CrowdSimError
from crowdsim.playback.moments import telling_time
from crowdsim.playback.scene import Scene
from crowdsim.recording.reader import Recording

_SUPERSAMPLE = 2


def shot(
    recording: Recording,
    path: str | os.PathLike[str],
    time: float | None = None,
    view: str = "overview",
    size: tuple[int, int] = (1600, 900),
    agent: int | None = None,
    color_by: str = "behavior",
) -> Path:
    """Write a picture (PNG or JPEG) of ``recording`` at ``time`` seconds, by default at a telling moment.

    view: ``overview``, ``top`` or ``follow``, which needs an ``agent``. color_by: ``behavior`` or ``agent``.
    Raises CrowdSimError for a view, time, size or file that cannot be, DrawingUnavailable where nothing can draw.
    """
    path = Path(path)
    if path.suffix.lower() not in (".png", ".jpg", ".jpeg"):
        raise CrowdSimError(f"{path}: pictures are written as .png or .jpg; choose such a name")
    if not path.parent.is_dir():
        raise CrowdSimError(f"the folder {path.parent} does not exist; make it first")
    moment = telling_time(recording) if time is None else time
    scene = Scene(recording, size, color_by, supersample=_SUPERSAMPLE)
    try:
        scene.show_time(moment)
        scene.look(view, moment, agent)
        pixels = scene.picture()
    finally:
        scene.close()
    _write_picture(path, pixels)
    return path


def _write_picture(path: Path, pixels: NDArray[np.uint8]) -> None:
    from PIL import Image

    handle, written = tempfile.mkstemp(suffix=path.suffix, prefix=f".{path.stem}-", dir=path.parent)
    os.close(handle)
    try:
        Image.fromarray(pixels).save(written)
        os.chmod(written, 0o644)
        os.replace(written, path)
    except BaseException:
        Path(written).unlink(missing_ok=True)
        raise
