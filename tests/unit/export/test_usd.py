"""Binary USD, read back by usd-core and its validators."""

import sys
from dataclasses import replace

import numpy as np
import pytest
from pxr import Gf, Usd, UsdGeom, UsdShade, UsdSkel, UsdValidation

from crowdsim.errors import CrowdSimError
from crowdsim.export.formats import export
from crowdsim.export.options import ExportOptions
from crowdsim.recording.header import AgentState
from crowdsim.recording.reader import Recording
from crowdsim.recording.writer import RecordingWriter
from tests.support.odd_recording import ODD_NAMES, odd_header, write_recording
from tests.support.small_recording import small_frame, small_header, write_small_recording
from tests.support.walked_recordings import write_ring, write_steered, write_switching, write_with_crate

WRITERS = {
    "captured": write_small_recording,
    "ring": write_ring,
    "crate": write_with_crate,
    "steered": write_steered,
    "switching": write_switching,
}
POINTS = ExportOptions(points=True)


@pytest.fixture(scope="module", params=WRITERS)
def pair(request, tmp_path_factory):
    """A recording and the USD of it."""
    folder = tmp_path_factory.mktemp(request.param)
    with Recording.open(WRITERS[request.param](folder / "run.h5")) as recording:
        yield recording, export(recording, folder / "run.usdc")


def complaints(file):
    """What the validators of usd-core say."""
    stage = Usd.Stage.Open(str(file))
    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    assert len(validators) >= 20
    return [error.GetErrorAsString() for error in UsdValidation.ValidationContext(validators).Validate(stage)]


def joints_at(stage, code):
    """Agent -> places (J, 3) of the joints of all who are to be seen."""
    cache, places, found = UsdSkel.Cache(), UsdGeom.XformCache(code), {}
    for prim in stage.GetPrimAtPath("/World/Characters").GetChildren():
        root = UsdSkel.Root(prim)
        if UsdGeom.Imageable(prim).ComputeVisibility(code) == UsdGeom.Tokens.invisible:
            continue
        cache.Populate(root, Usd.PrimDefaultPredicate)
        skeleton = UsdSkel.Skeleton(stage.GetPrimAtPath(prim.GetPath().AppendChild("Skeleton")))
        world = cache.GetSkelQuery(skeleton).ComputeJointWorldTransforms(places)
        agent = prim.GetCustomDataByKey("crowdsim:agent")
        found[agent] = np.array([matrix.ExtractTranslation() for matrix in world])
    return found


def test_joints_are_where_the_recording_shows_them(pair):
    recording, file = pair
    stage = Usd.Stage.Open(str(file))
    assert stage.GetTimeCodesPerSecond() == recording.steps_per_second
    worst = 0.0
    for step in sorted({*range(0, recording.steps, 7), recording.steps - 1}):
        positions, _ = recording.poses(step)
        present = np.flatnonzero(np.isfinite(positions[:, 0, 0]))
        shown = joints_at(stage, Usd.TimeCode(step))
        assert sorted(shown) == present.tolist()
        for agent in present.tolist():
            worst = max(worst, float(np.abs(shown[agent] - positions[agent]).max()))
    assert worst <= 1e-4


def test_validators_find_nothing(pair):
    assert complaints(pair[1]) == []


def test_skins_follow_their_skeletons(pair):
    stage = Usd.Stage.Open(str(pair[1]))
    prims = list(stage.GetPrimAtPath("/World/Characters").GetChildren())
    assert prims
    for prim in prims:
        cache = UsdSkel.Cache()
        cache.Populate(UsdSkel.Root(prim), Usd.PrimDefaultPredicate)
        (binding,) = cache.ComputeSkelBindings(UsdSkel.Root(prim), Usd.PrimDefaultPredicate)
        assert [query.GetPrim().GetName() for query in binding.GetSkinningTargets()] == ["Body"]
        for tissue in ("shirt", "trousers", "skin", "hair", "shoes"):
            subset = stage.GetPrimAtPath(f"{prim.GetPath()}/Body/{tissue}")
            material, _ = UsdShade.MaterialBindingAPI(subset).ComputeBoundMaterial()
            assert material.GetSurfaceOutput().HasConnectedSource()


