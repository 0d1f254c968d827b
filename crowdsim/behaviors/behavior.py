"""A locomotion behavior: how wide a body it makes, what a meter of it costs, where its clips are."""

from __future__ import annotations

import re
from collections.abc import Iterable
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

FILE_NAME = "behavior.yaml"


@dataclass(frozen=True)
class Behavior:
    """One way to move.

    facings: radians, body heading relative to the direction of motion, one for each side it can be done on.
    detectors: names of the feature detectors that cut its clips.
    cost_per_meter: relative to 1.0; the planner minimizes its sum along the path.
    speed: preferred, m/s. color: "#rrggbb" of its sections in pictures.
    radii: (layers,) float64, meters the body reaches off its track across the motion, in each height band.
    folder: where its ``behavior.yaml`` is.
    turning: (2, layers) float64, meters the body reaches to the sides of its way while it turns off it, and back onto
        it; None where no clip leads in or out.
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

    @property
    def turned(self) -> bool:
        """Whether the body moves turned off its way, so that it has to turn before and after."""
        return min(abs(facing) for facing in self.facings) > np.pi / 4.0


@dataclass(frozen=True)
class BehaviorClips:
    """Clips of one behavior: its own, those it waits in, and those that lead (clip, from, to) between two by name."""

    clips: tuple[Clip, ...]
    idle: tuple[Clip, ...]
    transitions: tuple[tuple[Clip, str, str], ...]


class _Model(BaseModel):
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
    if not re.fullmatch(r"[a-z][a-z0-9_]*", name):
        raise ValueError(f"expected small letters, digits and _, such as side_steps, got '{name}'")
    return name


def _checked_color(color: str) -> str:
    if not re.fullmatch(r"#[0-9a-fA-F]{6}", color):
        raise ValueError(f"expected a color such as \"#1f77b4\", in quotes, got '{color}'")
    return color


class BehaviorFile(_Model):
    """What a ``behavior.yaml`` says; angles in degrees."""

    name: Annotated[str, AfterValidator(_checked_name)]
    description: str
    facing: Annotated[tuple[Annotated[float, Field(gt=-180.0, le=180.0)], ...], Field(strict=False, min_length=1)]
    detectors: Annotated[tuple[str, ...], Field(strict=False, min_length=1)]
    cost_per_meter: Annotated[float, Field(gt=0.0, allow_inf_nan=False)]
    speed: Annotated[float, Field(gt=0.0, allow_inf_nan=False)]
    color: Annotated[str, AfterValidator(_checked_color)]
    clips: Annotated[tuple[ClipEntry, ...], Field(strict=False, min_length=1)]
    transitions: Annotated[tuple[TransitionEntry, ...], Field(strict=False)] = ()
    idle: Annotated[tuple[ClipEntry, ...], Field(strict=False)] = ()

    def behavior(
        self, radii: NDArray[np.float64], folder: Path, turning: NDArray[np.float64] | None = None
    ) -> Behavior:
        """The behavior, with body radii measured from its clips, and those of its turns."""
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
    """Names of the behaviors in a library folder, in alphabetical order."""
    return tuple(sorted(path.parent.name for path in folder.glob(f"*/{FILE_NAME}")))


def read_behavior(name: str, library: Path) -> BehaviorFile:
    """The checked ``behavior.yaml`` of behavior ``name`` in a library folder.

    BehaviorError names the file, line and key of everything that is wrong in it, and the nearest valid name.
    """
    path = library / name / FILE_NAME
    if not path.is_file():
        known = list_behaviors(library)
        raise BehaviorError(f"no behavior '{name}' in {library}; {nearest(name, known, 'there are')}")
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
    if entry.name != name:
        complaints.append((("name",), f"'{entry.name}' is not the name of its folder, '{name}'"))
    for key in ("clips", "idle", "transitions"):
        for number, listed in enumerate(getattr(entry, key)):
            if not (path.parent / listed.file).is_file():
                complaints.append(((key, number, "file"), f"'{listed.file}' is missing in {path.parent}"))
    for number, transition in enumerate(entry.transitions):
        if name not in (transition.from_, transition.to):
            complaints.append((("transitions", number), f"'{transition.file}' neither begins nor ends with '{name}'"))
    if complaints:
        _refuse(document.problem(*complaint) for complaint in complaints)
    return entry


def _refuse(problems: Iterable[Problem]) -> NoReturn:
    raise BehaviorError("\n".join(map(str, problems)))
