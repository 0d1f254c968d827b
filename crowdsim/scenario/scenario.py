"""A validated scenario with the geometry it describes."""

from __future__ import annotations

from pathlib import Path

from pydantic import PrivateAttr
from shapely import Polygon

from crowdsim.environment.layers import ClearanceLayer, clearance_layers
from crowdsim.environment.solids import Solid
from crowdsim.errors import Problem
from crowdsim.scenario.document import Document
from crowdsim.scenario.document import Path as KeyPath
from crowdsim.scenario.schema import ScenarioFields


class Scenario(ScenarioFields):
    """The keys of a scenario file as attributes, and what they mean as shapes; see :func:`load_scenario`."""

    _text: str = PrivateAttr(default="")
    _path: Path | None = PrivateAttr(default=None)
    _document: Document = PrivateAttr(default_factory=lambda: Document("<scenario>"))
    _layers: tuple[ClearanceLayer, ...] | None = PrivateAttr(default=None)

    @classmethod
    def from_document(cls, document: Document, text: str, path: Path | None) -> Scenario:
        """Validate the values of ``document``; pydantic's ``ValidationError`` if they break the schema."""
        scenario = cls.model_validate(document.value)
        scenario._document, scenario._text, scenario._path = document, text, path
        return scenario

    @property
    def text(self) -> str:
        """Source text of the file, without overrides."""
        return self._text

    @property
    def path(self) -> Path | None:
        """The file the scenario was read from."""
        return self._path

    def problem(self, path: KeyPath, message: str) -> Problem:
        """What is wrong with the entry at ``path``, with its place in the file."""
        return self._document.problem(path, message)

    def floor_polygon(self) -> Polygon:
        """The floor before anything stands on it."""
        return self.floor.shape()

    def solids(self) -> tuple[Solid, ...]:
        """The obstacles in the order of the file."""
        return tuple(obstacle.solid() for obstacle in self.obstacles)

    def layers(self) -> tuple[ClearanceLayer, ...]:
        """Clearance layers, the ground layer first; built once."""
        if self._layers is None:
            bands = [layer.band() for layer in self.bands]
            self._layers = clearance_layers(self.floor_polygon(), self.solids(), bands)
        return self._layers

    def region(self, name: str) -> Polygon:
        """Polygon of the named area; ``KeyError`` if there is none of the name."""
        shapes = {area.name: area.shape() for area in self.areas}
        return shapes[name]

    def capture_files(self) -> tuple[Path, ...]:
        """Motion captures the scenario asks for, sorted within each pattern, each once; none for a built-in set."""
        folder = self.capture_folder()
        if folder is None:
            return ()
        found = [file for pattern in self.motion.clips for file in sorted(folder.glob(pattern))]
        return tuple(dict.fromkeys(found))

    def capture_folder(self) -> Path | None:
        """Folder of the captures, relative to the scenario file; None for a built-in set."""
        if self.motion.captures is None:
            return None
        return (self._path.parent if self._path else Path()) / self.motion.captures
