"""Read the data of a page in plain Python: a slow twin of the viewer's decoder."""

from __future__ import annotations

import base64
import gzip
import json
import re
from pathlib import Path

import numpy as np


def unzigzag(values: np.ndarray) -> np.ndarray:
    """Map 0, 1, 2, ... to 0, -1, 1, ..."""
    return np.where(values % 2, -(values + 1) // 2, values // 2)


def read_page(file: Path) -> PageData:
    """Return the data of a page."""
    text = file.read_text(encoding="utf-8")
    data = re.search(r'<script type="application/octet-stream" id="data">([^<]*)</script>', text)[1]
    return PageData(gzip.decompress(base64.b64decode(data)))


class PageData:
    """Facts and arrays of a page."""

    def __init__(self, whole: bytes) -> None:
        length = int.from_bytes(whole[4:8], "little")
        self.facts = json.loads(whole[8 : 8 + length])
        self._arrays = whole[8 + length :]

    def array(self, name: str) -> np.ndarray:
        """Return a named array."""
        offset, kind, count = self.facts["arrays"][name]
        return np.frombuffer(self._arrays, np.dtype(kind), count, offset)

    @staticmethod
    def numbers(packed: np.ndarray) -> np.ndarray:
        """Return all varints in some bytes."""
        found, value, bits = [], 0, 0
        for byte in packed.tolist():
            value |= (byte & 127) << bits
            bits += 7
            if byte < 128:
                found.append(value)
                value, bits = 0, 0
        return np.array(found, np.int64)

    def present(self) -> np.ndarray:
        """Return (steps, N) whether each character is present."""
        counts, since = (self.numbers(self.array(f"event_{name}")) for name in ("counts", "steps"))
        states = self.array("event_states")
        here = np.zeros((self.facts["steps"], len(counts)), bool)
        row = 0
        for agent, count in enumerate(counts.tolist()):
            step = 0
            for _ in range(count):
                step += int(since[row])
                here[step:, agent] = states[row] % 4 > 0
                row += 1
        return here

    def tracks(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Return x, y [m], heading [rad] and presence, each (steps, N)."""
        here = self.present()
        out = [np.full(here.shape, np.nan) for _ in range(3)]
        units = self.facts["units"]
        scales = (1 / units["place"], 1 / units["place"], 2 * np.pi / units["turn"])
        sizes = self.array("chunk_sizes").reshape(-1, 4)
        for number, size in enumerate(sizes.tolist()):
            low = max(number * self.facts["chunk"] - self.facts["margin"], 0)
            high = min((number + 1) * self.facts["chunk"] + self.facts["margin"], self.facts["steps"])
            cut = np.split(self.array(f"chunk_{number}"), np.cumsum(size)[:-1])
            for column in range(3):
                values = iter(unzigzag(self.numbers(cut[column])).tolist())
                for agent in range(here.shape[1]):
                    _read_column(values, here[low:high, agent], out[column][low:high, agent], scales[column])
        return (*out, here)


def _read_column(values, here, out, scale) -> None:
    value = once = since = 0
    for row, there in enumerate(here.tolist()):
        since = since + 1 if there else 0
        if not since:
            continue
        read = next(values)
        if since == 1:
            value = read
        else:
            once = read if since == 2 else once + read
            value += once
        out[row] = value * scale
