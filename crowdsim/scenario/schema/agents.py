"""Keys of a scenario file for groups of agents: starts, goals, numbers, and how they move."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import AfterValidator, ConfigDict, Field, WithJsonSchema, model_validator

from crowdsim.constants import CAPTURE_PATTERNS, NONE
from crowdsim.scenario.schema.attributes import Attributes
from crowdsim.scenario.schema.exits import Choice, Exits
from crowdsim.scenario.schema.spreads import Breadth, Delay, Spread, WalkingSpeed
from crowdsim.scenario.schema.values import Degrees, FileText, Name, Part, Region, Seconds, one_of

MAX_COUNT = 100_000
"""Largest number of agents in a group, and of rounds over its goals."""

MOST_TOGETHER = 8
"""Largest number of agents in a party."""

STAND_WITHIN = 0.1
"""Default distance from its goal within which an agent comes to stand [m]."""


class Motion(Part):
    """Source of the clips: a built-in set, or motion captures in a folder beside the scenario file."""

    model_config = ConfigDict(json_schema_extra=one_of(("set",), ("captures",)))
    set: Annotated[Literal["default", "happy", "dance"] | None, Field(description="built-in motion set")] = None
    captures: Annotated[FileText | None, Field(description="folder of motion captures, beside the scenario file")] = (
        None
    )
    clips: Annotated[
        tuple[FileText, ...],
        Field(strict=False, min_length=1, description="patterns of the files to take, such as *.bvh"),
    ] = CAPTURE_PATTERNS
    unit: Annotated[
        Literal["m", "cm", "mm", "ft", "inch", "CMU unit"] | None,
        Field(description="unit of length of the captures, if the files do not name it"),
    ] = None
    joints: Annotated[
        dict[str, str] | None, Field(description="names of joints in the files by their roles, such as left_hip")
    ] = None

    @model_validator(mode="after")
    def _check(self) -> Motion:
        """Refuse keys of captures without captures."""
        if self.only("set", "captures") == "set":
            for key in ("clips", "unit", "joints"):
                if key in self.model_fields_set:
                    what = "chooses among captures" if key == "clips" else "is that of captures"
                    raise ValueError(f"'{key}' {what}; give 'captures' with it, or drop it")
        return self


def _checked_repeat(value: Any) -> Any:
    """Return a number of rounds or ``forever``; raise ValueError for anything else."""
    whole = isinstance(value, int) and not isinstance(value, bool)
    if value != "forever" and not (whole and 1 <= value <= MAX_COUNT):
        raise ValueError(f"expected a whole number from 1 to {MAX_COUNT}, or forever")
    return value


Repeat = Annotated[
    Any,
    AfterValidator(_checked_repeat),
    WithJsonSchema({"anyOf": [{"type": "integer", "minimum": 1, "maximum": MAX_COUNT}, {"const": "forever"}]}),
]


def _one_goal_and_some_agents(schema: dict[str, Any]) -> None:
    """Require in the JSON schema of a group exactly one kind of goal, and a count, a rate or both."""
    schema["oneOf"] = [{"required": [key]} for key in ("goal", "goals", "exits")]
    schema["anyOf"] = [{"required": ["count"]}, {"required": ["rate"]}]


USUAL_SPEED = Spread(mean=1.34, sd=0.26, min=0.5, max=2.2)
"""Default distribution of free walking speeds [m/s] (Weidmann 1993)."""

USUAL_BREADTH = Spread(mean=0.46, sd=0.03, min=0.38, max=0.55)
"""Default distribution of body breadths over the arms of adults [m] (DIN 33402)."""

_STEERED_KEYS = ("breadth", "delay")


class Goal(Region):
    """A place to go to, and the heading to take there; or an endless way ``along`` an axis of a periodic floor."""

    model_config = ConfigDict(
        json_schema_extra=one_of(("rectangle",), ("point",), ("circle",), ("polygon",), ("along",))
    )
    heading: Annotated[
        Degrees | None, Field(description="to face while standing there, counter-clockwise from +x [degrees]")
    ] = None
    along: Annotated[
        Literal["+x", "-x", "+y", "-y"] | None,
        Field(description="walk in this direction without end, on a periodic floor"),
    ] = None

    def _kinds(self) -> tuple[str, ...]:
        """Return the keys of which exactly one gives the goal: those of a region, and ``along``."""
        return (*super()._kinds(), "along")


class AgentGroup(Part):
    """Agents with one start region and the same goals.

    ``count`` of them start ``interval`` seconds after each other; or a source lets in ``rate`` per second until
    ``until`` (``count`` at most). Each ``together`` consecutive agents form a party that walks together, such as a
    pair or a family. ``on_call``: they come only if a command adds them; ``count`` is how many there can be.

    They go to their ``goal``, or to each of ``goals`` in turn, ``repeat`` times over, and stand ``wait`` seconds at
    each but the last of the last round, within ``stand_within`` meters of it; or they leave through one of ``exits``,
    by ``choice`` or by assigned shares. A ``route`` gives places to pass on the way to a goal or an exit.

    ``locomotion``: captured agents play motion that is searched for each of them; steered ones decide on a velocity
    ten times a second, and their bodies follow; ``auto`` ones are captured while they have room, and steered where they
    meet others. They walk at ``speed`` [m/s] if nothing is in the way; captured motion is played at 0.6 to 1.15 times
    its own speed. Steered ones are ``breadth`` [m] broad, and take their first step ``delay`` seconds after they
    appear. ``attributes`` describe them for statistics, recordings and pictures; they do not change how agents
    walk.
    """

    model_config = ConfigDict(json_schema_extra=_one_goal_and_some_agents)
    name: Annotated[Name, Field(description="unique among groups")]
    count: Annotated[
        Annotated[int, Field(ge=1, le=MAX_COUNT)] | None,
        Field(description="number of agents; of a source, at most"),
    ] = None
    rate: Annotated[
        Annotated[float, Field(allow_inf_nan=False, gt=0.0, le=1000.0)] | None,
        Field(description="makes the group a source: agents a second on average"),
    ] = None
    arrivals: Annotated[
        Literal["poisson", "regular"], Field(description="of a source: at random, or in equal steps")
    ] = "poisson"
    start: Annotated[Region, Field(description="region to start in")]
    goal: Annotated[Goal | None, Field(description="region to go to")] = None
    goals: Annotated[
        Annotated[tuple[Goal, ...], Field(strict=False, min_length=1)] | None,
        Field(description="regions to go to, one after another"),
    ] = None
    exits: Annotated[
        Exits | None, Field(description="all, names of exits, or names with the share of agents assigned to each")
    ] = None
    choice: Annotated[Choice, Field(description="among exits: the nearest, or the one reached and passed soonest")] = (
        "nearest"
    )
    route: Annotated[Name | None, Field(description="name of the route to take")] = None
    repeat: Annotated[Repeat, Field(description="how many times over to go to the goals, or forever")] = 1
    wait: Annotated[Seconds, Field(description="seconds to stand at each goal but the last of the last round")] = 0.0
    start_time: Annotated[Seconds, Field(description="seconds until the first may start")] = 0.0
    interval: Annotated[Seconds, Field(description="seconds from one start to the next")] = 0.0
    until: Annotated[
        Seconds | None, Field(description="seconds at which a source ends; the end of the run if absent")
    ] = None
    on_call: Annotated[bool, Field(description="come only if a command adds them while the simulation runs")] = False
    together: Annotated[
        int, Field(ge=1, le=MOST_TOGETHER, description="number of agents that walk together as a party")
    ] = 1
    on_arrival: Annotated[
        Literal["leave", "stay"], Field(description="leave the world at the last goal, or stay there")
    ] = "leave"
    stand_within: Annotated[
        float,
        Field(
            allow_inf_nan=False, ge=0.01, le=0.35, description="meters from their goals within which they come to stand"
        ),
    ] = STAND_WITHIN
    locomotion: Annotated[
        Literal["auto", "captured", "steered"],
        Field(
            description="captured: motion is searched for each; steered: for many; auto: captured while there is room"
        ),
    ] = "auto"
    speed: Annotated[
        WalkingSpeed, Field(description="walking speed where nothing is in the way, a number or a distribution [m/s]")
    ] = USUAL_SPEED
    breadth: Annotated[
        Breadth, Field(description="breadth over the arms while steered, a number or a distribution [m]")
    ] = USUAL_BREADTH
    delay: Annotated[
        Delay, Field(description="seconds between coming and the first step, a number or a distribution")
    ] = Spread(mean=0.0)
    attributes: Attributes = Field(default_factory=dict)

    @model_validator(mode="after")
    def _check(self) -> AgentGroup:
        """Refuse keys that contradict each other, or have no effect beside each other."""
        self.only("goal", "goals", "exits")
        if self.count is None and self.rate is None:
            raise ValueError("give 'count' for so many agents, or 'rate' for a source of them")
        if self.rate is None:
            for key in ("arrivals", "until"):
                if key in self.model_fields_set:
                    raise ValueError(f"'{key}' is about a source; give 'rate' with it, or drop it")
        elif "interval" in self.model_fields_set:
            raise ValueError("a source has a 'rate', not an 'interval'; drop one of them")
        elif self.until is not None and self.until <= self.start_time:
            raise ValueError(f"'until' ({self.until:g} s) must lie after 'start_time' ({self.start_time:g} s)")
        if self.on_call:
            for key in ("rate", "start_time", "interval", "together"):
                if key in self.model_fields_set:
                    raise ValueError(f"agents on call come one by one if a command adds them; drop '{key}'")
        if self.rounds != 1 and len(self.regions()) < 2:
            raise ValueError("'repeat' goes round among several places; give 'goals' with at least two")
        if self.locomotion == "captured":
            if self.together > 1:
                raise ValueError(
                    "parties that walk 'together' are steered; give 'locomotion: auto' or 'steered', or drop 'together'"
                )
            for key in _STEERED_KEYS:
                if key in self.model_fields_set:
                    raise ValueError(
                        f"'{key}' is about steered agents; give 'locomotion: auto' or 'steered', or drop it"
                    )
        self._check_exits()
        self._check_route()
        self._check_stands()
        return self

    def _check_exits(self) -> None:
        """Refuse keys that do not go with ``exits``.

        Without exits, refuse ``choice``, an endless way among several goals, and an endless way of captured agents.
        """
        if self.exits is None:
            if "choice" in self.model_fields_set:
                raise ValueError("'choice' is among exits; give 'exits' with it, or drop it")
            if len(self.goals or ()) > 1 and any(goal.along is not None for goal in self.goals or ()):
                raise ValueError("a way 'along' an axis is endless; give it as the only 'goal'")
            if self.locomotion == "captured" and self.goal is not None and self.goal.along is not None:
                raise ValueError("captured agents go to a region; give 'locomotion: auto' or 'steered'")
            return
        if isinstance(self.exits, dict) and "choice" in self.model_fields_set:
            raise ValueError("these 'exits' are assigned by their shares; drop 'choice', or list names only")
        for key in ("on_arrival", "wait"):
            if getattr(self, key) not in ("leave", 0.0):
                raise ValueError(f"agents that go to an exit leave there; drop '{key}', or give a 'goal'")

    def _check_route(self) -> None:
        """Refuse keys that do not go with a ``route``: several goals, an endless way, and ``wait``."""
        if self.route is None:
            return
        if self.goals is not None:
            raise ValueError("a 'route' leads to one 'goal' or to 'exits'; list its places among the 'goals' instead")
        if self.goal is not None and self.goal.along is not None:
            raise ValueError(
                "a way 'along' an axis is endless, so no 'route' leads to its end; name a region, or drop 'route'"
            )
        if self.wait > 0.0:
            raise ValueError("agents do not wait on a 'route'; list its places as 'goals', or drop 'wait'")

    def _check_stands(self) -> None:
        """Refuse headings, ``stand_within`` and ``wait`` for goals at which no agent stands."""
        regions = self.regions()
        # Agents that go to exits have no goal to stand at; ``wait`` is refused with ``exits``.
        if not regions:
            return
        # At the last goal, agents stay, or wait for the next round.
        stands = [self.wait > 0.0] * len(regions)
        stands[-1] = self.on_arrival == "stay" or (self.wait > 0.0 and self.rounds != 1)
        if "stand_within" in self.model_fields_set and not any(stands):
            needed = "'on_arrival: stay'" if len(regions) == 1 else "'wait' or 'on_arrival: stay'"
            raise ValueError(f"'stand_within' is about goals to stand at; give {needed}, or drop it")
        for (key, goal), stood_at in zip(regions, stands, strict=True):
            if goal.heading is not None and not stood_at:
                name = ".".join(str(part) for part in key)
                needed = "'on_arrival: stay'" if key == regions[-1][0] else "'wait'"
                raise ValueError(f"no agent stands at {name} to face its 'heading'; give {needed}, or drop it")
        # An endless way with ``wait`` is refused with other keys of standing, in the checks across keys.
        if self.wait > 0.0 and len(regions) == 1 and regions[0][1].along is None:
            raise ValueError("agents 'wait' between goals; give 'goals' with at least two, or drop it")

    @property
    def rounds(self) -> int:
        """Return how often the goals are visited in turn; NONE for as long as the run lasts."""
        return NONE if self.repeat == "forever" else int(self.repeat)

    @property
    def level(self) -> str:
        """Return the ``locomotion``; steered instead of ``auto`` for exits, endless ways and parties.

        Captured motion serves none of these.
        """
        endless = any(goal.along is not None for _, goal in self.regions())
        steers = self.exits is not None or endless or self.together > 1
        return "steered" if self.locomotion == "auto" and steers else self.locomotion

    def regions(self) -> list[tuple[tuple[str | int, ...], Goal]]:
        """Return the goals in order, each with its key in the group, as ``("goals", 1)``; none if it goes to exits."""
        if self.goal is not None:
            return [(("goal",), self.goal)]
        return [(("goals", number), region) for number, region in enumerate(self.goals or ())]
