"""Written BVH files, read back by another reader."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pybvh
import pytest

from crowdsim.errors import MotionError
from crowdsim.motion.captures.bvh_writer import bvh_text, euler_zxy, write_bvh
from crowdsim.motion.captures.reader import read_clip
from crowdsim.motion.clips.clip import Clip
from crowdsim.motion.clips.kinematics import about_axis, multiply
from crowdsim.motion.synthesis.body import default_skeleton
from crowdsim.motion.synthesis.plan_builder import PlanBuilder
from crowdsim.motion.synthesis.styles import NORMAL
from crowdsim.motion.synthesis.synthesize import synthesize


@pytest.fixture(scope="module")
def walk() -> Clip:
    return synthesize(PlanBuilder("walk").start(NORMAL).cycle(NORMAL, 0.3).stop().finish())


def test_another_reader_finds_the_same_joints_where_they_were(walk: Clip, tmp_path: Path) -> None:
    write_bvh(walk, tmp_path / "walk.bvh")
    bvh = pybvh.read_bvh_file(str(tmp_path / "walk.bvh"))
    assert bvh.frame_time == pytest.approx(1.0 / 60.0, abs=1e-8)
    names = [node.name for node in bvh.nodes if not node.is_end_site()]
    assert sorted(names) == sorted(walk.skeleton.names)
    found = np.asarray(bvh.joint_positions(centered="world"))[..., [2, 0, 1]] / 100.0
    order = [walk.skeleton.names.index(name) for name in names]
    assert np.abs(found - walk.joint_positions[:, order]).max() < 5e-5


def test_angles_restore_any_rotation() -> None:
    rng = np.random.default_rng(7)
    q = rng.normal(size=(500, 4))
    q /= np.linalg.norm(q, axis=-1, keepdims=True)
    z, x, y = np.radians(euler_zxy(q)).T
    axes = np.eye(3)
    back = multiply(multiply(about_axis(axes[2], z), about_axis(axes[0], x)), about_axis(axes[1], y))
    assert np.abs(np.abs(np.sum(back * q, axis=-1)) - 1.0).max() < 1e-9


def test_the_body_faces_z_with_its_left_toward_x() -> None:
    skeleton = default_skeleton()
    still = Clip("rest", skeleton, np.zeros((1, 3)), np.tile([1.0, 0.0, 0.0, 0.0], (1, skeleton.joint_count, 1)))
    lines = [line.split() for line in bvh_text(still).splitlines()]
    places = {lines[i][1]: [float(v) for v in lines[i + 2][1:]] for i in range(len(lines)) if lines[i][0] == "JOINT"}
    assert places["left_shoulder"][0] > 10.0
    assert places["left_toe"][2] > 10.0
    assert places["left_knee"][1] < -40.0


def test_a_failed_write_leaves_the_old_file(walk: Clip, tmp_path: Path) -> None:
    path = tmp_path / "walk.bvh"
    path.write_text("old")
    broken = replace(walk, root_positions=np.full_like(walk.root_positions, np.nan))
    with pytest.raises(MotionError, match="not finite"):
        write_bvh(broken, path)
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_joints_keep_their_names_in_any_script(walk: Clip, tmp_path: Path) -> None:
    names = ("Hüfte", *walk.skeleton.names[1:])
    write_bvh(replace(walk, skeleton=replace(walk.skeleton, names=names)), tmp_path / "walk.bvh")
    assert read_clip(tmp_path / "walk.bvh").skeleton.names[0] == "Hüfte"


def test_numbers_are_short_and_no_minus_zero_is_written(walk: Clip) -> None:
    words = bvh_text(walk).split("MOTION")[1].split()
    assert "-0" not in words
    assert max(map(len, words)) <= 10
