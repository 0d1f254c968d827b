"""Pictures and films show what was recorded; machines that cannot draw are told so."""

import json
import subprocess
import sys
from dataclasses import replace
from itertools import pairwise
from unittest.mock import Mock

import numpy as np
import pytest
from PIL import Image

from crowdsim.crowd.simulation import Simulation
from crowdsim.errors import CrowdSimError, DrawingUnavailable, RecordingError
from crowdsim.playback import drawing_backend
from crowdsim.playback import shot as shot_module
from crowdsim.playback import window as window_module
from crowdsim.playback.drawing_backend import DrawingBackend, find_backend
from crowdsim.playback.film import film
from crowdsim.playback.scene import Scene
from crowdsim.playback.shot import shot, shots
from crowdsim.playback.window import Player, window
from crowdsim.recording.header import MeshRecord, SolidRecord
from crowdsim.recording.reader import Recording
from crowdsim.recording.writer import RecordingWriter
from crowdsim.scenario.loader import parse_scenario
from tests.support.small_recording import small_frame, small_header

SMALL = (160, 90)


@pytest.mark.usefixtures("can_draw")
def test_shot_shows_characters_in_the_colors_of_their_behaviors(recording, tmp_path):
    path = shot(recording, tmp_path / "out.png", time=2.0, size=(640, 360))
    pixels = np.asarray(Image.open(path))
    assert pixels.shape == (360, 640, 3)
    reddish = (pixels[..., 0].astype(int) > pixels[..., 2].astype(int) + 50).sum()
    bluish = (pixels[..., 2].astype(int) > pixels[..., 0].astype(int) + 50).sum()
    assert reddish > 300
    assert bluish > 300
    assert [p.name for p in tmp_path.iterdir()] == ["out.png"]


@pytest.mark.usefixtures("can_draw")
def test_a_run_to_which_nobody_came_has_pictures(tmp_path):
    scene = "{crowdsim: 1, name: closed, duration: 1, seed: 1, floor: {rectangle: [0, 0, 10, 6]}, obstacles: \
      [{name: wall, box: {min: [5, 0], max: [5.2, 6]}, top: 2.5}], agents: \
      [{name: some, count: 2, locomotion: captured, start: {rectangle: [1, 1, 3, 5]}, goal: {point: [9, 3]}}]}"
    with Simulation(parse_scenario(scene.replace("\\\n", ""))).run(tmp_path / "run.h5") as recording:
        assert recording.most_present == 0
        for color in ("behavior", "group", "level"):
            assert shot(recording, tmp_path / f"{color}.png", time=0.0, size=SMALL, color_by=color).is_file()


@pytest.mark.usefixtures("can_draw")
def test_several_times_are_the_pictures_of_each(recording, tmp_path):
    files = shots(recording, tmp_path / "out.png", [2.0, 0.25], size=SMALL)
    assert [file.name for file in files] == ["out-2.png", "out-0.25.png"]
    for file, time in zip(files, (2.0, 0.25), strict=True):
        alone = shot(recording, tmp_path / "alone.png", time=time, size=SMALL)
        assert np.array_equal(np.asarray(Image.open(file)), np.asarray(Image.open(alone)))
    with pytest.raises(CrowdSimError):
        shots(recording, tmp_path / "none.png", [1.0, 99.0], size=SMALL)
    assert not list(tmp_path.glob("none*"))


def test_times_that_hardly_differ_are_files_of_their_own(recording, tmp_path, monkeypatch):
    monkeypatch.setattr(shot_module, "_draw", lambda *_: None)
    for times, names in (
        ([1.2345678, 1.2345679, 2.0], ["a-1.2345678.png", "a-1.2345679.png", "a-2.png"]),
        ([1.0, 1.0 + 2**-52], ["a-1.png", "a-1.0000000000000002.png"]),
        ([2.0, 2.0], ["a-2.png", "a-2.png"]),
    ):
        assert [file.name for file in shots(recording, tmp_path / "a.png", times)] == names


