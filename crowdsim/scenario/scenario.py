"""A validated scenario: its keys, their positions in its file, and the environment that they describe."""

from __future__ import annotations

import inspect
import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypedDict, TypeVar, Unpack

from pydantic import PrivateAttr
from shapely import MultiPolygon, Polygon

from crowdsim.errors import Problem
from crowdsim.scenario.composing.files import Files, named_from
from crowdsim.scenario.composing.plain_values import SOURCE, plain_keys
from crowdsim.scenario.composing.validation import validated
from crowdsim.scenario.environment import Environment
from crowdsim.scenario.schema.commands import Command
from crowdsim.scenario.schema.schema import FORMAT_VERSION, ScenarioFields
from crowdsim.scenario.schema.values import Part
from crowdsim.whole_files import whole_file
from crowdsim.yamlfile.document import Document, Position
from crowdsim.yamlfile.document import Path as KeyPath
from crowdsim.yamlfile.written import written_document

if TYPE_CHECKING:
    from trimesh import Trimesh

Entries = Sequence[Mapping[str, Any] | Part]

_USUAL = {"crowdsim": FORMAT_VERSION, "name": "untitled", "seed": 1, "duration": 300.0}
"""Keys that are required in a file but optional in Python, with their defaults."""


class _RequiredKeys(TypedDict):
    """The keys that have no default."""

    floor: Polygon | MultiPolygon | Mapping[str, Any] | Part
    agents: Entries


class ScenarioKeys(_RequiredKeys, total=False):
    """The keys of a scenario in Python; docs/scenarios.md describes each.

    Entries are mappings with the keys of the file, or models of :mod:`crowdsim.scenario.schema`. A shapely polygon is
    accepted for the floor (also with holes), a start, a goal, an area, or an obstacle as high as a wall; a trimesh mesh
    (z up, in meters) for an obstacle.
    """

    name: str
    description: str
    seed: int
    duration: float
    steps_per_second: int
    obstacles: Sequence[Polygon | Trimesh | Mapping[str, Any] | Part]
    clutter: Mapping[str, Any]
    doors: Entries
    events: Entries
    layers: Entries
    behaviors: Sequence[str]
    planner: Literal["layered", "greedy_literal", "collision3d"]
    motion: Mapping[str, Any]
    exits: Entries
    routes: Entries
    areas: Entries
    lines: Entries
    captured_near: Mapping[str, Any]
    commands: Entries


def _signature() -> inspect.Signature:
    """Return the signature of :class:`Scenario`: the keys of a file as keywords, with their defaults in Python."""
    parameters = [inspect.Parameter("self", inspect.Parameter.POSITIONAL_OR_KEYWORD)]
    for name, field in ScenarioFields.model_fields.items():
        key = field.alias or name
        if key not in ScenarioKeys.__annotations__:
            continue  # the version of the format is no keyword
        default = _USUAL.get(key, inspect.Parameter.empty if field.is_required() else field.default)
        # A TypedDict keeps its annotations as text, not evaluated: ``__forward_arg__``.
        annotation = ScenarioKeys.__annotations__[key].__forward_arg__
        parameters.append(
            inspect.Parameter(key, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=annotation)
        )
    return inspect.Signature(parameters)


Init = TypeVar("Init", bound=Callable[..., None])


def _with_signature(init: Init) -> Init:
    """Return ``init`` with the signature of :func:`_signature`; pydantic shows it for the class."""
    described: Any = init
    described.__signature__ = _signature()
    return init


