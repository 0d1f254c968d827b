"""A small recording, and a stop where nothing can draw."""

import pytest

from crowdsim.errors import DrawingUnavailable
from crowdsim.playback.drawing_backend import find_backend
from crowdsim.recording.reader import Recording
from tests.support.small_recording import write_small_recording


@pytest.fixture(scope="session")
def recording(tmp_path_factory):
    with Recording.open(write_small_recording(tmp_path_factory.mktemp("playback") / "run.h5")) as opened:
        yield opened


@pytest.fixture(scope="session")
def can_draw():
    try:
        return find_backend()
    except DrawingUnavailable as reason:
        pytest.skip(str(reason))
