"""Turn Python values (shapely polygons, meshes, arrays, models) into the plain values of a scenario file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely
from pydantic import BaseModel
from shapely.geometry.base import BaseGeometry

from crowdsim.environment.floor_plans import WALL_HEIGHT
from crowdsim.errors import Problem, ScenarioError
from crowdsim.yamlfile.document import MAX_DEPTH, dotted
from crowdsim.yamlfile.document import Path as KeyPath

if TYPE_CHECKING:
    from trimesh import Trimesh

SOURCE = "Scenario"
"""Name that problems give instead of a file if the scenario was made in Python."""

_RINGS, _LINES, _SPOTS = ("polygon",), ("points", "line"), ("point", "center", "min", "max", "to", "by")
"""Keys whose values are coordinates: of a polygon's outline, of a line, of a point."""


def plain_keys(keys: Mapping[str, Any], source: str = SOURCE) -> tuple[dict[str, Any], dict[str, bytes]]:
    """Turn the keys of a scenario into plain values.

    Parameters
    ----------
    keys : mapping
        Keys of a scenario as Python values.
    source : str
        Name that problems give instead of a file.

    Returns
    -------
    keys : dict
        Dictionaries, lists, text, numbers and None only.
    made : dict of str to bytes
        Contents of the files that stand for meshes and for floors with holes, by name.

    Raises
    ------
    ScenarioError
        If a value has a type that no scenario key accepts, is a shape or mesh that its key does not take, or is nested
        too deep.
    """
    reader = _Reader(source)
    return reader.mapping(keys, ()), reader.made


def is_mesh(value: Any) -> bool:
    """Return whether ``value`` is a trimesh mesh, without importing trimesh."""
    return any(kind.__name__ == "Trimesh" and kind.__module__.startswith("trimesh.") for kind in type(value).__mro__)


class _Reader:
    """Converts values recursively and collects the files made for meshes and floors.

    ``path`` is the key path of a value in the scenario; ``source`` stands for the file in problems.
    """

    def __init__(self, source: str) -> None:
        self.source = source
        self.made: dict[str, bytes] = {}

    def mapping(self, values: Mapping[str, Any], path: KeyPath) -> dict[str, Any]:
        """Return a mapping with plain values; ``path`` is its key path in the scenario."""
        return {str(key): self.value(value, (*path, str(key))) for key, value in values.items()}

    def value(self, value: Any, path: KeyPath) -> Any:
        """Return the plain value of any accepted Python value at the key ``path``.

        Raise ScenarioError for other types, and if the value is nested deeper than MAX_DEPTH.
        """
        if len(path) > MAX_DEPTH:
            raise self._refusal(path, f"nested more than {MAX_DEPTH} levels deep")
        if value is None or isinstance(value, str | bool | int | float):
            # A numpy.float64 is a float, too.
            return float(value) if isinstance(value, np.floating) else value
        if isinstance(value, BaseModel):
            return self.mapping(value.model_dump(by_alias=True, exclude_unset=True), path)
        if isinstance(value, Mapping):
            return self.mapping(value, path)
        if isinstance(value, BaseGeometry):
            return self._shape(value, path)
        if is_mesh(value):
            return self._mesh(value, path)
        if isinstance(value, Path):
            return value.as_posix()
        if isinstance(value, np.ndarray | np.generic):
            return value.tolist()
        if isinstance(value, Sequence):
            return [self.value(inner, (*path, number)) for number, inner in enumerate(value)]
        raise self._refusal(path, f"a {type(value).__name__} cannot be written into a scenario; see docs/scenarios.md")

    def _shape(self, shape: BaseGeometry, path: KeyPath) -> Any:
        """Return coordinates if the key holds coordinates, else the mapping of a floor, an obstacle or a region.

        A floor with holes or several parts becomes a file. Raise ScenarioError for a shape that the key cannot hold.
        """
        if shape.is_empty:
            raise self._refusal(path, f"an empty {shape.geom_type}; give one that is not empty")
        if path[-1] in _RINGS:
            return self._ring(shape, path)
        if path[-1] in _LINES and shape.geom_type == "LineString":
            return _pairs(shape)
        if shape.geom_type == "Point":
            spot = _pairs(shape)[0]
            return spot if path[-1] in _SPOTS else {"point": spot}
        # A floor may have holes and parts, which only a file can hold.
        if path == ("floor",):
            if shape.geom_type == "Polygon" and not shape.interiors:
                return {"polygon": self._ring(shape, path)}
            # With all digits (-1), so that the floor stays the same to the bit.
            text = shapely.to_wkt(shape, rounding_precision=-1, output_dimension=2)
            return {"file": self._made("floor.wkt", text.encode())}
        if _is_obstacle(path):
            return {"name": f"obstacle {path[1]}", "polygon": self._ring(shape, path), "top": WALL_HEIGHT}
        return {"polygon": self._ring(shape, path)}

    def _mesh(self, mesh: Trimesh, path: KeyPath) -> Any:
        """Make a file of a mesh; return its name, a mapping with the name, or an obstacle with this mapping.

        The key decides: ``file``, ``mesh``, or an entry of ``obstacles``. Raise ScenarioError at other keys.
        """
        if not (_is_obstacle(path) or path[-1] in ("mesh", "file")):
            raise self._refusal(path, "a mesh stands among 'obstacles'; give a polygon here")
        from trimesh.exchange.ply import export_ply

        # The index of the obstacle, so that each mesh has a file name of its own.
        number = next((part for part in path if isinstance(part, int)), 0)
        name = self._made(f"obstacle-{number}.ply", export_ply(mesh, vertex_normal=False, include_attributes=False))
        if path[-1] == "file":
            return name
        return {"file": name} if path[-1] == "mesh" else {"name": f"obstacle {path[1]}", "mesh": {"file": name}}

    def _made(self, name: str, content: bytes) -> str:
        """Keep the content of a file in memory; return its name."""
        self.made[name] = content
        return name

    def _ring(self, shape: BaseGeometry, path: KeyPath) -> list[list[float]]:
        """Return the corners of a polygon without holes, the first one not repeated [m]; else raise ScenarioError."""
        if shape.geom_type != "Polygon":
            raise self._refusal(path, f"expected a Polygon, got a {shape.geom_type}; give each part by itself")
        if shape.interiors:
            raise self._refusal(path, "a polygon with holes; give its outline, or its parts, or a mesh")
        return _pairs(shape.exterior)[:-1]

    def _refusal(self, path: KeyPath, message: str) -> ScenarioError:
        """Return the error that refuses the value at ``path``."""
        return ScenarioError([Problem(self.source, None, None, dotted(path), message)])


def _is_obstacle(path: KeyPath) -> bool:
    """Return whether a key path is that of a whole obstacle, as ``("obstacles", 2)``."""
    return len(path) == 2 and path[0] == "obstacles"


def _pairs(shape: BaseGeometry) -> list[list[float]]:
    """Return the points of a shape as lists [x, y] [m]."""
    pairs: list[list[float]] = shapely.get_coordinates(shape).tolist()
    return pairs
