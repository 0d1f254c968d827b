"""Binary glTF, read back."""

import os
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
import trimesh

from crowdsim.errors import CrowdSimError
from crowdsim.export.formats import export
from crowdsim.export.scenes import gltf
from crowdsim.export.scenes.bodies import default_rate
from crowdsim.recording.reader import Recording
from tests.support.browser import NPM_CI
from tests.support.gltf_reader import Glb
from tests.support.odd_recording import ODD_NAMES, odd_header, write_recording
from tests.support.small_recording import small_header, write_small_recording
from tests.support.walked_recordings import write_ring, write_steered, write_switching, write_with_crate

WRITERS = {
    "captured": write_small_recording,
    "ring": write_ring,
    "crate": write_with_crate,
    "steered": write_steered,
    "switching": write_switching,
}
VALIDATE = """
require("gltf-validator").validateBytes(new Uint8Array(require("fs").readFileSync(process.argv[1])))
    .then((report) => console.log(report.issues.numErrors + report.issues.numWarnings, JSON.stringify(report.issues)))
"""


@pytest.fixture(scope="module", params=WRITERS)
def pair(request, tmp_path_factory):
    """A recording and the GLB of it."""
    folder = tmp_path_factory.mktemp(request.param)
    with Recording.open(WRITERS[request.param](folder / "run.h5")) as recording:
        yield recording, export(recording, folder / "run.glb")


@pytest.fixture(scope="session")
def validator(tmp_path_factory):
    """The folder in which npm has put Khronos' validator; None without npm or its registry, which fails in CI."""
    needed = os.environ.get(NPM_CI)
    if shutil.which("node") is None or shutil.which("npm") is None:
        assert not needed, f"npm is not installed, but {NPM_CI} is set"
        return None
    folder = tmp_path_factory.mktemp("validator")
    install = ["npm", "install", "--no-audit", "--no-fund", "gltf-validator@2.0.0-dev.3.10"]
    done = subprocess.run(install, cwd=folder, capture_output=True)
    assert done.returncode == 0 or not needed, done.stderr.decode()
    return folder if done.returncode == 0 else None


def require_valid(file: Path, validator: Path | None) -> None:
    """Khronos' validator finds nothing wrong; without it, trimesh reads every mesh."""
    if validator is not None:
        command = ["node", "-e", VALIDATE, str(file)]
        report = subprocess.run(command, cwd=validator, capture_output=True, text=True, check=True).stdout
        assert report.startswith("0 "), report
    scene = trimesh.load(file)
    assert len(scene.geometry) >= 1
    assert all(np.isfinite(mesh.vertices).all() for mesh in scene.geometry.values())


def test_joints_are_where_the_recording_shows_them(pair):
    recording, file = pair
    read = Glb(file)
    assert read.document["scene"] == 0
    assert len(read.document["scenes"]) == 1
    names = recording.header.motion.skeleton.names
    for skin in read.document["skins"]:
        assert [read.nodes[joint]["name"] for joint in skin["joints"]] == list(names)
    worst = 0.0
    for step in sorted({*range(0, recording.steps, 7), recording.steps - 1}):
        positions, _ = recording.poses(step)
        present = np.flatnonzero(np.isfinite(positions[:, 0, 0]))
        shown = read.joints_at(step / recording.steps_per_second)
        assert sorted(shown) == present.tolist()
        for agent in present.tolist():
            worst = max(worst, float(np.abs(shown[agent] - positions[agent]).max()))
    assert worst <= 1e-4


def test_validators_find_nothing(pair, validator):
    require_valid(pair[1], validator)


def test_nobody_is_drawn_on_the_way_back_across_a_periodic_floor(tmp_path):
    with Recording.open(write_ring(tmp_path / "ring.h5")) as ring:
        read = Glb(export(ring, tmp_path / "ring.glb"))
        times = (np.arange(1990) + 0.5) / 100.0
        tracks = [values for (_, path), (_, values, _) in read.channels().items() if path == "translation"]
        steps = [read.joints_at(time)[0][0, 0] for time in times[::20]]
        leaps = [int((np.abs(np.diff(values[:, 0])) > 4.0).sum()) for values in tracks]
    assert min(leaps) >= 2
    for (_, path), (at, values, _) in read.channels().items():
        if path == "translation":
            far = np.abs(np.diff(values[:, 0])) > 4.0
            assert (np.diff(at)[far] < 0.0015).all()  # all that is not seen
    assert min(steps) >= -4.2
    assert max(steps) <= 4.2


