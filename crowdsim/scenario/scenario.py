"""A validated scenario with the geometry it describes."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from pydantic import PrivateAttr
from shapely import MultiPolygon, Polygon

from crowdsim.environment.layers import AnySolid, ClearanceLayer, clearance_layers
from crowdsim.errors import Problem
from crowdsim.scenario.changes import Changes, read_changes
from crowdsim.scenario.schema.schema import ScenarioFields
from crowdsim.scenario.site import Site, read_site
from crowdsim.yamlfile.document import Document
from crowdsim.yamlfile.document import Path as KeyPath


class Captures(NamedTuple):
    """A folder of motion captures and the patterns of the files to take from it."""

    folder: Path
    patterns: tuple[str, ...]


class Scenario(ScenarioFields):
    """The keys of a scenario file as attributes, and what they mean as shapes; see :func:`load_scenario`."""

    _text: str = PrivateAttr(default="")
    _path: Path | None = PrivateAttr(default=None)
    _document: Document = PrivateAttr(default_factory=lambda: Document("<scenario>"))
    _site: Site | None = PrivateAttr(default=None)
    _layers: tuple[ClearanceLayer, ...] | None = PrivateAttr(default=None)
    _changes: Changes | None = PrivateAttr(default=None)

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

    def beside(self, file: str) -> Path:
        """A file or folder that the scenario names, sought from its own folder."""
        return (self._path.parent if self._path else Path()) / file

    def site(self) -> Site:
        """Floor and solids with what is wrong with them; made once."""
        if self._site is None:
            self._site = read_site(self)
        return self._site

    def floor_polygon(self) -> Polygon | MultiPolygon:
        """The floor before anything stands on it."""
        return self.site().floor

    def solids(self) -> tuple[AnySolid, ...]:
        """The obstacles in the order of the file, where they are drawn, then the clutter; doors are not among them."""
        return self.site().solids

    def layers(self) -> tuple[ClearanceLayer, ...]:
        """Clearance layers as they are at the start, the ground layer first; built once."""
        if self._layers is None:
            self._layers = self.layers_of(self.changes().at_start())
        return self._layers

    def layers_of(self, solids: Sequence[AnySolid]) -> tuple[ClearanceLayer, ...]:
        """Clearance layers of the floor with nothing but ``solids`` on it."""
        return clearance_layers(self.floor_polygon(), solids, [layer.band() for layer in self.bands])

    def things(self) -> list[tuple[str, tuple[AnySolid, ...]]]:
        """What stands on the floor by name: the solids of each obstacle, and of the clutter."""
        names: dict[KeyPath, str] = {
            ("obstacles", number): obstacle.name for number, obstacle in enumerate(self.obstacles)
        }
        return [(names.get(path, str(path[0])), solids) for path, solids in self.site().by_entry.items()]

    def changes(self) -> Changes:
        """What never changes, what does, and when."""
        if self._changes is None:
            self._changes = read_changes(self, self.things())[0]
        return self._changes

    def area_polygons(self) -> dict[str, Polygon]:
        """Polygons of the named areas in the order of the file."""
        return {area.name: area.shape() for area in self.areas}

    def captures(self) -> Captures | None:
        """The motion captures asked for; None for the built-in set."""
        if self.motion.captures is None:
            return None
        return Captures(self.beside(self.motion.captures), self.motion.clips)