@pytest.mark.usefixtures("can_draw")
@pytest.mark.parametrize("supersample", [1.5, 2])
def test_pixels_are_means_of_those_drawn(recording, supersample):
    scenes = [Scene(recording, size, supersample=k) for size, k in ((SMALL, supersample), ((480, 270), 1))]
    means = []
    for scene in scenes:
        scene.show_time(2.0)
        scene.look("top", 2.0)
        # Letters keep their size in pixels, so only the middle is compared.
        picture = scene.picture()
        height, width, _ = picture.shape
        middle = picture[height // 4 : 3 * height // 4, width // 4 : 3 * width // 4]
        means.append(middle.reshape(-1, 3).mean(axis=0))
        assert picture.dtype == np.uint8
        scene.close()
    assert np.abs(means[0] - means[1]).max() < 4.0


@pytest.mark.usefixtures("can_draw")
def test_planned_paths_are_drawn_unless_they_are_not_wanted(recording, tmp_path):
    files = [shot(recording, tmp_path / f"{k}.png", 1.0, "top", SMALL, paths=k == 0) for k in range(3)]
    files += shots(recording, tmp_path / "some.png", [1.0], "top", SMALL, paths=False)
    drawn, *others = (np.asarray(Image.open(file)).astype(int) for file in files)
    assert recording.paths_at(1.0)
    assert (np.abs(drawn - others[0]).max(axis=2) > 20).sum() > 10
    assert all(np.array_equal(others[0], other) for other in others[1:])


@pytest.mark.usefixtures("can_draw")
def test_time_view_and_coloring_change_the_picture(recording):
    pictures = {}
    for color_by in ("behavior", "agent", "level"):
        scene = Scene(recording, SMALL, color_by)
        try:
            for view, time in (("overview", 1.0), ("overview", 3.0), ("top", 3.0), ("follow", 3.0)):
                scene.show_time(time)
                scene.look(view, time, 0)
                pictures[color_by, view, time] = scene.picture().astype(int)
            scene.show_time(1.0)
            scene.look("overview", 1.0)
            np.testing.assert_array_equal(scene.picture(), pictures[color_by, "overview", 1.0])
        finally:
            scene.close()
    shown = list(pictures.values())
    for i, first in enumerate(shown):
        for second in shown[i + 1 :]:
            assert (np.abs(first - second).sum(axis=-1) > 30).sum() > 20


@pytest.mark.usefixtures("can_draw")
def test_film_has_its_frames_and_moves(recording, tmp_path):
    import av

    calls = []
    path = film(
        recording, tmp_path / "out.mp4", fps=10, size=SMALL, start=1.0, end=2.0,
        progress=lambda done, count: calls.append((done, count)),
    )  # fmt: skip
    assert calls == [(done, 11) for done in range(1, 12)]
    with av.open(str(path)) as container:
        frames = [frame.to_ndarray(format="rgb24").astype(int) for frame in container.decode(video=0)]
    assert len(frames) == 11
    assert frames[0].shape == (90, 160, 3)
    for first, second in pairwise(frames):
        assert (np.abs(first - second).sum(axis=-1) > 60).sum() > 10
    assert [p.name for p in tmp_path.iterdir()] == ["out.mp4"]


@pytest.mark.usefixtures("can_draw")
def test_a_film_that_breaks_off_leaves_nothing(recording, tmp_path):
    def stop(done, count):
        if done == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        film(recording, tmp_path / "out.mp4", fps=10, size=SMALL, progress=stop)
    assert not list(tmp_path.iterdir())


def test_impossible_films_and_pictures_are_refused(recording, tmp_path):
    for change, word in (
        ({"fps": 0}, "pictures a second"),
        ({"size": (161, 90)}, "even sides"),
        ({"start": 3.0, "end": 2.0}, "from 3 to 2"),
        ({"end": 99.0}, "lasts from 0"),
    ):
        with pytest.raises(CrowdSimError, match=word):
            film(recording, tmp_path / "out.mp4", **change)
    for make, name in ((film, "out.avi"), (shot, "out.gif"), (film, "absent/out.mp4"), (shot, "absent/out.png")):
        with pytest.raises(CrowdSimError, match=r"choose such a name|does not exist"):
            make(recording, tmp_path / name)
    with pytest.raises(CrowdSimError, match="colored by 'mood'"):
        shot(recording, tmp_path / "out.png", color_by="mood")
    with pytest.raises(CrowdSimError, match="choose sides of 16 to 8192 pixels"):
        shot(recording, tmp_path / "out.png", size=(2, 2))
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(("supersample", "most"), [(1, 16384), (1.5, 10922), (2, 8192)])
def test_sides_are_limited_by_what_is_drawn(recording, supersample, most):
    with pytest.raises(CrowdSimError, match=f"choose sides of 16 to {most} pixels"):
        Scene(recording, (64, most + 1), supersample=supersample)
    with pytest.raises(CrowdSimError, match=f"choose sides of 16 to {most} pixels"):
        Scene(recording, (15, most), supersample=supersample)


@pytest.mark.usefixtures("can_draw")
def test_a_time_beyond_the_end_is_refused(recording, tmp_path):
    with pytest.raises(RecordingError, match="nothing at 99 s"):
        shot(recording, tmp_path / "out.png", time=99.0, size=SMALL)
    assert not list(tmp_path.iterdir())


def test_window_needs_a_display(recording, monkeypatch):
    monkeypatch.setattr(drawing_backend, "find_backend", lambda: DrawingBackend("egl", "vtkEGLRenderWindow"))
    with pytest.raises(DrawingUnavailable, match="--shot"):
        window(recording)


def test_nothing_is_skipped_while_the_window_opens(monkeypatch):
    now, ticks, shown = [0.0], [], []
    monkeypatch.setattr(window_module.clock, "perf_counter", lambda: now[0])

    def show(**_):
        for now[0] in (3.0, 3.5):  # three seconds until the window is open
            ticks[0](0)

    plotter = Mock()
    plotter.add_timer_event.side_effect = lambda callback, **_: ticks.append(callback)
    plotter.show.side_effect = show
    window_module._play(Mock(plotter=plotter, show_time=shown.append), Player(9.0), "overview", None)
    assert shown == [0.0, 0.0, 0.5]


def test_player_plays_pauses_seeks_and_starts_again():
    player = Player(2.0)
    player.advance(0.5)
    assert player.time == 0.5
    player.toggle()
    player.advance(0.5)
    assert player.time == 0.5
    player.seek(9.0)
    assert player.time == 2.0
    player.toggle()
    assert (player.time, player.playing) == (0.0, True)
    player.advance(5.0)
    assert (player.time, player.playing) == (2.0, False)


def test_what_works_is_remembered_and_what_changed_is_tried_again(tmp_path, monkeypatch):
    monkeypatch.setenv("CROWDSIM_CACHE", str(tmp_path))
    tried = []

    def probe(backend):
        tried.append(backend.name)
        return None if backend.name == "osmesa" else "OpenGL crashes"

    monkeypatch.setattr(drawing_backend, "_probe", probe)
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    monkeypatch.delenv("DISPLAY", raising=False)
    assert find_backend().name == "osmesa"
    assert find_backend() == DrawingBackend("osmesa", "vtkOSOpenGLRenderWindow")
    assert tried == ["egl", "osmesa"]
    monkeypatch.setenv("DISPLAY", ":9")
    find_backend()
    assert tried[2:] == ["display", "egl", "osmesa"]
    (tmp_path / "drawing.json").write_text(json.dumps({"situation": 1}))
    find_backend()
    assert len(tried) == 8


def test_nothing_that_draws_says_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setenv("CROWDSIM_CACHE", str(tmp_path))
    monkeypatch.setattr(drawing_backend, "_probe", lambda backend: "OpenGL crashes")
    with pytest.raises(DrawingUnavailable, match="libegl1") as caught:
        find_backend()
    assert caught.value.exit_code == 3
    assert not list(tmp_path.iterdir())


def test_a_crash_of_the_probe_is_survived(monkeypatch, tmp_path):
    crash = tmp_path / "crash.py"
    crash.write_text("import os, signal\nos.kill(os.getpid(), signal.SIGSEGV)\n")
    monkeypatch.setattr(drawing_backend, "_PROBE", crash)
    assert drawing_backend._probe(DrawingBackend("egl", "vtkEGLRenderWindow")) == "OpenGL crashes"
    crash.write_text("import sys\nsys.exit(1)\n")
    assert drawing_backend._probe(DrawingBackend("egl", None)) == "the picture stayed empty"
    crash.write_text("print('vtkEGLRenderWindow', end='')\n")
    assert drawing_backend._probe(drawing_backend._DISPLAY) == "the display does not answer"


def test_importing_playback_loads_no_graphics():
    program = (
        "import sys, crowdsim.playback.scene, crowdsim.playback.film, crowdsim.playback.shot, crowdsim.playback.window;"
        "assert not {'pyvista', 'vtkmodules', 'av', 'matplotlib'} & set(sys.modules)"
    )
    subprocess.run([sys.executable, "-c", program], check=True)


@pytest.mark.usefixtures("can_draw")
def test_a_place_without_solids_points_of_meshes_paths_or_people_can_be_drawn(recording):
    header = recording.header
    empty = MeshRecord("nothing", np.zeros((0, 3), np.float32), np.zeros((0, 3), np.int32))
    recording.header = replace(header, solids=(), meshes=(empty,))
    try:
        scene = Scene(recording, SMALL)
        scene.show_time(0.0)
        scene.look("overview", 0.0)
        assert scene.picture().std() > 1.0
        scene.close()
    finally:
        recording.header = header


@pytest.mark.usefixtures("can_draw")
def test_a_door_is_drawn_while_it_is_there(tmp_path):
    header = small_header()
    leaf = "POLYGON ((2 -0.6, 2.15 -0.6, 2.15 0.6, 2 0.6, 2 -0.6))"
    header = replace(header, movables=(SolidRecord("door", leaf, 0.0, 2.1), SolidRecord("box", leaf, 0.0, 0.5)))
    with RecordingWriter(tmp_path / "door.h5", header) as writer:
        writer.add_change(0, leaf)
        for step in range(20):
            if step == 10:
                writer.add_change(0, None)
                writer.add_change(1, leaf)
            writer.append(small_frame(header, 0), step)
        writer.finish({})
    with Recording.open(tmp_path / "door.h5") as recording:
        scene = Scene(recording, SMALL)
        try:
            pictures = []
            for time in (0.0, 0.4, 0.6, 0.2):
                scene.show_time(time)
                scene.look("overview", time)
                scene._clock.input = ""
                pictures.append(scene.picture().astype(int))
        finally:
            scene.close()
    closed, still, opened, again = pictures
    np.testing.assert_array_equal(closed, still)
    np.testing.assert_array_equal(closed, again)
    assert (np.abs(closed - opened).sum(axis=-1) > 30).sum() > 20
