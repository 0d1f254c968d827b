"""A locomotion behavior: its clearance, its cost per meter, and the files of its clips."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, NoReturn

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError

from crowdsim.errors import BehaviorError, Problem
from crowdsim.motion.clips.clip import Clip
from crowdsim.motion.graph.features import DETECTORS
from crowdsim.yamlfile.document import Complaint, read_document, read_text
from crowdsim.yamlfile.messages import nearest, schema_problems

FRONTAL = "frontal"
HELD = "arm_constrained"
LATERAL = "lateral"
CAPTURED = (FRONTAL, HELD, LATERAL)
"""Behaviors that can be made from a folder of captures."""

FILE_NAME = "behavior.yaml"


@dataclass(frozen=True)
class Behavior:
    """A way to walk, such as frontally or sideways.

    Attributes
    ----------
    name, description : str
        Name of its folder, and a sentence about it.
    facings : tuple of float
        Heading of the body relative to the direction of motion [rad], one for each side it can be walked on.
    detectors : tuple of str
        Names of the feature detectors that cut its clips into segments.
    cost_per_meter : float
        Cost of walking one meter, relative to 1.0; plans minimize the sum along the path.
    speed : float
        Preferred speed [m/s].
    color : str
        Color of its sections in pictures, "#rrggbb".
    radii : (layers,) float64
        Clearance in each layer: largest distance from the track that the body reaches across the motion [m].
    folder : Path
        Folder of its ``behavior.yaml``.
    turning : (2, layers) float64 or None
        Clearance while the body turns into the behavior, and out of it [m]; None if no clip does either.
    widest : tuple of str
        Clip and frame that determine the radius of each layer; empty if radii were not measured cycle by cycle.
    """

    name: str
    description: str
    facings: tuple[float, ...]
    detectors: tuple[str, ...]
    cost_per_meter: float
    speed: float
    color: str
    radii: NDArray[np.float64]
    folder: Path
    turning: NDArray[np.float64] | None = None
    widest: tuple[str, ...] = ()

    @property
    def turned(self) -> bool:
        """Return whether the body faces more than 45 degrees off its direction of motion.

        It then has to turn before and after a section of this behavior.
        """
        return min(abs(facing) for facing in self.facings) > np.pi / 4.0


def facings_of(behaviors: Sequence[Behavior]) -> NDArray[np.float64]:
    """Return the ``facings`` of B behaviors as rows (B, F) [rad], padded with nan."""
    rows = np.full((len(behaviors), max(len(behavior.facings) for behavior in behaviors)), np.nan)
    for row, behavior in zip(rows, behaviors, strict=True):
        row[: len(behavior.facings)] = behavior.facings
    return rows


@dataclass(frozen=True)
class BehaviorClips:
    """Clips of one behavior: its own, those for standing, and transitions (clip, from, to) between named behaviors."""

    clips: tuple[Clip, ...]
    idle: tuple[Clip, ...]
    transitions: tuple[tuple[Clip, str, str], ...]


class _Model(BaseModel):
    """Base of all mappings of a ``behavior.yaml``; unknown keys are refused."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)


class ClipEntry(_Model):
    """A clip of the behavior itself."""

    file: str


class TransitionEntry(_Model):
    """A clip that leads from one behavior to another."""

    file: str
    from_: str = Field(alias="from")
    to: str


def _checked_name(name: str) -> str:
    """Return a valid name of a behavior; raise ValueError for others."""
    if not re.fullmatch(r"[a-z][a-z0-9_]*", name):
        raise ValueError(f"expected small letters, digits and _, a letter first, such as side_steps, got '{name}'")
    return name


def _checked_color(color: str) -> str:
    """Return a valid color, "#rrggbb"; raise ValueError for others."""
    if not re.fullmatch(r"#[0-9a-fA-F]{6}", color):
        raise ValueError(f"expected a color such as \"#1f77b4\", in quotes, got '{color}'")
    return color


class BehaviorFile(_Model):
    """The content of a ``behavior.yaml``; angles are in degrees, ``speed`` in m/s.

    Only ``cost_per_meter`` is required of all; a ``speed`` of 0 and an empty ``color`` mean that the key is absent. A
    file that lists neither ``idle`` nor ``transitions`` is :attr:`captured`: its clips are captures, all in its folder
    if it lists none, and missing clips are synthesized from them.
    """

    name: Annotated[str, AfterValidator(_checked_name)] = ""
    description: str = ""
    facing: Annotated[tuple[Annotated[float, Field(gt=-180.0, le=180.0)], ...], Field(strict=False, min_length=1)] = (
        0.0,
    )
    detectors: Annotated[tuple[str, ...], Field(strict=False, min_length=1)] = ("crossing", "standing")
    cost_per_meter: Annotated[float, Field(gt=0.0, allow_inf_nan=False)]
    speed: Annotated[float, Field(gt=0.0, allow_inf_nan=False)] = 0.0
    color: Annotated[str, AfterValidator(_checked_color)] = ""
    clips: Annotated[tuple[ClipEntry, ...], Field(strict=False, min_length=1)] = ()
    transitions: Annotated[tuple[TransitionEntry, ...], Field(strict=False)] = ()
    idle: Annotated[tuple[ClipEntry, ...], Field(strict=False)] = ()

    @property
    def captured(self) -> bool:
        """Return whether the clips are captures, from which standing and other movements are synthesized."""
        return not self.idle and not self.transitions

    def behavior(
        self, radii: NDArray[np.float64], folder: Path, turning: NDArray[np.float64] | None = None
    ) -> Behavior:
        """Return the behavior of this file in ``folder``.

        ``radii`` (layers,) are measured from its clips, and ``turning`` (2, layers) from its transitions, see
        :class:`Behavior` [m].
        """
        return Behavior(
            name=self.name,
            description=self.description,
            facings=tuple(float(np.radians(angle)) for angle in self.facing),
            detectors=self.detectors,
            cost_per_meter=self.cost_per_meter,
            speed=self.speed,
            color=self.color,
            radii=radii,
            folder=folder,
            turning=turning,
        )


