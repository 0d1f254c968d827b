"""Quantities that differ between agents: a number, a distribution within bounds, or a mix of distributions."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import AfterValidator, BeforeValidator, ConfigDict, Field, WithJsonSchema, model_validator

from crowdsim.scenario.schema.populations import POPULATIONS
from crowdsim.scenario.schema.values import Part

Finite = Annotated[float, Field(allow_inf_nan=False, ge=-1e6, le=1e6)]
Positive = Annotated[float, Field(allow_inf_nan=False, gt=0.0, le=1e6)]

KINDS = ("mean", "uniform", "lognormal", "gamma", "weibull", "mix", "table")
"""Keys that choose the distribution, exactly one each; ``mean`` stands for a normal distribution."""


class LogNormal(Part):
    """A lognormal distribution: the logarithm has mean ``mu`` and standard deviation ``sigma``."""

    mu: Annotated[float, Field(allow_inf_nan=False, ge=-100.0, le=100.0, description="mean of the logarithm")]
    sigma: Annotated[
        float, Field(allow_inf_nan=False, gt=0.0, le=10.0, description="standard deviation of the logarithm")
    ]


class Shaped(Part):
    """Parameters of a gamma or a Weibull distribution."""

    shape: Annotated[float, Field(allow_inf_nan=False, ge=0.05, le=1e4, description="shape parameter")]
    scale: Annotated[Positive, Field(description="scale parameter, in the unit of the quantity")]


class Spread(Part):
    """The distribution of a quantity among agents.

    Normal with ``mean`` and standard deviation ``sd``; or ``uniform`` between two values, ``lognormal``, ``gamma`` or
    ``weibull``; or a ``mix`` of such distributions, each with its ``share``; or a built-in ``table`` by age and sex.
    The distribution is truncated to [``min``, ``max``]. ``stratified``: one value from each of as many equally probable
    intervals as there are agents, so that even a few agents have the distribution.
    """

    model_config = ConfigDict(json_schema_extra={"oneOf": [{"required": [kind]} for kind in KINDS]})
    mean: Annotated[Finite | None, Field(description="mean of a normal distribution")] = None
    sd: Annotated[Finite, Field(ge=0.0, description="its standard deviation")] = 0.0
    uniform: Annotated[
        Annotated[tuple[Finite, Finite], Field(strict=False)] | None,
        Field(description="least and greatest value, all between as likely"),
    ] = None
    lognormal: Annotated[LogNormal | None, Field(description="log-normal distribution")] = None
    gamma: Annotated[Shaped | None, Field(description="gamma distribution")] = None
    weibull: Annotated[Shaped | None, Field(description="Weibull distribution")] = None
    mix: Annotated[
        Annotated[tuple[Share, ...], Field(strict=False, min_length=1, max_length=100)] | None,
        Field(description="several distributions, each with its share"),
    ] = None
    table: Annotated[str | None, Field(description="distribution published by age and sex")] = None
    min: Annotated[Finite | None, Field(description="no value below is drawn")] = None
    max: Annotated[Finite | None, Field(description="no value above is drawn")] = None
    stratified: Annotated[bool, Field(description="one value of each equally probable part of the distribution")] = (
        False
    )

    @model_validator(mode="after")
    def _check(self) -> Spread:
        """Refuse parameters that belong to other kinds of distributions, and bounds out of order."""
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
        """Return the key of :data:`KINDS` that is given."""
        return self.only(*self._kinds())

    def _kinds(self) -> tuple[str, ...]:
        """Return the keys of which exactly one gives the distribution; models with more kinds add theirs."""
        return KINDS

    def parts(self) -> tuple[Share, ...]:
        """Return the parts of a mix or a table, each with its share; empty for any other kind."""
        if self.table is not None:
            return tuple(Share(share=share, uniform=band) for _, share, band in POPULATIONS[self.table])
        return self.mix or ()


class Share(Spread):
    """A part of a mix; its ``share`` counts relative to the other shares."""

    share: Annotated[Positive, Field(description="share of the agents, against the other shares")]


Spread.model_rebuild()


def _as_mean(value: Any) -> Any:
    """Return the distribution that a plain number stands for; any other value as it is."""
    return {"mean": value} if isinstance(value, int | float) and not isinstance(value, bool) else value


def _within(least: float, most: float) -> Any:
    """Return a validator that keeps a spread within ``least`` to ``most``, which are its bounds if it has none."""

    def check(name: str, value: float) -> None:
        """Raise ValueError if a value is out of bounds; ``name`` is its key."""
        if not least <= value <= most:
            raise ValueError(f"'{name}' must be from {least:g} to {most:g}, got {value:g}")

    def bounded(spread: Spread) -> Spread:
        """Return the spread, and those that it mixes, with ``least`` and ``most`` as bounds, unless it has its own.

        Raise ValueError if its mean, its uniform range or its own bounds lie outside of ``least`` to ``most``. Draws of
        other distributions are truncated to the bounds.
        """
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


def spread_schema(number: dict[str, Any], model: type[Spread] = Spread, **more: dict[str, Any]) -> dict[str, Any]:
    """Return the JSON schema of a distribution of numbers, each with the JSON schema ``number``.

    ``more`` holds JSON schemas of further kinds that ``model`` has, by their keys.
    """
    positive = {"type": "number", "exclusiveMinimum": 0.0}

    def mapping(model: type[Part], required: tuple[str, ...], **keys: Any) -> dict[str, Any]:
        """Return the JSON schema of a mapping with the ``required`` keys.

        ``keys`` are the schemas of its keys, to which their descriptions in ``model`` are added.
        """
        described = {key: {**value, "description": model.model_fields[key].description} for key, value in keys.items()}
        return {"type": "object", "properties": described, "required": list(required), "additionalProperties": False}

    shaped = mapping(Shaped, ("shape", "scale"), shape=positive, scale=positive)
    kinds: dict[str, Any] = {
        "mean": number,
        "uniform": {"type": "array", "items": number, "minItems": 2, "maxItems": 2},
        "lognormal": mapping(LogNormal, ("mu", "sigma"), mu={"type": "number"}, sigma=positive),
        "gamma": shaped,
        "weibull": shaped,
        "table": {"enum": list(POPULATIONS)},
    }
    rest = {"sd": {"type": "number", "minimum": 0.0}, "min": number, "max": number}
    share = mapping(Share, ("share",), share=positive, **kinds, **rest)
    kinds["mix"] = {"type": "array", "items": share, "minItems": 1}
    spread = mapping(model, (), **kinds, **more, **rest, stratified={"type": "boolean"})
    del spread["required"]
    spread["oneOf"] = [{"required": [kind]} for kind in (*KINDS, *more)]
    return spread


def _number_or_spread(least: float, most: float) -> Any:
    """Return the JSON schema of a number from ``least`` to ``most``, or a distribution of such numbers."""
    number = {"type": "number", "minimum": least, "maximum": most}
    return WithJsonSchema({"anyOf": [number, spread_schema(number)]})


LEAST_SPEED, MOST_SPEED = 0.1, 3.0
"""Bounds of the speeds at which agents walk if nothing is in the way [m/s]."""

WalkingSpeed = Annotated[
    Spread,
    BeforeValidator(_as_mean),
    _within(LEAST_SPEED, MOST_SPEED),
    _number_or_spread(LEAST_SPEED, MOST_SPEED),
]
Breadth = Annotated[Spread, BeforeValidator(_as_mean), _within(0.3, 0.7), _number_or_spread(0.3, 0.7)]
Delay = Annotated[Spread, BeforeValidator(_as_mean), _within(0.0, 1e6), _number_or_spread(0.0, 1e6)]
