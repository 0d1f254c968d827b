"""Write an analysis: analysis.json, a table and a picture for each result, and one page with all of them."""

from __future__ import annotations

import html
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

from crowdsim.analysis.analyze import Analysis
from crowdsim.analysis.drawing import floor_panels, outline
from crowdsim.analysis.results import Result
from crowdsim.errors import CrowdSimError
from crowdsim.figures import write_figure
from crowdsim.whole_files import whole_file

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PAGE = "index.html"

_STYLE = (
    "body{font-family:sans-serif;max-width:60em;margin:2em auto;padding:0 1em;color:#222}"
    "img{max-width:100%;height:auto}li{margin:.2em 0}.note{color:#8a4b00}h2{margin-top:2em}"
)


def write_analysis(analysis: Analysis, folder: Path) -> list[Path]:
    """Write all files of an analysis into ``folder``, which is made if it is missing; return them, the page last.

    Raises
    ------
    CrowdSimError
        If ``folder`` is a file, or its disk is full.
    """
    if folder.exists() and not folder.is_dir():
        raise CrowdSimError(f"cannot write into {folder}: it is no folder; choose another one with -o")
    folder.mkdir(parents=True, exist_ok=True)
    written = [folder / "analysis.json"]
    _write_text(written[0], json.dumps(analysis.values(), indent=1, ensure_ascii=False, allow_nan=False) + "\n")
    for result in analysis.results:
        if result.table is not None:
            file = folder / f"{result.name}.csv"
            _write_text(file, result.table.to_csv(index=False, lineterminator="\n", float_format="%.6g"))
            written.append(file)
        if result.draw is not None:
            file = folder / f"{result.name}.png"
            write_figure(_drawn(result), file)
            written.append(file)
    if analysis.places.areas or analysis.places.lines:
        file = folder / "places.png"
        write_figure(_draw_places(analysis), file)
        written.append(file)
    _write_text(folder / PAGE, _page(analysis))
    return [*written, folder / PAGE]


def _write_text(file: Path, text: str) -> None:
    """Write a file of text, which appears whole or not at all."""
    with whole_file(file, (file.suffix,), "analyses") as written:
        written.write_text(text, encoding="utf-8", newline="\n")


def _new_figure() -> Figure:
    """Return an empty figure; matplotlib is imported only here, as that is slow."""
    from matplotlib.figure import Figure

    return Figure(dpi=110, layout="constrained")


def _drawn(result: Result) -> Figure:
    """Return the picture of a result, empty if there is nothing to draw."""
    figure = _new_figure()
    if result.draw is not None:
        result.draw(figure)
    return figure


def _draw_places(analysis: Analysis) -> Figure:
    """Draw the floor with the areas and lines by name."""
    figure = _new_figure()
    walkable = analysis.tracks.recording.walkable()
    (axes,) = floor_panels(figure, walkable, 1)
    outline(axes, walkable, analysis.places)
    for name, (shape, *_) in (*analysis.places.areas.items(), *analysis.places.lines.items()):
        # The name stands inside of an area, and at the middle of a line.
        at = shape.representative_point() if shape.area else shape.interpolate(0.5, normalized=True)
        frame = {"boxstyle": "round,pad=0.15", "facecolor": "white", "edgecolor": "none", "alpha": 0.8}
        axes.annotate(name, (at.x, at.y), fontsize="small", ha="center", va="center", bbox=frame)
    return figure


def _page(analysis: Analysis) -> str:
    """Return the report as a page of HTML; it links to pictures and tables in the folder of the page."""
    values = analysis.values()
    title = html.escape(f"{values['scenario']}, seed {values['seed']}")
    parts = [
        f"<h1>{title}</h1>",
        f"<p>{html.escape(values['recording'])}: {values['duration']:g} s, measured by {values['measured_by']} at "
        f"{values['frames_per_second']} frames a second. All figures: <a href='analysis.json'>analysis.json</a>.</p>",
        *(f"<p class='note'>{html.escape(note)}</p>" for note in values["notes"]),
    ]
    if analysis.places.areas or analysis.places.lines:
        parts.append("<p><img src='places.png' alt='areas and lines on the floor'></p>")
    for result in analysis.results:
        parts.append(f"<h2 id='{result.name}'>{html.escape(result.title)}</h2>")
        parts.append("<ul>" + "".join(f"<li>{html.escape(text)}</li>" for text in result.sentences) + "</ul>")
        if result.draw is not None:
            parts.append(f"<p><img src='{result.name}.png' alt='{html.escape(result.title)}'></p>")
        if result.table is not None:
            parts.append(f"<p><a href='{result.name}.csv'>{result.name}.csv</a></p>")
    return (
        f"<!doctype html><html lang='en'><head><meta charset='utf-8'><title>{title}</title>"
        f"<style>{_STYLE}</style></head><body>{''.join(parts)}</body></html>\n"
    )


def sentences(analysis: Analysis) -> list[tuple[str, str]]:
    """Return rows (title, sentence) for a terminal; a title stands before the first sentence of a result only."""
    rows: list[tuple[str, str]] = [("note", note) for note in analysis.tracks.notes]
    for result in analysis.results:
        for number, text in enumerate(result.sentences):
            rows.append(("" if number else result.title, text))
    return rows


def as_json(analysis: Analysis, files: list[Path]) -> dict[str, Any]:
    """Return what ``crowdsim analyze --json`` prints: all figures, and the names of the ``files`` written."""
    return {**analysis.values(), "files": [str(file) for file in files]}
