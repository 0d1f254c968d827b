"""Quantities that differ from character to character: a number, or a normal distribution within bounds."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import AfterValidator, BeforeValidator, Field, WithJsonSchema, model_validator

from crowdsim.scenario.schema.values import Part

Finite = Annotated[float, Field(allow_inf_nan=False, ge=-1e6, le=1e6)]


class Spread(Part):
    """Normal with ``mean`` and standard deviation ``sd`` within [``min``, ``max``]; the mean itself if ``sd`` is 0."""

    mean: Finite
    sd: Annotated[Finite, Field(ge=0.0)] = 0.0
    min: Finite | None = None
    max: Finite | None = None

    @model_validator(mode="after")
    def _check_order(self) -> Spread:
        if self.min is not None and self.min > self.mean:
            raise ValueError(f"'min' ({self.min:g}) must not be above 'mean' ({self.mean:g})")
        if self.max is not None and self.max < self.mean:
            raise ValueError(f"'max' ({self.max:g}) must not be below 'mean' ({self.mean:g})")
        return self


def _as_mean(value: Any) -> Any:
    """A plain number as the spread that it is short for."""
    return {"mean": value} if isinstance(value, int | float) and not isinstance(value, bool) else value


def _within(least: float, most: float) -> Any:
    """Checks that values lie within these bounds, which hold where a spread names none of its own."""

    def bounded(spread: Spread) -> Spread:
        low = least if spread.min is None else spread.min
        high = most if spread.max is None else spread.max
        for name, value in (("mean", spread.mean), ("min", low), ("max", high)):
            if not least <= value <= most:
                raise ValueError(f"'{name}' must be from {least:g} to {most:g}, got {value:g}")
        return spread.model_copy(update={"min": low, "max": high})

    return AfterValidator(bounded)


def _number_or_spread(least: float, most: float) -> Any:
    """JSON schema of the same."""
    number = {"type": "number", "minimum": least, "maximum": most}
    keys = {"mean": number, "sd": {"type": "number", "minimum": 0.0}, "min": number, "max": number}
    spread = {"type": "object", "properties": keys, "required": ["mean"], "additionalProperties": False}
    return WithJsonSchema({"anyOf": [number, spread]})


WalkingSpeed = Annotated[Spread, BeforeValidator(_as_mean), _within(0.1, 3.0), _number_or_spread(0.1, 3.0)]
Breadth = Annotated[Spread, BeforeValidator(_as_mean), _within(0.3, 0.7), _number_or_spread(0.3, 0.7)]
Delay = Annotated[Spread, BeforeValidator(_as_mean), _within(0.0, 1e6), _number_or_spread(0.0, 1e6)]
