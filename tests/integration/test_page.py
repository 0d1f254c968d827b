"""Pages in a real browser, from ``file://``: what they show beside what recordings hold, and how they are used."""

import io
import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from crowdsim.export.page.page import PageOptions, write_page
from crowdsim.recording.reader import Recording
from tests.support.changing_recording import CLOSES, MOVES, NAME, write_changing_recording
from tests.support.shown_bodies import compare

PHONE = {"width": 380, "height": 740}


@pytest.fixture(scope="module")
def pages(recorded, tmp_path_factory):
    """``pages("corridor")`` gives a recording and its page."""
    folder = tmp_path_factory.mktemp("pages")
    made: dict[str, tuple[Path, Path]] = {}

    def of(name: str) -> tuple[Path, Path]:
        if name not in made:
            source = write_changing_recording(folder / "doors.h5") if name == "doors" else recorded(name)
            with Recording.open(source) as recording:
                write_page(recording, folder / f"{name}.html")
            made[name] = source, folder / f"{name}.html"
        return made[name]

    return of


@pytest.mark.parametrize("name", ["corridor", "plaza", "doors"])
def test_bodies_are_where_the_recording_has_them(visit, pages, name):
    source, page = pages(name)
    shown = visit(page)
    with Recording.open(source) as recording:
        times = np.random.default_rng(7).uniform(0.0, recording.duration, 40).tolist()
        places, joints, switched, frames = compare(recording, shown, sorted(times) + times[:5])
    assert places <= 0.001
    assert np.percentile(joints, 99) <= 0.001
    assert max(joints) <= 0.003
    # A foot that comes round by half a turn may do so the other way round.
    assert np.percentile(switched, 99) <= 0.008
    assert frames <= 1e-3
    assert shown.requests == [page.as_uri()]
    assert shown.complained == []


@pytest.mark.parametrize("name", ["corridor", "plaza", "doors"])
def test_a_page_is_used_with_mouse_and_keys(visit, pages, name):
    _, file = pages(name)
    shown = visit(file, viewport={"width": 1000, "height": 640})
    page, ask = shown.page, shown.ask
    # Play and stop.
    began = ask("crowdsim.player.time")
    page.keyboard.press(" ")
    shown.wait(f"crowdsim.player.time > {began} + 0.05")
    page.keyboard.press(" ")
    assert ask("crowdsim.player.playing") is False
    # Seek: keys, slider, buttons.
    page.keyboard.press("Home")
    page.keyboard.press("ArrowRight")
    page.keyboard.press(".")
    assert ask("crowdsim.player.time") == pytest.approx(1.0 + 1.0 / ask("crowdsim.player.source.rate"))
    page.locator("#slider").fill("20")
    assert ask("crowdsim.player.step") == 20
    # Select, and follow.
    shown.wait("crowdsim.player.frame.step === 20")
    agent = ask("crowdsim.player.frame.state.findIndex(state => state > 0)")
    at = ask(
        """agent => {
        const { player } = crowdsim, { x, y } = player.frame, v = player.cameras.camera.position.clone();
        v.set(x[agent], y[agent], 1).project(player.cameras.camera);
        return [500 * (v.x + 1), 320 * (1 - v.y)];
    }""",
        agent,
    )
    page.mouse.click(*at)
    page.wait_for_selector("#card:not([hidden])")
    assert "Agent" in page.locator("#card-title").inner_text()
    page.keyboard.press("3")
    assert ask("crowdsim.player.cameras.view") == "follow"
    assert "view=follow" in page.url
    # What is drawn.
    for key, state in (("c", "color"), ("d", "density.mode"), ("t", "trails"), ("w", "walls"), ("p", "paths")):
        before = ask(f"crowdsim.player.{state}")
        page.keyboard.press(key)
        assert ask(f"crowdsim.player.{state}") != before
    page.keyboard.press("?")
    assert page.locator("#keys").is_visible()
    page.keyboard.press("Escape")
    page.locator("#keys").wait_for(state="hidden")
    with page.expect_download() as download:
        page.keyboard.press("s")
    assert Path(download.value.path()).read_bytes()[:4] == b"\x89PNG"
    assert shown.complained == []


