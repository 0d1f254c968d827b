"""Movables and doors that have come, gone or moved since the step before, for the recording."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from crowdsim.scenario.timetable import Movable, Placing, placed


def movable_changes(
    now: Sequence[tuple[Movable, Placing | None]], before: list[Placing | None]
) -> Iterator[tuple[int, str | None]]:
    """Yield number and footprint of each solid whose movable has another placing than ``before``; update ``before``.

    Parameters
    ----------
    now : sequence of (Movable, Placing or None)
        All movables with their placings, None while absent.
    before : list of Placing or None
        Their placings in the step before, None while absent; gets the present ones.

    Yields
    ------
    tuple of (int, str or None)
        Number of the solid among those of all movables; footprint as WKT [m], None if it is absent now.
    """
    solid_number = 0
    for number, (movable, placing) in enumerate(now):
        for solid in movable.solids:
            if placing != before[number]:
                yield solid_number, None if placing is None else placed(solid.footprint, placing).wkt
            solid_number += 1
        before[number] = placing
