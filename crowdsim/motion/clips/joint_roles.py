"""Which joint of a file plays which role, whatever the conversion that wrote it calls its joints."""

from __future__ import annotations

import re
from collections.abc import Sequence

_SIDED = {
    "shoulder": ("arm", "uparm", "upperarm", "humerus", "shoulder"),
    "elbow": ("forearm", "lowarm", "lowerarm", "radius", "elbow"),
    "wrist": ("wrist", "hand"),
    "hip": ("upleg", "upperleg", "femur", "thigh", "hip"),
    "knee": ("leg", "lowleg", "lowerleg", "tibia", "shin", "calf", "knee"),
    "ankle": ("foot", "ankle"),
    "toe": ("toebase", "toes", "toe", "ball"),
}
_CENTRAL = {
    "hips": ("hips", "hip", "pelvis"),
    "chest": ("chest", "thorax", "upperchest", "spine3", "spine2", "spine1", "spine"),
    "neck": ("neck", "lowerneck", "neck1"),
    "head": ("head",),
}


def _spellings(side: str, stem: str) -> tuple[str, ...]:
    return side + stem, side[0] + stem, stem + side, stem + side[0]


def _alias_table() -> dict[str, tuple[str, ...]]:
    """For each role the normalized names that may play it, the most telling first."""
    table = dict(_CENTRAL)
    for side in ("left", "right"):
        for part, stems in _SIDED.items():
            table[f"{side}_{part}"] = tuple(name for stem in stems for name in _spellings(side, stem))
    return table


_ALIASES = _alias_table()


def _normalize(name: str) -> str:
    """``mixamorig:Spine_01`` as ``spine1``."""
    letters = re.sub(r"[^a-z0-9]", "", name.rsplit(":", 1)[-1].lower())
    return re.sub(r"(?<=[a-z])0+(?=\d)", "", letters)


def find_roles(names: Sequence[str]) -> dict[str, int]:
    """Index of the joint for each role that ``names`` (root first) can fill.

    Case, punctuation and a namespace such as ``mixamorig:`` do not count. A root that no alias fits plays the hips.
    """
    normal = [_normalize(name) for name in names]
    first_place = {name: index for index, name in reversed(list(enumerate(normal)))}
    roles: dict[str, int] = {}
    for role, aliases in _ALIASES.items():
        found = next((first_place[alias] for alias in aliases if alias in first_place), None)
        if found is not None and found not in roles.values():
            roles[role] = found
    roles.setdefault("hips", 0)
    return roles
