"""Capture files: every fault, unit, axis and rate."""

import errno
import json
import os
import tracemalloc
from pathlib import Path

import numpy as np
import pybvh
import pytest

from crowdsim.errors import MotionError
from crowdsim.motion.analysis.capture_sets import read_clips
from crowdsim.motion.captures.cleaning import clean_stretches, resample
from crowdsim.motion.captures.reader import capture_paths, read_capture, read_clip
from crowdsim.motion.clips.joint_roles import find_roles
from crowdsim.motion.clips.skeleton import ROLES
from crowdsim.motion.graph.motion_graph import MotionSource, build_motion_graph

FAULTS = {
    "binary": "reject", "ch_bad": "reject", "ch_zero": "reject", "comma": "reject", "crlf": "accept",
    "dup_names": "reject", "endsite_named": "accept", "frames_huge": "reject", "frames_more": "reject",
    "frames_zero": "reject", "ft_sci": "accept", "glued": "reject", "joint_named_end": "accept", "latin1": "reject",
    "nan": "reject", "ok": "accept", "order_xyz": "accept", "row_wrap": "accept", "static": "no locomotion",
    "trunc": "reject", "val_sci": "accept",
}  # fmt: skip


@pytest.mark.parametrize(("name", "expected"), FAULTS.items())
def test_malformed_files_are_read_right_or_refused_with_a_typed_error(shared: Path, name: str, expected: str) -> None:
    path = shared / "faults" / "bvh" / f"{name}.bvh"
    if expected == "reject":
        with pytest.raises(MotionError, match=name):
            read_capture(path)
        return
    clip = read_clip(path)
    assert clip.frame_count == 5  # 3 frames at 30 a second
    assert np.isfinite(clip.joint_positions).all()
    assert np.allclose(np.linalg.norm(clip.rotations, axis=-1), 1.0)
    if expected == "no locomotion":
        with pytest.raises(MotionError, match="no locomotion"):
            build_motion_graph([MotionSource(clip, 0, ("crossing",))])


ALLOWED = {
    "accept": {"accept"}, "reject": {"reject"}, "reject_no_alloc": {"reject"}, "reject_or_rename": {"reject"},
    "accept_or_clear_error": {"accept", "reject"}, "reject_for_locomotion": {"reject", "no locomotion"},
    "reject_as_locomotion": {"no locomotion"},
}  # fmt: skip
"""What may be done for each expectation of EXPECT.json."""


def test_every_fault_is_treated_as_expected(shared: Path) -> None:
    wanted = json.loads((shared / "faults" / "bvh" / "EXPECT.json").read_text())
    assert wanted.keys() == FAULTS.keys()
    assert {path.stem for path in (shared / "faults" / "bvh").glob("*.bvh")} == FAULTS.keys()
    assert {
        name: entry["expect"] for name, entry in wanted.items() if FAULTS[name] not in ALLOWED[entry["expect"]]
    } == {}


def test_a_folder_that_cannot_be_read_is_not_taken_for_an_empty_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(MotionError, match=r"no file in .* matches"):
        capture_paths(tmp_path)
    monkeypatch.setattr(os, "listdir", refuse)
    monkeypatch.setattr(os, "scandir", refuse)
    with pytest.raises(MotionError, match=f"{tmp_path} cannot be read: Permission denied"):
        capture_paths(tmp_path)


def refuse(*_: object) -> None:
    """Refuse as the system does for folders of others; root may read them all."""
    raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))


def test_a_file_that_declares_too_many_frames_takes_no_memory(shared: Path) -> None:
    tracemalloc.start()
    try:
        with pytest.raises(MotionError, match="frames_huge"):
            read_capture(shared / "faults" / "bvh" / "frames_huge.bvh")
        assert tracemalloc.get_traced_memory()[1] < 10e6
    finally:
        tracemalloc.stop()


