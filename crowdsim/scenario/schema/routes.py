"""Keys of a scenario file for routes: places that agents pass on the way to their goal."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from crowdsim.scenario.schema.values import Name, Part, Region


class Route(Part):
    """Named points and regions to be passed ``through`` one after another."""

    name: Annotated[Name, Field(description="unique among routes")]
    through: Annotated[
        tuple[Region, ...],
        Field(strict=False, min_length=1, max_length=1000, description="places to come by, one after another"),
    ]
