"""Write binary glTF 2.0: numbers in one buffer, and a JSON text that describes them."""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

_COMPONENTS = {"int8": 5120, "uint8": 5121, "int16": 5122, "uint16": 5123, "uint32": 5125, "float32": 5126}
_KINDS = {(): "SCALAR", (2,): "VEC2", (3,): "VEC3", (4,): "VEC4", (4, 4): "MAT4"}

VERTICES, INDICES = 34962, 34963
"""Targets of buffer views: vertex attributes, and triangle indices."""


class GltfBuffer:
    """Collects arrays, and the views and accessors through which the JSON refers to them."""

    def __init__(self) -> None:
        self._parts: list[bytes] = []
        self._length = 0
        self._known: dict[tuple[Any, ...], int] = {}
        self.views: list[dict[str, Any]] = []
        self.accessors: list[dict[str, Any]] = []

    def add_view(self, values: NDArray[Any], target: int | None = None) -> int:
        """Append the bytes of an array; return the index of its view.

        target: VERTICES, INDICES, or None for other data.
        """
        content = np.ascontiguousarray(values).tobytes()
        view: dict[str, Any] = {"buffer": 0, "byteOffset": self._length, "byteLength": len(content)}
        if target is not None:
            view["target"] = target
        self.views.append(view)
        padded = content + bytes(-len(content) % 4)
        self._parts.append(padded)
        self._length += len(padded)
        return len(self.views) - 1

    def add_accessor(
        self, view: int, values: NDArray[Any], offset: int = 0, bounds: bool = False, normalized: bool = False
    ) -> int:
        """Describe ``values``, which begin at byte ``offset`` of a view; return the index of the accessor.

        ``bounds`` adds their least and greatest values, which glTF requires for positions and times. ``normalized``
        marks integers that stand for shares of the largest integer. An accessor with the same properties is reused.
        """
        known = view, offset, values.dtype.name, values.shape, bounds, normalized
        if known in self._known:
            return self._known[known]
        kind = _KINDS[values.shape[1:]]
        accessor: dict[str, Any] = {"bufferView": view, "componentType": _COMPONENTS[values.dtype.name]}
        accessor |= {"count": len(values), "type": kind}
        if offset:
            accessor["byteOffset"] = offset
        if normalized:
            accessor["normalized"] = True
        if bounds:
            flat = values.reshape(len(values), -1)
            accessor["min"], accessor["max"] = flat.min(axis=0).tolist(), flat.max(axis=0).tolist()
        self.accessors.append(accessor)
        self._known[known] = len(self.accessors) - 1
        return self._known[known]

    def add(self, values: NDArray[Any], target: int | None = None, bounds: bool = False) -> int:
        """Append an array with a view of its own; return the index of its accessor."""
        return self.add_accessor(self.add_view(values, target), values, bounds=bounds)

    def write(self, file: Path, document: dict[str, Any]) -> None:
        """Write a GLB file of ``document`` and the collected arrays, without empty lists, which glTF forbids."""
        document = {**document, "buffers": [{"byteLength": self._length}]}
        document |= {"bufferViews": self.views, "accessors": self.accessors}
        kept = {name: value for name, value in document.items() if value != []}
        text = json.dumps(kept, ensure_ascii=False, separators=(",", ":"), allow_nan=False).encode()
        # Both chunks are filled up to whole 4 bytes; their heads are length and kind.
        text += b" " * (-len(text) % 4)
        with file.open("wb") as stream:
            stream.write(struct.pack("<4sII", b"glTF", 2, 12 + 8 + len(text) + 8 + self._length))
            stream.write(struct.pack("<I4s", len(text), b"JSON") + text)
            stream.write(struct.pack("<I4s", self._length, b"BIN\0"))
            stream.writelines(self._parts)
