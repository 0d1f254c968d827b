"""One walk as ten systems name it, in six units and axes, of an adult and a child: all are read as the same walk."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from crowdsim.errors import MotionError
from crowdsim.motion.captures.reader import read_capture, read_clip
from crowdsim.motion.clips.skeleton import ROLES
from crowdsim.motion.clips.tracks import track_of
from tests.support.capture_conventions import CONVENTIONS, VARIANTS, Variant, rewritten

WALK = "16_11_walk_veer_left_slow_a.bvh"
CHILD = 0.6


def at_start(positions: np.ndarray, track: np.ndarray) -> np.ndarray:
    """Places (F, J, 3) seen from where the body is in the first frame."""
    x, y, turn = track[0]
    c, s = np.cos(turn), np.sin(turn)
    moved = positions - [x, y, 0.0]
    return np.stack([c * moved[..., 0] + s * moved[..., 1], c * moved[..., 1] - s * moved[..., 0], moved[..., 2]], -1)


def roles_of(file: Path) -> tuple[np.ndarray, set[str]]:
    clip = read_clip(file)
    places = at_start(clip.joint_positions, track_of(clip))
    return np.stack([places[:, clip.skeleton.joint(role)] for role in ROLES], axis=1), set(clip.skeleton.roles)


@pytest.mark.parametrize("size", [1.0, CHILD], ids=["adult", "child"])
@pytest.mark.parametrize("variant", VARIANTS)
@pytest.mark.parametrize("convention", CONVENTIONS)
def test_every_convention_is_the_same_walk(
    shared: Path, tmp_path: Path, convention: str, variant: str, size: float
) -> None:
    source = shared / "mocap" / WALK
    file = tmp_path / "walk.bvh"
    rewritten(source, file, CONVENTIONS[convention], VARIANTS[variant], size)
    wanted, _ = roles_of(source)
    found, roles = roles_of(file)
    assert roles == set(ROLES)
    assert found.shape == wanted.shape
    assert np.abs(found / size - wanted).max() < 1e-3


def test_a_file_of_one_line(shared: Path, tmp_path: Path) -> None:
    source, file = shared / "mocap" / WALK, tmp_path / "line.bvh"
    file.write_text(" ".join(source.read_text().split()))
    assert np.allclose(read_clip(file).joint_positions, read_clip(source).joint_positions, atol=1e-6)


def test_places_that_move_are_told_by_their_joint(shared: Path, tmp_path: Path) -> None:
    file = tmp_path / "six.bvh"
    rewritten(shared / "mocap" / WALK, file, CONVENTIONS["mixamo"], Variant(0.01, "y", 0.0, True))
    text, _, rows = file.read_text().partition("Frame Time:")
    time, *frames = rows.strip().splitlines()
    values = np.array([frame.split() for frame in frames], np.float64)
    values[::2, 6] += 3.0  # the second joint's x
    body = "\n".join(" ".join(f"{value:.9g}" for value in row) for row in values)
    file.write_text(f"{text}Frame Time: {time}\n{body}\n")
    (told,) = read_capture(file).report.assumed
    assert "joints stay at the mean of their own places" in told
    assert "units away" in told


def test_joints_and_unit_that_nobody_knows_are_given(shared: Path, tmp_path: Path) -> None:
    names = {role: f"bone{number}" for number, role in enumerate(CONVENTIONS["cmu"])}
    file = tmp_path / "own.bvh"
    rewritten(shared / "mocap" / WALK, file, names, Variant(1.0 / 7000.0, "y", 0.0, False))
    with pytest.raises(MotionError, match=r"own.bvh: .*--unit.*bone0"):
        read_capture(file)
    joints = {role: name for role, name in names.items() if role in ROLES}
    clip = read_clip(file, 1.0 / 7000.0, joints)
    wanted = read_clip(shared / "mocap" / WALK)
    assert np.allclose(clip.joint_positions, wanted.joint_positions, atol=1e-3)
    with pytest.raises(MotionError, match=r"own.bvh: no joint is called 'bone99', the name given for 'left_hip'"):
        read_capture(file, 1.0, {"left_hip": "bone99"})
    with pytest.raises(MotionError, match=r"no joint has a role 'left_hipp'; did you mean 'left_hip'"):
        read_capture(file, 1.0, {"left_hipp": "bone9"})


def test_channels_that_make_no_sense_are_refused_by_joint(shared: Path, tmp_path: Path) -> None:
    file = tmp_path / "odd.bvh"
    rewritten(shared / "mocap" / WALK, file, CONVENTIONS["cmu"], VARIANTS["mm, y up, six channels"])
    text = file.read_text()
    joint, channels = "JOINT LeftLeg\n", "CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation"
    head, _, tail = text.partition(joint)
    assert channels in tail
    file.write_text(head + joint + tail.replace(channels, channels.replace("Yrotation", "Xrotation"), 1))
    with pytest.raises(MotionError, match="joint 'LeftLeg' has the channels 6"):
        read_capture(file)
