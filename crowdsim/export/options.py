"""Options of single formats, beside the choice of steps and agents."""

from __future__ import annotations

from typing import NamedTuple


class ExportOptions(NamedTuple):
    """Options of formats; None if the user gave none.

    Attributes
    ----------
    layer : str or None
        Layer whose walkable area is written with the tracks.
    paths : str or None
        Paths that a page draws: "all", "selected" or "none".
    title : str or None
        Title of a page.
    points : bool or None
        Whether agents are capsules instead of bodies.
    """

    layer: str | None = None
    paths: str | None = None
    title: str | None = None
    points: bool | None = None
