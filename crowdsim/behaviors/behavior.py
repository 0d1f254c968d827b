"""A locomotion behavior: how wide a body it makes, what a meter of it costs, where its clips are."""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, ValidationError
from ruamel.yaml import YAML
from ruamel.yaml.comments import CommentedMap, CommentedSeq
from ruamel.yaml.error import YAMLError

from crowdsim.errors import BehaviorError
from crowdsim.motion.clips.clip import Clip
from crowdsim.motion.graph.features import DETECTORS

FILE_NAME = "behavior.yaml"

_MAX_BYTES = 100_000


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


class BehaviorFile(_Model):
    """What a ``behavior.yaml`` says; angles in degrees."""

    name: Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]*$")]
    description: str
    facing: Annotated[list[Annotated[float, Field(gt=-180.0, le=180.0)]], Field(min_length=1)]
    detectors: Annotated[list[str], Field(min_length=1)]
    cost_per_meter: Annotated[float, Field(gt=0.0, allow_inf_nan=False)]
    speed: Annotated[float, Field(gt=0.0, allow_inf_nan=False)]
    color: Annotated[str, Field(pattern=r"^#[0-9a-fA-F]{6}$")]
    clips: Annotated[list[ClipEntry], Field(min_length=1)]
    transitions: list[TransitionEntry] = []
    idle: list[ClipEntry] = []

    def behavior(
        self, radii: NDArray[np.float64], folder: Path, turning: NDArray[np.float64] | None = None
    ) -> Behavior:
        """The behavior, with body radii measured from its clips, and those of its turns."""
        return Behavior(
            name=self.name,
            description=self.description,
            facings=tuple(float(np.radians(angle)) for angle in self.facing),
            detectors=tuple(self.detectors),
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
        raise BehaviorError(f"no behavior '{name}' in {library}{_nearest(name, known)}; there are: {', '.join(known)}")
    if path.stat().st_size > _MAX_BYTES:
        raise BehaviorError(f"{path}: larger than {_MAX_BYTES} bytes, which is no behavior file")
    try:
        document = YAML(typ="rt", pure=True).load(path.read_text(encoding="utf-8"))
    except (YAMLError, ValueError) as error:
        raise BehaviorError(f"{path}: not valid YAML: {error}") from None
    try:
        entry = BehaviorFile.model_validate(document)
    except ValidationError as error:
        problems = [_explain(document, problem) for problem in error.errors()]
        raise BehaviorError("\n".join(f"{path}{problem}" for problem in problems)) from None
    unknown = [detector for detector in entry.detectors if detector not in DETECTORS]
    if unknown:
        raise BehaviorError(
            f"{path}: detectors: no feature detector is called '{unknown[0]}'{_nearest(unknown[0], DETECTORS)};"
            f" there are: {', '.join(sorted(DETECTORS))}"
        )
    if entry.name != name:
        raise BehaviorError(f"{path}: name: '{entry.name}' is not the name of its folder, '{name}'")
    for file in [listed.file for listed in [*entry.clips, *entry.idle]] + [listed.file for listed in entry.transitions]:
        if not (path.parent / file).is_file():
            raise BehaviorError(f"{path}: file: '{file}' is missing in {path.parent}")
    for transition in entry.transitions:
        if name not in (transition.from_, transition.to):
            raise BehaviorError(f"{path}: transitions: '{transition.file}' neither begins nor ends with '{name}'")
    return entry


def _explain(document: Any, problem: Any) -> str:
    """':line: key: what is wrong' for one finding of pydantic."""
    models: dict[Any, type[BaseModel]] = {"clips": ClipEntry, "idle": ClipEntry, "transitions": TransitionEntry}
    node, line = document, 1
    model: type[BaseModel] = BehaviorFile
    for key in problem["loc"]:
        model = models.get(key, model)
        if isinstance(node, CommentedMap) and key in node:
            line, node = node.lc.key(key)[0] + 1, node[key]
        elif isinstance(node, CommentedSeq) and isinstance(key, int):
            line, node = node.lc.item(key)[0] + 1, node[key]
    key = ".".join(str(part) for part in problem["loc"]) or "document"
    hint = ""
    if problem["type"] == "extra_forbidden":
        names = [field.alias or name for name, field in model.model_fields.items()]
        hint = _nearest(str(problem["loc"][-1]), names)
    return f":{line}: {key}: {problem['msg']}{hint}"


def _nearest(word: str, words: Iterable[str]) -> str:
    near = difflib.get_close_matches(word, list(words), n=1)
    return f"; did you mean '{near[0]}'?" if near else ""