def test_channel_order_is_kept(shared: Path) -> None:
    zxy = read_clip(shared / "faults" / "bvh" / "ok.bvh")
    xyz = read_clip(shared / "faults" / "bvh" / "order_xyz.bvh")
    assert not np.allclose(zxy.rotations[0], xyz.rotations[0])


def test_joints_are_where_pybvh_has_them(shared: Path) -> None:
    """On every capture: each clip is a stretch of the file, every second frame, on its own floor."""
    paths = sorted((shared / "mocap").glob("*.bvh"))
    assert len(paths) == 44
    for path in paths:
        bvh = pybvh.read_bvh_file(path, world_up="+y")
        ours = np.asarray(bvh.joint_positions())[:, :, [2, 0, 1]] * 0.01
        first = 0
        for clip in read_capture(path).clips:
            begin = clip.joint_positions[0, :, :2]
            near = np.abs(ours[first:, :, :2] - begin).max(axis=(1, 2)) < 1e-6
            assert near.any(), (path.name, clip.name)
            first += int(np.argmax(near))
            theirs = ours[first::2][: clip.frame_count]
            lift = theirs[0, 0, 2] - clip.joint_positions[0, 0, 2]
            assert np.allclose(clip.joint_positions, theirs - [0, 0, lift], rtol=0.0, atol=1e-6), (path.name, clip.name)


@pytest.mark.parametrize("trial", ["16_15_walk_straight_slow_a", "16_27_brisk_walk_turn90_left_a"])
def test_an_amc_file_is_its_bvh_conversion(shared: Path, trial: str) -> None:
    original = read_capture(shared / "mocap" / "asfamc" / f"{trial[:5]}.amc")
    converted = read_capture(shared / "mocap" / f"{trial}.bvh")
    assert original.report.unit == "CMU unit"
    assert original.report.assumed == ("120 frames a second", "the skeleton is 16.asf")
    assert original.report.kept_frames == converted.report.kept_frames
    for one, other in zip(original.clips, converted.clips, strict=True):
        assert np.allclose(one.joint_positions, other.joint_positions, rtol=0.0, atol=1e-3)
        assert one.skeleton.roles == other.skeleton.roles


ASF = """:version 1.10
:units
  length 0.45
  angle deg
:root
  order TX TY TZ RX RY RZ
  axis XYZ
:bonedata
{bones}:hierarchy
  begin
    root lhipjoint rhipjoint
    lhipjoint lfemur
    rhipjoint rfemur
    lfemur ltibia
    ltibia lfoot
    rfemur rtibia
    rtibia rfoot
  end
"""
BONE = """  begin
    name {name}
    direction {way}
    length 7.6
    axis 0 0 0 XYZ
    dof rx ry rz
  end
"""


def write_amc(folder: Path, motion: str, asf: str | None = None) -> Path:
    bones = "".join(
        BONE.format(name=side + part, way="0 0 1" if part == "foot" else f"{across} -0.97 0")
        for side, across in (("l", 0.2), ("r", -0.2))
        for part in ("hipjoint", "femur", "tibia", "foot")
    )
    (folder / "x.asf").write_text(ASF.format(bones=bones) if asf is None else asf)
    path = folder / "x_01.amc"
    path.write_text(motion)
    return path


@pytest.mark.parametrize(
    ("motion", "said"),
    [
        (":DEGREES\n", "no frames"),
        (":DEGREES\n1\nroot 0 0 0 0 0\n", "5 values for 'root'"),
        (":DEGREES\n1\nroot 0 0 zero 0 0 0\n", "not numbers"),
        (":DEGREES\n1\nroot 0 0 nan 0 0 0\n", "not finite"),
        (":DEGREES\n2\nroot 0 0 0 0 0 0\n", "frame 2 follows frame 0"),
        (":DEGREES\n1\ntail 1 2 3\n", "'tail' is not a bone"),
        ("root 0 0 0 0 0 0\n", "before the first frame"),
        (":RADIANS\n1\nroot 0 0 0 0 0 0\n", "radians"),
        (":DEGREES\n1\nroot 0 0 0 0 0 0\nlfoot 1 2 3\n2\nroot 0 0 0 0 0 0\n", "1 of 2 frames"),
        (f":DEGREES\n{'9' * 5000}\nroot 0 0 0 0 0 0\n", "frame 9{20} follows frame 0"),
        ("\x00\xff", "read as text"),
    ],
)
def test_what_is_wrong_in_an_amc_file_is_said(tmp_path: Path, motion: str, said: str) -> None:
    path = write_amc(tmp_path, motion)
    if "xff" in repr(motion) or chr(255) in motion:
        path.write_bytes(b"\x00\xff")
    with pytest.raises(MotionError, match=said):
        read_capture(path)


