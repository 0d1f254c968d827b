"""Decision of a steered agent: yield to opposing agents, let others merge, or walk along guidance behind the next one.

The rules extend the vision-based model of Moussaid, Helbing and Theraulaz (PNAS 108, 2011) by keeping right, by an
order of right of way and by a time gap. docs/steering.md describes them.

Arguments of all helpers: ``rows`` (ROW[n] of row_kernels) sorted agents, ``mine`` the row that decides, ``near``
(NEAR[k] of direction_kernels) its neighbors, of which the first ``count`` are valid, ``walls`` (Walls, Walls, float)
those of the legs' layer and of the torso's layers, and the radius of the legs [m], ``rules`` the constants of the model
(Rules), ``want`` (WANTED) the decision of ``mine``. (gx, gy) and (ix, iy) are the unit vectors of guidance and intent,
(0, 0) for an agent that stays; (px, py) leads from ``mine`` to a neighbor [m].
"""

import math

import numpy as np

from crowdsim.geometry.elementary_kernels import cos_sin
from crowdsim.jit import helper, kernel
from crowdsim.steering.capsule_kernels import gap_to
from crowdsim.steering.direction_kernels import NEAR, TURNS, choose_direction, face, turn_first
from crowdsim.steering.look_kernels import MOST_NEAR, take_in
from crowdsim.steering.order_kernels import key_of, same_way
from crowdsim.steering.stuck_kernels import handed_on, is_wedged, press_or_step_back, push_on, rank_of, way_aside
from crowdsim.steering.wall_kernels import distance_at, is_in_sight, is_lane, is_lane_behind

AT_PLACE = 0.9
"""Share of a rank that an agent without a goal inherits."""

WANTED = np.dtype(
    [
        ("vx", np.float64),  # velocity [m/s]
        ("vy", np.float64),
        ("turn", np.float64),  # turn of the heading in this step, counterclockwise [rad]
        ("half", np.float64),  # half length of the core after the step [m]
        ("ix", np.float64),  # intent, rank, key and opposed: as in ROW
        ("iy", np.float64),
        ("rank", np.float64),
        ("key", np.float64),
        ("opposed", np.float64),
        ("facing_x", np.float64),  # direction in which the chest faces if the shoulders are not turned; any length
        ("facing_y", np.float64),
        ("turn_cos", np.float64),  # cosine and sine of the turn of the shoulders against the facing
        ("turn_sin", np.float64),
    ],
    align=True,
)
"""What an agent wants in a step. The commit grants as much of it as touches nothing."""


@helper
def hear_opposing(rows, mine, near, count, walls, rules):
    """Return the agent's awareness of opposing traffic, 0 to 1: what it sees, hears from agents ahead, or remembers.

    Agents behind walls are neither seen nor heard: an agent in a narrow ring does not meet those on its other side.
    Agents without a goal (``goal`` < 0) count as of one goal.
    """
    # What the agent remembers fades: slowly in a crowd, where others will follow that it cannot see yet, else soon, as
    # keeping right longer would only lead it aside.
    fading = rules.fading if count >= rules.company else rules.fading_alone
    news = max(mine.opposed - fading * rules.step, 0.0)
    for n in range(count):
        seen = near[n]
        # Only agents ahead count.
        if seen.px * mine.gx + seen.py * mine.gy <= 0.0:
            continue
        other = rows[seen.row]
        along = other.ix * mine.gx + other.iy * mine.gy
        # An agent whose intent is more than 107 degrees off this one's guidance is opposing traffic unless it is far to
        # the side of the line along that guidance; less far to the left, where it will pass. Agents of one way never
        # are: at a door they face each other because they queue for it.
        if along < -0.3 and not same_way(mine, seen, other):
            left = mine.gx * seen.py - mine.gy * seen.px
            meets = -rules.opposing_right < left < rules.opposing_left
            if meets and is_in_sight(walls[1], mine.x, mine.y, seen.px, seen.py):
                return 1.0
        # An agent that walks the same way (less than 73 degrees off) hands on a share of its awareness, less a little:
        # so the news runs back through a queue from agent to agent, and ends.
        elif along > 0.3:
            heard = rules.news * other.opposed - 0.02
            if heard > news and is_in_sight(walls[1], mine.x, mine.y, seen.px, seen.py):
                news = heard
    return news


