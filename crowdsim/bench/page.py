"""Pages in a headless browser: size, start time, time per picture, and accuracy of the bodies.

Needs Playwright and Chromium, as the tests do. Without a graphics card, drawing times mean nothing; bytes, vertices,
draw calls and milliseconds of JavaScript do.
"""

from __future__ import annotations

import shutil
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from crowdsim.bench.registry import Measurement
from crowdsim.crowd.simulation import Simulation
from crowdsim.errors import CrowdSimError
from crowdsim.export.page.page import write_page
from crowdsim.recording.levels import Level
from crowdsim.recording.reader import Recording
from crowdsim.scenario.loader import load_scenario

_BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
_FLAGS = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]

_CROWDS = {
    "1,000 captured, 120 s": ("captured", 500, 120, 150, 60),
    "1,000 auto, 120 s": ("auto", 500, 120, 150, 60),
    "1,000 steered in the open, 120 s": ("steered", 500, 120, 150, 60),
    "1,000 steered, 120 s": ("steered", 500, 120, 90, 30),
    "10,000 steered, 20 s": ("steered", 5000, 20, 240, 100),
}
"""Locomotion, number of people in each of two groups, duration [s], and length and width of the floor [m]."""

_MOMENTS, _POSES = 25, 5000
"""Largest number of moments at which bodies are compared, and approximate number of bodies in all: each needs new
footstep plans."""
_SETTLED = 5.0
"""Time after a switch of level during which a page blends bodies differently from playback [s]."""

# Times of the page's own work for 180 frames, without drawing them: 30 warm up; `median` and `slow` (95 %) are of the
# other 150.
_TIMES_OF_FRAMES = """() => {
    const { player } = crowdsim, render = player.renderer.render, times = [];
    player.renderer.render = () => {};
    for (let k = 0; k < 180; k++) {
        player.time = Math.min(player.start + 0.3 * (player.end - player.start) + k / 60, player.end);
        const began = performance.now();
        player.draw();
        times.push(performance.now() - began);
    }
    player.renderer.render = render;
    player.draw();
    times.splice(0, 30);
    times.sort((a, b) => a - b);
    return { ...crowdsim.costs(), median: times[75], slow: times[142], ready: crowdsim.ready,
        memory: performance.memory ? performance.memory.usedJSHeapSize / 1e6 : null };
}"""


def measure() -> Measurement:
    """Return a row for each of two scenarios, and for each crowd in _CROWDS.

    Figures hold all floats of the rows; names, ``same_bytes``, vertices and draw calls are in the rows only.
    """
    rows: list[dict[str, Any]] = []
    with TemporaryDirectory() as name, _browser() as browser:
        folder = Path(name)
        for number, (what, scenario) in enumerate(_scenarios(folder)):
            file = folder / f"{number}.h5"
            with Simulation(load_scenario(scenario, []), workers=2) as simulation:
                simulation.run(file).close()
            with Recording.open(file) as recording:
                rows.append({"page": what, **_row(recording, browser, folder / f"{number}.html")})
    figures = {f"{row['page']} {key}": float(row[key]) for row in rows for key in row if isinstance(row[key], float)}
    return Measurement(rows, figures)


def _scenarios(folder: Path) -> Iterator[tuple[str, str]]:
    """Yield names, and the scenarios of that name: built-in ones, and crowds written to ``folder``.

    A crowd walks to and fro between both ends of a floor, half of it from each end.
    """
    yield from (("corridor", "corridor"), ("plaza", "plaza"))
    for number, (name, (locomotion, count, seconds, long, wide)) in enumerate(_CROWDS.items()):
        near, far = f"[1, 1, {0.35 * long:g}, {wide - 1}]", f"[{0.65 * long:g}, 1, {long - 1}, {wide - 1}]"
        groups = [
            f"  - {{name: {group}, locomotion: {locomotion}, count: {count}, start: {{rectangle: {start}}}, "
            f"goals: [{{rectangle: {goal}}}, {{rectangle: {start}}}], repeat: 9}}"
            for group, start, goal in (("east", near, far), ("west", far, near))
        ]
        file = folder / f"crowd-{number}.yaml"
        head = f"crowdsim: 1\nname: crowd\nseed: 3\nduration: {seconds}\nfloor: {{rectangle: [0, 0, {long}, {wide}]}}\n"
        file.write_text(head + "agents:\n" + "\n".join(groups) + "\n", encoding="utf-8")
        yield name, str(file)


