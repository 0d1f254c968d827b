"""A joint that stands still above hips that travel is no part of the body."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from crowdsim.errors import MotionError
from crowdsim.library import library_folder
from crowdsim.motion.captures.reader import Capture, read_capture

WALK = library_folder("behaviors") / "frontal" / "clips" / "walk_slow.bvh"
STILL = {
    "Reference": ("0 0 0", "0 0 0", "0 0 0", 6),
    "turned": ("0 0 0", "10 -5 20", "0 90 0", 6),
    "without places": ("0 0 0", "", "0 90 0", 3),
}
"""Offset, place and turn of the joint above, and its channels."""


def rooted(folder: Path, offset: str, place: str, turn: str, count: int) -> Path:
    """The walk below two more joints: one as given, and one without a place between."""
    text = WALK.read_text()
    head, _, rest = text.partition("ROOT")
    body, _, motion = rest.partition("MOTION")
    lines = motion.strip().splitlines()
    channels = "Xposition Yposition Zposition Zrotation Yrotation Xrotation".split()[6 - count :]
    above = f"ROOT Reference\n{{\nOFFSET {offset}\nCHANNELS {count} {' '.join(channels)}\n"
    between = "JOINT Armature\n{\nOFFSET 1 2 3\nCHANNELS 3 Zrotation Yrotation Xrotation\n"
    rows = [f"{place} {turn} 0 0 0 {row}" for row in lines[2:]]
    file = folder / "rooted.bvh"
    file.write_text("\n".join([f"{head}{above}{between}JOINT{body.rstrip()}\n}}\n}}\nMOTION", *lines[:2], *rows, ""]))
    return file


def speed_and_height(capture: Capture) -> tuple[float, float]:
    (clip,) = capture.clips
    moved = np.diff(clip.root_positions, axis=0)
    return float(np.hypot(moved[:, 0], moved[:, 1]).sum()), float(clip.root_positions[:, 2].mean())


@pytest.mark.parametrize("kind", STILL)
def test_the_body_walks_as_without_it(tmp_path: Path, kind: str) -> None:
    expected, found = read_capture(WALK), read_capture(rooted(tmp_path, *STILL[kind]))
    assert speed_and_height(found) == pytest.approx(speed_and_height(expected), abs=1e-6)
    before, after = expected.clips[0], found.clips[0]
    assert after.skeleton.names == before.skeleton.names
    # Distances of joints to one another do not depend on where a body stands and what it faces.
    apart = [np.linalg.norm(c.joint_positions[:, 1:] - c.joint_positions[:, :1], axis=-1) for c in (before, after)]
    np.testing.assert_allclose(apart[0], apart[1], atol=1e-6)
    assert after.root_positions[:, 2] == pytest.approx(before.root_positions[:, 2], abs=1e-6)
    assert found.report.assumed == ("'hips' is the root, as nothing above it moves (Reference, Armature)",)


def test_an_end_site_of_a_still_joint_is_left_out(tmp_path: Path) -> None:
    path = rooted(tmp_path, *STILL["Reference"])
    path.write_text(path.read_text().replace("JOINT Armature", "End Site\n{\nOFFSET 0 1 0\n}\nJOINT Armature"))
    expected, found = read_capture(WALK).clips[0].skeleton, read_capture(path).clips[0].skeleton
    assert found.end_parents.tolist() == expected.end_parents.tolist()
    np.testing.assert_allclose(found.end_offsets, expected.end_offsets, atol=1e-6)


def test_hips_that_travel_themselves_stay_the_root(tmp_path: Path) -> None:
    assert not read_capture(WALK).report.assumed


def test_a_still_joint_without_turns_is_named(tmp_path: Path) -> None:
    path = rooted(tmp_path, "0 0 0", "", "", 3)
    path.write_text(path.read_text().replace("CHANNELS 3 Zrotation Yrotation Xrotation", "CHANNELS 0", 1))
    with pytest.raises(MotionError, match="joint 'Reference' has the channels 0; it needs three rotations"):
        read_capture(path)
