"""Keys of a scenario file about the characters: who walks from where to where, and how they move."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import AfterValidator, ConfigDict, Field, WithJsonSchema, model_validator

from crowdsim.constants import NONE
from crowdsim.scenario.schema.attributes import Attributes
from crowdsim.scenario.schema.exits import Choice, Exits
from crowdsim.scenario.schema.spreads import Breadth, Delay, Spread, WalkingSpeed
from crowdsim.scenario.schema.values import Degrees, FileText, Name, Part, Region, Seconds, one_of

MAX_COUNT = 100_000

MOST_TOGETHER = 8

STAND_WITHIN = 0.1
"""Meters from its goal within which a character comes to stand where nothing else is asked for."""


class Motion(Part):
    """Where movement comes from: a built-in set, or captures in a folder beside the scenario file."""

    model_config = ConfigDict(json_schema_extra=one_of(("set",), ("captures",)))
    set: Literal["default", "happy", "dance"] | None = None
    captures: FileText | None = None
    clips: Annotated[tuple[FileText, ...], Field(strict=False, min_length=1)] = ("*.bvh",)

    @model_validator(mode="after")
    def _check(self) -> Motion:
        if self.only("set", "captures") == "set" and "clips" in self.model_fields_set:
            raise ValueError("'clips' chooses among captures; give 'captures' with it, or drop it")
        return self


def _checked_repeat(value: Any) -> Any:
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
    schema["oneOf"] = [{"required": [key]} for key in ("goal", "goals", "exits")]
    schema["anyOf"] = [{"required": ["count"]}, {"required": ["rate"]}]


USUAL_SPEED = Spread(mean=1.34, sd=0.26, min=0.5, max=2.2)
"""Speeds at which people walk alone [m/s] (Weidmann 1993)."""

USUAL_BREADTH = Spread(mean=0.46, sd=0.03, min=0.38, max=0.55)
"""Breadths of adults over their arms [m] (DIN 33402)."""

_STEERED_KEYS = ("breadth", "delay")


class Goal(Region):
    """A place to go to, and where to face for those who stand there; or a way ``along`` an axis without end."""

    model_config = ConfigDict(
        json_schema_extra=one_of(("rectangle",), ("point",), ("circle",), ("polygon",), ("along",))
    )
    heading: Degrees | None = None
    along: Literal["+x", "-x", "+y", "-y"] | None = None

    def _kinds(self) -> tuple[str, ...]:
        return (*super()._kinds(), "along")


class AgentGroup(Part):
    """Characters with one start and the same goals.

    ``together``: so many of them, one after the other, are a party that walks together, as pairs and families do.

    ``count`` of them start ``interval`` seconds after each other; or a source lets in ``rate`` a second until ``until``
    (at most ``count``). They go to their ``goal``, or to each of ``goals`` in turn, ``repeat`` times over, and stand
    ``wait`` seconds at all but the last, within ``stand_within`` meters of them; or they leave through one of
    ``exits``, by ``choice`` or as it is assigned to them. To a goal or an exit, they may take a ``route``.

    ``locomotion``: captured characters play motion that is searched for each of them; steered ones decide ten times a
    second, and their bodies follow; ``auto`` ones are captured while they have room, and steered where they meet
    others. They walk at their ``speed`` [m/s] where nothing is in their way; captured motion is played at 0.6 to 1.15
    of the speed that it has. Steered ones are ``breadth`` [m] broad, and take their first step ``delay`` seconds after
    they came. ``attributes`` are said of them for statistics, recordings and pictures; nobody walks otherwise because
    of them.
    """

    model_config = ConfigDict(json_schema_extra=_one_goal_and_some_agents)
    name: Name
    count: Annotated[int, Field(ge=1, le=MAX_COUNT)] | None = None
    rate: Annotated[float, Field(allow_inf_nan=False, gt=0.0, le=1000.0)] | None = None
    arrivals: Literal["poisson", "regular"] = "poisson"
    start: Region
    goal: Goal | None = None
    goals: Annotated[tuple[Goal, ...], Field(strict=False, min_length=1)] | None = None
    exits: Exits | None = None
    choice: Choice = "nearest"
    route: Name | None = None
    repeat: Repeat = 1
    wait: Seconds = 0.0
    start_time: Seconds = 0.0
    interval: Seconds = 0.0
    until: Seconds | None = None
    together: Annotated[int, Field(ge=1, le=MOST_TOGETHER)] = 1
    on_arrival: Literal["leave", "stay"] = "leave"
    stand_within: Annotated[float, Field(allow_inf_nan=False, ge=0.01, le=0.35)] = STAND_WITHIN
    locomotion: Literal["auto", "captured", "steered"] = "auto"
    speed: WalkingSpeed = USUAL_SPEED
    breadth: Breadth = USUAL_BREADTH
    delay: Delay = Spread(mean=0.0)
    attributes: Attributes = Field(default_factory=dict)

    @model_validator(mode="after")
    def _check(self) -> AgentGroup:
        self.only("goal", "goals", "exits")
        if self.count is None and self.rate is None:
            raise ValueError("give 'count' for so many characters, or 'rate' for a source of them")
        if self.rate is None:
            for key in ("arrivals", "until"):
                if key in self.model_fields_set:
                    raise ValueError(f"'{key}' is about a source; give 'rate' with it, or drop it")
        elif "interval" in self.model_fields_set:
            raise ValueError("a source has a 'rate', not an 'interval'; drop one of them")
        elif self.until is not None and self.until <= self.start_time:
            raise ValueError(f"'until' ({self.until:g} s) must lie after 'start_time' ({self.start_time:g} s)")
        if self.rounds != 1 and len(self.regions()) < 2:
            raise ValueError("'repeat' goes round among several places; give 'goals' with at least two")
        if self.locomotion == "captured":
            if self.together > 1:
                raise ValueError(
                    "who walks 'together' steers; give 'locomotion: auto' or 'steered', or drop 'together'"
                )
            for key in _STEERED_KEYS:
                if key in self.model_fields_set:
                    raise ValueError(
                        f"'{key}' is about steered characters; give 'locomotion: auto' or 'steered', or drop it"
                    )
        self._check_exits()
        self._check_route()
        self._check_stands()
        return self

    def _check_exits(self) -> None:
        if self.exits is None:
            if "choice" in self.model_fields_set:
                raise ValueError("'choice' is among exits; give 'exits' with it, or drop it")
            if len(self.goals or ()) > 1 and any(goal.along is not None for goal in self.goals or ()):
                raise ValueError("a way along an axis has no end; give it as the only 'goal'")
            if self.locomotion == "captured" and self.goal is not None and self.goal.along is not None:
                raise ValueError("captured characters go to a region; give 'locomotion: auto' or 'steered'")
            return
        if isinstance(self.exits, dict) and "choice" in self.model_fields_set:
            raise ValueError("these 'exits' are assigned by their shares; drop 'choice', or list names only")
        for key in ("on_arrival", "wait"):
            if getattr(self, key) not in ("leave", 0.0):
                raise ValueError(f"who goes to an exit leaves there; drop '{key}', or give a 'goal'")

    def _check_route(self) -> None:
        if self.route is None:
            return
        if self.goals is not None:
            raise ValueError("a 'route' leads to one 'goal' or to 'exits'; list its places among the 'goals' instead")
        if self.goal is not None and self.goal.along is not None:
            raise ValueError("a way along an axis has no end to take a 'route' to; name a region, or drop 'route'")
        if self.wait > 0.0:
            raise ValueError("nobody waits on a 'route'; list its places as 'goals', or drop 'wait'")

    def _check_stands(self) -> None:
        regions = self.regions()
        if not regions:
            return
        stands = [self.wait > 0.0] * len(regions)
        stands[-1] = self.on_arrival == "stay" or (self.wait > 0.0 and self.rounds != 1)
        if "stand_within" in self.model_fields_set and not any(stands):
            raise ValueError("'stand_within' is about goals to stand at; give 'wait' or 'on_arrival: stay', or drop it")
        for (key, goal), stood_at in zip(regions, stands, strict=True):
            if goal.heading is not None and not stood_at:
                name = ".".join(str(part) for part in key)
                needed = "'on_arrival: stay'" if key == regions[-1][0] else "'wait'"
                raise ValueError(f"nobody stands at {name} to face its 'heading'; give {needed}, or drop it")

    @property
    def rounds(self) -> int:
        """How many times over the goals are gone to; NONE for as long as the run lasts."""
        return NONE if self.repeat == "forever" else int(self.repeat)

    @property
    def level(self) -> str:
        """How the characters move: their ``locomotion``, but ``auto`` ones steer where captured motion cannot go."""
        endless = any(goal.along is not None for _, goal in self.regions())
        steers = self.exits is not None or endless or self.together > 1
        return "steered" if self.locomotion == "auto" and steers else self.locomotion

    def regions(self) -> list[tuple[tuple[str | int, ...], Goal]]:
        """The goals in order, each with its place in the group: ``("goals", 1)``; none of who goes to an exit."""
        if self.goal is not None:
            return [(("goal",), self.goal)]
        return [(("goals", number), region) for number, region in enumerate(self.goals or ())]