def test_nobody_is_drawn_on_the_way_back_across_a_periodic_floor(tmp_path):
    with Recording.open(write_ring(tmp_path / "ring.h5")) as ring:
        stage = Usd.Stage.Open(str(export(ring, tmp_path / "ring.usdc")))
    ways = UsdGeom.Xformable(stage.GetPrimAtPath("/World/Characters/character_0")).GetOrderedXformOps()[0]
    codes = ways.GetTimeSamples()
    places = np.array([ways.Get(code)[0] for code in codes])
    far = np.abs(np.diff(places)) > 4.0
    assert far.sum() >= 2
    assert (np.diff(codes)[far] < 0.015).all()


def test_a_crate_is_seen_while_it_is_there(tmp_path):
    with Recording.open(write_with_crate(tmp_path / "run.h5")) as recording:
        stage = Usd.Stage.Open(str(export(recording, tmp_path / "run.usdc")))
    crates = [prim for prim in stage.Traverse() if prim.GetDisplayName() == 'a "crate", ב']
    assert len(crates) == 2
    seen = [
        [UsdGeom.Imageable(crate).ComputeVisibility(code) != UsdGeom.Tokens.invisible for crate in crates]
        for code in (0, 10, 20, 39, 40, 59, 60, 89)
    ]
    first, second, none = [True, False], [False, True], [False, False]
    assert seen == [none, none, first, first, second, second, none, none]


def test_capsules_stand_where_the_tracks_are(tmp_path):
    with Recording.open(write_small_recording(tmp_path / "run.h5")) as recording:
        file = export(recording, tmp_path / "run.usdc", rate=10, options=POINTS)
        stage = Usd.Stage.Open(str(file))
        crowd = UsdGeom.PointInstancer(stage.GetPrimAtPath("/World/Crowd"))
        for code in range(45):
            frame = recording.at_step(2 * code)
            present = np.flatnonzero(frame.state != AgentState.ABSENT)
            assert list(crowd.GetIdsAttr().Get(code)) == present.tolist()
            assert list(crowd.GetProtoIndicesAttr().Get(code)) == frame.behavior[present].tolist()
            places = np.array(crowd.GetPositionsAttr().Get(code))
            assert np.array_equal(places[:, :2], np.column_stack([frame.x, frame.y])[present])
            for turn, heading in zip(crowd.GetOrientationsAttr().Get(code), frame.heading[present], strict=True):
                ahead = Gf.Rotation(Gf.Quatd(turn)).TransformDir(Gf.Vec3d(1.0, 0.0, 0.0))
                assert np.abs(np.array(ahead)[:2] - [np.cos(heading), np.sin(heading)]).max() < 2e-3
    assert complaints(file) == []


def write_exchange(path):
    """Two people at two places: in each step but the first ones the other one is in the world."""
    header = small_header(2, 10)
    with RecordingWriter(path, header) as writer:
        for step in range(60):
            frame = small_frame(header, step)
            absent = np.array([step % 3 == 1, step % 3 == 2])
            x, y = (np.where(absent, np.nan, each).astype(np.float32) for each in (frame.x, frame.y + [0.0, 3.0]))
            writer.append(frame._replace(x=x, y=y, state=np.where(absent, AgentState.ABSENT, frame.state)), step)
        writer.finish({})
    return path


