"""A part of a film: draw its pictures and encode them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from crowdsim.errors import CrowdSimError
from crowdsim.playback.camera import place_camera, tallest_person
from crowdsim.playback.scene import Scene
from crowdsim.recording.reader import Recording

CODECS = {"libx264": {"crf": "20", "preset": "veryfast"}, "mpeg4": {"qscale": "3"}}
"""Encoders in order of preference, with settings for a sharp picture."""

_SUPERSAMPLE = 1.5
"""Pixels drawn per pixel of the film, along each side; a higher factor is smoother and slower. Multisampling costs as
much in software, and loses shadows and thin lines."""
_GLOBAL_HEADER = 1 << 22
"""FFmpeg's flag AV_CODEC_FLAG_GLOBAL_HEADER: MP4 holds an encoder's settings once per file, not in packets."""


@dataclass(frozen=True)
class Shooting:
    """What is filmed, and how; see :func:`~crowdsim.playback.film.film`. ``start`` is the time of picture 0 [s]."""

    fps: int
    size: tuple[int, int]
    start: float
    view: str
    agent: int | None
    color_by: str
    paths: bool


class Packet(NamedTuple):
    """A piece of an encoded film; times are numbers of pictures from the beginning of the film.

    ``shown`` is when its picture is shown, ``decoded`` when it is decoded. ``is_key`` is True if its picture can be
    decoded without others.
    """

    data: bytes
    shown: int
    decoded: int
    is_key: bool


def find_codec() -> str:
    """Return the first encoder that PyAV has.

    Raises
    ------
    CrowdSimError
        If it has none.
    """
    import av

    codec = next((name for name in CODECS if name in av.codecs_available), None)
    if codec is None:
        raise CrowdSimError(f"PyAV has none of the encoders {', '.join(CODECS)}; install it with 'pip install av'")
    return codec


def encoded_pictures(recording: Recording, shooting: Shooting, pictures: range) -> Iterator[list[Packet]]:
    """Draw and encode pictures of a film; yield the packets that the encoder gives after each, and at last the rest.

    ``pictures`` are their numbers in the film. An encoder looks ahead, so the first pictures may give no packet yet.
    """
    encoder = _encoder(shooting)
    aspect = shooting.size[0] / shooting.size[1]
    begin = shooting.start + pictures.start / shooting.fps
    camera = place_camera(recording, shooting.view, aspect, begin, shooting.agent)
    tallest = tallest_person(recording, camera, round(shooting.size[1] * _SUPERSAMPLE))
    scene = Scene(recording, shooting.size, shooting.color_by, _SUPERSAMPLE, tallest=tallest, paths=shooting.paths)
    reduction = _Reduction(shooting.size)
    try:
        scene.set_camera(camera)
        for number in pictures:
            time = shooting.start + number / shooting.fps
            if shooting.view == "follow":
                scene.look(shooting.view, time, shooting.agent)
            elif number == pictures.start:
                # In all other views the camera stands still, so what stands still is drawn only once.
                scene.keep_still()
            scene.show_time(time)
            picture = reduction.frame(scene.drawn_rows())
            picture.pts = number - pictures.start
            yield _packets(encoder.encode(picture), pictures.start)
        yield _packets(encoder.encode(None), pictures.start)
    finally:
        scene.close()


def _encoder(shooting: Shooting) -> Any:
    """Return an encoder of one thread: with more, the bytes of a film would depend on their number."""
    import av

    codec = find_codec()
    encoder: Any = av.CodecContext.create(codec, "w")
    encoder.width, encoder.height = shooting.size
    encoder.pix_fmt = "yuv420p"
    encoder.framerate = Fraction(shooting.fps)
    encoder.time_base = 1 / Fraction(shooting.fps)
    encoder.options = CODECS[codec]
    encoder.thread_count = 1
    encoder.flags |= _GLOBAL_HEADER
    return encoder


class _Reduction:
    """Scales drawn pictures down to the size of the film: each of its pixels is the mean of the pixels drawn for it.

    One buffer serves all pictures: to get new memory for each takes as long as to copy it.
    """

    def __init__(self, size: tuple[int, int]) -> None:
        self._size = size
        self._whole: Any = None

    def frame(self, rows: NDArray[np.uint8]) -> Any:
        """Return the picture, as the encoder takes it, of drawn rows (height, width, 4), the lowest first."""
        import av

        height, width, _ = rows.shape
        if self._whole is None:
            self._whole = av.VideoFrame(width, height, "rgba")
        plane = self._whole.planes[0]
        # FFmpeg may pad rows: line_size is their length in bytes.
        memory = np.frombuffer(plane, np.uint8).reshape(height, plane.line_size)
        memory[:, : 4 * width] = rows[::-1].reshape(height, 4 * width)
        return self._whole.reformat(*self._size, format="yuv420p", interpolation="AREA")


def _packets(encoded: list[Any], first: int) -> list[Packet]:
    """Return PyAV's packets, whose times count from the picture ``first`` of the film, with times of the whole film."""
    return [Packet(bytes(each), first + each.pts, first + each.dts, bool(each.is_keyframe)) for each in encoded]