def list_behaviors(folder: Path) -> tuple[str, ...]:
    """Return the names of the behaviors in a library folder, in alphabetical order."""
    return tuple(sorted(path.parent.name for path in folder.glob(f"*/{FILE_NAME}")))


def is_own(entry: str) -> bool:
    """Return whether an entry of ``behaviors`` is the path of a folder, as ``./crouch``, not a name in the library."""
    return entry.startswith(".") or "/" in entry or "\\" in entry


def behavior_folder(entry: str, beside: Path, library: Path) -> Path:
    """Return the folder of an entry of ``behaviors``; the folder of an own behavior is relative to ``beside``."""
    return Path(os.path.normpath(beside.absolute() / entry)) if is_own(entry) else library / entry


def carrier(radii: Sequence[NDArray[np.float64]], before: int, after: int) -> int:
    """Return which of two behaviors carries the nodes of a clip that leads from one to the other: the wider one.

    The width of a behavior is its largest clearance on any layer. Of two equally wide ones, it is the one with the
    larger index. ``radii`` holds the clearances (layers,) of each behavior [m]; ``before`` and ``after`` are the
    indices of the two.
    """
    return max((before, after), key=lambda index: (float(radii[index].max()), index))


def read_behavior(name: str, library: Path) -> BehaviorFile:
    """Read and check the ``behavior.yaml`` of the behavior ``name`` in a library folder.

    Raises
    ------
    BehaviorError
        With file, line and key of everything that is wrong; with the nearest name if there is no such behavior.
    """
    path = library / name / FILE_NAME
    if not path.is_file():
        known = list_behaviors(library)
        raise BehaviorError(f"no behavior '{name}' in {library}; {nearest(name, known, 'there are')}")
    try:
        checked = _checked_name(name)
    except ValueError as error:
        raise BehaviorError(f"{library / name}: the folder names the behavior; {error}") from None
    text, problems = read_text(path, str(path))
    document, more = read_document(text, str(path))
    if problems := [*problems, *more]:
        _refuse(problems)
    try:
        entry = BehaviorFile.model_validate(document.value)
    except ValidationError as error:
        _refuse(schema_problems(error, document, BehaviorFile))
    complaints: list[Complaint] = []
    for number, detector in enumerate(entry.detectors):
        if detector not in DETECTORS:
            message = f"no feature detector '{detector}'; {nearest(detector, sorted(DETECTORS), 'there are')}"
            complaints.append((("detectors", number), message))
    if entry.name not in ("", name):
        complaints.append((("name",), f"'{entry.name}' is not the name of its folder, '{name}'"))
    if entry.captured:
        complaints += _of_captures(entry)
    else:
        # Captures show their speed, and get a color; clips that are ready to use need all keys in the file.
        needed = [key for key in ("speed", "color", "clips") if not getattr(entry, key)]
        complaints += [((), f"'{key}' is missing, which goes with 'idle' and 'transitions'") for key in needed]
    for key in ("clips", "idle", "transitions"):
        for number, listed in enumerate(getattr(entry, key)):
            if not (path.parent / listed.file).is_file():
                complaints.append(((key, number, "file"), f"'{listed.file}' is missing in {path.parent}"))
    for number, transition in enumerate(entry.transitions):
        if name not in (transition.from_, transition.to):
            complaints.append((("transitions", number), f"'{transition.file}' neither begins nor ends with '{name}'"))
    if complaints:
        _refuse(document.problem(*complaint) for complaint in complaints)
    return entry.model_copy(update={"name": checked})


def _of_captures(entry: BehaviorFile) -> list[Complaint]:
    """Return a complaint for each key that a file of captures must not have."""
    message = "captures give behaviors that go ahead; drop this key, or list 'idle' and 'transitions' of your own"
    return [((key,), message) for key in ("facing", "detectors") if key in entry.model_fields_set]


def _refuse(problems: Iterable[Problem]) -> NoReturn:
    """Raise BehaviorError with all problems, a line each."""
    raise BehaviorError("\n".join(map(str, problems)))