@helper
def yield_to_opposing(rows, mine, near, count, walls, rules, want):
    """Step out of the way of an opposing agent that is stuck, if this agent blocks it; return True if so.

    Then set velocity, intent, rank, facing and shoulders of ``want``. Of several stuck agents, the one with the highest
    rank counts. Agents of one way do not yield to each other like this, as that would ruin the flow at a door;
    :func:`let_merge` orders them. Agents without a goal (``goal`` < 0), which stand, turn or walk to their spots, yield
    to each other, too: one that steps aside takes over the rank, and those behind it have to make room in turn.
    """
    goes = mine.gx != 0.0 or mine.gy != 0.0
    # The rank is about the time stuck [s], or a lasting one above any time (rank_of): yield only to agents that have
    # been stuck for ``yield_after`` and have a higher rank than this one, in the last step and in this one (either may
    # be inherited). The own rank of an agent that stays does not count, as it needs no way.
    highest = max(mine.rank, want.rank, rules.yield_after) if goes else rules.yield_after
    first = -1
    for n in range(count):
        seen = near[n]
        other = rows[seen.row]
        queues = mine.goal >= 0 and same_way(mine, seen, other)
        if other.rank <= highest or queues or seen.distance > rules.yield_reach:
            continue
        # Intents must oppose each other by more than 107 degrees. An agent that stays yields to any direction.
        if goes and other.ix * mine.gx + other.iy * mine.gy > -0.3:
            continue
        # This agent blocks the other one if it is ahead of it, and less than the sum of their half breadths beside the
        # line along its intent.
        ahead = -(seen.px * other.ix + seen.py * other.iy)
        aside = abs(seen.px * other.iy - seen.py * other.ix)
        if ahead <= 0.0 or aside >= mine.half + mine.radius + seen.half + seen.radius:
            continue
        # This agent does not block one on the other side of a wall.
        if is_in_sight(walls[1], mine.x, mine.y, seen.px, seen.py):
            highest = other.rank
            first = n
    if first < 0:
        return False
    seen = near[first]
    other = rows[seen.row]
    want.vx, want.vy, want.ix, want.iy = way_aside(mine, seen, other, walls, rules)
    # Inherit the rank, a little lower, so that agents behind this one yield to it in turn. An agent at its place
    # inherits a share of it only: many of them would hand it to and fro long after its owner has left.
    want.rank = max(want.rank, handed_on(other.rank) if mine.goal >= 0 else AT_PLACE * other.rank)
    # Turn the shoulders parallel to the other's way, so that the body is narrow across it.
    want.facing_x = other.ix
    want.facing_y = other.iy
    want.turn_cos = 0.0
    want.turn_sin = 1.0
    return True


@helper
def let_merge(rows, mine, near, count, rules, want):
    """Back away from agents of the same way that go first, are stuck, and are hindered by this agent.

    Return False if there are none, or if the directions away from them cancel out. Otherwise set velocity, intent, key,
    facing and shoulders of ``want``, and return True. An agent with a lower key goes first
    (:mod:`crowdsim.steering.order_kernels`). Agents without a goal (``goal`` < 0), such as those on the way to their
    own spots, count as of one goal.
    """
    awayx = 0.0
    awayy = 0.0
    lowest = want.key
    wayx = 0.0
    wayy = 0.0
    for n in range(count):
        seen = near[n]
        other = rows[seen.row]
        # Only agents within 1 m with the right of way that are stuck.
        if other.stuck <= rules.merge_after or seen.distance > 1.0:
            continue
        key = key_of(mine, seen, other)
        if key >= want.key:
            continue
        # Skip agents that have this one behind them: it is not in their way.
        if seen.px * other.ix + seen.py * other.iy > rules.merge_behind * seen.distance:
            continue
        # Sum up the directions away from all of them; remember the intent of the one that goes first.
        if gap_to(mine, seen) < rules.merge_gap:
            awayx -= seen.px / seen.distance
            awayy -= seen.py / seen.distance
            if key < lowest:
                lowest = key
                wayx = other.ix
                wayy = other.iy
    away = math.sqrt(awayx * awayx + awayy * awayy)
    if away == 0.0:
        return False
    want.ix = awayx / away
    want.iy = awayy / away
    want.vx = rules.merge_speed * want.ix
    want.vy = rules.merge_speed * want.iy
    # Inherit the key, a little higher, so that agents behind this one make room for it in turn.
    want.key = lowest + 1e-4
    # Turn the shoulders parallel to the way of the first agent: two side by side in a narrow passage could otherwise
    # lock their shoulders.
    want.facing_x = wayx
    want.facing_y = wayy
    want.turn_cos = 0.0
    want.turn_sin = 1.0
    return True