@pytest.mark.parametrize(
    ("asf", "said"),
    [
        ("", "hierarchy has no root"),
        (":bonedata\nbegin\nname a\nend\n", "no direction, length, axis"),
        (":hierarchy\nbegin\nroot a\nend\n", "order"),
        (":root\norder TX TY TZ RX RY RZ\n:hierarchy\nbegin\nroot a\nend\n", "not defined: a"),
    ],
)
def test_what_is_wrong_in_an_asf_file_is_said(tmp_path: Path, asf: str, said: str) -> None:
    with pytest.raises(MotionError, match=said):
        read_capture(write_amc(tmp_path, "1\nroot 0 0 0 0 0 0\n", asf))


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("axis XYZ\n:", "axis XYW\n:", "axis 'XYW'.*orders them, as XYZ"),
        ("axis XYZ\n:", "axis\n:", "axis ''.*orders them, as XYZ"),
        ("axis XYZ\n:", "axis XYZ\n  orientation 0 0\n:", "orientation '0 0'.*three numbers"),
        ("angle deg", "angle gon", "x.asf:4: the unit of angles is 'gon'; write deg or rad"),
        ("angle deg", "angle", "x.asf:4: the unit of angles is ''; write deg or rad"),
    ],
)
def test_what_is_wrong_in_one_line_of_an_asf_file_is_said(tmp_path: Path, old: str, new: str, said: str) -> None:
    path = write_amc(tmp_path, "1\nroot 0 0 0 0 0 0\n")
    asf = (tmp_path / "x.asf").read_text()
    assert old in asf
    (tmp_path / "x.asf").write_text(asf.replace(old, new))
    with pytest.raises(MotionError, match=said):
        read_capture(path)


def write_chain(folder: Path, count: int) -> Path:
    """A chain of ``count`` bones of 0.1 units."""
    bones = "".join(BONE.format(name=f"b{k}", way="0 -1 0").replace("7.6", "0.1") for k in range(count))
    lines = "".join(f"b{k} b{k + 1}\n" for k in range(count - 1))
    head = ":root\norder TX TY TZ RX RY RZ\n:bonedata\n"
    return write_amc(folder, "1\nroot 0 0 0 0 0 0\n", f"{head}{bones}:hierarchy\nbegin\nroot b0\n{lines}end\n")


def test_long_chains_of_bones_are_read_up_to_as_many_joints_as_bvh_files_may_have(tmp_path: Path) -> None:
    assert read_clip(write_chain(tmp_path, 999), meters_per_unit=0.01).skeleton.joint_count == 1000
    with pytest.raises(MotionError, match="1501 bones, more than the 1000"):
        read_capture(write_chain(tmp_path, 1500))


def test_a_skeleton_must_be_beside_an_amc_file(tmp_path: Path) -> None:
    (tmp_path / "x_01.amc").write_text("1\nroot 0 0 0 0 0 0\n")
    with pytest.raises(MotionError, match=r"put x_01\.asf beside it"):
        read_capture(tmp_path / "x_01.amc")


