"""Units of length of drawings."""

from __future__ import annotations

from crowdsim.errors import GeometryError

_SHORT = ("m", "dm", "cm", "mm", "km", "in", "ft", "yd")
_LONG = ("meters", "decimeters", "centimeters", "millimeters", "kilometers", "inches", "feet", "yards")
_LENGTHS = (1.0, 0.1, 0.01, 0.001, 1000.0, 0.0254, 0.3048, 0.9144)

METERS = {name: meters for *names, meters in zip(_SHORT, _LONG, _LENGTHS, strict=True) for name in names}
"""Meters of a unit, by its short and long name."""

_COMMON = ("mm", "cm", "in", "ft", "m")
"""Units that a warning suggests, in this order."""

ROOM_HEIGHTS = (2.0, 10.0)
"""Plausible heights from floor to ceiling [m]."""


def meters_per_unit(name: str) -> float:
    """Return the meters of the unit called ``name``, in capitals or not; raise GeometryError if it is unknown."""
    if name.lower() not in METERS:
        raise GeometryError(f"units: '{name}' is unknown; known are {', '.join(METERS)}")
    return METERS[name.lower()]


def doubt_about_height(height: float, meters: float) -> str | None:
    """Return a warning if a place ``height`` [m] high is implausible, else None.

    ``meters`` is the length of the unit that the file was read with [m]; the warning suggests better units.
    """
    low, high = ROOM_HEIGHTS
    if low <= height <= high:
        return None
    drawn = height / meters
    fitting = [name for name in _COMMON if low <= drawn * METERS[name] <= high and METERS[name] != meters]
    remedy = (
        f"in {' or '.join(fitting)} it would be plausible: give units={fitting[0]}" if fitting else "check the units"
    )
    return (
        f"warning: the place is {height:.3g} m high as a whole, but {low:g} to {high:g} m from floor to ceiling are "
        f"usual; {remedy}, unless this is a single piece of furniture or a building of several floors"
    )
