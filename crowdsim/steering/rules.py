"""Constants of the steering model: how far agents see, how fast they walk, and who goes first.

docs/steering.md says how the values were chosen.
"""

from __future__ import annotations

from typing import NamedTuple

from crowdsim.constants import STEERING_RATE


class Rules(NamedTuple):
    """Constants of the steering model, the same for all agents and places. Lengths [m], times [s], angles [rad]."""

    step: float = 1.0 / STEERING_RATE
    """Duration of a step."""
    reach: float = 3.0
    """Distance up to which an agent sees neighbors."""
    reach_in_crowd: float = 2.0
    """The same if more than ``crowd`` agents are in the 5 x 5 cells of 1 m around it."""
    crowd: int = 50
    """Number of agents in these 25 m2, itself included, above which an agent sees only ``reach_in_crowd`` far."""
    horizon: float = 4.0
    """Distance ahead up to which collisions count. A longer horizon makes agents evade earlier."""
    wall_horizon: float = 1.6
    """Distance ahead up to which walls count."""
    inertia: float = 0.12
    """Cost of a direction that differs from the present velocity, per meter of the horizon: multiplied by 1 -
    cos(angle); 0 for an agent slower than 0.1 m/s. More makes agents steadier, and slower to evade."""
    left_bias: float = 0.03
    """Cost of a direction to the left, per meter of the horizon."""
    turn_cost: float = 0.25
    """Cost of turned shoulders, per meter of the horizon: multiplied by 1 - cos(turn)."""
    tight: float = 0.7
    """Free distance of the best direction up to which an agent also tries turned shoulders."""
    sideways_below: float = 0.6
    """Speed from which on an agent turns its shoulders by 60 degrees at most; slower ones by up to 75 degrees [m/s]."""
    keep_right: float = 1.0
    """Largest angle by which an agent aims to the right of its guidance while it meets opposing traffic; times its
    awareness of that traffic, and less if there is little room."""
    edge: float = 0.35
    """Clearance, 0.5 m to its right, below which an agent does not aim to the right; above, the angle grows to the
    whole over 0.3 m."""
    direct: float = 2.0
    """Length of the way to go below which an agent aims less and less to the right, so that it reaches its goal
    straight."""
    opposing_left: float = 0.9
    """Distance to the left of its way up to which others that come towards an agent are opposing traffic. Those farther
    to the left pass by; keeping right of them, too, leads two streams that meet in the open ever farther aside."""
    opposing_right: float = 1.5
    """The same to the right."""
    fading: float = 0.5
    """Awareness of opposing traffic that is lost in a second, of an agent that has ``company`` or more near [1/s]."""
    fading_alone: float = 2.0
    """The same of an agent with fewer near."""
    company: int = 6
    """Number of neighbors, of the twelve that an agent sees at most, from which on it is in a crowd."""
    news: float = 0.6
    """Share of the awareness of opposing traffic that an agent takes over from agents ahead that walk the same way."""
    sidle: float = 0.6
    """Largest angle by which an agent that meets opposing traffic aims farther to the right if it is stuck behind
    another one; reached 1 s after it got stuck, and less if there is little room."""
    headway: float = 0.43
    """Time gap to the agent ahead. Less makes crowds faster and denser."""
    standoff: float = 0.3
    """Gap at which the allowed speed is 0; the time gap counts from there."""
    leader: float = 0.5
    """Share of the leader's speed that is added to the speed that the time gap allows."""
    leader_gap: float = 0.5
    """Gap above which ``leader`` counts fully; below, in proportion to the gap."""
    offset_gain: float = 0.15
    """Length added to the gap to an agent ahead that is offset to the side: times the square of the offset, as a share
    of the sum of both half breadths."""
    swath: float = 0.9
    """Half width of the swath in which agents ahead limit the speed, as a share of the sum of both half breadths."""
    swath_before: float = 0.79
    """The same towards agents of the same way that go first, which are those with a lower key."""
    swath_behind: float = 0.0
    """The same towards agents of the same way that go after this one."""
    abreast: float = 0.9
    """Width between walls that two agents need side by side. In lanes narrower than this by 0.05 m, agents that walk
    the same way keep in file: they do not turn their shoulders to get beside each other, and agents ahead of the same
    goal limit their speed with the whole width of their swath (1 instead of ``swath_before``)."""
    lane: float = 2.5
    """Length that a lane must have had behind an agent before it keeps in file; so agents that enter side by side have
    room to sort themselves."""
    file_gap: float = 1.0
    """Largest gap to the agent ahead in a file."""
    file_aside: float = 0.5
    """Largest offset of the agent ahead in a file, as a share of the sum of both half breadths."""
    file_headway: float = 0.85
    """Time gap in a file."""
    file_patience: float = 0.5
    """Time stuck after which an agent leaves the file."""
    creep: float = 0.8
    """Speed at which a stuck agent presses on, at most its free speed [m/s]; reached 2.3 s after it got stuck."""
    creep_first: float = 1.34
    """The same if no agent that it has to wait for is close ahead [m/s]; reached 1.2 s after it got stuck."""
    merge_after: float = 0.2
    """Time stuck of an agent that goes first, after which others of the same way make room for it."""
    merge_behind: float = 0.3
    """Cosine, between the vector to an agent that goes first and that agent's intent, above which this agent is behind
    it and so does not hinder it."""
    merge_gap: float = 0.1
    """Gap below which an agent hinders the one that goes first."""
    merge_speed: float = 0.4
    """Speed at which an agent makes room [m/s]."""
    yield_after: float = 1.0
    """Time stuck of an agent, after which opposing agents step out of its way."""
    yield_reach: float = 1.5
    """Distance up to which opposing agents do so, and up to which a lasting right of way is handed on (``push_on``)."""
    yield_aside: float = 0.5
    """Speed at which opposing agents step aside [m/s]."""
    yield_along: float = 0.3
    """Speed at which they also step back, along the way of the stuck agent [m/s]."""
    relaxation: float = 0.24
    """Time constant with which the velocity approaches the wanted one."""
    acceleration: float = 2.5
    """Largest change of the velocity [m/s2]."""
    turn_rate: float = 2.5
    """Largest turn rate of the body [rad/s]."""
    backward: float = 0.3
    """Speed of an agent whose way leads 120 degrees or more off its heading, while it turns [m/s]."""
    turned_slowdown: float = 0.3
    """Share of the speed that is lost if the shoulders are turned by a right angle to get past others; times 1 -
    cos(turn)."""
    sideways_slowdown: float = 0.55
    """The same if a section of the plan prescribes the turn."""
    identity: float = 0.15
    """Range of the tie breaker (``share`` in ROW) that is added to the length of the way to go, in the order of right
    of way among agents of one way."""