@helper
def walks_in_file(rows, mine, near, count, walls, rules, opposed):
    """Return True if the agent follows another one through a lane too narrow for two side by side.

    Two side by side need ``rules.abreast`` [m]. The lane must reach back ``rules.lane`` [m] or more behind the agent.
    An agent that meets opposing traffic (``opposed`` > 0) or is stuck does not keep in file.
    """
    if opposed > 0.0 or mine.stuck > rules.file_patience:
        return False
    if not is_lane(walls[1], mine.x, mine.y, mine.gx, mine.gy, rules.abreast):
        return False
    if not is_lane_behind(walls[1], mine.x, mine.y, mine.gx, mine.gy, rules.abreast, rules.lane):
        return False
    for n in range(count):
        seen = near[n]
        other = rows[seen.row]
        # The leader is ahead and walks the same way (less than 73 degrees off, cosine 0.3), whatever its goal.
        if seen.px * mine.gx + seen.py * mine.gy <= 0.0 or other.ix * mine.gx + other.iy * mine.gy <= 0.3:
            continue
        # In a bend, the straight line to the leader, a chord, runs along the mean of both directions: measure how far
        # the leader is aside from the line along that mean [m].
        way_x = mine.gx + other.ix
        way_y = mine.gy + other.iy
        both = mine.half + mine.radius + seen.half + seen.radius
        aside = abs(seen.px * way_y - seen.py * way_x) / math.sqrt(way_x * way_x + way_y * way_y)
        if aside < rules.file_aside * both and gap_to(mine, seen) < rules.file_gap:
            return True
    return False


