"""Read binary glTF by the specification alone: numbers, trees of nodes, and joint positions at a time."""

from __future__ import annotations

import json
import struct
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

_TYPES = {5121: np.uint8, 5122: np.int16, 5123: np.uint16, 5125: np.uint32, 5126: np.float32}
_SIZES = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}


class Glb:
    """A file; ``document`` is its JSON."""

    def __init__(self, path: Path) -> None:
        content = path.read_bytes()
        magic, version, length, text_length, kind = struct.unpack_from("<4sII I4s", content)
        assert (magic, version, length, kind) == (b"glTF", 2, len(content), b"JSON")
        self.document = json.loads(content[20 : 20 + text_length])
        begin = 20 + text_length
        bytes_length, kind = struct.unpack_from("<I4s", content, begin)
        assert kind == b"BIN\0"
        self._bytes = content[begin + 8 : begin + 8 + bytes_length]
        self.nodes = self.document["nodes"]
        self.parents = {child: n for n, node in enumerate(self.nodes) for child in node.get("children", ())}

    def array(self, accessor: int) -> np.ndarray:
        """Return the values (n, k) of an accessor."""
        of = self.document["accessors"][accessor]
        view = self.document["bufferViews"][of["bufferView"]]
        kind, size = _TYPES[of["componentType"]], _SIZES[of["type"]]
        begin = view["byteOffset"] + of.get("byteOffset", 0)
        assert of.get("byteOffset", 0) + of["count"] * size * np.dtype(kind).itemsize <= view["byteLength"]
        values = np.frombuffer(self._bytes, kind, of["count"] * size, begin).reshape(-1, size)
        assert np.isfinite(values).all()
        if "min" in of:
            assert np.array_equal(values.min(axis=0), np.array(of["min"], kind))
            assert np.array_equal(values.max(axis=0), np.array(of["max"], kind))
        return values / 32767.0 if of.get("normalized") else values

    def channels(self) -> dict[tuple[int, str], tuple[np.ndarray, np.ndarray, str]]:
        """Return (node, path) -> times (k,), values (k, n), interpolation."""
        found = {}
        for animation in self.document.get("animations", ()):
            for channel in animation["channels"]:
                sampler = animation["samplers"][channel["sampler"]]
                times = self.array(sampler["input"])[:, 0]
                assert (np.diff(times) > 0.0).all()
                key = channel["target"]["node"], channel["target"]["path"]
                assert key not in found
                found[key] = times, self.array(sampler["output"]), sampler["interpolation"]
        return found

    def matrices_at(self, time: float) -> list[np.ndarray]:
        """Return the matrix (4, 4) from each node to the world at a time, in glTF's axes."""
        local = []
        channels = self.channels()
        for number, node in enumerate(self.nodes):
            parts = {"translation": np.zeros(3), "rotation": np.array([0.0, 0, 0, 1]), "scale": np.ones(3)}
            for path in parts:
                parts[path] = np.array(node.get(path, parts[path]), np.float64)
                if (number, path) in channels:
                    parts[path] = _sampled(*channels[number, path], time, path)
            matrix = np.eye(4)
            matrix[:3, :3] = Rotation.from_quat(parts["rotation"]).as_matrix() * parts["scale"]
            matrix[:3, 3] = parts["translation"]
            local.append(matrix)
        world: dict[int, np.ndarray] = {}

        def of(number: int) -> np.ndarray:
            if number not in world:
                parent = self.parents.get(number)
                world[number] = local[number] if parent is None else of(parent) @ local[number]
            return world[number]

        return [of(number) for number in range(len(self.nodes))]

    def characters(self) -> dict[int, int]:
        """Return agent -> index of its skin."""
        found = {}
        for number, skin in enumerate(self.document.get("skins", ())):
            top = self.nodes[self.parents[skin["joints"][0]]]
            found[top["extras"]["agent"]] = number
        return found

    def joints_at(self, time: float) -> dict[int, np.ndarray]:
        """Return agent -> positions (J, 3) of its joints, z up, for agents with a scale above 0."""
        matrices = self.matrices_at(time)
        found = {}
        for agent, number in self.characters().items():
            joints = [matrices[joint] for joint in self.document["skins"][number]["joints"]]
            if abs(np.linalg.det(joints[0][:3, :3])) > 1e-6:
                x, y, z = np.array([joint[:3, 3] for joint in joints]).T
                found[agent] = np.column_stack([x, -z, y])
        return found


def _sampled(times: np.ndarray, values: np.ndarray, interpolation: str, time: float, path: str) -> np.ndarray:
    time = float(np.clip(time, times[0], times[-1]))
    after = min(int(np.searchsorted(times, time, side="right")), len(times) - 1)
    before = max(after - 1, 0) if times[after] > time else after
    if interpolation == "STEP" or after == before:
        return values[before].astype(np.float64)
    share = (time - times[before]) / (times[after] - times[before])
    first, second = values[before].astype(np.float64), values[after].astype(np.float64)
    if path == "rotation" and first @ second < 0.0:
        second = -second
    mixed = (1.0 - share) * first + share * second
    return mixed / np.linalg.norm(mixed) if path == "rotation" else mixed
