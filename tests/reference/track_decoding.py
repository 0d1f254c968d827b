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
        # Chance of 1 and decisions so far of each model that is mixed, and weights by what chooses them.
        self._mixed: dict[object, list[int]] = defaultdict(lambda: [2**15, 0])
        self._weights: dict[object, list[int]] = defaultdict(lambda: [round(1.4 / 3 * 2**16)] * 3)

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

    def mixed_bit(self, contexts: Sequence[object], row: object) -> int:
        """Return the outcome of a decision that three models expect together; they and their weights learn of it."""
        models, weights = [self._mixed[context] for context in contexts], self._weights[row]
        logits = [LOGITS[chance >> 4] for chance, _ in models]
        logit = sum(weight * each for weight, each in zip(weights, logits, strict=True)) >> 16
        chance = squashed(min(max(logit, -2047), 2047))
        bound = self._range // 2**12 * (4096 - chance)
        bit = int(self._code >= bound)
        self._code -= bit * bound
        self._range = self._range - bound if bit else bound
        self._widen()
        off = 24 * (4096 * bit - chance)
        self._weights[row] = [
            min(max(weight + ((each * off + 2**15) >> 16), 1 - 2**18), 2**18 - 1)
            for weight, each in zip(weights, logits, strict=True)
        ]
        for model in models:
            model[0] += ((65535 * bit - model[0]) * round(32768 / (model[1] + 1.5))) >> 15
            model[1] = min(model[1] + 1, 127)
        return bit

    def mixed(self, kind: str, contexts: Sequence[object], row: object, bits: int) -> int:
        """Return a number near 0, or any after an escape, by three contexts of a kind and what chooses the weights."""
        leaf = 0
        for depth in range(bits):
            at = depth, leaf
            decided = self.mixed_bit([(kind, k, each, at) for k, each in enumerate(contexts)], (kind, row, at))
            leaf = 2 * leaf + decided
        return leaf - 2 ** (bits - 1) if leaf else self.whole()


POINTS = (1, 2, 3, 6, 10, 16, 27, 45, 73, 120, 194, 310, 488, 747, 1101, 1546, 2047, 2549, 2994, 3348, 3607, 3785)
POINTS = (*POINTS, 3901, 3975, 4022, 4050, 4068, 4079, 4085, 4089, 4092, 4093, 4094)


def squashed(logit: int) -> int:
    """Return the chance, of 4096, of a logit in units of 1 / 256: straight lines between points."""
    index, share = divmod(logit + 2048, 128)
    return (POINTS[index] * (128 - share) + POINTS[index + 1] * share + 64) // 128


LOGITS = [next((k for k in range(-2047, 2048) if squashed(k) >= chance), 2047) for chance in range(4096)]
"""The least logit that gives each chance."""


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


def coarse_class(value: int) -> int:
    """Return the coarse class of a difference, with its sign."""
    kind = next((kind for kind, most in enumerate((0, 2, 5, 11)) if abs(value) <= most), 4)
    return kind if value > 0 else -kind


def cadence(speed: float, angle: float, turning: float) -> tuple[float, int]:
    """Return the cadence that is expected [cycles/s], and what gives it; the series of the cosine is that of pages."""
    off = abs(angle)
    hip = 0.0 if off >= 1.4 else min(off, 1.4 - off)
    follows = min(speed / 0.4, 1.0)
    rest = off - hip * follows * follows
    s = rest * rest
    c = 1.0 - s * (0.5 - s * (1.0 / 24.0 - s * (1.0 / 720.0 - s * (1.0 / 40320.0 - s / 3628800.0))))
    c = min(max(c, -1.0), 1.0)
    along, across = speed * abs(c), speed * math.sqrt(1.0 - c * c)
    ahead = max(math.sqrt(0.39 * along) / 0.78 * (1.35 if c < 0.0 else 1.0), speed / 1.6)
    aside = min(0.5 * min(1.0, across / 0.1) + 1.1 * across, 1.7)
    on_spot = min(0.35 * min(1.0, abs(turning) / 0.2) + 0.4 * abs(turning), 1.5)
    rates = ahead, aside, on_spot
    return max(rates), rates.index(max(rates))