@helper
def choose_speed(rows, mine, near, count, rules, ux, uy, in_file, want):
    """Return the speed along the unit vector ``(ux, uy)`` [m/s]: as the gap ahead allows, or pressing on if stuck.

    It is at most the free speed. The time gap follows the collision-free speed model (Tordeux, Chraibi and Seyfried,
    Traffic and Granular Flow 2015): speed <= (gap - standoff) / headway, plus a share of the leader's speed. The
    headway is longer if the agent walks in file (``in_file``). Of ``want``, the turn of the shoulders is read.
    """
    # Free speed, lower with turned shoulders, most so if a section of the plan prescribes the turn (``turn`` >= 0);
    # half breadth of the body across its way.
    slowdown = rules.turned_slowdown if mine.turn < 0.0 else rules.sideways_slowdown
    speed = mine.speed * (1.0 - slowdown * (1.0 - want.turn_cos))
    width = mine.half * want.turn_cos + mine.radius
    headway = rules.file_headway if in_file else rules.headway
    before = 1.0 if in_file else rules.swath_before
    led = False
    for n in range(count):
        seen = near[n]
        if seen.px * ux + seen.py * uy <= 0.0:
            continue
        other = rows[seen.row]
        key = key_of(mine, seen, other)
        own_way = key < math.inf
        # Share of the swath in which the neighbor counts: of agents of the same way, those that go first count almost
        # fully, those that go after this one not at all. In a file all ahead count: for two steps, the key of an agent
        # that has just reached one of several goals is still that of the way there, so those ahead would seem to go
        # after it.
        share = rules.swath
        if own_way:
            share = before if in_file or key < mine.key else rules.swath_behind
        # Sum of both half breadths across the direction (a core is across its heading). An agent whose center is aside
        # by this share of the sum or more does not limit the speed.
        both = width + seen.radius + seen.half * abs(seen.hx * ux + seen.hy * uy)
        aside = abs(seen.px * uy - seen.py * ux)
        if aside >= share * both:
            continue
        gap = gap_to(mine, seen)
        # An agent at the edge of the swath limits less: the gap grows with the square of its relative offset.
        offset = aside / both
        allowed = max(0.0, gap - rules.standoff + rules.offset_gain * offset * offset) / headway
        # Start at once when the leader starts; its speed counts less in a small gap.
        leading = max(0.0, seen.vx * ux + seen.vy * uy)
        speed = min(speed, allowed + rules.leader * leading * min(1.0, max(gap, 0.0) / rules.leader_gap))
        # An agent close ahead that walks the same way is one to wait for, if it goes first.
        if gap < 0.4 and other.ix * mine.gx + other.iy * mine.gy > 0.3 and (not own_way or key < mine.key):
            led = True
    # The time gap alone would stop touching agents for ever. Contact is harmless, as the commit lets bodies slide: a
    # stuck agent presses on, more and more from 0.3 to 2.3 s; faster, from 0.2 to 1.2 s, without a leader to wait for.
    creep = rules.creep * min(max((mine.stuck - 0.3) / 2.0, 0.0), 1.0)
    if not led:
        creep = max(creep, rules.creep_first * min(max(mine.stuck - 0.2, 0.0), 1.0))
    return max(speed, min(creep, mine.speed))


@helper
def keep_right(mine, near, count, walls, rules, opposed):
    """Return the angle by which an agent aims to the right of its guidance [rad], 0 or more.

    It is 0 if ``opposed``, the awareness of opposing traffic from 0 to 1, is 0.
    """
    if opposed <= 0.0:
        return 0.0
    # Share of the angle for which there is room: reduced by walls near the point 0.5 m to the right (0 up to ``edge``,
    # 1 from 0.3 m beyond on), and near the goal.
    free = distance_at(walls[1], mine.x + 0.5 * mine.gy, mine.y - 0.5 * mine.gx)
    room = min(max((free - rules.edge) / 0.3, 0.0), 1.0) * min(mine.togo / rules.direct, 1.0)
    angle = rules.keep_right * opposed * room
    # If it is stuck and an agent within 1 m ahead is not clearly (0.25 m) to its left, it aims farther to the right.
    if mine.stuck > 0.0:
        for n in range(count):
            seen = near[n]
            ahead = seen.px * mine.gx + seen.py * mine.gy
            if seen.distance < 1.0 and ahead > 0.0 and mine.gx * seen.py - mine.gy * seen.px < 0.25:
                angle += rules.sidle * room * min(1.0, mine.stuck)
                break
    return angle


@helper
def follow_way(rows, mine, near, count, walls, rules, want):
    """Walk along guidance and around neighbors, at the speed that the gap ahead allows.

    Set velocity and shoulders of ``want``, whose ``opposed`` is set already. Set its facing in two cases: along
    guidance if a section of the plan prescribes the turn of the body; along its way if :func:`turn_first` lets the
    agent turn first. Otherwise the facing stays along the present velocity, as :func:`decide_rows` sets it.
    """
    # Desired direction: guidance, turned to the right under opposing traffic.
    ahead = (mine.gx, mine.gy)
    angle = keep_right(mine, near, count, walls, rules, want.opposed)
    if angle > 0.0:
        cos, sin = cos_sin(angle)
        ahead = (mine.gx * cos + mine.gy * sin, mine.gy * cos - mine.gx * sin)
    fixed_cos = -1.0  # no turn of the shoulders is prescribed
    if mine.turn >= 0.0:
        # A section of the plan prescribes the turn of the body against the way: try no other.
        fixed_cos, want.turn_sin = cos_sin(mine.turn)
        want.turn_cos = fixed_cos
        want.facing_x = mine.gx
        want.facing_y = mine.gy
    in_file = walks_in_file(rows, mine, near, count, walls, rules, want.opposed)
    ux, uy, turned = choose_direction(mine, near, count, walls, rules, ahead, fixed_cos, in_file)
    if mine.turn < 0.0:
        want.turn_cos = TURNS[turned, 0]
        want.turn_sin = TURNS[turned, 1]
    # Agents that meet opposing traffic are stuck for other reasons than walls.
    wedged = want.opposed <= 0.0 and is_wedged(mine, walls)
    if wedged and mine.turn < 0.0:
        # The free distances of a wedged agent do not tell how to turn; sideways its body is narrowest across its way.
        want.turn_cos = 0.0
        want.turn_sin = 1.0
    speed = choose_speed(rows, mine, near, count, rules, ux, uy, in_file, want)
    # A section that prescribes the turn of the body prescribes the facing, too: do not change that.
    if mine.turn < 0.0:
        speed = turn_first(mine, rules, ux, uy, speed, want)
    want.vx, want.vy = press_or_step_back(mine, near, count, walls, wedged, want.opposed, speed, ux, uy)


