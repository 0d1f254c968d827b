"""Films are drawn over a backdrop and by several processes: it shows in nothing, and nothing of it is left behind."""

import multiprocessing
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from crowdsim.cli.app import app
from crowdsim.cli.errors_shown import TERMINATED
from crowdsim.errors import CrowdSimError
from crowdsim.playback.backdrop import Backdrop
from crowdsim.playback.camera import place_camera, tallest_person
from crowdsim.playback.film import film
from crowdsim.playback.scene import Scene
from crowdsim.recording.reader import Recording
from tests.support.small_recording import write_small_recording

SMALL = (160, 90)
FAST = 60
"""Pictures a second by which the small recording gives a film of two parts."""


def pictures_of(path: Path) -> list[np.ndarray]:
    import av

    with av.open(str(path)) as container:
        return [frame.to_ndarray(format="rgb24").astype(int) for frame in container.decode(video=0)]


@pytest.mark.usefixtures("can_draw")
@pytest.mark.parametrize("view", ["overview", "top"])
def test_what_stands_still_is_drawn_once_and_it_shows_in_nothing(recording, view):
    scenes = _, over, lit = [Scene(recording, (480, 270), supersample=1.5) for _ in range(3)]
    for scene in scenes:
        scene.show_time(0.0)
        scene.look(view, 0.0)
    over._backdrop = Backdrop(over.plotter, over._still)
    lit.keep_still()
    seen = []
    for moment in (0.5, 3.0, 1.0):
        for scene in scenes:
            scene.show_time(moment)
        drawn, copied, baked = (scene.drawn_rows()[..., :3].astype(int) for scene in scenes)
        assert np.abs(drawn - copied).max() <= 1
        # Light at corners instead of pixels is seen on bodies alone, and hardly there.
        off = np.abs(drawn - baked).max(axis=-1)
        assert (off > 1).mean() < 0.03
        assert off[off > 1].mean() < 6.0
        seen.append(baked)
    # Nobody leaves a trail: going back in time gives what was there.
    assert (np.abs(seen[0] - seen[1]).sum(axis=-1) > 60).sum() > 100
    for scene in scenes:
        scene.close()


@pytest.mark.usefixtures("can_draw")
@pytest.mark.parametrize("view", ["overview", "follow"])
def test_the_first_picture_is_lit_as_those_after_it(recording, tmp_path, view):
    pictures = pictures_of(
        film(recording, tmp_path / "out.mp4", fps=60, size=(480, 270), start=2.0, end=2.1, view=view, agent=0)
    )
    shirts = [picture[np.ptp(picture, axis=-1) > 70] for picture in pictures]
    assert min(map(len, shirts)) > 50
    assert abs(shirts[0].mean() - shirts[1].mean()) < 4.0


@pytest.mark.usefixtures("can_draw")
def test_a_part_of_a_recording_is_filmed_by_the_command(recording, tmp_path):
    file = tmp_path / "out.mp4"
    arguments = ["play", str(recording.path), "--film", str(file), "--size", "160x90", "--start", "1.0", "--end", "1.5"]
    done = CliRunner().invoke(app, arguments)
    assert done.exit_code == 0, done.output
    drawn = pictures_of(file)
    assert len(drawn) == 16
    assert CliRunner().invoke(app, [*arguments, "--no-paths"]).exit_code == 0
    assert np.abs(np.subtract(drawn[0], pictures_of(file)[0], dtype=float)).max() > 20.0
    refused = CliRunner().invoke(app, [*arguments[:-1], "1000"])
    assert refused.exit_code == 2
    assert "a film cannot go from 1 to 1000 s" in str(refused.output) + str(refused.exception)