class NodeRows:
    """Tracks of nodes, in integers of which 10,000 are a meter or a radian; ``ticks`` are a frame."""

    def __init__(self, frames: Sequence[int], rows: np.ndarray, ticks: int) -> None:
        self.frames, self.rows, self.ticks = list(frames), rows, ticks
        self.first = np.cumsum([0, *(count + 1 for count in self.frames)])

    def at(self, node: int, tick: int) -> tuple[np.ndarray, float]:
        """Return x, y [m] and heading [rad] in a frame of a node, and how much of a offset is left."""
        count = self.frames[node]
        rows = self.rows[self.first[node] : self.first[node] + count + 1] / 10_000.0
        left = [1.0 - 3.0 * (k / 12) ** 2 + 2.0 * (k / 12) ** 3 if k < 12 else 0.0 for k in range(count + 2)]
        frame = min(tick / self.ticks, count)
        track = np.array([np.interp(frame, np.arange(count + 1), column) for column in rows.T])
        return track, float(np.interp(frame, np.arange(count + 2), left))


class TrackReader:
    """Reads what ``code_chunk`` has written, agent by agent, in lists of integers."""

    def __init__(self, data: bytes, units: Sequence[int], nodes: NodeRows) -> None:
        self.reader, self.nodes = RangeReader(data), nodes
        places, turns = map(int, units[:6]), map(int, units[6:])
        self.place, self.turn, self.rate, self.cycle, self.most, self.natural = places
        self.phase_step, self.turn_step, self.played_turn_step = turns

    def _wrapped(self, value: int) -> int:
        return (value + self.turn // 2) % self.turn - self.turn // 2

    def _radians(self, value: int) -> float:
        return self._wrapped(value) * (2.0 * math.pi) / self.turn

    def _speed_and_ahead(self, dx: int, dy: int) -> tuple[float, int]:
        speed = math.sqrt(float(dx * dx + dy * dy)) * self.rate / self.place
        ahead = direction(float(dx), float(dy)) * self.turn / (2.0 * math.pi)
        return speed, math.floor(ahead + 0.5)

    def track(self, node: Sequence[int]) -> tuple[list[int], list[int], list[int], list[int]]:
        """Return x, y, headings and frames of a run of steps; ``node``: what is played in each, -1 for none."""
        track: list[tuple[int, int, int, int]] = []
        for played, first, end in runs([each >= 0 for each in node]):
            if played:
                frames = self._frames(node[first:end])
                track += self._played(track, list(node[first:end]), frames)
            else:
                x, y = self._places([each[0] for each in track], [each[1] for each in track], end)
                headings = self._headings([each[2] for each in track], x, y)
                track += zip(x[first:], y[first:], headings[first:], [0] * (end - first), strict=True)
        x, y, headings, frames = (list(column) for column in zip(*track, strict=True))
        return x, y, headings, frames

    def _places(self, x: list[int], y: list[int], end: int) -> tuple[list[int], list[int]]:
        """Return x and y, which are known so far, up to step ``end``."""
        read = self.reader
        (ax, ay), (bx, by), before = (0, 0), (0, 0), 0
        for t in range(len(x), end):
            if t < 2:
                x.append(read.whole(("first x", t)) + (x[-1] if t else 0))
                y.append(read.whole(("first y", t)) + (y[-1] if t else 0))
                continue
            size = abs(ax) + abs(ay)
            lately = size_class((2 * size + before) // 3)
            some = min(lately // 3, 2)
            before = size
            speed, ahead = self._speed_and_ahead(x[-1] - x[-2], y[-1] - y[-2])
            way = min(int(10.0 * speed), 15), 16 * ahead // self.turn % 16
            recent = tuple(map(coarse_class, (ax, ay, bx, by)))
            now = read.mixed("x", ((lately, signed_class(ax)), recent, (way, some)), lately, 6)
            kind, up = signed_class(ay)
            contexts = (
                (min(abs(now), 29), kind // 2, up, some),
                (signed_class(now), coarse_class(ay), coarse_class(ax)),
                (way, signed_class(now)),
            )
            (bx, by), ax = (ax, ay), now
            ay = read.mixed("y", contexts, size_class(abs(ax)), 6)
            x.append(ax + 2 * x[-1] - x[-2])
            y.append(ay + 2 * y[-1] - y[-2])
        return x, y

    def _frames(self, node: Sequence[int]) -> list[int]:
        """Return frames of captured steps; a node that another one follows was played to its end."""
        read, last = self.reader, 0
        frames = [read.whole("first frame")]
        for old, new in pairwise(node):
            if new != old:
                last += read.number("change", 8)
                frames.append(frames[-1] + self.natural + last - self.nodes.ticks * int(self.nodes.frames[old]))
            else:
                last += read.number(("frame", signed_class(last)), 6)
                frames.append(frames[-1] + self.natural + last)
        return frames

    def _played(
        self, before: Sequence[tuple[int, int, int, int]], node: Sequence[int], frames: Sequence[int]
    ) -> list[tuple[int, int, int, int]]:
        """Return the track (x, y, heading, frame) of captured steps that come after the steps ``before``.

        A node's track goes on from an origin. What that is off from the end of the node before fades.
        """
        read, nodes, track, off = self.reader, self.nodes, [], False
        to_world = np.array([self.place, self.place, self.turn / (2.0 * math.pi)])
        origin = offset = np.zeros(3)
        for t, (now, frame) in enumerate(zip(node, frames, strict=True)):
            if t == 0 and not before:
                shown = np.array([read.whole((f"first {each}", 0)) for each in ("x", "y", "turn")], float)
            elif t == 0:
                shown = np.array(before[-1][:3], float)
                if len(before) > 1:
                    shown[:2] += np.subtract(before[-1][:2], before[-2][:2])
            else:
                if now != node[t - 1] or frame < frames[t - 1]:
                    whole, left = nodes.at(node[t - 1], nodes.ticks * int(nodes.frames[node[t - 1]]))
                    ended = self._moved(origin, whole * to_world) + left * offset
                    along, across, turn = (read.number(("offset", k), 8) for k in range(3))
                    origin = self._moved(ended, np.array([0.5 * along, 0.5 * across, turn * self.played_turn_step]))
                    offset = ended - origin
                own, left = nodes.at(now, frame)
                shown = self._moved(origin, own * to_world) + left * offset
            if t or before:
                off = bool(read.bit(("off", frame < 12 * nodes.ticks, off)))
                if off:
                    by = np.array([read.number(("off", k), 7) for k in range(3)]) * (1, 1, self.played_turn_step)
                    shown, origin = shown + by, origin + by
            if t == 0:
                own = nodes.at(now, frame)[0] * to_world
                heading = shown[2] - own[2]
                away = self._moved(np.array([0.0, 0.0, heading]), own)
                origin = np.array([*(shown - away)[:2], heading])
            x, y, h = np.floor(shown + 0.5).astype(int).tolist()
            track.append((x, y, h, frame))
        return track

    def _moved(self, origin: np.ndarray, way: np.ndarray) -> np.ndarray:
        """Return a pose in units of a page, seen from an origin, as it is in the world."""
        angle = 2.0 * math.pi / self.turn * origin[2]
        c, s = math.cos(angle), math.sin(angle)
        return origin + (c * way[0] - s * way[1], s * way[0] + c * way[1], way[2])

    def _turn_class(self, turn: int) -> int:
        return min(max(10 * turn // self.most, -10), 10)

    def _headings(self, headings: list[int], x: list[int], y: list[int]) -> list[int]:
        """Return headings, which are known so far, of all steps of x and y."""
        read, last, before, ways = self.reader, 0, 0, (0, 0, 0)
        for t in range(len(headings), len(x)):
            if t < 2:
                headings.append(read.whole(("first turn", t)) + (headings[-1] if t else 0))
                continue
            speed, ahead = self._speed_and_ahead(x[t - 1] - x[t - 2], y[t - 1] - y[t - 2])
            pace = min(int(16.0 * speed), 23)
            coming = min(int(16.0 * self._speed_and_ahead(x[t] - x[t - 1], y[t] - y[t - 1])[0]), 23)
            wanted = self._wrapped(ahead - headings[-1])
            expected = min(max(wanted, -self.most), self.most)
            wish, turned = min(max(8 * wanted // self.most, -24), 24), self._turn_class(last)
            contexts: Sequence[object] = ((pace, wish), (turned, wish), (coming, pace))
            way = read.mixed_bit([("way", k, ways, each) for k, each in enumerate(contexts)], ("way", ways))
            before_last, before = before, last
            if way:
                contexts = ((turned, wanted > 0), (wish, pace // 3), (turned, self._turn_class(before_last)))
                last = self.turn_step * read.mixed("turn", contexts, None, 7)
            elif abs(wanted) < self.most:
                contexts = (pace, (coming, self._turn_class(expected)), (ways, coming))
                last = expected + self.turn_step * read.mixed("near", contexts, None, 6)
            else:
                last = expected
            ways = (*ways[1:], way)
            headings.append(headings[-1] + last)
        return headings

    def phases(self, track: tuple[list[int], list[int], list[int]], first: int, end: int) -> list[int]:
        """Return the phases of steps ``first`` to before ``end`` of a track of all steps of a chunk."""
        read, (x, y, headings) = self.reader, track
        phases, off, foot = [read.whole("first phase")], 0, tuple(column[first] for column in track)
        for t in range(first + 1, end):
            dx, dy = x[t] - foot[0], y[t] - foot[1]
            away = math.sqrt(float(dx * dx + dy * dy)) / self.place
            after, kind, speed = self._expected_phase(phases[-1], track, t, away, foot[2])
            if read.bit(("follows", kind, off == 0)):
                phases.append(phases[-1] if read.bit(("stays", kind)) else self._next_stand(phases[-1]))
                off = 0
            else:
                pace, turn = min(int(16.0 * speed), 23), abs(self._wrapped(headings[t] - headings[t - 1]))
                old = signed_class(off)
                contexts = (
                    (kind, pace, old),
                    (kind, self._turn_class(turn), old),
                    (kind, min(int(50 * away), 15), pace),
                )
                off = read.mixed("phase", contexts, kind, 6)
                phases.append(after + self.phase_step * off)
            over = 0.26 * self.cycle
            if math.floor((2 * phases[-2] - 2 * over) / self.cycle) < math.floor(
                (2 * phases[-1] - 2 * over) / self.cycle
            ):
                foot = x[t], y[t], headings[t]
        return phases

    def _next_stand(self, phase: int) -> int:
        """Return the first phase of a stand, 0.06 cycles after a foot lands, from ``phase`` on."""
        half, stand = self.cycle // 2, round(0.06 * self.cycle)
        return phase + (stand - phase) % half

    def _expected_phase(
        self, phase: int, track: tuple[list[int], list[int], list[int]], t: int, away: float, left: int
    ) -> tuple[int, int, float]:
        """Return the phase after step ``t``, the rule that gives it, and the speed."""
        x, y, headings = track
        speed, ahead = self._speed_and_ahead(x[t] - x[t - 1], y[t] - y[t - 1])
        half = self.cycle // 2
        begin, passed = phase - phase % half, phase % half / self.cycle
        stand = begin + round(0.06 * self.cycle)
        if speed < 0.35 and passed <= 0.1 and away < 0.06 and abs(self._radians(headings[t] - left)) < 0.25:
            return max(phase, min(stand, phase + math.floor(0.75 / self.rate * self.cycle + 0.5))), 3, speed
        turning = self._radians(headings[t] - headings[t - 1]) * self.rate
        rate, kind = cadence(speed, self._radians(ahead - headings[t]), turning)
        if rate < 0.45:
            rate, kind = (0.6 if speed > 0.1 else 0.75), 4
        elif passed < 0.26 and away * rate < 0.5 * (passed + 0.5 - 0.26) * speed:
            rate, kind = max(rate, min(6.0 * speed, 1.5)), 5
        after = phase + math.floor(rate / self.rate * self.cycle + 0.5)
        if after > stand + half and rate <= 0.75 and speed <= 0.1:
            return stand + half, 6, speed
        return after, kind, speed


def runs(values: Sequence[int]) -> list[tuple[int, int, int]]:
    """Return value, first index and the index after the last of each run of equal values."""
    edges = np.flatnonzero(np.diff(np.asarray(values))) + 1
    bounds = [0, *edges.tolist(), len(values)]
    return [(int(values[a]), a, b) for a, b in pairwise(bounds) if b > a]
