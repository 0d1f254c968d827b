"""Figures of docs are as the code draws them, small, and shown in a page."""

import importlib
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from matplotlib.figure import Figure

from tools.draw_figures import FIGURES, FOLDER
from tools.figures.style import alike, drawn, new_figure, read_drawn, styled, write_svg
from tools.guidance_figures import layers_of

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md"))]
RUNS = {"timelines"}
"""Figures that need a simulation: drawn by hand, and not compared here."""
LARGEST = 150_000


@pytest.fixture(scope="module")
def figures() -> Iterator[dict[str, Figure]]:
    with styled():
        yield {name: draw() for name, draw in FIGURES.items() if name not in RUNS}


@pytest.mark.parametrize("name", sorted(set(FIGURES) - RUNS))
def test_a_figure_is_as_the_code_draws_it(name, figures):
    now, before = drawn(figures[name]), read_drawn(FOLDER / f"{name}.svg")
    differing = [(old, new) for old, new in zip(before, now, strict=False) if not alike(old, new)]
    assert len(now) == len(before), f"draw it anew: python tools/draw_figures.py {name}"
    assert not differing, f"draw it anew: python tools/draw_figures.py {name}; {differing[:3]}"


@pytest.mark.parametrize("name", sorted(FIGURES))
def test_a_figure_is_small_and_stands_in_a_page(name):
    assert (FOLDER / f"{name}.svg").stat().st_size <= LARGEST
    assert any(f"figures/{name}.svg)" in page.read_text(encoding="utf-8") for page in PAGES)


def test_every_figure_in_the_folder_is_drawn_by_the_tool():
    assert {file.stem for file in FOLDER.glob("*.svg")} == set(FIGURES)


def test_every_figure_has_a_caption():
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        for shown in re.findall(r"!\[[^\]]+\]\(figures/[^)]+\.svg\)(\n\n\*?)", text):
            assert shown == "\n\n*", page.name


def test_the_same_drawing_gives_the_same_bytes(tmp_path):
    house = importlib.import_module("tools.figures.house")
    files = [tmp_path / "one.svg", tmp_path / "two.svg"]
    with styled():
        for file in files:
            write_svg(house.draw_house(), file)
    assert files[0].read_bytes() == files[1].read_bytes()


def test_a_line_that_moved_is_found(tmp_path):
    def draw(height: float) -> Figure:
        figure, (axes,) = new_figure(2.0)
        axes.plot([0.0, 1.0], [0.0, height], label="a")
        axes.set_title("a line")
        return figure

    write_svg(draw(1.0), tmp_path / "a.svg")
    kept = read_drawn(tmp_path / "a.svg")
    assert alike(kept, drawn(draw(1.0 + 1e-9)))
    assert not alike(kept, drawn(draw(1.01)))


def test_guidance_is_measured_on_the_layers_of_a_scenario():
    legs, torso = layers_of("corridor")
    assert 0.0 < legs.area < torso.area