@contextmanager
def _browser() -> Iterator[Any]:
    """Open a browser without a window for the block; raise CrowdSimError if there is none, or no Playwright."""
    found = next((path for path in map(shutil.which, _BROWSERS) if path), None)
    try:
        from playwright.sync_api import sync_playwright
    except ImportError:
        found = None
    if found is None:
        raise CrowdSimError(
            "pages are measured in a browser: install Chromium, and Playwright (pip install playwright)"
        )
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=found, args=_FLAGS)
        try:
            yield browser
        finally:
            browser.close()


def _row(recording: Recording, browser: Any, file: Path) -> dict[str, Any]:
    """Return all measurements of one page, written to ``file``.

    The time is that of its second export: the first one loads modules and kernels. ``heap_MB`` is 0 if the browser does
    not tell it.
    """
    write_page(recording, file)
    first = file.read_bytes()
    begin = time.perf_counter()
    write_page(recording, file)
    seconds = time.perf_counter() - begin
    page = browser.new_page(viewport={"width": 1280, "height": 720})
    page.goto(file.as_uri())
    while not page.evaluate("window.crowdsim !== undefined"):
        page.wait_for_timeout(50)
    shown = page.evaluate(_TIMES_OF_FRAMES)
    track, joints = _errors(recording, page)
    page.close()
    return {
        "MB": round(len(first) / 1e6, 3),
        "same_bytes": file.read_bytes() == first,
        "made_s": round(seconds, 2),
        "ready_s": round(shown["ready"] / 1000.0, 2),
        "vertices": shown["vertices"],
        "draw_calls": shown["calls"],
        "script_ms": round(float(shown["median"]), 2),
        "script_ms_slow": round(float(shown["slow"]), 2),
        "heap_MB": round(float(shown["memory"] or 0.0), 1),
        "track_mm": round(1000.0 * track, 2),
        "joints_mm": round(1000.0 * joints, 2),
    }


def _errors(recording: Recording, page: Any) -> tuple[float, float]:
    """Return the largest error of a track's x or y, and of places of joints, at some moments [m].

    Joints of agents that switched their level less than _SETTLED before, or that are on no level, do not count. Moments
    are spread evenly over the recording; both errors are 0 if no agent is shown at any of them.
    """
    track, joints = 0.0, 0.0
    count = min(max(_POSES // max(recording.most_present, 1), 1), _MOMENTS)
    moments: Sequence[float] = np.linspace(0.0, recording.duration, count + 2)[1:-1].tolist()
    for moment in moments:
        rows, frame = page.evaluate("time => crowdsim.at(time)", moment), recording.at_time(moment)
        agents = np.array([row["agent"] for row in rows], np.int64)
        if not len(agents):
            continue
        places = np.array([[row["x"], row["y"]] for row in rows])
        track = max(track, float(np.abs(places - np.stack([frame.x, frame.y], axis=1)[agents]).max()))
        step = int(moment * recording.steps_per_second + 1e-6)
        # The last switch of each agent, -1 without one: that row is the 0 appended.
        last = recording.switches.last(agents, step)
        shown = np.append(recording.switches.shown, 0)[last] / recording.steps_per_second
        settled = (last < 0) | (moment - shown >= _SETTLED)
        settled &= recording.levels[step][agents] != Level.NOBODY
        posed = np.array([row["joints"] for row in rows]).reshape(len(agents), -1, 3)[settled]
        true = recording.poses_at(moment, agents[settled])[0]
        joints = max(joints, float(np.sqrt(np.sum((posed - true) * (posed - true), axis=-1)).max(initial=0.0)))
    return track, joints
