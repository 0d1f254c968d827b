"""Feet that stand, as a page holds them: decoded one after the other, they are those of the recording."""

import math

import numpy as np
import pytest

from crowdsim.export.page.packed_feet import FRAMES, PLACES, TIMES
from crowdsim.export.page.page import PageOptions, write_page
from crowdsim.export.page.tracks import track_chunks
from crowdsim.motion.planted.pin_kernels import FADES, MODE, NODE, SINCE, STANDS, UNTIL, YAW, X
from crowdsim.recording.reader import Recording
from tests.support.page_data import read_page, unzigzag


def placed(a, b):
    """The planar pose ``b``, seen from ``a``, in the world."""
    c, s = math.cos(a[2]), math.sin(a[2])
    return np.array([a[0] + c * b[0] - s * b[1], a[1] + s * b[0] + c * b[1], a[2] + b[2]])


def seen(a, b):
    """The planar pose ``b`` as seen from ``a``."""
    c, s = math.cos(a[2]), math.sin(a[2])
    x, y, turn = b - a
    return np.array([c * x + s * y, c * y - s * x, turn])


def changes(recording, page, number):
    """Times after the page's first step, and states, of the changes of a foot: what holds there, and what follows."""
    begin = page.facts["first"] / recording.steps_per_second
    end = begin + page.facts["steps"] / recording.steps_per_second
    agent = page.facts["agents"][number // 2]
    times, states = recording.planted_feet.changes_of(agent, number % 2)
    first = max(int(np.count_nonzero(times <= begin)) - 1, 0)
    last = int(np.count_nonzero(times < end))
    names = [recording.header.motion.node_names[int(node)] for node in states[:, NODE]]
    some = [k for k in range(first, last) if names[k] in page.facts["nodes"]]
    return np.maximum(times[some] - begin, 0.0), states[some]


@pytest.mark.parametrize(
    ("name", "options"),
    [("corridor", PageOptions()), ("plaza", PageOptions()), ("plaza", PageOptions(start=8.0, end=30.0))],
)
@pytest.mark.parametrize("few", [True, False])
def test_changes_of_feet_come_back(recorded, tmp_path, monkeypatch, name, options, few):
    if not few:
        monkeypatch.setattr(track_chunks, "_FEW", 0)
    with Recording.open(recorded(name)) as recording:
        write_page(recording, tmp_path / "page.html", options)
        page = read_page(tmp_path / "page.html")
        frames = page.varints("node_frames")
        first = np.cumsum(np.asarray(frames) + 1) - np.asarray(frames) - 1
        rows = unzigzag(page.varints("feet_rows")).reshape(6, -1)
        clip = (np.cumsum(rows, axis=1) / PLACES).T.reshape(-1, 2, 3)
        units = page.facts["feet"]
        scale = np.array([units["place"], units["place"], units["angle"]])
        names = ("times", "modes", "nodes", "since", "fading")
        columns = [iter(page.varints(f"feet_{each}").tolist()) for each in names]
        poses = [iter(unzigzag(page.varints(f"feet_{each}")).tolist()) for each in ("x", "y", "yaws")]

        def in_clip(node, frame, foot):
            row = first[node] + frame
            now, later = (clip[min(math.floor(row) + k, first[node] + frames[node]), foot] for k in (0, 1))
            way = later - now
            way[2] = math.remainder(way[2], 2.0 * math.pi)
            return now + (row - math.floor(row)) * way

        off, times_off, checked = [], [], 0
        for number, count in enumerate(page.varints("feet_counts")):
            times, states = changes(recording, page, number)
            assert count == len(times)
            ticks, stood, before = 0, None, None
            for time, state in zip(times, states, strict=True):
                since, mode, node, frame, fading = (next(column) for column in columns)
                ticks += since
                pose = np.array([next(column) for column in poses]) / scale
                if mode == STANDS and stood is not None:
                    last, old, began = stood
                    if before is stood:
                        way = seen(in_clip(old, began, number % 2), in_clip(old, frames[old], number % 2))
                        pose = placed(last, way) + pose
                    else:
                        pose = placed(last, pose)
                before = pose, node, frame / FRAMES
                stood = before if mode == STANDS else stood
                assert mode == state[MODE]
                assert page.facts["nodes"][node] == recording.header.motion.node_names[int(state[NODE])]
                assert frame / FRAMES == pytest.approx(state[SINCE], abs=0.51 / FRAMES)
                if mode == FADES:
                    assert (frame + fading) / FRAMES == pytest.approx(state[UNTIL], abs=0.51 / FRAMES)
                times_off.append(abs(ticks / TIMES - time))
                away = pose - state[X : YAW + 1]
                off.append([*np.abs(away[:2]), abs(math.remainder(away[2], 2.0 * math.pi))])
                checked += 1
        assert checked > 100
        assert max(times_off) <= 0.51 / TIMES
        # Errors do not add up from step to step. They are half a unit along both axes of a foot.
        assert (np.array(off).max(axis=0) <= 0.71 / scale + 1e-6).all()