def test_a_small_amc_file_is_read(tmp_path: Path) -> None:
    frames = "".join(f"{f}\nroot 0 16 {f / 10} 0 0 0\nlfemur {30 - abs(f - 30)} 0 0\n" for f in range(1, 61))
    clip = read_clip(write_amc(tmp_path, ":FULLY-SPECIFIED\n:DEGREES\n" + frames))
    assert clip.frame_count == 30
    assert clip.skeleton.leg_length() == pytest.approx(0.86, abs=0.02)
    # All of the leg swings; the other hangs.
    ankle = clip.joint_positions[:, clip.skeleton.joint("left_ankle")] - clip.joint_positions[:, 0]
    assert np.ptp(ankle[:, 0]) > 0.2
    other = clip.joint_positions[:, clip.skeleton.joint("right_ankle")] - clip.joint_positions[:, 0]
    assert np.ptp(other, axis=0) == pytest.approx(np.zeros(3), abs=1e-9)


def test_angles_of_an_amc_file_are_in_its_own_unit_if_it_names_one(tmp_path: Path) -> None:
    """Axes of bones stay in the unit of the skeleton."""
    frames = "".join(f"{f}\nroot 0 16 {f / 10} 0 0 0\nlfemur {30 - abs(f - 30)} 0 0\n" for f in range(1, 61))
    in_degrees = read_clip(write_amc(tmp_path, ":DEGREES\n" + frames))
    text = (tmp_path / "x.asf").read_text().replace("angle deg", "angle rad")
    of_both = read_clip(write_amc(tmp_path, ":DEGREES\n" + frames, text))
    assert np.allclose(of_both.joint_positions, in_degrees.joint_positions)
    radians = "".join(
        f"{f}\nroot 0 16 {f / 10} 0 0 0\nlfemur {np.radians(30 - abs(f - 30))} 0 0\n" for f in range(1, 61)
    )
    for word in ("rad", "RAD", "radians"):
        of_skeleton = read_clip(write_amc(tmp_path, radians, text.replace("angle rad", f"angle {word}")))
        assert np.allclose(of_skeleton.joint_positions, in_degrees.joint_positions), word


def test_reports_agree_with_the_manifest(shared: Path) -> None:
    manifest = json.loads((shared / "mocap" / "manifest.json").read_text())
    for entry in manifest[::3]:
        report = read_capture(shared / "mocap" / entry["file"]).report
        assert report.unit == "cm"
        assert 0.82 <= report.leg_length <= 0.88
        assert (report.up, report.facing) == ("+y", "+z")
        assert report.source_rate == 120.0
        assert not report.dropped_first
        assert sorted({frame for frame, _ in report.glitches}) == entry["glitch_frames"]


def test_calibration_pose_is_dropped_and_cmu_units_are_found(shared: Path) -> None:
    capture = read_capture(shared / "mocap" / "asfamc" / "16_27_cgspeed_style_tpose_cmu_units.bvh")
    assert capture.report.unit == "CMU unit"
    assert capture.report.dropped_first
    other = read_clip(shared / "mocap" / "16_27_brisk_walk_turn90_left_a.bvh")
    assert np.allclose(capture.clips[0].joint_positions, other.joint_positions, atol=2e-3)


def test_feet_stand_on_the_floor(shared: Path) -> None:
    clip = read_clip(shared / "mocap" / "16_47_walk_straight_normal_a.bvh")
    feet = clip.joint_positions[:, [clip.skeleton.joint("left_toe"), clip.skeleton.joint("right_toe")], 2]
    assert 0.0 <= feet.min() < 0.03


BVH = """HIERARCHY
ROOT {prefix}Hips
{{
 OFFSET 0 0 0
 CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
{legs}}}
MOTION
Frames: {frames}
Frame Time: {time}
{rows}
"""
LEG = """ JOINT {p}{s}UpLeg
 {{
  OFFSET {hip}
  CHANNELS 3 Zrotation Xrotation Yrotation
  JOINT {p}{s}Leg
  {{
   OFFSET {bone}
   CHANNELS 3 Zrotation Xrotation Yrotation
   JOINT {p}{s}Foot
   {{
    OFFSET {bone}
    CHANNELS 3 Zrotation Xrotation Yrotation
    End Site
    {{
     OFFSET {toe}
    }}
   }}
  }}
 }}
"""


