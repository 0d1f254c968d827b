"""Options that several commands share, and functions that parse their values."""

from __future__ import annotations

import math
from typing import Annotated, Any

import typer

from crowdsim.cli.errors_shown import remember_debug

Scenario = Annotated[
    str, typer.Argument(metavar="SCENARIO", help="A scenario file, or a name that `crowdsim scenarios` lists.")
]
RecordingFile = Annotated[str, typer.Argument(metavar="FILE", help="A recording that `crowdsim run` wrote.")]
Overrides = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="PATH=VALUE", help="Change one value of the scenario, as in agents.0.count=20."),
]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")]
Debug = Annotated[
    bool, typer.Option("--debug", help="Show the traceback of an error.", callback=remember_debug, is_eager=True)
]
MapDepth = Annotated[
    str | None,
    typer.Option(
        "--depth", metavar="N|METERSm", help="How far motion maps look ahead: in nodes, as 4, or in meters, as 3.5m."
    ),
]


def read_point(text: str, option: str) -> tuple[float, float]:
    """Return (x, y) [m] from ``"X,Y"``; raise a usage error otherwise."""
    try:
        x, y = (float(part) for part in text.split(","))
    except ValueError:
        raise typer.BadParameter(f"'{text}' is not X,Y in meters, as in 1.5,-2", param_hint=option) from None
    if not (math.isfinite(x) and math.isfinite(y)):
        raise typer.BadParameter(f"'{text}' is not finite", param_hint=option)
    return x, y


def read_size(text: str) -> tuple[int, int]:
    """Return width and height in pixels from ``"WxH"``; raise a usage error otherwise."""
    try:
        width, height = (int(part) for part in text.lower().split("x"))
    except ValueError:
        raise typer.BadParameter(f"'{text}' is not WxH in pixels, as in 1600x900", param_hint="--size") from None
    if not (16 <= width <= 16384 and 16 <= height <= 16384):
        raise typer.BadParameter(f"'{text}': width and height are 16 to 16384 pixels", param_hint="--size")
    return width, height


def read_map_depth(text: str | None) -> dict[str, Any]:
    """Return size arguments of ``MotionMaps.build``: none without a text, else a depth in nodes or meters.

    Raise a usage error unless the number is above 0 and below 1000.
    """
    if text is None:
        return {}
    meters = text.endswith("m")
    try:
        number = float(text[:-1]) if meters else int(text)
    except ValueError:
        number = 0
    if not 0 < number < 1000:
        raise typer.BadParameter(
            f"'{text}' is neither nodes, as 4, nor meters, as 3.5m, above 0 and below 1000", param_hint="--depth"
        )
    # Of nodes and meters, the one that is not given is so large that it sets no bound; entries bound the memory.
    most = {"max_entries": 100_000}
    return most | ({"depth": 1000, "reach": number} if meters else {"depth": number, "reach": 1e3})


Unit = Annotated[
    str | None,
    typer.Option("--unit", metavar="UNIT", help="m, cm, mm, ft, inch or 'CMU unit', if leg lengths are ambiguous."),
]

Joints = Annotated[
    list[str] | None,
    typer.Option(
        "--joint", metavar="ROLE=NAME", help="Name of the joint with a role, as in left_hip=BoneA7; repeatable."
    ),
]


def read_unit(unit: str | None) -> float | None:
    """Return the length of a named unit [m], None without a name; raise a usage error for an unknown name."""
    from crowdsim.motion.captures.reader import UNITS

    if unit is not None and unit not in UNITS:
        raise typer.BadParameter(f"'{unit}' is not one of {', '.join(UNITS)}", param_hint="--unit")
    return None if unit is None else UNITS[unit]


def read_joints(given: list[str]) -> dict[str, str]:
    """Return joint names by role from ``ROLE=NAME`` entries; raise a usage error for any other form."""
    for entry in given:
        if not all(entry.partition("=")):
            raise typer.BadParameter(f"'{entry}' is not ROLE=NAME, as in left_hip=BoneA7", param_hint="--joint")
    return {role: name for role, _, name in (entry.partition("=") for entry in given)}
