"""Systems in their order, each with the columns it may read and write."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from crowdsim.ecs.world import View, World


@dataclass(frozen=True)
class System:
    """A stage of the step: ``run(view)`` sees only the columns named here."""

    name: str
    run: Callable[[View], None]
    reads: tuple[str, ...] = ()
    writes: tuple[str, ...] = ()


class Schedule:
    """Runs systems one after another; entities come and go only between two of them."""

    def __init__(self, world: World, systems: Sequence[System]) -> None:
        known = set(world.column_names)
        for system in systems:
            unknown = (set(system.reads) | set(system.writes)) - known
            if unknown:
                raise KeyError(f"system '{system.name}' declares no such column: {', '.join(sorted(unknown))}")
        self._world = world
        self.systems = tuple(systems)

    def run(self) -> None:
        """One step."""
        for system in self.systems:
            system.run(self._world.view(system.reads, system.writes))
            self._world.apply_changes()