def write_legs(path: Path, scale: float, axes: str, time: float = 1 / 60, frames: int = 30, prefix: str = "") -> Path:
    """A pair of legs that walks ahead at 1.2 m/s; ``axes`` says which file axes are left, up and ahead."""

    def vector(left: float, up: float, ahead: float) -> str:
        values = dict(zip(axes, (left, up, ahead), strict=True))
        return " ".join(f"{values[a] * scale:.8f}" for a in "xyz")

    legs = "".join(
        LEG.format(p=prefix, s=s, hip=vector(sign * 0.09, 0, 0), bone=vector(0, -0.43, 0), toe=vector(0, -0.05, 0.15))
        for s, sign in (("Left", 1), ("Right", -1))
    )
    rows = "\n".join(vector(0, 0.91, 1.2 * f * time) + " 0 0 0" * 7 for f in range(frames))
    path.write_text(BVH.format(prefix=prefix, legs=legs, frames=frames, time=f"{time:.7f}", rows=rows))
    return path


@pytest.mark.parametrize(
    ("unit", "scale"), [("m", 1.0), ("cm", 100.0), ("inch", 1 / 0.0254), ("CMU unit", 1 / 0.056444)]
)
@pytest.mark.parametrize("axes", ["xyz", "yzx"])
def test_units_and_axes_are_found(tmp_path: Path, unit: str, scale: float, axes: str) -> None:
    capture = read_capture(write_legs(tmp_path / "legs.bvh", scale, axes, prefix="mixamorig:"))
    assert capture.report.unit == unit
    assert (capture.report.up, capture.report.facing) == ("+" + axes[1], "+" + axes[2])
    clip = capture.clips[0]
    assert np.allclose(clip.skeleton.offsets[clip.skeleton.joint("left_hip")], [0, 0.09, 0], atol=1e-6)
    assert np.allclose(clip.root_positions[-1] - clip.root_positions[0], [1.2 * 29 / 60, 0, 0], atol=1e-6)
    assert np.allclose(clip.root_positions[:, 2], 0.91, atol=1e-6)


@pytest.mark.parametrize(("unit", "leg"), [(0.0254, "2.18 m"), (0.001, "0.086 m"), (1.0, "86 m")])
def test_a_unit_with_which_legs_are_no_persons_is_refused(tmp_path: Path, unit: float, leg: str) -> None:
    path = tmp_path / "legs.bvh"
    write_legs(path, 100.0, "xyz")
    assert read_capture(path, meters_per_unit=0.01).report.leg_length == pytest.approx(0.86)
    with pytest.raises(MotionError, match=rf"with the unit that is given, the legs are {leg} long.* give another unit"):
        read_capture(path, meters_per_unit=unit)


def test_a_size_of_no_person_is_refused_unless_the_unit_is_given(tmp_path: Path) -> None:
    path = write_legs(tmp_path / "legs.bvh", 5000.0, "xyz")
    with pytest.raises(MotionError, match="meters_per_unit"):
        read_capture(path)
    assert read_capture(path, meters_per_unit=1 / 5000).report.leg_length == pytest.approx(0.86)
    for unit in (0.0, -0.01, np.nan, np.inf):
        with pytest.raises(MotionError, match=r"meters_per_unit is .*; give a positive number"):
            read_capture(path, meters_per_unit=unit)


@pytest.mark.parametrize(("time", "rate"), [(0.0083333, 120.0), (0.0333333, 30.0), (0.01, 100.0), (0.0417083, 23.976)])
def test_rates_are_snapped_and_resampled(tmp_path: Path, time: float, rate: float) -> None:
    capture = read_capture(write_legs(tmp_path / "legs.bvh", 1.0, "xyz", time=time))
    assert capture.report.source_rate == pytest.approx(rate, rel=2e-3)
    steps = np.diff(capture.clips[0].root_positions[:, 0])
    assert np.allclose(steps * 60, 1.2, rtol=3e-3)


