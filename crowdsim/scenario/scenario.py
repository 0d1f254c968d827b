"""A validated scenario: the keys of its file, where they stand there, and the environment that they describe."""

from __future__ import annotations

from pathlib import Path

from pydantic import PrivateAttr
from shapely import Polygon

from crowdsim.errors import Problem
from crowdsim.scenario.environment import Environment
from crowdsim.scenario.schema.schema import ScenarioFields
from crowdsim.yamlfile.document import Document
from crowdsim.yamlfile.document import Path as KeyPath


class Scenario(ScenarioFields):
    """The keys of a scenario file as attributes, and the environment built of them; see :func:`load_scenario`."""

    _document: Document = PrivateAttr()
    _text: str = PrivateAttr()
    _path: Path | None = PrivateAttr()
    _environment: Environment = PrivateAttr()

    @classmethod
    def of(
        cls, keys: ScenarioFields, document: Document, text: str, path: Path | None, environment: Environment
    ) -> Scenario:
        """Join validated keys with the file they come from and the environment they describe."""
        scenario = cls.model_construct(keys.model_fields_set, **dict(keys))
        scenario._document, scenario._text, scenario._path = document, text, path
        scenario._environment = environment
        return scenario

    @property
    def text(self) -> str:
        """Source text of the file, without overrides."""
        return self._text

    @property
    def path(self) -> Path | None:
        """The file the scenario was read from."""
        return self._path

    @property
    def environment(self) -> Environment:
        """Floor, layers and timetable."""
        return self._environment

    def problem(self, path: KeyPath, message: str) -> Problem:
        """What is wrong with the entry at ``path``, with its place in the file."""
        return self._document.problem(path, message)

    def area_polygons(self) -> dict[str, Polygon]:
        """Polygons of the named areas in the order of the file."""
        return {area.name: area.shape() for area in self.areas}

    def captures_folder(self) -> Path | None:
        """The folder of the motion captures asked for; None for a built-in set."""
        return None if self.motion.captures is None else (self._path or Path()).parent / self.motion.captures
