"""The last steps of steered stretches in a page: exact, as footsteps after them are extrapolated from these."""

import math

import numpy as np
import pytest

from crowdsim.export.page.page import PageOptions, write_page
from crowdsim.export.page.tracks import track_chunks
from crowdsim.recording.reader import Recording
from tests.support.page_data import read_page


@pytest.mark.parametrize("few", [True, False])
def test_ends_of_stretches_are_exact(recorded, tmp_path, monkeypatch, few):
    if not few:
        monkeypatch.setattr(track_chunks, "_FEW", 0)
    with Recording.open(recorded("plaza")) as recording:
        write_page(recording, tmp_path / "page.html", PageOptions(start=6.0, end=16.0))
        page = read_page(tmp_path / "page.html")
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
        assert steered > 20
        assert captured > 5
