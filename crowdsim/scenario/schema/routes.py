"""Keys of a scenario file about routes: places that characters come by on the way to their goal."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from crowdsim.scenario.schema.values import Name, Part, Region


class Route(Part):
    """Points and regions with a name, to be visited ``through`` one after another."""

    name: Name
    through: Annotated[tuple[Region, ...], Field(strict=False, min_length=1, max_length=1000)]
