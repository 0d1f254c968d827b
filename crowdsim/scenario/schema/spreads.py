"""Quantities that differ from character to character: a number, a distribution within bounds, or a mix of these."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import AfterValidator, BeforeValidator, ConfigDict, Field, WithJsonSchema, model_validator

from crowdsim.scenario.schema.populations import POPULATIONS
from crowdsim.scenario.schema.values import Part

Finite = Annotated[float, Field(allow_inf_nan=False, ge=-1e6, le=1e6)]
Positive = Annotated[float, Field(allow_inf_nan=False, gt=0.0, le=1e6)]

KINDS = ("mean", "uniform", "lognormal", "gamma", "weibull", "mix", "table")
"""Keys that say how a quantity is distributed; ``mean`` stands for a normal distribution."""


class LogNormal(Part):
    """The logarithm of the quantity is normal with mean ``mu`` and standard deviation ``sigma``."""

    mu: Annotated[float, Field(allow_inf_nan=False, ge=-100.0, le=100.0)]
    sigma: Annotated[float, Field(allow_inf_nan=False, gt=0.0, le=10.0)]


class Shaped(Part):
    """Parameters of a gamma or a Weibull distribution."""

    shape: Annotated[float, Field(allow_inf_nan=False, ge=0.05, le=1e4)]
    scale: Positive


class Spread(Part):
    """How a quantity is distributed among characters.

    Normal with ``mean`` and standard deviation ``sd``; or ``uniform`` between two values, ``lognormal``, ``gamma`` or
    ``weibull``; or a ``mix`` of such spreads, each with its ``share``; or a ``table`` of the package, by age and sex.
    Values outside of [``min``, ``max``] are drawn anew. ``stratified``: one value from each of as many equally
    probable parts of the distribution as there are characters, so that few of them have it, too.
    """

    model_config = ConfigDict(json_schema_extra={"oneOf": [{"required": [kind]} for kind in KINDS]})
    mean: Finite | None = None
    sd: Annotated[Finite, Field(ge=0.0)] = 0.0
    uniform: Annotated[tuple[Finite, Finite], Field(strict=False)] | None = None
    lognormal: LogNormal | None = None
    gamma: Shaped | None = None
    weibull: Shaped | None = None
    mix: Annotated[tuple[Share, ...], Field(strict=False, min_length=1, max_length=100)] | None = None
    table: str | None = None
    min: Finite | None = None
    max: Finite | None = None
    stratified: bool = False

    @model_validator(mode="after")
    def _check(self) -> Spread:
        kind = self.kind
        if "sd" in self.model_fields_set and kind != "mean":
            raise ValueError(f"'sd' goes with 'mean', not with '{kind}'; drop it")
        if self.uniform is not None and self.uniform[0] > self.uniform[1]:
            raise ValueError(f"'uniform' is [least, most], got [{self.uniform[0]:g}, {self.uniform[1]:g}]")
        if self.table is not None and self.table not in POPULATIONS:
            raise ValueError(f"there is no table '{self.table}'; there are: {', '.join(POPULATIONS)}")
        if self.mix is not None:
            for share in self.mix:
                if share.stratified:
                    raise ValueError("'stratified' belongs beside 'mix', not in it")
        if self.min is not None and self.max is not None and self.min > self.max:
            raise ValueError(f"'min' ({self.min:g}) must not be above 'max' ({self.max:g})")
        if self.mean is not None:
            if self.min is not None and self.min > self.mean:
                raise ValueError(f"'min' ({self.min:g}) must not be above 'mean' ({self.mean:g})")
            if self.max is not None and self.max < self.mean:
                raise ValueError(f"'max' ({self.max:g}) must not be below 'mean' ({self.mean:g})")
        return self

    @property
    def kind(self) -> str:
        """Which of :data:`KINDS` it is."""
        return self.only(*self._kinds())

    def _kinds(self) -> tuple[str, ...]:
        return KINDS

    def parts(self) -> tuple[Share, ...]:
        """The spreads that a mix or a table is made of, each with its share; empty for any other."""
        if self.table is not None:
            return tuple(Share(share=share, uniform=band) for _, share, band in POPULATIONS[self.table])
        return self.mix or ()


class Share(Spread):
    """A part of a mix: ``share`` of the characters, against the other shares."""

    share: Positive


Spread.model_rebuild()


def _as_mean(value: Any) -> Any:
    """A plain number as the spread that it is short for."""
    return {"mean": value} if isinstance(value, int | float) and not isinstance(value, bool) else value


def _within(least: float, most: float) -> Any:
    """Checks that values lie within these bounds, which hold where a spread names none of its own."""

    def check(name: str, value: float) -> None:
        if not least <= value <= most:
            raise ValueError(f"'{name}' must be from {least:g} to {most:g}, got {value:g}")

    def bounded(spread: Spread) -> Spread:
        low = least if spread.min is None else spread.min
        high = most if spread.max is None else spread.max
        if spread.mean is not None:
            check("mean", spread.mean)
        for value in spread.uniform or ():
            check("uniform", value)
        check("min", low)
        check("max", high)
        parts = None if spread.mix is None else tuple(bounded(part) for part in spread.mix)
        return spread.model_copy(update={"min": low, "max": high, "mix": parts})

    return AfterValidator(bounded)


def spread_schema(number: dict[str, Any], **more: dict[str, Any]) -> dict[str, Any]:
    """JSON schema of a spread of numbers; ``more``: kinds of its own, by their keys."""
    positive = {"type": "number", "exclusiveMinimum": 0.0}

    def mapping(required: tuple[str, ...], **keys: Any) -> dict[str, Any]:
        return {"type": "object", "properties": keys, "required": list(required), "additionalProperties": False}

    shaped = mapping(("shape", "scale"), shape=positive, scale=positive)
    kinds: dict[str, Any] = {
        "mean": number,
        "uniform": {"type": "array", "items": number, "minItems": 2, "maxItems": 2},
        "lognormal": mapping(("mu", "sigma"), mu={"type": "number"}, sigma=positive),
        "gamma": shaped,
        "weibull": shaped,
        "table": {"enum": list(POPULATIONS)},
    }
    rest = {"sd": {"type": "number", "minimum": 0.0}, "min": number, "max": number}
    share = mapping(("share",), share=positive, **kinds, **rest)
    kinds["mix"] = {"type": "array", "items": share, "minItems": 1}
    spread = mapping((), **kinds, **more, **rest, stratified={"type": "boolean"})
    del spread["required"]
    spread["oneOf"] = [{"required": [kind]} for kind in (*KINDS, *more)]
    return spread


def _number_or_spread(least: float, most: float) -> Any:
    """JSON schema of a number within bounds, or a spread of such."""
    number = {"type": "number", "minimum": least, "maximum": most}
    return WithJsonSchema({"anyOf": [number, spread_schema(number)]})


WalkingSpeed = Annotated[Spread, BeforeValidator(_as_mean), _within(0.1, 3.0), _number_or_spread(0.1, 3.0)]
Breadth = Annotated[Spread, BeforeValidator(_as_mean), _within(0.3, 0.7), _number_or_spread(0.3, 0.7)]
Delay = Annotated[Spread, BeforeValidator(_as_mean), _within(0.0, 1e6), _number_or_spread(0.0, 1e6)]
