"""A scenario of two rooms joined by two doors, with changing obstacles."""

from __future__ import annotations

_TEXT = """\
crowdsim: 1
name: rooms
seed: {seed}
duration: {duration}
floor: {{rectangle: [0, 0, 12, 6]}}
obstacles:
  - {{name: wall_low, box: {{min: [5, 0], max: [5.15, 1]}}, top: 2.5}}
  - {{name: wall_mid, box: {{min: [5, 2], max: [5.15, 4]}}, top: 2.5}}
  - {{name: wall_high, box: {{min: [5, 5], max: [5.15, 6]}}, top: 2.5}}
  - {{name: crate, box: {{center: [8, 1.5], size: [0.8, 0.8]}}, top: 0.9}}
doors:
  - {{name: door_a, box: {{min: [5, 1], max: [5.15, 2]}}, top: 2.2, initially: {door_a}}}
  - {{name: door_b, box: {{min: [5, 4], max: [5.15, 5]}}, top: 2.2, initially: {door_b}}}
agents:
{agents}
{events}
"""

WALKERS = """\
name: walkers, count: 4, interval: 2, start: {rectangle: [0.5, 0.5, 2, 2.5]},
     goal: {rectangle: [10.5, 0.5, 11.5, 2.5]}"""


def two_rooms(
    *agents: str,
    events: tuple[str, ...] = (),
    door_a: str = "open",
    door_b: str = "open",
    duration: float = 60.0,
    seed: int = 3,
) -> str:
    """Return YAML text; agents and events are contents of mappings, the wall is at x = 5, door a at y = 1 to 2."""
    return _TEXT.format(
        agents="\n".join(f"  - {{{group}}}" for group in agents),
        events="events:\n" + "\n".join(f"  - {{{event}}}" for event in events) if events else "",
        door_a=door_a,
        door_b=door_b,
        duration=duration,
        seed=seed,
    )
