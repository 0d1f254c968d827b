"""Keys of a scenario file about the characters: who walks from where to where, and how they move."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import ConfigDict, Field, model_validator

from crowdsim.scenario.values import FileText, Name, Part, Region, Seconds, one_of


class Motion(Part):
    """Where movement comes from: a built-in set, or captures in a folder beside the scenario file."""

    model_config = ConfigDict(json_schema_extra=one_of(("set",), ("captures",)))
    set: Literal["default"] | None = None
    captures: FileText | None = None
    clips: Annotated[tuple[FileText, ...], Field(strict=False, min_length=1)] = ("*.bvh",)

    @model_validator(mode="after")
    def _check(self) -> Motion:
        if self.only("set", "captures") == "set" and "clips" in self.model_fields_set:
            raise ValueError("'clips' chooses among captures; give 'captures' with it, or drop it")
        return self


class AgentGroup(Part):
    """Characters with one start and one goal; ``interval`` seconds pass between the starts of one and the next."""

    name: Name
    count: Annotated[int, Field(ge=1, le=100_000)]
    start: Region
    goal: Region
    start_time: Seconds = 0.0
    interval: Seconds = 0.0
    on_arrival: Literal["leave", "stay"] = "leave"
