"""Slow, obvious twins of the steering kernels: every pair of agents is compared, and every candidate tried."""

from __future__ import annotations

import math
from collections.abc import Callable
from fractions import Fraction
from itertools import combinations

import numpy as np
import shapely
from numpy.typing import NDArray

from crowdsim.steering.rules import Rules
from tests.reference.order_reference import key_of, same_way
from tests.reference.steering_room import handed_on, in_sight, is_jammed, rank_of, turned, where_room_is, widest_behind

Lines = NDArray[np.float64]


def core_ends(place: NDArray[np.float64], heading: NDArray[np.float64], half: float) -> NDArray[np.float64]:
    """Return both ends of a body's core segment, (2, 2), which lies across ``heading``, a unit vector."""
    across = np.array([-heading[1], heading[0]])
    return np.array([place - half * across, place + half * across])


def point_to_segment(point: NDArray[np.float64], ends: NDArray[np.float64]) -> float:
    """Return the distance of a point from a segment (2, 2) [m]."""
    # In plain floats, as all below: numpy takes twenty times longer for two numbers, and tests ask a million times.
    return _to_segment(point.tolist(), *ends.tolist())


def _to_segment(point: list[float], a: list[float], b: list[float]) -> float:
    """Return the distance of a point from the segment from ``a`` to ``b`` [m]."""
    ux, uy = b[0] - a[0], b[1] - a[1]
    px, py = point[0] - a[0], point[1] - a[1]
    square = ux * ux + uy * uy
    s = 0.0 if square == 0.0 else min(max((px * ux + py * uy) / square, 0.0), 1.0)
    return math.hypot(px - s * ux, py - s * uy)


def _side(a: list[float], b: list[float], point: list[float]) -> float:
    """Return on which side of the line from ``a`` to ``b`` a point is: positive on the left."""
    return (b[0] - a[0]) * (point[1] - a[1]) - (b[1] - a[1]) * (point[0] - a[0])


def segment_to_segment(first: NDArray[np.float64], second: NDArray[np.float64]) -> float:
    """Return the distance of two segments (2, 2): 0 if they cross, else that from one of the four ends [m]."""
    (a, b), (c, d) = first.tolist(), second.tolist()
    if _side(a, b, c) * _side(a, b, d) < 0.0 and _side(c, d, a) * _side(c, d, b) < 0.0:
        return 0.0
    return min(_to_segment(a, c, d), _to_segment(b, c, d), _to_segment(c, a, b), _to_segment(d, a, b))


def gap(state: NDArray[np.void], i: int, j: int) -> float:
    """Return the gap between the bodies of two agents [m]."""
    ends = [
        core_ends(np.array([row["x"], row["y"]]), np.array([row["hx"], row["hy"]]), row["half"])
        for row in (state[i], state[j])
    ]
    return segment_to_segment(*ends) - state[i]["radius"] - state[j]["radius"]


def nearest_agents(state: NDArray[np.void], me: int, reach: float, most: int) -> list[int]:
    """Return the agents that an agent heeds, the most important first."""
    mine = state[me]
    weights = []
    for other, row in enumerate(state):
        px, py = row["x"] - mine["x"], row["y"] - mine["y"]
        distance = math.sqrt(px * px + py * py)
        if other != me and px * px + py * py <= reach * reach:
            weights.append((1.25 * distance - 0.5 * (px * mine["gx"] + py * mine["gy"]), other))
    return [other for _, other in sorted(weights)[:most]]


def nearest_feasible(wanted: NDArray[np.float64], lines: Lines) -> NDArray[np.float64]:
    """Return the move nearest to ``wanted`` that crosses no line.

    Candidates are ``wanted`` itself, its feet on all lines, and all crossings of lines. Computed with fractions, which
    do not round: between two nearly opposite lines, crossing one by 1e-9 m would allow moves that are 1 m too long.
    """
    wx, wy = (Fraction(float(each)) for each in wanted)
    exact = [tuple(Fraction(float(each)) for each in line[:3]) for line in lines]
    candidates = [(wx, wy)]
    for nx, ny, room in exact:
        excess = (nx * wx + ny * wy - room) / (nx * nx + ny * ny)
        candidates.append((wx - excess * nx, wy - excess * ny))
    for (ax, ay, a), (bx, by, b) in combinations(exact, 2):
        determinant = ax * by - ay * bx
        if determinant != 0:
            candidates.append(((a * by - b * ay) / determinant, (ax * b - bx * a) / determinant))
    feasible = [(x, y) for x, y in candidates if all(nx * x + ny * y <= room for nx, ny, room in exact)]
    nearest = min(feasible, key=lambda each: (each[0] - wx) ** 2 + (each[1] - wy) ** 2)
    return np.array(nearest, float)


