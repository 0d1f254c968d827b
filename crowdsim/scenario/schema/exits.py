"""Keys of a scenario file for exits that agents choose from."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import AfterValidator, ConfigDict, Field, WithJsonSchema, model_validator

from crowdsim.scenario.schema.values import Name, Region, one_of

Choice = Literal["nearest", "quickest"]


class Exit(Region):
    """A named region through which agents leave; it may be shallower than a body."""

    model_config = ConfigDict(json_schema_extra=one_of(("rectangle",), ("circle",), ("polygon",)))
    name: Annotated[Name, Field(description="unique among exits")]

    @model_validator(mode="after")
    def _check_extent(self) -> Exit:
        """Refuse an exit that is a point."""
        if self.point is not None:
            raise ValueError("an exit needs an extent; give rectangle, circle or polygon")
        return self


def _checked_exits(value: Any) -> Any:
    """Return ``all``, names as a tuple, or shares by name as floats; raise ValueError for anything else."""
    shares = "all, a list of names, or names with their shares as {west: 3, east: 1}"
    if value == "all":
        return value
    if isinstance(value, list | tuple) and value and all(isinstance(name, str) for name in value):
        if len(set(value)) < len(value):
            raise ValueError("an exit is named twice")
        return tuple(value)
    if isinstance(value, dict) and value and all(isinstance(name, str) for name in value):
        for name, share in value.items():
            number = isinstance(share, int | float) and not isinstance(share, bool)
            if not (number and 0.0 <= share <= 1e6):
                raise ValueError(f"the share of '{name}' must be a number from 0 to 1e+06, got {share!r}")
        if not any(value.values()):
            raise ValueError("one share at least must be above 0")
        return {name: float(share) for name, share in value.items()}
    raise ValueError(f"expected {shares}")


Exits = Annotated[
    Any,
    AfterValidator(_checked_exits),
    WithJsonSchema(
        {
            "anyOf": [
                {"const": "all"},
                {"type": "array", "items": {"type": "string"}, "minItems": 1, "uniqueItems": True},
                {"type": "object", "additionalProperties": {"type": "number", "minimum": 0.0}, "minProperties": 1},
            ]
        }
    ),
]
