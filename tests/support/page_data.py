"""Read the data of a page in plain Python: a slow twin of the viewer's decoder."""

from __future__ import annotations

import gzip
import json
import re
from pathlib import Path

import numpy as np

from tests.reference.track_decoding import NodeRows, TrackReader, runs


def unzigzag(values: np.ndarray) -> np.ndarray:
    """Map 0, 1, 2, ... to 0, -1, 1, ..."""
    return np.where(values % 2, -(values + 1) // 2, values // 2)


def read_page(file: Path) -> PageData:
    """Return the data of a page."""
    text = file.read_text(encoding="utf-16")
    data = re.search(r'<script type="application/octet-stream" id="data">([^<]*)</script>', text)[1]
    return PageData(gzip.decompress(bytes_of(data)))


def bytes_of(text: str) -> bytes:
    """Return the bytes that a text of a page holds: after their number, 47 bits in three letters each."""
    count, letters = text.split(" ")
    digits = [ord(letter) - 0x0C00 for letter in letters]
    groups = zip(digits[::3], digits[1::3], digits[2::3], strict=True)
    bits = "".join(f"{(a * 52016 + b) * 52016 + c:047b}" for a, b, c in groups)
    return bytes(int(bits[8 * k : 8 * k + 8], 2) for k in range(int(count)))


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

    def varints(self, name: str) -> np.ndarray:
        """Return all numbers of a named array of varints."""
        return self.numbers(self.array(name))

    def present(self) -> np.ndarray:
        """Return (steps, N) whether each agent is present."""
        counts, since = (self.numbers(self.array(f"event_{name}")) for name in ("counts", "steps"))
        states = self.array("event_states")
        here = np.zeros((self.facts["steps"], len(counts)), bool)
        row = 0
        for agent, count in enumerate(counts.tolist()):
            step = 0
            for _ in range(count):
                step += int(since[row])
                here[step:, agent] = states[row] & 3 > 0
                row += 1
        return here

    def nodes(self) -> np.ndarray:
        """Return (steps, N) the node that each agent plays plus one, 0 for none."""
        counts, since, nodes = (self.numbers(self.array(f"event_{name}")) for name in ("counts", "steps", "nodes"))
        out = np.zeros((self.facts["steps"], len(counts)), np.int64)
        row = 0
        for agent, count in enumerate(counts.tolist()):
            step = 0
            for _ in range(count):
                step += int(since[row])
                out[step:, agent] = nodes[row]
                row += 1
        return out

    def tracks(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Return x, y [m], heading [rad] and presence, each (steps, N)."""
        here = self.present()
        out = [np.full(here.shape, np.nan) for _ in range(3)]
        units = self.facts["units"]
        scales = (1 / units["place"], 1 / units["place"], 2 * np.pi / units["turn"])
        rows = [unzigzag(self.varints("node_tracks")).reshape(3, -1).cumsum(axis=1).T, units["frame"]]
        nodes, played = NodeRows(self.varints("node_frames").tolist(), *rows), self.nodes() - 1
        for number in range(-(-len(here) // self.facts["chunk"])):
            low = max(number * self.facts["chunk"] - self.facts["margin"], 0)
            high = min((number + 1) * self.facts["chunk"] + self.facts["margin"], len(here))
            reader = TrackReader(self.array(f"chunk_{number}").tobytes(), self.facts["coding"], nodes)
            for agent in range(here.shape[1]):
                whole = np.zeros((4, high - low), np.int64)
                for there, first, end in runs(here[low:high, agent]):
                    if there:
                        whole[:, first:end] = reader.track(played[low + first : low + end, agent].tolist())
                        # Steps before a chunk are those of the chunk before.
                        first = max(first, number * self.facts["chunk"] - low)
                        for column in range(3):
                            out[column][low + first : low + end, agent] = whole[column, first:end] * scales[column]
                # Phases come behind the track.
                for begin, stop in self.stretches().get(agent, []):
                    first, end = max(begin, low) - low, min(stop, high) - low
                    if first < end:
                        reader.phases(tuple(whole[:3].tolist()), first, end)
        return (*out, here)

    def stretches(self) -> dict[int, list[tuple[int, int]]]:
        """Return the first step of each stretch in which an agent is steered, and the step after its last, by agent."""
        names = ("agents", "begins", "firsts", "ends", "stops")
        found: dict[int, list[tuple[int, int]]] = {}
        for agent, begin, *rest in zip(*(self.varints(f"stretch_{name}").tolist() for name in names), strict=True):
            found.setdefault(agent, []).append((begin, begin + sum(rest)))
        return found
