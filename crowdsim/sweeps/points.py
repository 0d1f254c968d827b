"""Points of a sweep: a scenario with one value for each changed key, and a seed."""

from __future__ import annotations

import hashlib
import itertools
import json
from collections.abc import Sequence
from typing import NamedTuple

from crowdsim.errors import CrowdSimError
from crowdsim.scenario.loader import load_scenario

MOST_POINTS = 1_000_000
"""Largest number of points of a sweep, all of which are held in memory."""
MOST_SEED = 2**32 - 1
"""Largest seed that ``--seeds`` takes."""

_OPENING, _CLOSING = "[{(", "]})"


class Point(NamedTuple):
    """One run of a sweep.

    Attributes
    ----------
    text : str
        Text of the scenario file.
    file : str
        Absolute path of the scenario file; relative names in it start from its folder.
    settings : tuple of (str, str)
        Changed keys with their values, as YAML.
    seed : int
        Seed.
    """

    text: str
    file: str
    settings: tuple[tuple[str, str], ...]
    seed: int

    @property
    def overrides(self) -> list[str]:
        """Return the changes, the seed last, as ``--set`` of ``crowdsim run`` takes them."""
        return [*(f"{key}={value}" for key, value in self.settings), f"seed={self.seed}"]

    @property
    def name(self) -> str:
        """Return the hash of what is run, text, changes and seed, as a name for files."""
        parts = [self.text, *self.overrides]
        return hashlib.sha256(json.dumps(parts, ensure_ascii=False).encode()).hexdigest()


def points_of(scenario: str, seeds: str | None = None, settings: Sequence[str] = ()) -> list[Point]:
    """Return all points of a sweep: each combination of values with each seed, the seeds innermost.

    Parameters
    ----------
    scenario : str
        A scenario file, or the name of a built-in one.
    seeds : str or None
        Seeds, as ``1-20`` or ``1,3,10-12``; by default the scenario's own.
    settings : sequence of str
        Changes, as ``agents.0.count=10,20``.

    Raises
    ------
    ScenarioError
        If the scenario itself is wrong. What is wrong with single points is found when they run.
    CrowdSimError
        If seeds or changes cannot be read, change a key twice or the seed, or make more than MOST_POINTS points.
    """
    loaded = load_scenario(scenario)
    if loaded.path is None:
        raise CrowdSimError(f"{scenario} was not read from a file; save it first")
    keys = [read_setting(text) for text in settings]
    names = [key for key, _ in keys]
    for key in names:
        if names.count(key) > 1:
            raise CrowdSimError(f"--set {key} is given twice; name all its values in one")
    if "seed" in names:
        raise CrowdSimError("--set seed: name seeds by --seeds, as in --seeds 1-20")
    numbers = [loaded.seed] if seeds is None else read_seeds(seeds)
    count = len(numbers)
    for _, values in keys:
        count *= len(values)
    if count > MOST_POINTS:
        raise CrowdSimError(f"these are {count} points, more than {MOST_POINTS}; take fewer values or seeds")
    combinations = itertools.product(*([(key, value) for value in values] for key, values in keys))
    file = str(loaded.path.resolve())
    return [Point(loaded.text, file, combination, seed) for combination in combinations for seed in numbers]


def read_seeds(text: str) -> list[int]:
    """Return the seeds of a text as ``1-20`` or ``1,3,10-12``, each once, in the order of the text.

    Raise CrowdSimError for other texts, for seeds above MOST_SEED, and for a range of more than MOST_POINTS seeds.
    """
    seeds: list[int] = []
    for part in text.split(","):
        first, dash, last = part.strip().partition("-")
        if not (first.isascii() and first.isdigit()) or (dash and not (last.isascii() and last.isdigit())):
            raise CrowdSimError(f"--seeds {text}: '{part.strip()}' is no seed; give them as 1-20 or 1,3,10-12")
        no_range = f"--seeds {text}: '{part.strip()}' is no range of seeds up to {MOST_SEED}"
        if max(len(first), len(last)) > len(str(MOST_SEED)):  # Python does not read numbers of thousands of digits
            raise CrowdSimError(no_range)
        low, high = int(first), int(last or first)
        if high < low or high > MOST_SEED or high - low >= MOST_POINTS:
            raise CrowdSimError(no_range)
        seeds += range(low, high + 1)
    return list(dict.fromkeys(seeds))


def read_setting(text: str) -> tuple[str, list[str]]:
    """Return key and values of ``KEY=v1,v2``, each value once; commas within brackets and quotes belong to a value.

    Raise CrowdSimError if the key or a value is missing.
    """
    key, equals, rest = text.partition("=")
    key = key.strip()
    values, depth, quote, begin = [], 0, "", 0
    for at, sign in enumerate(rest):
        if quote:
            quote = "" if sign == quote else quote
        elif sign in "\"'":
            quote = sign
        elif sign in _OPENING:
            depth += 1
        elif sign in _CLOSING:
            depth = max(depth - 1, 0)  # one that was never opened closes nothing
        elif sign == "," and depth == 0:
            values.append(rest[begin:at].strip())
            begin = at + 1
    values.append(rest[begin:].strip())
    if not (key and equals and all(values)):
        raise CrowdSimError(f"--set {text}: expected KEY=v1,v2, as in agents.0.count=10,20")
    return key, list(dict.fromkeys(values))