def orange_pixels(visit):
    pixels = np.asarray(Image.open(io.BytesIO(visit.page.locator("#canvas").screenshot()))).astype(int)
    return int(((pixels[..., 0] > pixels[..., 1] + 40) & (pixels[..., 1] > pixels[..., 2] + 40)).sum())


def test_shirts_show_who_is_captured_and_who_is_steered(visit, pages):
    source, file = pages("plaza")
    with Recording.open(source) as recording:
        times = np.arange(0.0, recording.duration, 1.0)
        steered = [recording.at_time(time).steered for time in times]
        busiest = int(np.argmax([each.sum() for each in steered]))
        assert 0 < steered[busiest].sum() < (recording.at_time(times[busiest]).state != 0).sum()
    shown = visit(file, f"#t={times[busiest]:g}", viewport={"width": 1000, "height": 640})
    before = orange_pixels(shown)
    shown.page.locator("#color").select_option("level")
    legend = shown.page.locator("#legend li").all()
    assert [each.inner_text() for each in legend] == ["captured", "steered"]
    assert shown.ask("Array.from(crowdsim.player.frame.steered)") == steered[busiest].astype(int).tolist()
    assert orange_pixels(shown) > before + 100
    assert shown.complained == []


def test_a_link_leads_to_a_moment_a_character_and_a_view(visit, pages):
    _, file = pages("plaza")
    shown = visit(file, "#t=12.34&agent=3&view=top")
    assert shown.ask("[crowdsim.player.time, crowdsim.player.selected, crowdsim.player.cameras.view]") == [
        12.34,
        3,
        "top",
    ]
    shown.page.evaluate("location.hash = '#t=15&agent=4&view=overview'")
    shown.wait("crowdsim.player.time === 15 && crowdsim.player.selected === 4")


def test_a_phone_shows_all_of_the_place_and_its_controls(visit, pages):
    _, file = pages("plaza")
    shown = visit(file, viewport=PHONE, has_touch=True, is_mobile=True)
    page = shown.page
    assert page.evaluate("document.documentElement.scrollWidth") <= PHONE["width"]
    assert not page.locator("#choices").is_visible()
    page.locator("#more").tap()
    page.locator("#color").select_option("speed")
    for control in page.locator("#bar select, #bar button").all():
        box = control.bounding_box()
        assert box["x"] >= 0
        assert box["x"] + box["width"] <= PHONE["width"]
        assert box["y"] + box["height"] <= PHONE["height"]
    assert shown.ask("crowdsim.player.color") == "speed"
    assert corners_in_the_picture(shown) == []
    assert shown.complained == []


def corners_in_the_picture(visit):
    """Corners of the place that lie outside the picture."""
    return visit.ask("""() => {
        const { player } = crowdsim, { low, high } = player.facts.bounds, camera = player.cameras.camera, out = [];
        camera.updateMatrixWorld();
        for (const x of [low[0], high[0]]) for (const y of [low[1], high[1]]) for (const z of [0, high[2]]) {
            const at = camera.position.clone().set(x, y, z).project(camera);
            if (Math.abs(at.x) > 1 || Math.abs(at.y) > 1) out.push([x, y, z]);
        }
        return out;
    }""")


@pytest.mark.parametrize("name", ["corridor", "plaza", "doors"])
def test_the_overview_shows_the_whole_place_and_costs_few_calls(visit, pages, name):
    _, file = pages(name)
    shown = visit(file)
    assert corners_in_the_picture(shown) == []
    costs = shown.ask("crowdsim.costs()")
    assert costs["calls"] <= 20
    assert 0 < costs["vertices"] <= 500_000


