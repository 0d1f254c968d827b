"""A slow twin of the coding of tracks: reads a chunk of a page with Python's own integers, decision by decision."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Sequence
from itertools import pairwise

import numpy as np


class RangeReader:
    """Reads decisions, each in a model of its own: any key will do."""

    def __init__(self, data: bytes) -> None:
        self._data = iter(data)
        self._range = 2**32 - 1
        self._code = 0
        for _ in range(5):
            self._code = (self._code * 256 + next(self._data)) % 2**32
        self._models: dict[object, list[int]] = defaultdict(lambda: [2**15, 2**15])

    def _widen(self) -> None:
        while self._range < 2**24:
            self._range *= 256
            self._code = self._code * 256 + next(self._data, 0)

    def bit(self, model: object) -> int:
        """Return the outcome of a decision; its model learns of it."""
        fast, slow = self._models[model]
        bound = self._range // 2**16 * ((fast + slow) // 2)
        if self._code < bound:
            self._range = bound
            self._models[model] = [fast + (2**16 - fast) // 16, slow + (2**16 - slow) // 128]
            bit = 0
        else:
            self._code -= bound
            self._range -= bound
            self._models[model] = [fast - fast // 16, slow - slow // 128]
            bit = 1
        self._widen()
        return bit

    def plain(self, bits: int) -> int:
        """Return a number whose bits are as likely 0 as 1."""
        value = 0
        for _ in range(bits):
            self._range //= 2
            value *= 2
            if self._code >= self._range:
                self._code -= self._range
                value += 1
            self._widen()
        return value

    def whole(self, context: object = "escape") -> int:
        """Return a number of any size."""
        length, negative = divmod(self._leaf(context, 6), 2)
        size = 2 ** (length - 1) + self.plain(length - 1) if length else 0
        return -size if negative else size

    def _leaf(self, context: object, bits: int) -> int:
        leaf = 0
        for depth in range(bits):
            leaf = 2 * leaf + self.bit((context, depth, leaf))
        return leaf

    def number(self, context: object, bits: int) -> int:
        """Return a number near 0, or any after an escape."""
        leaf = self._leaf(context, bits)
        return leaf - 2 ** (bits - 1) if leaf else self.whole()


def size_class(size: int) -> int:
    """Return the class of the size of a difference."""
    return next((kind for kind, most in enumerate((0, 1, 2, 4, 7, 11, 17, 24)) if size <= most), 8)


def signed_class(value: int) -> tuple[int, bool]:
    """Return the class of a difference with its sign."""
    return size_class(abs(value)), value > 0


def direction(x: float, y: float) -> float:
    """Return the angle of a vector within 1e-5, by the polynomial that pages use: the bits of atan2 may differ."""
    if x == y == 0.0:
        return 0.0
    z = min(abs(x), abs(y)) / max(abs(x), abs(y))
    s = z * z
    angle = z * (0.999866 + s * (-0.3302995 + s * (0.180141 + s * (-0.085133 + s * 0.0208351))))
    angle = 0.5 * math.pi - angle if abs(y) > abs(x) else angle
    angle = math.pi - angle if x < 0.0 else angle
    return -angle if y < 0.0 else angle


def cadence(speed: float, angle: float, turning: float) -> float:
    """Return the cadence that is expected [cycles/s]; the series of the cosine is that of pages."""
    off = abs(angle)
    hip = 0.0 if off >= 1.4 else min(off, 1.4 - off)
    follows = min(speed / 0.4, 1.0)
    s = (off - hip * follows * follows) ** 2
    c = 1.0 - s * (0.5 - s * (1.0 / 24.0 - s * (1.0 / 720.0 - s * (1.0 / 40320.0 - s / 3628800.0))))
    c = min(max(c, -1.0), 1.0)
    along, across = speed * abs(c), speed * math.sqrt(1.0 - c * c)
    ahead = math.sqrt(0.39 * along) / 0.78 * (1.35 if c < 0.0 else 1.0)
    aside = min(0.5 * min(1.0, across / 0.1) + 1.1 * across, 1.7)
    on_spot = min(0.35 * min(1.0, abs(turning) / 0.2) + 0.4 * abs(turning), 1.5)
    rate = max(ahead, aside, on_spot, speed / 1.6)
    return rate if rate >= 0.45 else 0.6 if speed > 0.1 else 0.75


class TrackReader:
    """Reads what ``code_chunk`` has written, agent by agent, in lists of integers."""

    def __init__(self, data: bytes, units: Sequence[int]) -> None:
        self.reader = RangeReader(data)
        self.place, self.turn, self.rate, self.cycle, self.most, self.natural = map(int, units)

    def _wrapped(self, value: int) -> int:
        return (value + self.turn // 2) % self.turn - self.turn // 2

    def _speed_and_ahead(self, dx: int, dy: int) -> tuple[float, int]:
        speed = math.sqrt(float(dx * dx + dy * dy)) * self.rate / self.place
        ahead = direction(float(dx), float(dy)) * self.turn / (2.0 * math.pi)
        return speed, math.floor(ahead + 0.5)

    def track(self, steered: Sequence[int]) -> tuple[list[int], list[int], list[int]]:
        """Return x, y and headings of a run of steps, as long as ``steered``."""
        x, y = self._places(steered)
        return x, y, self._headings(steered, x, y)

    def _places(self, steered: Sequence[int]) -> tuple[list[int], list[int]]:
        read, x, y = self.reader, [], []
        last, before = (0, 0), 0
        for t, steers in enumerate(steered):
            if t < 2:
                x.append(read.whole(("first x", t)) + (x[-1] if t else 0))
                y.append(read.whole(("first y", t)) + (y[-1] if t else 0))
                continue
            size = abs(last[0]) + abs(last[1])
            lately = size_class((2 * size + before) // 3)
            before = size
            ax = read.number(("x", steers, lately, signed_class(last[0]) if steers else None), 7)
            some = min(lately // 3, 2)
            kind, up = signed_class(last[1])
            if steers:
                ay = read.number(("y", min(abs(ax), 29), kind // 2, up, some), 7)
            else:
                ay = read.number(("plain y", size_class(abs(ax)), some), 7)
            x.append(ax + 2 * x[-1] - x[-2])
            y.append(ay + 2 * y[-1] - y[-2])
            last = ax, ay
        return x, y

    def _headings(self, steered: Sequence[int], x: list[int], y: list[int]) -> list[int]:
        read, headings, close, last = self.reader, [], True, 0
        for t, steers in enumerate(steered):
            if t < 2:
                headings.append(read.whole(("first turn", t)) + (headings[-1] if t else 0))
                continue
            if not steers:
                last += read.number(("on", signed_class(last)), 8)
            else:
                speed, ahead = self._speed_and_ahead(x[t - 1] - x[t - 2], y[t - 1] - y[t - 2])
                wanted = self._wrapped(ahead - headings[-1])
                expected = min(max(wanted, -self.most), self.most)
                free = abs(wanted) < self.most
                fast = 0 if speed > 0.27 else 1 if speed > 0.23 else 2
                if read.bit(("is close", close, fast, free, not free and wanted > 0)) == 0:
                    last = expected + read.number(("near", min(int(10.0 * speed), 14), free), 6)
                    close = True
                else:
                    last = read.number(("turn", signed_class(last), wanted > 0), 8)
                    close = False
            headings.append(headings[-1] + last)
        return headings

    def frames(self, count: int) -> list[int]:
        """Return the frames of a node that is played for ``count`` steps."""
        read, last = self.reader, 0
        frames = [read.whole("first frame")]
        while len(frames) < count:
            last += read.number(("frame", signed_class(last)), 6)
            frames.append(frames[-1] + self.natural + last)
        return frames

    def phases(self, track: tuple[list[int], list[int], list[int]], first: int, end: int) -> list[int]:
        """Return the phases of steps ``first`` to before ``end`` of a track of all steps of a chunk."""
        read, (x, y, headings) = self.reader, track
        phases, off, moved = [read.whole("first phase")], 0, True
        for t in range(first + 1, end):
            speed, ahead = self._speed_and_ahead(x[t] - x[t - 1], y[t] - y[t - 1])
            angle = self._wrapped(ahead - headings[t]) * (2.0 * math.pi) / self.turn
            turning = self._wrapped(headings[t] - headings[t - 1]) * (2.0 * math.pi) / self.turn * self.rate
            expected = math.floor(cadence(speed, angle, turning) / self.rate * self.cycle + 0.5)
            past = 2 * phases[-1] % self.cycle
            context = (
                min(size_class(abs(off)), 6), off > 0, moved,
                speed < 0.35 and 10 * past <= 2 * self.cycle, 100 * past < 52 * self.cycle,
            )  # fmt: skip
            moved = not read.bit(("rests", context))
            if moved:
                off = read.number(("phase", context), 7)
                phases.append(phases[-1] + expected + off)
            else:
                phases.append(phases[-1])
        return phases


def runs(values: Sequence[int]) -> list[tuple[int, int, int]]:
    """Return value, first index and the index after the last of each run of equal values."""
    edges = np.flatnonzero(np.diff(np.asarray(values))) + 1
    bounds = [0, *edges.tolist(), len(values)]
    return [(int(values[a]), a, b) for a, b in pairwise(bounds) if b > a]