def test_missing_file_is_a_motion_error(tmp_path: Path) -> None:
    with pytest.raises(MotionError, match="no such capture file"):
        read_clip(tmp_path / "none.bvh")


def test_a_spike_splits_the_capture() -> None:
    positions = np.zeros((200, 3, 3))
    positions[:, :, 0] = np.linspace(0, 2, 200)[:, None]
    positions[100, 2, 1] = 0.6
    stretches, dropped, jumps = clean_stretches(positions, 120.0)
    assert not dropped
    assert jumps == [(100, 2), (101, 2)]
    assert stretches == [(0, 96), (104, 199)]


@pytest.mark.parametrize("rate", [10.0, 20.0])
def test_a_spike_is_cut_out_of_slow_captures_too(rate: float) -> None:
    positions = np.zeros((100, 1, 3))
    positions[50, 0, 1] = 4.0
    stretches, _, jumps = clean_stretches(positions, rate)
    assert jumps == [(50, 0), (51, 0)]
    assert stretches == [(0, 48), (52, 99)]


def test_files_that_hold_clips_of_the_same_name_are_refused(tmp_path: Path) -> None:
    paths = [write_legs(tmp_path / f"{name}.bvh", 1.0, "xyz", frames=120) for name in ("walk", "walk.1")]
    lines = paths[0].read_text().splitlines()
    lines[-60] = "9 " + lines[-60].partition(" ")[2]
    paths[0].write_text("\n".join(lines))
    assert [clip.name for clip in read_clips(paths[:1])] == ["walk.1", "walk.2"]
    with pytest.raises(MotionError, match=r"walk\.bvh and walk\.1\.bvh both hold a clip 'walk\.1'; rename one"):
        read_clips(paths)


def test_resampling_turns_along_the_shorter_arc() -> None:
    angle = np.linspace(0, 1, 11)
    rotations = np.stack([np.cos(angle / 2), 0 * angle, 0 * angle, np.sin(angle / 2)], axis=-1)[:, None]
    rotations[::2] *= -1.0
    _, result = resample(np.zeros((11, 3)), rotations, 50.0, 60.0)
    turned = 2 * np.arctan(result[:, 0, 3] / result[:, 0, 0])
    assert np.allclose(np.diff(turned), 0.1 * 50 / 60, atol=1e-9)


@pytest.mark.parametrize(
    "names",
    [
        ["Hips", "Chest", "Neck", "Head", "LeftArm", "LeftForeArm", "LeftHand", "RightArm", "RightForeArm", "RightHand",
         "LeftUpLeg", "LeftLeg", "LeftFoot", "LeftToeBase", "RightUpLeg", "RightLeg", "RightFoot", "RightToeBase"],
        ["root", "thorax", "lowerneck", "head", "lhumerus", "lradius", "lwrist", "rhumerus", "rradius", "rwrist",
         "lfemur", "ltibia", "lfoot", "ltoes", "rfemur", "rtibia", "rfoot", "rtoes"],
        ["pelvis", "spine_03", "neck_01", "head", "upperarm_l", "lowerarm_l", "hand_l", "upperarm_r", "lowerarm_r",
         "hand_r", "thigh_l", "calf_l", "foot_l", "ball_l", "thigh_r", "calf_r", "foot_r", "ball_r"],
    ],
)  # fmt: skip
def test_roles_of_the_usual_conventions(names: list[str]) -> None:
    assert find_roles(names) == {role: index for index, role in enumerate(ROLES)}


def test_the_trunk_is_told_by_where_the_arms_hang() -> None:
    names = ["Root", "A", "B", "LeftClav", "LeftUpperArm", "RightClav", "RightUpperArm", "N", "Top"]
    parents = [-1, 0, 1, 2, 3, 2, 5, 2, 7]
    roles = find_roles(names, parents)
    assert (roles["chest"], roles["neck"], roles["head"]) == (2, 7, 8)
    assert roles["hips"] == 0
    assert "chest" not in find_roles(names)
