"""The rules of steering: what an agent looks at, how fast it goes, whom it gives way to.

docs/steering.md says what they were chosen on.
"""

from __future__ import annotations

from typing import NamedTuple

from crowdsim.constants import STEERING_RATE


class Rules(NamedTuple):
    """Constants of the steering model, the same for all agents and places. Lengths [m], times [s], angles [rad]."""

    step: float = 1.0 / STEERING_RATE
    """Time between two decisions."""
    reach: float = 3.0
    """Distance up to which an agent sees others."""
    reach_in_crowd: float = 2.0
    """The same if more than ``crowd`` others stand in the 5 x 5 cells around it."""
    crowd: int = 50
    horizon: float = 4.0
    """Distance ahead at which collisions count."""
    wall_horizon: float = 1.6
    """Distance ahead at which walls count."""
    inertia: float = 0.12
    """Cost of turning away from the present velocity, for each meter of the horizon [m]."""
    left_bias: float = 0.03
    """Cost of passing on the left, for each meter of the horizon [m]."""
    turn_cost: float = 0.25
    """Cost of turning the shoulders, for each meter of the horizon [m]."""
    tight: float = 0.7
    """An agent that can go no farther than this tries to turn its shoulders."""
    keep_right: float = 1.0
    """Angle by which an agent aims to the right of its way while others come towards it."""
    edge: float = 0.35
    """An agent stops aiming to the right if a wall is this near to the place 0.5 m to its right."""
    direct: float = 2.0
    """Length of the way to go from which on an agent aims less and less to the right: close to its goal it goes
    straight there [m]."""
    news: float = 0.6
    """Share of what somebody ahead knows of opposing agents that is handed on."""
    sidle: float = 0.6
    """Angle by which it aims farther to the right if it is stuck behind somebody."""
    headway: float = 0.45
    """Time gap kept to whoever walks ahead."""
    standoff: float = 0.3
    """Gap at which the time gap begins."""
    leader: float = 0.5
    """Share of the speed of whoever walks ahead that is added to what the time gap allows."""
    leader_gap: float = 0.5
    """Gap from which on that share counts whole."""
    offset_gain: float = 0.15
    """Gap added for somebody at the edge of the agent's swath."""
    swath: float = 0.9
    """Width of an agent's swath, as a share of both bodies' widths."""
    swath_before: float = 0.79
    """The same towards those of the same goal who go first."""
    swath_behind: float = 0.0
    """The same towards those of the same goal who go after it."""
    abreast: float = 0.9
    """Room that two side by side need between walls. In lanes 0.05 m narrower than that, agents of one way walk in
    file: they do not turn their shoulders to get beside each other, and heed the whole width of those who go first."""
    lane: float = 2.5
    """Length of the lane behind an agent from which on it does: those who come in side by side sort themselves."""
    file_gap: float = 1.0
    """Gap up to which an agent is in file behind somebody."""
    file_aside: float = 0.5
    """Distance of that one from the agent's way, as a share of both bodies' widths, up to which it is."""
    file_headway: float = 0.85
    """Time gap kept in file."""
    file_patience: float = 0.5
    """Time stuck after which an agent does not keep in file any more."""
    creep: float = 0.8
    """Speed [m/s] at which an agent that is stuck presses on."""
    creep_first: float = 1.2
    """The same if nobody of its way is ahead; reached within a second."""
    merge_after: float = 0.2
    """Time stuck after which an agent gives way to those of its goal who go first."""
    merge_behind: float = 0.3
    """Cosine, against the way of such an agent, from which on somebody beside it counts as behind it."""
    merge_gap: float = 0.1
    """Gap below which somebody hinders such an agent."""
    merge_speed: float = 0.4
    """Speed [m/s] at which an agent makes room."""
    yield_after: float = 1.0
    """Time after which others step out of the way of somebody stuck."""
    yield_reach: float = 1.5
    """Distance up to which they do."""
    yield_aside: float = 0.5
    """Speed [m/s] at which they step aside."""
    yield_along: float = 0.3
    """Speed [m/s] at which they step back along its way."""
    relaxation: float = 0.24
    """Time in which the velocity approaches what is wanted."""
    acceleration: float = 2.5
    """Largest change of the velocity [m/s2]."""
    turn_rate: float = 2.5
    """Largest turn rate of the body [rad/s]."""
    turned_slowdown: float = 0.3
    """Share of the speed that is lost if the shoulders are turned by a right angle to get past others."""
    sideways_slowdown: float = 0.55
    """Share of the speed that is lost if a section of the plan asks to walk sideways."""
    identity: float = 0.15
    """Spread of the order among those as far from their goal as each other [m]."""