def test_doors_and_crates_are_drawn_where_they_are_when(visit, pages):
    _, file = pages("doors")
    shown = visit(file)
    colors = """async step => {
        const { player } = crowdsim;
        player.set("view", "top"); player.set("paths", "none"); player.seekStep(step); player.draw();
        const gl = player.renderer.getContext(), w = gl.drawingBufferWidth, h = gl.drawingBufferHeight;
        const pixel = new Uint8Array(4), v = player.cameras.camera.position.clone();
        return [[2.07, 0], [3.3, 1.3], [3.3, -1.3]].map(([x, y]) => {
            v.set(x, y, 0).project(player.cameras.camera);
            const at = [Math.round(0.5 * (v.x + 1) * w), Math.round(0.5 * (v.y + 1) * h)];
            gl.readPixels(...at, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel);
            return Array.from(pixel);
        });
    }"""
    open_door, crate, gone = shown.ask(colors, CLOSES - 1)
    closed_door, left, moved = shown.ask(colors, MOVES)
    brown = [crate, moved, closed_door]
    floor = [open_door, gone, left]
    assert all(red - blue > 40 for red, _, blue, _ in brown)
    assert all(red - blue < 30 and red > 200 for red, _, blue, _ in floor)


def test_names_that_try_to_be_code_stay_text(visit, pages):
    _, file = pages("doors")
    shown = visit(file, "#agent=0&t=1")
    assert shown.page.locator("#title").inner_text() == NAME
    assert shown.page.title() == NAME
    assert NAME in shown.page.locator("#card-rows").inner_text()
    assert shown.ask("window.hacked") is None


def test_without_webgl_a_page_says_what_is_missing(browser, pages):
    _, file = pages("doors")
    blank = browser.new_context()
    blank.add_init_script("HTMLCanvasElement.prototype.getContext = () => null")
    page = blank.new_page()
    page.goto(file.as_uri())
    page.locator("#message").filter(has_text="WebGL 2").wait_for()
    blank.close()


def test_readers_of_screens_are_told_what_everything_is(visit, pages):
    _, file = pages("corridor")
    page = visit(file).page
    nameless = page.evaluate("""() => Array.from(document.querySelectorAll("button, select, input, canvas, ul, dialog"))
        .filter(e => !e.ariaHidden && !e.getAttribute("aria-label") && !e.getAttribute("aria-labelledby")
            && !e.closest("label") && !/[a-z]{3}/i.test(e.textContent)).map(e => e.outerHTML)""")
    assert nameless == []
    page.keyboard.press(" ")
    assert page.locator("#said").inner_text() == "playing"
    assert "present" in page.locator("#slider").get_attribute("aria-valuetext")


def test_dark_and_light_differ(visit, pages):
    _, file = pages("corridor")
    for scheme, theme in (("dark", "dark"), ("light", "light")):
        page = visit(file, color_scheme=scheme).page
        assert page.evaluate("document.documentElement.dataset.theme") == theme
        page.keyboard.press("l")
        assert page.evaluate("document.documentElement.dataset.theme") != theme


def test_pages_are_as_small_as_they_are_meant_to_be(pages):
    for name, most in (("corridor", 800_000), ("plaza", 950_000)):
        assert pages(name)[1].stat().st_size <= most


def test_the_same_recording_gives_the_same_page(pages, tmp_path):
    source, file = pages("corridor")
    with Recording.open(source) as recording:
        write_page(recording, tmp_path / "again.html", PageOptions())
    assert (tmp_path / "again.html").read_bytes() == file.read_bytes()


def test_a_run_writes_its_page_beside_the_recording(crowdsim, tmp_path):
    run = crowdsim("run", "corridor", "--set", "agents.0.count=1", "--page", "--json")
    assert run.returncode == 0, run.stderr
    assert json.loads(run.stdout)["page"] == "corridor.html"
    again = crowdsim("export", "corridor.h5", "-o", "again.html")
    assert again.returncode == 0, again.stderr
    assert (tmp_path / "again.html").read_bytes() == (tmp_path / "corridor.html").read_bytes()
