"""Feet that stand: a page holds them in the first step of each chunk, and its viewer follows them from there."""

import numpy as np
import pytest

from crowdsim.export.page.page import PageOptions, write_page
from crowdsim.export.page.tracks import track_chunks
from crowdsim.geometry.planar import wrap_angle
from crowdsim.motion.graph.pose_kernels import pose_joints
from crowdsim.motion.planted.pin_kernels import FADES, MODE, SINCE, STANDS, UNTIL, YAW, X
from crowdsim.recording.reader import Recording
from tests.reference.pinned_feet import carried, clip_place, place_of
from tests.support.page_data import read_page, unzigzag
from tests.support.shown_bodies import AFTER_A_SWITCH, compare

CAPTURED = tuple(f"agents.{group}.locomotion=captured" for group in range(4))


@pytest.fixture
def short_chunks(monkeypatch):
    """Chunks of 64 steps, so that feet stand in many first steps."""
    monkeypatch.setattr(track_chunks, "_LONGEST", 64)


def posed_place(recording, agent, step, foot):
    """Place of a foot of an agent in a step, as its body is posed without correction."""
    joints = len(recording.pose_table.parents)
    positions, rotations = np.empty((1, joints, 3), np.float32), np.empty((1, joints, 4), np.float32)
    node, previous = (np.array([column[step][agent]], np.int32) for column in (recording.node, recording.previous))
    track = np.array([[column[step][agent] for column in (recording.x, recording.y, recording.heading)]], np.float64)
    frame = np.array([recording.frame[step][agent]], np.float64)
    pose_joints(recording.pose_table, node, previous, frame, track, positions, rotations)
    return place_of(recording.foot_table, foot, positions[0], rotations[0])


@pytest.mark.parametrize("few", [True, False])
@pytest.mark.parametrize(
    ("name", "options"),
    [("corridor", PageOptions()), ("plaza", PageOptions()), ("plaza", PageOptions(start=8.0, end=30.0))],
)
def test_feet_in_the_first_steps_of_chunks_come_back(recorded, tmp_path, monkeypatch, short_chunks, name, options, few):
    if not few:
        monkeypatch.setattr(track_chunks, "_FEW", 0)
    with Recording.open(recorded(name)) as recording:
        write_page(recording, tmp_path / "page.html", options)
        page = read_page(tmp_path / "page.html")
        units = page.facts["feet"]
        scale = np.array([units["place"], units["place"], units["angle"]])
        modes, since, fading = (iter(page.varints(f"feet_{each}").tolist()) for each in ("modes", "since", "fading"))
        poses = [iter(unzigzag(page.varints(f"feet_{each}")).tolist()) for each in ("x", "y", "yaws")]
        nodes, found = page.nodes(), []
        for first in range(0, page.facts["steps"], page.facts["chunk"]):
            step = page.facts["first"] + first
            for agent in np.flatnonzero(nodes[first]).tolist():
                who = page.facts["agents"][agent]
                node, frame = int(recording.node[step][who]), float(recording.frame[step][who])
                time = step / recording.steps_per_second
                states = recording.planted_feet.states_at(
                    time, np.array([who]), np.array([node], np.int32), np.array([frame])
                )
                for foot in (0, 1):
                    state, pose = states[0, foot], np.array([next(column) for column in poses]) / scale
                    mode, begin, length = next(modes), next(since) / units["frame"], next(fading) / units["frame"]
                    found.append(mode)
                    assert mode == state[MODE]
                    expected = state[X : YAW + 1].copy()
                    if mode == FADES:
                        assert begin == pytest.approx(state[SINCE], abs=0.51 / units["frame"])
                        assert begin + length == pytest.approx(state[UNTIL], abs=1.01 / units["frame"])
                    elif mode == STANDS:
                        row = int(recording.pose_table.node_first[node])
                        clip = [clip_place(recording.foot_table, row, foot, at) for at in (float(state[SINCE]), frame)]
                        expected = carried(expected, *clip) - posed_place(recording, who, step, foot)
                        expected[2] = wrap_angle(expected[2])
                    else:
                        expected[:] = 0.0
                    # Half a unit, and what float32 poses are off.
                    assert (np.abs(pose - expected) <= 0.5 / scale + [1e-5, 1e-5, 1e-4]).all()
        assert not any(any(True for _ in column) for column in (modes, since, fading, *poses))
        # Feet that stand were there, and feet that swing and lose what moved them.
        assert {STANDS, FADES} <= set(found)
        stands = page.array("feet_stands")
        assert ((stands & 1) > 0).mean() == pytest.approx(((stands & 2) > 0).mean(), abs=0.3)


@pytest.mark.parametrize(
    ("name", "changes", "options"),
    [
        ("corridor", (), PageOptions()),
        ("plaza", (), PageOptions(start=8.0, end=45.0)),
        ("plaza", CAPTURED, PageOptions(end=50.0)),
    ],
)
def test_feet_stand_where_the_recording_has_them(visit, recorded, tmp_path, short_chunks, name, changes, options):
    with Recording.open(recorded(name, *changes)) as recording:
        write_page(recording, tmp_path / "page.html", options)
        shown = visit(tmp_path / "page.html")
        # To and fro, on from step to step, and over many steps at once: feet are followed on, or found anew.
        # Within some seconds of the cut, footsteps of steered people are planned without what lies behind it.
        last = options.end - AFTER_A_SWITCH if options.end else recording.duration - 0.05
        drawn = np.random.default_rng(3).uniform(options.start or 0.0, last, 25)
        paced = np.arange(12.0, 14.5, 0.11), np.arange(10.0, min(last, 20.0), 1.7)
        # At the borders of chunks, and just beside them.
        borders = (options.start or 0.0) + np.arange(64, (last - (options.start or 0.0)) * 30, 64 * 3)[:6] / 30.0
        beside = [borders - 0.01, borders, borders + 0.01]
        _, joints, _, frames = compare(recording, shown, np.concatenate([drawn, *paced, *beside]).tolist())
    assert len(joints) > 100
    assert np.percentile(joints, 99) <= 0.001
    assert max(joints) <= 0.003
    assert frames <= 1e-3
    assert shown.complained == []
