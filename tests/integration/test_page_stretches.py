"""The last steps of steered stretches in a page: exact, as footsteps after them are extrapolated from these."""

import math

import numpy as np
import pytest

from crowdsim.export.page.page import PageOptions, write_page
from crowdsim.export.page.tracks import track_chunks
from crowdsim.recording.reader import Recording
from tests.support.page_data import read_page
from tests.support.steered_recording import FRONTAL, steered_header, track_frames, write_frames


@pytest.mark.parametrize("few", [True, False])
def test_ends_of_stretches_are_exact(recorded, tmp_path, monkeypatch, few):
    if not few:
        monkeypatch.setattr(track_chunks, "_FEW", 0)
    with Recording.open(recorded("plaza")) as recording:
        write_page(recording, tmp_path / "page.html", PageOptions(start=6.0, end=16.0))
        steered, captured = checked_ends(recording, tmp_path / "page.html")
    assert steered > 20
    assert captured > 5


def test_ends_of_stretches_are_exact_across_chunks(tmp_path, monkeypatch):
    """At 20 steps a second the three last ones are: here they lie on both sides of the border of two chunks."""
    monkeypatch.setattr(track_chunks, "_SHORTEST", 16)
    monkeypatch.setattr(track_chunks, "_LONGEST", 16)
    times, agents = np.arange(60)[:, None] / 20.0, np.arange(8)
    tracks = np.stack(
        [1.3 * times + 0.0 * agents, np.sin(times) + 0.3 * agents, 0.5 * times + agents, 0.95 * times + 0.1 * agents],
        axis=2,
    )
    present = np.arange(60)[:, None] < 30 + agents
    frames = track_frames(tracks, np.full(present.shape, FRONTAL), present)
    with Recording.open(write_frames(tmp_path / "run.h5", steered_header(8, 20), frames)) as recording:
        write_page(recording, tmp_path / "page.html")
        assert read_page(tmp_path / "page.html").facts["chunk"] == 16
        assert checked_ends(recording, tmp_path / "page.html") == (24, 0)


def checked_ends(recording, file):
    """Check each exact step of the stretches in a page; return how many are steered and captured."""
    page = read_page(file)
    x, y, heading, _ = page.tracks()
    units = page.facts["units"]
    stretches = [(agent, *each) for agent, some in page.stretches().items() for each in some]
    exact = page.array("stretch_exact").reshape(len(stretches), -1, 4)
    per_turn = units["turn"] / (2.0 * np.pi) / units["turn_step"]
    steered = captured = 0
    for number, (agent, begin, stop) in enumerate(stretches):
        for back in range(min(exact.shape[1], stop - begin)):
            step, add = stop - 1 - back, exact[number, back] / units["exact"]
            row = page.facts["first"] + step
            if recording.node[row, agent] >= 0:
                assert (add[:3] == 0.0).all()
                captured += 1
                continue
            places = np.array([x[step, agent], y[step, agent]]) * units["place"] + add[:2]
            true = np.array([recording.x[row, agent], recording.y[row, agent]], float) * units["place"]
            assert np.abs(places - true).max() <= 0.51 / units["exact"]
            off = math.remainder(heading[step, agent] - float(recording.heading[row, agent]), 2.0 * math.pi)
            assert abs(off * per_turn + add[2]) <= 0.51 / units["exact"]
            steered += 1
    return steered, captured
