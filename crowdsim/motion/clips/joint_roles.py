"""Find the joint of a file that plays each role, whatever its software calls its joints."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence

from crowdsim.errors import MotionError

_SIDED = {
    "shoulder": ("arm", "uparm", "upperarm", "uarm", "humerus", "shoulder"),
    "elbow": ("forearm", "lowarm", "lowerarm", "farm", "radius", "elbow"),
    "wrist": ("wrist", "hand"),
    "hip": ("upleg", "upperleg", "femur", "thigh", "hip"),
    "knee": ("leg", "lowleg", "lowerleg", "tibia", "shin", "calf", "knee"),
    "ankle": ("ankle", "foot"),
    "toe": ("toebase", "toes", "toe", "toe0", "ball", "foot"),
}
"""Names of joints by part, the side left out. The first that a file has counts: beside an "arm", a "shoulder" is a
collar bone; beside an "ankle" and without a "toe", a "foot" is the toe joint."""
_CENTRAL = {
    "hips": ("hips", "hip", "pelvis"),
    "chest": ("chest", "thorax", "upperchest", "spine3", "spine2", "spine1", "spine"),
    "neck": ("neck", "lowerneck", "neck1"),
    "head": ("head",),
}
"""Names of joints in the middle of the body by role; again the first that a file has counts."""

_SHARED = 0.75
"""Share of the joint names with a common beginning or end from which on that part is ignored."""


def _spellings(side: str, stem: str) -> tuple[str, ...]:
    """Return the ways in which a side and a stem are combined, as ``leftarm``, ``larm``, ``armleft``, ``arml``."""
    return side + stem, side[0] + stem, stem + side, stem + side[0]


def _alias_table() -> dict[str, tuple[str, ...]]:
    """Return for each role the normalized names that may play it, the most specific first."""
    table = dict(_CENTRAL)
    for side in ("left", "right"):
        for part, stems in _SIDED.items():
            table[f"{side}_{part}"] = tuple(name for stem in stems for name in _spellings(side, stem))
    return table


_ALIASES = _alias_table()


def _normalize(name: str) -> str:
    """Return a name without case, namespace, punctuation and leading zeros: ``spine1`` for ``mixamorig:Spine_01``."""
    letters = re.sub(r"[^a-z0-9]", "", re.split(r"[:|]", name)[-1].lower())
    return re.sub(r"(?<=[a-z])0+(?=\d)", "", letters)


def _shared_beginning(names: Sequence[str]) -> str:
    """Return the longest beginning that at least the share _SHARED of ``names`` have, '' if there is none."""
    best = ""
    for length in range(1, max(map(len, names)) + 1):
        start, count = Counter(name[:length] for name in names if len(name) >= length).most_common(1)[0]
        if count < _SHARED * len(names):
            break
        best = start
    return best


def _stripped(names: Sequence[str]) -> list[str]:
    """Return normalized names without common beginnings or ends, such as a character's name, ``bip1`` or ``jnt``."""
    normal = [_normalize(name) for name in names]
    # Of a few joints, most may begin alike by chance.
    if len(names) < 8:
        return normal
    # A name that is nothing but the common part keeps it (or name).
    beginning = _shared_beginning(normal)
    normal = [name.removeprefix(beginning) or name for name in normal]
    ending = _shared_beginning([name[::-1] for name in normal])[::-1]
    return [name.removesuffix(ending) or name for name in normal]


def find_roles(
    names: Sequence[str], parents: Sequence[int] = (), given: Mapping[str, str] | None = None
) -> dict[str, int]:
    """Return the index of the joint for each role that ``names`` (root first) can fill.

    Case, punctuation, a namespace such as ``mixamorig:``, and common beginnings or ends are ignored. The root plays the
    hips if no alias fits.

    Parameters
    ----------
    parents: if given, chest, neck and head without a known name are found from where the arms hang.
    given: names of joints by role; they come first.

    Raises
    ------
    MotionError: if a given joint does not exist.
    """
    plain, stripped = [_normalize(name) for name in names], _stripped(names)
    roles: dict[str, int] = {}
    for role, name in (given or {}).items():
        if name not in names:
            raise MotionError(
                f"no joint is called '{name}', the name given for '{role}'; the joints are {', '.join(names)}"
            )
        roles[role] = list(names).index(name)
    # First joint of each name; a joint whose whole name fits goes before one whose stripped name does.
    first_place = {name: index for normal in (stripped, plain) for index, name in reversed(list(enumerate(normal)))}
    # A joint that is found by its name plays one role only.
    for role, aliases in _ALIASES.items():
        found = next((first_place[alias] for alias in aliases if alias in first_place), None)
        if role not in roles and found is not None and found not in roles.values():
            roles[role] = found
    roles.setdefault("hips", 0)
    if len(parents) > 0:
        _add_trunk(roles, parents)
    return roles


def _add_trunk(roles: dict[str, int], parents: Sequence[int]) -> None:
    """Add chest, neck and head to ``roles``, in place, by where the arms hang.

    The chest is the nearest joint above both shoulders. The neck is its first child that leads to no shoulder. The head
    is the last joint down from the neck, along first children. Roles that are known stay, and no joint gets a second
    one. Nothing is added if a shoulder is unknown.
    """
    if "left_shoulder" not in roles or "right_shoulder" not in roles:
        return
    left, right = (_line(roles[f"{side}_shoulder"], parents) for side in ("left", "right"))
    common = next(joint for joint in left if joint in right)
    taken = set(roles.values())
    if "chest" not in roles and common not in taken:
        roles["chest"] = common
    arms = {*left, *right}
    others = [j for j, parent in enumerate(parents) if parent == common and j not in arms]
    if "neck" not in roles and others and others[0] not in taken:
        roles["neck"] = others[0]
    if "head" not in roles and "neck" in roles:
        last = roles["neck"]
        while below := [j for j, parent in enumerate(parents) if parent == last]:
            last = below[0]
        if last not in roles.values():
            roles["head"] = last


def _line(joint: int, parents: Sequence[int]) -> list[int]:
    """Return the joint and all its ancestors, the root last."""
    line = [joint]
    while parents[line[-1]] >= 0:
        line.append(int(parents[line[-1]]))
    return line