def free_way(
    state: NDArray[np.void], me: int, direction: NDArray[np.float64], width: float, horizon: float, tick: float = 1e-3
) -> float:
    """Return the distance until an agent meets another that keeps its velocity, in small steps of time [m]."""
    mine = state[me]
    velocity = mine["speed"] * direction
    times = np.arange(0.0, horizon / mine["speed"], tick)
    met = np.zeros(len(times), bool)
    for other, row in enumerate(state):
        relative = velocity - np.array([row["vx"], row["vy"]])
        apart = np.array([row["x"] - mine["x"], row["y"] - mine["y"]])
        if other == me or apart @ relative <= 0.0:
            continue
        across = abs(row["hx"] * relative[0] + row["hy"] * relative[1]) / np.hypot(*relative)
        distance = np.hypot(*(apart[:, None] - times * relative[:, None]))
        met |= distance < width + row["radius"] + row["half"] * across
    return float(mine["speed"] * times[met][0]) if met.any() else horizon


def wall_distance(segments: NDArray[np.float64], x: float, y: float) -> float:
    """Return the distance from a place to the nearest segment [m]."""
    return min((point_to_segment(np.array([x, y]), each.reshape(2, 2)) for each in segments), default=math.inf)


def turn_between(
    segments: NDArray[np.float64], place: NDArray[np.float64], heading: float, half: float, keep: float, turn: float
) -> float:
    """Return how far a core turns about its center before it is nearer than ``keep`` to a segment, in small steps."""
    steps = 4000
    angles = heading + turn * np.arange(steps + 1) / steps
    ends = half * np.column_stack((-np.sin(angles), np.cos(angles)))
    cores = shapely.linestrings(np.stack((place - ends, place + ends), axis=1))
    walls = shapely.multilinestrings(shapely.linestrings(segments.reshape(-1, 2, 2)))
    too_near = shapely.distance(cores, walls) < keep
    return turn * max(int(np.argmax(too_near)) - 1, 0) / steps if too_near.any() else turn


def smallest_gaps(
    before: NDArray[np.void],
    after: NDArray[np.void],
    leg_walls: NDArray[np.float64],
    torso_walls: NDArray[np.float64],
    leg_radius: float,
    times: int = 5,
) -> tuple[float, float, float]:
    """Return the smallest gaps in a step between bodies, between legs and their walls, and torsos and theirs [m].

    Places and headings are interpolated between two states, as in playback.
    """
    turned = (after["heading"] - before["heading"] + math.pi) % (2.0 * math.pi) - math.pi
    people, legs, torsos = math.inf, math.inf, math.inf
    for share in np.linspace(0.0, 1.0, times + 1)[1:]:
        state = after.copy()
        for name in ("x", "y", "half"):
            state[name] = before[name] + share * (after[name] - before[name])
        state["heading"] = before["heading"] + share * turned
        state["hx"], state["hy"] = np.cos(state["heading"]), np.sin(state["heading"])
        places = np.column_stack((state["x"], state["y"]))
        for i in range(len(state)):
            near = np.flatnonzero(np.hypot(*(places[i + 1 :] - places[i]).T) < 1.2) + i + 1
            people = min([people, *(gap(state, i, j) for j in near)])
            ends = core_ends(places[i], np.array([state["hx"][i], state["hy"][i]]), state["half"][i])
            for wall in torso_walls:
                torsos = min(torsos, segment_to_segment(ends, wall.reshape(2, 2)) - state["radius"][i])
            legs = min(legs, wall_distance(leg_walls, *places[i]) - leg_radius)
    return people, legs, torsos