@pytest.mark.usefixtures("can_draw")
def test_two_processes_make_the_film_that_one_makes(recording, tmp_path):
    calls = []
    one = film(recording, tmp_path / "one.mp4", fps=FAST, size=SMALL)
    two = film(
        recording, tmp_path / "two.mp4", fps=FAST, size=SMALL, processes=2,
        progress=lambda done, count: calls.append((done, count)),
    )  # fmt: skip
    first, second = pictures_of(one), pictures_of(two)
    count = int(recording.duration * FAST + 1e-9) + 1
    assert len(first) == len(second) == count >= 240
    assert max(np.abs(a - b).max() for a, b in zip(first, second, strict=True)) <= 24
    assert max(np.abs(a - b).mean() for a, b in zip(first, second, strict=True)) < 0.05
    assert calls == sorted(calls)
    assert calls[-1] == (count, count)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["one.mp4", "two.mp4"]
    assert not multiprocessing.active_children()


@pytest.mark.usefixtures("can_draw")
def test_a_film_whose_process_dies_says_so_and_leaves_nothing(recording, tmp_path):
    doomed = []

    def kill(done, count):
        if not doomed:
            # Halted at once, it cannot have finished its part before it is killed, however slow this process is.
            doomed.append(multiprocessing.active_children()[0])
            os.kill(doomed[0].pid, signal.SIGSTOP)
        elif done:
            doomed[0].kill()

    with pytest.raises(CrowdSimError, match="died"):
        film(recording, tmp_path / "out.mp4", fps=FAST, size=SMALL, processes=2, progress=kill)
    assert not list(tmp_path.iterdir())
    assert not multiprocessing.active_children()


@pytest.mark.usefixtures("can_draw")
def test_errors_of_a_process_are_those_of_the_film(recording, tmp_path):
    with pytest.raises(CrowdSimError, match="cannot be colored"):
        film(recording, tmp_path / "out.mp4", fps=FAST, size=SMALL, processes=2, color_by="mood")
    assert not list(tmp_path.iterdir())


def children_of(process: int) -> list[int]:
    tasks = Path(f"/proc/{process}/task")
    return [int(each) for task in tasks.iterdir() for each in (task / "children").read_text().split()]


def ended(process: int) -> bool:
    """Return whether a process has ended, or waits for its end to be read."""
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] == "Z"
    except (FileNotFoundError, ProcessLookupError):
        return True


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="looks for processes in /proc")
@pytest.mark.usefixtures("can_draw")
def test_a_film_that_is_terminated_leaves_neither_files_nor_processes(tmp_path):
    with Recording.open(write_small_recording(tmp_path / "run.h5", steps=600)) as recording:
        assert recording.duration > 25.0
    command = [sys.executable, "-m", "crowdsim", "play", "run.h5", "--film", "out.mp4"]
    filming = subprocess.Popen(command, cwd=tmp_path, stderr=subprocess.PIPE)
    try:
        deadline = time.monotonic() + 120.0
        # Wait until there is something in the file: the first part is being drawn.
        while not any(path.stat().st_size > 0 for path in tmp_path.glob(".out-*.mp4")):
            assert filming.poll() is None
            assert time.monotonic() < deadline
            time.sleep(0.05)
        drawing = children_of(filming.pid)
        assert len(drawing) >= 2
        filming.send_signal(signal.SIGTERM)
        _, said = filming.communicate(timeout=60.0)
    finally:
        filming.kill()
        filming.wait()
    assert filming.returncode == TERMINATED
    assert said.decode().strip() == "terminated"
    assert [path.name for path in tmp_path.iterdir()] == ["run.h5"]
    while not all(map(ended, drawing)):
        assert time.monotonic() < deadline
        time.sleep(0.05)


def test_people_are_taller_in_the_picture_the_nearer_they_are(recording):
    following, over, above = (
        tallest_person(recording, place_camera(recording, view, 16 / 9, 1.0, agent), 720)
        for view, agent in (("follow", 0), ("overview", None), ("top", None))
    )
    assert following > over
    assert over > 1.85 * 720 / (2.0 * 30.0)
    low, high = (720 * 1.85 / extent for extent in (60.0, 3.0))
    assert low < above < high
