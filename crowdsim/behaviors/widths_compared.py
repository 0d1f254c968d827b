"""Compare the widths of behaviors with their costs, and put them into words."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import permutations

from crowdsim.behaviors.behavior import Behavior
from crowdsim.errors import BehaviorError

Band = tuple[float, float]
"""Lowest and highest height above the floor of a layer [m]."""


def layer_names(bands: Sequence[Band]) -> list[str]:
    """Return the names of height bands [m] in messages: legs and torso if there are two, else their heights."""
    return ["legs", "torso"] if len(bands) == 2 else [f"height of {low:g} to {high:g} m" for low, high in bands]


def _useless(behaviors: Sequence[Behavior]) -> list[tuple[Behavior, Behavior]]:
    """Return pairs (narrow, wide) of behaviors of which the wide one is never used.

    The narrow one costs less for each meter, fits wherever the wide one does (no radius is larger), and has a smaller
    greatest radius.
    """
    return [
        (narrow, wide)
        for narrow, wide in permutations(behaviors, 2)
        if narrow.cost_per_meter < wide.cost_per_meter
        and narrow.radii.max() < wide.radii.max()
        and (narrow.radii <= wide.radii).all()
    ]


def require_worth(behaviors: Sequence[Behavior]) -> None:
    """Raise BehaviorError if a behavior would never be used, as a narrower one costs less and fits wherever it does."""
    for narrow, wide in _useless(behaviors):
        raise BehaviorError(
            f"'{narrow.name}' is narrower than '{wide.name}' ({narrow.radii.max():.3f} m, {wide.radii.max():.3f} m)"
            f" and cheaper, so '{wide.name}' would never be used; "
            f"raise cost_per_meter in {narrow.folder}/behavior.yaml"
        )


def never_used(behaviors: Sequence[Behavior]) -> list[str]:
    """Return a sentence for each behavior that no plan can use, as a narrower one is cheaper."""
    return [
        f"no plan asks for '{wide.name}': '{narrow.name}' is narrower ({narrow.radii.max():.3f} m, "
        f"{wide.radii.max():.3f} m) and cheaper"
        for narrow, wide in _useless(behaviors)
    ]


def note_on_width(behavior: Behavior, layers: Sequence[str]) -> str:
    """Return a sentence that says how wide and how fast an own behavior was measured to be."""
    reach = ", ".join(f"{radius:.3f} m at the {layer}" for layer, radius in zip(layers, behavior.radii, strict=True))
    return f"'{behavior.name}' reaches {reach} to a side of its way, and goes at {behavior.speed:.2f} m/s"