@pytest.mark.parametrize(
    "write", [write_ring, write_steered, write_exchange], ids=["over the ends", "one comes and goes", "in turns"]
)
def test_capsules_fly_nowhere_between_frames(tmp_path, write):
    """As renderers ask for times between frames: each agent of a frame is near its place, even if others follow it."""
    with Recording.open(write(tmp_path / "run.h5")) as recording:
        stage = Usd.Stage.Open(str(export(recording, tmp_path / "run.usdc", options=POINTS)))
        crowd = UsdGeom.PointInstancer(stage.GetPrimAtPath("/World/Crowd"))
        checked = 0
        for code in range(recording.steps - 1):
            frames = recording.at_step(code), recording.at_step(code + 1)
            for late in (0.25, 0.5, 0.9):
                ids, places = crowd.GetIdsAttr().Get(code + late), crowd.GetPositionsAttr().Get(code + late)
                assert list(ids) == np.flatnonzero(frames[0].state != AgentState.ABSENT).tolist()
                for agent, place in zip(ids, places, strict=True):
                    way = np.hypot(frames[0].x[agent] - place[0], frames[0].y[agent] - place[1])
                    assert way < 0.3 * late
                    checked += 1
        assert checked > 100
        assert len(crowd.GetOrientationsAttr().Get(0.5)) == len(crowd.GetPositionsAttr().Get(0.5))


def test_names_stay_names(tmp_path):
    with Recording.open(write_recording(tmp_path / "odd.h5", odd_header(), 30)) as odd:
        file = export(odd, tmp_path / "odd.usdc")
    stage = Usd.Stage.Open(str(file))
    people = stage.GetPrimAtPath("/World/Characters").GetChildren()
    groups = {prim.GetCustomDataByKey("crowdsim:agent"): prim.GetCustomDataByKey("crowdsim:group") for prim in people}
    assert groups == dict(enumerate(ODD_NAMES))
    assert complaints(file) == []


def test_joints_whose_names_differ_in_other_characters_only_stay_apart(tmp_path):
    header = small_header()
    skeleton = header.motion.skeleton
    others = {
        "left_hip": "hip 1",
        "right_hip": "hip-1",
        "spine": "hip_1",
        "left_shoulder": "肩",
        "right_shoulder": "腕",
    }
    named = replace(skeleton, names=tuple(others.get(name, name) for name in skeleton.names))
    header = replace(header, motion=replace(header.motion, skeleton=named))
    with Recording.open(write_recording(tmp_path / "run.h5", header, 30)) as recording:
        file = export(recording, tmp_path / "run.usdc")
        positions, _ = recording.poses(20, [0])
        assert np.abs(joints_at(Usd.Stage.Open(str(file)), Usd.TimeCode(20))[0] - positions[0]).max() <= 1e-4
    assert complaints(file) == []


@pytest.mark.parametrize("options", [ExportOptions(), POINTS])
@pytest.mark.parametrize(("steps", "present"), [(0, True), (1, True), (5, False)])
def test_nobody_and_one_step_are_files_too(tmp_path, options, steps, present):
    with Recording.open(write_recording(tmp_path / "run.h5", small_header(2), steps, present)) as recording:
        file = export(recording, tmp_path / "run.usdc", options=options)
    assert complaints(file) == []


def test_the_same_recording_gives_the_same_bytes(tmp_path):
    with Recording.open(write_small_recording(tmp_path / "run.h5", 30)) as recording:
        files = [export(recording, tmp_path / f"{number}.usdc").read_bytes() for number in range(2)]
    assert files[0] == files[1]


def test_other_endings_and_a_missing_extra_are_refused(tmp_path, monkeypatch):
    with Recording.open(write_small_recording(tmp_path / "run.h5", 3)) as recording:
        with pytest.raises(CrowdSimError, match=r"ends in \.usdc"):
            export(recording, tmp_path / "run.data", kind="usdc")
        monkeypatch.setitem(sys.modules, "pxr", None)
        with pytest.raises(CrowdSimError, match=r"pip install 'crowdsim\[usd\]'"):
            export(recording, tmp_path / "run.usdc")
    assert [file.name for file in tmp_path.iterdir()] == ["run.h5"]