@helper
def limit_change(mine, rules, want):
    """Replace the velocity of ``want`` by one that human accelerations allow, and set the half length of its core."""
    # Relax towards the wanted velocity: dv = (v_wanted - v) dt / tau, clamped to the largest acceleration.
    ax = (want.vx - mine.vx) * rules.step / rules.relaxation
    ay = (want.vy - mine.vy) * rules.step / rules.relaxation
    change = math.sqrt(ax * ax + ay * ay)
    most = rules.acceleration * rules.step
    if change > most:
        ax *= most / change
        ay *= most / change
    want.vx = mine.vx + ax
    want.vy = mine.vy + ay
    # The core gets the half length that a section of the plan prescribes (``held``, -1 for none) if that is shorter
    # than the relaxed one (``rest``), else the relaxed one: by at most 3 cm less or 2 cm more in a step.
    asked = min(mine.held, mine.rest) if mine.held >= 0.0 else mine.rest
    want.half = min(max(asked, mine.half - 0.03), mine.half + 0.02)


@kernel
def decide_rows(rows, near_rows, first, last, order, moved, walls, rules, wanted):
    """Decide what the agents of rows ``first`` to ``last`` (exclusive) want in this step; write it to ``wanted``.

    ``near_rows`` (n, MOST_NEAR) int32 are the rows of the neighbors of each row, -1 after the last. ``order``
    (int32[n]) is the agent number of each row; agents from number ``moved`` on decide nothing. ``wanted`` (WANTED[n])
    gets the decisions. ``rows``, ``walls`` and ``rules`` are those of all helpers.
    """
    near = np.empty(MOST_NEAR, NEAR)
    for me in range(first, last):
        if order[me] >= moved:
            continue
        mine = rows[me]
        want = wanted[me]
        goes = mine.gx != 0.0 or mine.gy != 0.0
        # Default: stay, with the guidance as intent. The rank of right of way is the agent's own at first, the key the
        # distance to go with a tie breaker.
        want.vx = 0.0
        want.vy = 0.0
        want.ix = mine.gx
        want.iy = mine.gy
        want.rank = rank_of(mine, walls)
        want.key = mine.togo + rules.identity * mine.share
        want.opposed = 0.0
        want.facing_x = mine.vx
        want.facing_y = mine.vy
        want.turn_cos = 1.0
        want.turn_sin = 0.0
        count = take_in(rows, me, near_rows, near)
        if goes:
            want.opposed = hear_opposing(rows, mine, near, count, walls, rules)
            want.rank = push_on(rows, mine, near, count, walls, rules.yield_reach, want.rank)

        # The first rule that applies sets the velocity: yield, let others merge, walk.
        gives_way = yield_to_opposing(rows, mine, near, count, walls, rules, want)
        if goes and not gives_way and not let_merge(rows, mine, near, count, rules, want):
            follow_way(rows, mine, near, count, walls, rules, want)
        limit_change(mine, rules, want)
        face(mine, rules, want)