class Decision:
    """The velocity that an agent decides on, rule by rule, see docs/steering.md.

    Parameters
    ----------
    state : array of agents
        All agents.
    me : int
        Row of the agent.
    heeded : list of int
        Rows that it heeds.
    rules : Rules
        Parameters of the rules.
    walls : (n, 4) float64 or None
        Wall segments.
    free_ahead : callable or None
        Distance from (x, y) along (ux, uy) over which walls are at least a width away, up to a limit.
    """

    def __init__(
        self,
        state: NDArray[np.void],
        me: int,
        heeded: list[int],
        rules: Rules,
        walls: NDArray[np.float64] | None = None,
        free_ahead: Callable[..., float] | None = None,
    ) -> None:
        self.state, self.mine, self.rules, self.me = state, state[me], rules, me
        self.heeded, self.free_ahead = heeded, free_ahead
        self.walls = np.empty((0, 4)) if walls is None else walls
        self.way = np.array([self.mine["gx"], self.mine["gy"]])
        self.goes = bool(self.way.any())
        self.key = self.mine["togo"] + rules.identity * self.mine["share"]
        self.turn = 0.0
        # Direction across which it turns its narrow side while another agent merges; None if none does.
        self.across: NDArray[np.float64] | None = None
        self.opposed = self.hear() if self.goes else 0.0
        self.rank = max([rank_of(self.mine, self.walls), *(self.pressing() if self.goes else [])])
        # Rules in the order of priority: give way to higher ranks, let others merge, else follow the own way.
        velocity = self.give_way()
        if velocity is None and self.goes:
            velocity = self.let_merge()
        if velocity is None:
            velocity = self.follow() if self.goes else np.zeros(2)
        self.wanted = velocity
        # Relax toward the wanted velocity within the largest acceleration.
        now = np.array([self.mine["vx"], self.mine["vy"]])
        change = (velocity - now) * rules.step / rules.relaxation
        size = np.hypot(*change)
        self.velocity = now + change * min(1.0, rules.acceleration * rules.step / size if size > 0.0 else 1.0)

    def apart(self, other: int) -> NDArray[np.float64]:
        """Return the vector from the agent to another [m]."""
        return np.array([self.state[other]["x"] - self.mine["x"], self.state[other]["y"] - self.mine["y"]])

    def intent(self, other: int) -> NDArray[np.float64]:
        """Return the direction in which another agent means to go, a unit vector or 0."""
        return np.array([self.state[other]["ix"], self.state[other]["iy"]])

    def hear(self) -> float:
        """Return how strongly the agent believes in an opposing flow ahead, in [0, 1].

        An opposing agent seen near the own way gives 1; the belief decays with time, sooner with few near, and is
        passed on by agents ahead that go the same way.
        """
        rules = self.rules
        fading = rules.fading if len(self.heeded) >= rules.company else rules.fading_alone
        news = [0.0, self.mine["opposed"] - fading * rules.step]
        for other in self.heeded:
            row, apart = self.state[other], self.apart(other)
            along = self.intent(other) @ self.way
            if apart @ self.way <= 0.0 or not in_sight(self.walls, self.mine, row):
                continue
            if along < -0.3 and not same_way(self.mine, row):
                if -rules.opposing_right < cross(self.way, apart) < rules.opposing_left:
                    return 1.0
            elif along > 0.3:
                news.append(rules.news * row["opposed"] - 0.02)
        return max(news)

    def pressing(self) -> list[float]:
        """Return the lasting ranks that agents of the same way hand on, which press on behind this one."""
        ranks = []
        for other in self.heeded:
            row, apart, its_way = self.state[other], self.apart(other), self.intent(other)
            breadth = self.mine["half"] + self.mine["radius"] + row["half"] + row["radius"]
            in_front = -apart @ its_way > 0.0 and apart @ self.way <= 0.0 and abs(cross(its_way, apart)) < breadth
            along = its_way @ self.way >= 0.3 and self.mine["goal"] >= 0 and same_way(self.mine, row)
            near = np.hypot(*apart) <= self.rules.yield_reach and in_sight(self.walls, self.mine, row)
            if row["rank"] > 31.0 and along and in_front and near:
                ranks.append(handed_on(row["rank"]))
        return ranks

    def give_way(self) -> NDArray[np.float64] | None:
        """Return the velocity out of the way of the highest-ranked opposing agent; None if there is none."""
        ranks = [self.mine["rank"], self.rank] if self.goes else []
        highest, first = max([*ranks, self.rules.yield_after]), None
        for other in self.heeded:
            row, apart = self.state[other], self.apart(other)
            opposing = not self.goes or self.intent(other) @ self.way <= -0.3
            breadth = self.mine["half"] + self.mine["radius"] + row["half"] + row["radius"]
            in_its_way = -apart @ self.intent(other) > 0.0 and abs(cross(self.intent(other), apart)) < breadth
            near = np.hypot(*apart) <= self.rules.yield_reach and in_sight(self.walls, self.mine, row)
            queues = self.mine["goal"] >= 0 and same_way(self.mine, row)
            if row["rank"] > highest and not queues and opposing and in_its_way and near:
                highest, first = row["rank"], other
        if first is None:
            return None
        inherited = handed_on(highest) if self.mine["goal"] >= 0 else 0.9 * highest
        its_way, self.rank = self.intent(first), max(self.rank, inherited)
        # Step to the other's left (the own right), unless already clearly on its right.
        left_of_it = -cross(its_way, self.apart(first))
        aside = turned(its_way, math.pi / 2 if left_of_it > -0.25 else -math.pi / 2)
        velocity = self.rules.yield_aside * aside + self.rules.yield_along * its_way
        return where_room_is(self.mine, self.free_ahead, velocity, its_way)

    def let_merge(self) -> NDArray[np.float64] | None:
        """Return the velocity away from stuck agents with priority that want to merge; None if there is none."""
        away, lowest = np.zeros(2), self.key
        for other in self.heeded:
            row, apart = self.state[other], self.apart(other)
            distance = np.hypot(*apart)
            key = key_of(self.mine, row)
            first = key is not None and key < self.key
            behind = apart @ self.intent(other) > self.rules.merge_behind * distance
            waits = row["stuck"] > self.rules.merge_after and distance <= 1.0
            if first and waits and not behind and gap(self.state, self.me, other) < self.rules.merge_gap:
                away -= apart / distance
                if key < lowest:
                    lowest = key
                    self.across = self.intent(other) if self.intent(other).any() else self.way
        size = np.hypot(*away)
        return None if size == 0.0 else self.rules.merge_speed * away / size

    def in_file(self) -> bool:
        """Return whether the agent walks in single file: in a narrow passage, close behind another going its way."""
        rules, mine = self.rules, self.mine
        place = np.array([mine["x"], mine["y"]])
        narrow = widest_behind(self.walls, place, self.way, rules.lane) < rules.abreast - 0.05
        if not narrow or self.opposed > 0.0 or mine["stuck"] > rules.file_patience:
            return False
        for other in self.heeded:
            row, apart = self.state[other], self.apart(other)
            both = mine["half"] + mine["radius"] + row["half"] + row["radius"]
            between = (self.way + self.intent(other)) / np.hypot(*(self.way + self.intent(other)))
            ahead = apart @ self.way > 0.0 and abs(cross(between, apart)) < rules.file_aside * both
            own_way = self.intent(other) @ self.way > 0.3
            if ahead and own_way and gap(self.state, self.me, other) < rules.file_gap:
                return True
        return False

    def follow(self) -> NDArray[np.float64]:
        """Return the velocity of following the guidance: keep right in opposing flow, then choose a free direction."""
        rules, mine = self.rules, self.mine
        to_the_right = wall_distance(self.walls, mine["x"] + 0.5 * self.way[1], mine["y"] - 0.5 * self.way[0])
        room = min(max((to_the_right - rules.edge) / 0.3, 0.0), 1.0) * min(mine["togo"] / rules.direct, 1.0)
        angle = rules.keep_right * self.opposed * room
        blocked = any(
            np.hypot(*self.apart(other)) < 1.0
            and self.apart(other) @ self.way > 0.0
            and cross(self.way, self.apart(other)) < 0.25
            for other in self.heeded
        )
        if self.opposed > 0.0 and mine["stuck"] > 0.0 and blocked:
            angle += rules.sidle * min(1.0, mine["stuck"]) * room
        # Walk frontally if that is free enough; else also try to turn the shoulders, slow agents farther.
        ahead = turned(self.way, -angle)
        best = self.best_direction(ahead, [0.0])
        if best[2] <= rules.tight and not self.in_file():
            slow = np.hypot(mine["vx"], mine["vy"]) < rules.sideways_below
            turns = [40.0, 60.0, 75.0] if slow else [40.0, 60.0]
            best = min(best, self.best_direction(ahead, turns), key=lambda each: each[0])
        _, direction, _, self.turn = best
        speed = self.turning(self.speed(direction), direction)
        # Wedged beside a wall: sideways, and now and then a step back if nobody is near.
        near_wall = wall_distance(self.walls, mine["x"], mine["y"]) < mine["half"] + mine["radius"]
        if self.opposed <= 0.0 and mine["stuck"] > 5.0 and near_wall:
            if mine["turn"] < 0.0:
                self.turn = 0.5 * math.pi
                speed = self.turning(self.speed(direction), direction)
            alone = all(gap(self.state, self.me, other) >= 0.3 for other in self.heeded)
            if mine["stuck"] >= 10.0 and mine["stuck"] % 5.0 < 1.0 and alone:
                speed = -0.3
        # Jammed: a step back now and then.
        back = 20.0 <= mine["stuck"] < 22.0 and self.opposed > 0.0 and is_jammed(mine, self.walls)
        return -0.3 * self.way if back else speed * direction

    def turning(self, speed: float, direction: NDArray[np.float64]) -> float:
        """Return the speed while it turns, see :func:`speed_in_turn`."""
        mine, heading = self.mine, np.array([self.mine["hx"], self.mine["hy"]])
        if mine["turn"] >= 0.0:
            return speed
        return speed_in_turn(speed, mine["speed"], self.rules.backward, float(heading @ direction))

    def best_direction(self, ahead: NDArray[np.float64], turns: list[float]) -> tuple[float, NDArray, float, float]:
        """Return (score, direction, free distance, turn) of the best candidate direction around ``ahead``.

        The score is the squared distance from the end of the free way to the point one horizon ahead (law of cosines),
        plus costs of turning, of changing direction, and of the left side. The first candidate is taken at once if it
        is free.
        """
        rules, mine, horizon = self.rules, self.mine, self.rules.horizon
        velocity = np.array([mine["vx"], mine["vy"]])
        pace = np.hypot(*velocity)
        tried = []
        for turn in np.radians(turns):
            for offset in np.radians([0, -10, 10, -20, 20, -35, 35, -50, 50, -70, 70, -90, 90]):
                direction = turned(ahead, offset)
                width = mine["half"] * math.cos(turn) + mine["radius"]
                others = self.state[[self.me, *self.heeded]]
                way = free_way(others, 0, direction, width, horizon, tick=2e-3)
                way = min(way, self.free_of_walls(direction, width))
                score = horizon**2 + way**2 - 2.0 * horizon * way * math.cos(offset)
                score += rules.turn_cost * horizon * (1.0 - math.cos(turn))
                if pace > 0.1:
                    score += rules.inertia * horizon * (1.0 - direction @ velocity / pace)
                if offset > 0.0:
                    score += rules.left_bias * horizon
                if offset == 0.0 and way >= horizon:
                    return (score, direction, way, turn)
                tried.append((score, direction, way, turn))
        return min(tried, key=lambda each: each[0])

    def free_of_walls(self, direction: NDArray[np.float64], width: float) -> float:
        """Return the distance along a direction that is free of walls [m]; infinite beyond the horizon."""
        if self.free_ahead is None:
            return math.inf
        farthest = self.rules.wall_horizon
        way = self.free_ahead(self.mine["x"], self.mine["y"], *direction, width, farthest)
        return way if way < farthest else math.inf

    def speed(self, direction: NDArray[np.float64]) -> float:
        """Return the speed: lower with turned shoulders and behind others, but at least creeping if stuck."""
        rules, mine = self.rules, self.mine
        slowdown = rules.turned_slowdown if mine["turn"] < 0.0 else rules.sideways_slowdown
        speed = mine["speed"] * (1.0 - slowdown * (1.0 - math.cos(self.turn)))
        in_file = self.in_file()
        before, headway = (1.0, rules.file_headway) if in_file else (rules.swath_before, rules.headway)
        led = False
        for other in self.heeded:
            row, apart = self.state[other], self.apart(other)
            key = key_of(mine, row)
            same = key is not None
            goes_first = same and key < mine["key"]
            share = (before if in_file or goes_first else rules.swath_behind) if same else rules.swath
            both = mine["half"] * math.cos(self.turn) + mine["radius"] + row["radius"]
            both += row["half"] * abs(row["hx"] * direction[0] + row["hy"] * direction[1])
            aside = abs(cross(direction, apart))
            if apart @ direction <= 0.0 or aside >= share * both:
                continue
            # Time headway: the gap beyond the standoff in ``headway`` seconds, plus a share of the leader's speed.
            free = gap(self.state, self.me, other)
            allowed = max(0.0, free - rules.standoff + rules.offset_gain * (aside / both) ** 2) / headway
            leading = max(0.0, row["vx"] * direction[0] + row["vy"] * direction[1])
            speed = min(speed, allowed + rules.leader * leading * min(1.0, max(free, 0.0) / rules.leader_gap))
            led |= free < 0.4 and self.intent(other) @ self.way > 0.3 and (not same or goes_first)
        creep = rules.creep * np.clip((mine["stuck"] - 0.3) / 2.0, 0.0, 1.0)
        if not led:
            creep = max(creep, rules.creep_first * np.clip(mine["stuck"] - 0.2, 0.0, 1.0))
        return max(speed, min(creep, mine["speed"]))


def speed_in_turn(speed: float, free: float, backward: float, cosine: float) -> float:
    """Return the speed while it turns: from 100 degrees off its heading on less than free, backward from 120 on.

    ``cosine`` is that of the angle between heading and way.
    """
    if cosine >= -0.17 or free <= 0.0:
        return speed
    return min(speed, float(np.interp(cosine, [-0.5, -0.17], [backward, free])))


def cross(a: NDArray[np.float64], b: NDArray[np.float64]) -> float:
    """Return the z component of the cross product."""
    return float(a[0] * b[1] - a[1] * b[0])
