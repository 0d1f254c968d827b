"""Attributes of the agents of a group beside how they walk: numbers, which may be drawn, and words."""

from __future__ import annotations

import re
from typing import Annotated, Any

from pydantic import AfterValidator, BeforeValidator, ConfigDict, Field, WithJsonSchema, model_validator

from crowdsim.scenario.schema.spreads import KINDS, Positive, Spread, spread_schema

TAKEN = ("behavior", "agent", "level")
"""Names that are not allowed, because ``crowdsim play --color`` uses them for something else."""

_NAME = re.compile(r"[a-z][a-z0-9_]{0,39}")


class Attribute(Spread):
    """A number, a distribution of numbers, or ``words`` with the share of the agents that each is given to."""

    model_config = ConfigDict(json_schema_extra={"oneOf": [{"required": [kind]} for kind in (*KINDS, "words")]})
    words: Annotated[
        Annotated[dict[str, Positive], Field(min_length=1, max_length=100)] | None,
        Field(description="words with the share of agents that each is said of"),
    ] = None

    def _kinds(self) -> tuple[str, ...]:
        """Return the keys of which exactly one gives the values: those of a distribution, and ``words``."""
        return (*super()._kinds(), "words")

    @model_validator(mode="after")
    def _check_words(self) -> Attribute:
        """Refuse bounds of words."""
        if self.words is not None and (self.min is not None or self.max is not None):
            raise ValueError("words have no bounds; drop 'min' and 'max'")
        return self


def _short(value: Any) -> Any:
    """Return the mapping that a plain number or word stands for; any other value as it is."""
    if isinstance(value, int | float) and not isinstance(value, bool):
        return {"mean": value}
    return {"words": {value: 1.0}} if isinstance(value, str) else value


def _named(attributes: dict[str, Attribute]) -> dict[str, Attribute]:
    """Return the attributes; raise ValueError for names that are not valid, or that playback colors use otherwise."""
    for name in attributes:
        if not _NAME.fullmatch(name):
            raise ValueError(
                f"'{name}' is not a valid name of an attribute; use lower-case letters, digits and _, a letter first"
            )
        if name in TAKEN:
            raise ValueError(f"the name '{name}' has a meaning in playback colors; choose another one")
    return attributes


_WORDS = {
    "type": "object",
    "additionalProperties": {"type": "number", "exclusiveMinimum": 0.0},
    "minProperties": 1,
}

Attributes = Annotated[
    dict[str, Annotated[Attribute, BeforeValidator(_short)]],
    AfterValidator(_named),
    WithJsonSchema(
        {
            "type": "object",
            "propertyNames": {"pattern": f"^{_NAME.pattern}$"},
            "additionalProperties": {
                "anyOf": [
                    {"type": "number"},
                    {"type": "string"},
                    spread_schema({"type": "number"}, Attribute, words=_WORDS),
                ]
            },
        }
    ),
    Field(description="numbers, distributions of numbers, words, or words with their shares, by name"),
]
