"""Motion of the built-in behaviors, read once in a process for all runs that need the same, as a sweep does."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from crowdsim.behaviors import library
from crowdsim.behaviors.library import BehaviorSet, load_behavior_set


class SharedMotion:
    """Stands in for ``load_behavior_set`` where runs call it; own behaviors and captures are read anew each time."""

    def __init__(self) -> None:
        self._read: dict[Any, BehaviorSet] = {}

    def __call__(self, names: Sequence[str], bands: Sequence[tuple[float, float]], **options: Any) -> BehaviorSet:
        """Return the behaviors of these names in the library, measured in these bands."""
        folder = library.library_folder("behaviors")  # tests put another one there
        if not set(options) <= {"motion_set", "beside"} or not all(name.isidentifier() for name in names):
            return load_behavior_set(names, bands, **options)
        key = folder, tuple(names), tuple(map(tuple, bands)), options.get("motion_set")
        if key not in self._read:
            self._read[key] = load_behavior_set(names, bands, **options)
        return self._read[key]