def test_samples_at_an_end_have_times_of_their_own_if_an_instant_is_not_resolved(tmp_path, monkeypatch):
    monkeypatch.setattr(gltf, "_INSTANT", 1e-9)  # to times of seconds as a millisecond is to those of hours
    with Recording.open(write_ring(tmp_path / "ring.h5")) as ring:
        channels = Glb(export(ring, tmp_path / "ring.glb")).channels()
    places = [each for (_, path), each in channels.items() if path == "translation"]
    assert places
    for times, values, _ in places:
        assert (np.diff(times)[np.abs(np.diff(values[:, 0])) > 4.0] > 0.0).all()


def test_a_crate_has_size_while_it_is_there(tmp_path):
    with Recording.open(write_with_crate(tmp_path / "run.h5")) as recording:
        read = Glb(export(recording, tmp_path / "run.glb"))
    crates = [number for number, node in enumerate(read.nodes) if node["name"] == 'a "crate", ב']
    assert len(crates) == 2
    seen = []
    for time in (0.5, 1.5, 2.5, 3.5):
        matrices = read.matrices_at(time)
        seen.append([bool(abs(np.linalg.det(matrices[crate])) > 0.5) for crate in crates])
    assert seen == [[False, False], [True, False], [False, True], [False, False]]


def test_a_part_begins_at_second_zero(tmp_path):
    with Recording.open(write_small_recording(tmp_path / "run.h5")) as recording:
        read = Glb(export(recording, tmp_path / "run.glb", rate=10, start=2.0, end=3.0, agents="1"))
        positions, _ = recording.poses(50)
    assert list(read.characters()) == [1]
    assert read.document["asset"]["extras"]["start"] == 2.0
    assert np.abs(read.joints_at(0.5)[1] - positions[1]).max() <= 1e-4
    assert max(times[-1] for times, _, _ in read.channels().values()) == 1.0


def test_names_stay_names(tmp_path, validator):
    with Recording.open(write_recording(tmp_path / "odd.h5", odd_header(), 30)) as odd:
        file = export(odd, tmp_path / "odd.glb")
    read = Glb(file)
    groups = {node["extras"]["agent"]: node["extras"]["group"] for node in read.nodes if "extras" in node}
    assert groups == dict(enumerate(ODD_NAMES))
    require_valid(file, validator)


@pytest.mark.parametrize(("steps", "present"), [(0, True), (1, False), (1, True), (5, False)])
def test_nobody_and_one_step_are_files_too(tmp_path, validator, steps, present):
    with Recording.open(write_recording(tmp_path / "run.h5", small_header(2), steps, present)) as recording:
        file = export(recording, tmp_path / "run.glb")
    read = Glb(file)
    assert len(read.characters()) == (1 if steps and present else 0)  # the second one comes later
    require_valid(file, validator)


def test_many_take_fewer_frames_unless_others_are_asked_for(tmp_path):
    with Recording.open(write_small_recording(tmp_path / "few.h5", 5, 3, 30)) as few:
        assert default_rate(few, few.agent_count) == 30
    with Recording.open(write_small_recording(tmp_path / "many.h5", 5, 51, 30)) as many:
        assert default_rate(many, many.agent_count) == 15
        sizes = [export(many, tmp_path / "many.glb", rate=rate).stat().st_size for rate in (None, 15, 30)]
        assert sizes[0] == sizes[1] < sizes[2]
        with pytest.raises(CrowdSimError, match="choose one of"):
            export(many, tmp_path / "many.glb", rate=20)
    with Recording.open(write_small_recording(tmp_path / "slow.h5", 5, 51, 20)) as slow:
        assert default_rate(slow, slow.agent_count) == 10


def test_the_same_recording_gives_the_same_bytes(tmp_path):
    with Recording.open(write_small_recording(tmp_path / "run.h5", 30)) as recording:
        files = [export(recording, tmp_path / f"{number}.glb").read_bytes() for number in range(2)]
    assert files[0] == files[1]