class Scenario(ScenarioFields):
    """The keys of a scenario as attributes, and its environment; use :func:`load_scenario` for files.

    Parameters
    ----------
    **keys
        The keys of a scenario file, see docs/scenarios.md.

    Raises
    ------
    ScenarioError
        With every problem, each with its key: ``Scenario: agents.0.count: must be at least 1, got 0``.

    Examples
    --------
    >>> scenario = Scenario(
    ...     floor={"rectangle": [0, 0, 8, 4]},
    ...     agents=[{"name": "walkers", "count": 2, "start": {"point": [1, 2]}, "interval": 2.0,
    ...              "goal": {"point": [7, 2]}}],
    ... )
    >>> scenario.agents[0].count
    2
    """

    _document: Document = PrivateAttr()
    _text: str = PrivateAttr()
    _path: Path | None = PrivateAttr()
    _files: Files = PrivateAttr()
    _environment: Environment = PrivateAttr()

    @_with_signature
    def __init__(self, **keys: Unpack[ScenarioKeys]) -> None:
        plain, made = plain_keys({**_USUAL, **keys})
        document = Document(SOURCE, plain, {(): Position(SOURCE)}, complete=True)
        files = Files(Path(), made)
        fields, environment = validated(document, files)
        # Make a scenario of the checked keys and their source, and take over its whole state: pydantic keeps it in
        # these four attributes.
        made_of = Scenario.of(fields, document, written_document(plain), None, files, environment)
        for name in ("__dict__", "__pydantic_fields_set__", "__pydantic_extra__", "__pydantic_private__"):
            object.__setattr__(self, name, getattr(made_of, name))

    @classmethod
    def of(
        cls,
        keys: ScenarioFields,
        document: Document,
        text: str,
        path: Path | None,
        files: Files,
        environment: Environment,
    ) -> Scenario:
        """Return a scenario of validated keys, with their source and the environment they describe.

        Parameters
        ----------
        keys : ScenarioFields
            Validated keys.
        document : Document
            Their source, with the positions of the entries.
        text : str
            Text of the file.
        path : Path or None
            The file; None without one.
        files : Files
            Files that the scenario names.
        environment : Environment
            Environment built from the keys.

        Returns
        -------
        Scenario
            The scenario.
        """
        scenario = cls.model_construct(keys.model_fields_set, **dict(keys))
        scenario._document, scenario._text, scenario._path = document, text, path
        scenario._files, scenario._environment = files, environment
        return scenario

    @property
    def text(self) -> str:
        """Return the source text of the file, without overrides; for a scenario made in Python, :meth:`to_yaml`."""
        return self._text

    @property
    def path(self) -> Path | None:
        """Return the file that the scenario was read from; None if it was not read from a file."""
        return self._path

    @property
    def environment(self) -> Environment:
        """Return floor, layers and timetable."""
        return self._environment

    def problem(self, path: KeyPath, message: str) -> Problem:
        """Return a problem with an entry.

        Parameters
        ----------
        path : tuple of str and int
            Keys and indices that lead to the entry.
        message : str
            What is wrong, and the remedy.

        Returns
        -------
        Problem
            The problem, with its position in the file.
        """
        return self._document.problem(path, message)

    def area_polygons(self) -> dict[str, Polygon]:
        """Return the named areas.

        Returns
        -------
        dict of str to Polygon
            Polygons by name [m], in the order of the file.
        """
        return {area.name: area.shape() for area in self.areas}

    @property
    def folder(self) -> Path:
        """Return the folder that names in the scenario are relative to: that of its file, or the working folder."""
        return self._files.folder

    def captures_folder(self) -> Path | None:
        """Return the folder of the motion captures.

        Returns
        -------
        Path or None
            The folder; None if the scenario uses a built-in motion set.
        """
        return None if self.motion.captures is None else self._files.folder / self.motion.captures

    def to_yaml(self, folder: Path | None = None) -> str:
        """Return the text of a file that describes the same scenario, with overrides applied.

        Meshes, and floors with holes, that were given in Python appear as names of files that do not exist, such as
        ``floor.wkt``. :meth:`save` writes these files; it puts the name of the scenario file before their names, in the
        text as well: ``hall-floor.wkt`` beside ``hall.yaml``.

        Parameters
        ----------
        folder : Path or None
            Folder that relative file names start from; by default :attr:`folder`.

        Returns
        -------
        str
            Text of the file.
        """
        if folder is None:
            return written_document(self._document.value)
        return written_document(
            named_from(self._document.value, self._files, folder, {name: name for name in self._files.made})
        )

    def save(self, path: str | os.PathLike[str], commands: Sequence[Command] | None = None) -> list[Path]:
        """Write the scenario to ``path``, and beside it files for meshes, and floors with holes, given in Python.

        Relative file names in the scenario are rewritten to start from the new folder. Existing files are replaced.

        Parameters
        ----------
        path : str or path
            Name of the scenario file, .yaml or .yml.
        commands : sequence of Command or None
            Commands to write instead of the scenario's own.

        Returns
        -------
        list of Path
            The files that were written, the scenario last.

        Raises
        ------
        CrowdSimError
            If the ending is wrong, the folder does not exist, a name is taken by a folder or device, or the disk is
            full.
        OSError
            If the system refuses for another reason, as without permission.
        """
        path = Path(path)
        renamed = {name: f"{path.stem}-{name}" for name in self._files.made}
        keys = named_from(self._document.value, self._files, path.resolve().parent, renamed)
        if commands is not None:
            keys = {**keys, **plain_keys({"commands": commands})[0]}
        beside = {path.with_name(renamed[name]): made for name, made in self._files.made.items()}
        # The block checks the name of the scenario before anything is written, and puts the scenario there last.
        with whole_file(path, (".yaml", ".yml"), "scenarios") as part:
            for file, content in beside.items():
                with whole_file(file, (file.suffix,), "scenarios") as part_beside:
                    part_beside.write_bytes(content)
            part.write_bytes(written_document(keys).encode())
        return [*beside, path]
