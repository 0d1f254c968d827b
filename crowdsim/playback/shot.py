"""One picture of a recording."""

from __future__ import annotations

import os
from pathlib import Path

from crowdsim.playback.moments import telling_time
from crowdsim.playback.scene import Scene
from crowdsim.recording.reader import Recording
from crowdsim.whole_files import whole_file

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

    view: ``overview``, ``top`` or ``follow``, which needs an ``agent``. color_by: ``behavior``, ``agent``,
    ``level`` (captured, steered), or the name of an attribute.
    Raises CrowdSimError for a view, time, size or file that cannot be, DrawingUnavailable where nothing can draw.
    """
    from PIL import Image

    with whole_file(path, (".png", ".jpg", ".jpeg"), "pictures") as written:
        moment = telling_time(recording) if time is None else time
        scene = Scene(recording, size, color_by, supersample=_SUPERSAMPLE)
        try:
            scene.show_time(moment)
            scene.look(view, moment, agent)
            Image.fromarray(scene.picture()).save(written)
        finally:
            scene.close()
    return Path(path)
