"""Entities as rows of columns: structure of arrays, in spawn order, with ids that are never reused."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from crowdsim.constants import NONE
from crowdsim.ecs.records import opaque


@dataclass(frozen=True)
class Column:
    """One component: a value of ``dtype`` and ``shape`` for each entity."""

    name: str
    dtype: DTypeLike
    shape: tuple[int, ...] = ()
    fill: Any = 0
    """Value at spawning, unless another one is given."""


class View:
    """Live rows of all columns as attributes: views, valid until rows are added or removed."""

    def __init__(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        self.__dict__.update(arrays)

    def __getattr__(self, name: str) -> NDArray[Any]:
        raise AttributeError(f"there is no column '{name}'")


class World:
    """Columns of equal length, one row (slot) per entity.

    Slots follow spawn order. Removing entities closes the gaps without reordering the others, so results computed slot
    by slot do not depend on removed entities. An entity is identified by its id, which counts up and is never reused;
    its slot changes when earlier entities are removed. Spawning and removing take effect with :meth:`apply_changes`, so
    that rows do not change during a stage of a step.

    Exceptions are :meth:`take_out` and :meth:`put_in`, with which the processes of one run hand agents over: they take
    effect at once, and change the order of rows. Call them between two stages, and get new views afterwards.

    Parameters
    ----------
    columns : sequence of Column
        The components, in addition to ``id``.
    capacity : int
        Rows for which memory is allocated at first, at least 1; it doubles when they are used up.

    Raises
    ------
    ValueError
        If two columns have the same name, or one is called ``id``.
    """

    def __init__(self, columns: Sequence[Column], capacity: int = 64) -> None:
        names = [column.name for column in columns]
        if len(set(names)) != len(names) or "id" in names:
            raise ValueError("column names must differ from each other and from 'id'")
        self._columns = (Column("id", np.int64, (), NONE), *columns)
        self._arrays = {c.name: np.full((capacity, *c.shape), c.fill, c.dtype) for c in self._columns}
        self._capacity = capacity
        self._spawning: list[tuple[NDArray[np.int64], dict[str, Any]]] = []
        self._removing: list[NDArray[np.int64]] = []
        self._next_id = 0
        self.count = 0
        """Number of live rows."""

    @property
    def column_names(self) -> tuple[str, ...]:
        """Return the names of all columns, ``id`` first."""
        return tuple(column.name for column in self._columns)

    @property
    def bytes_an_entity(self) -> int:
        """Return the memory of one row of all columns [bytes]."""
        return sum(array.dtype.itemsize * int(np.prod(array.shape[1:])) for array in self._arrays.values())

    def column(self, name: str) -> NDArray[Any]:
        """Return a writable view of the live rows of one column."""
        return self._arrays[name][: self.count]

    def view(self) -> View:
        """Return views of the live rows of all columns."""
        return View({name: array[: self.count] for name, array in self._arrays.items()})

    def spawn(self, **values: Any) -> int:
        """Request a new entity and return its id; its row is added by :meth:`apply_changes`.

        ``values`` are those of some columns, of the columns' shapes; the others get their ``fill``.
        """
        return int(self.spawn_many(1, **{name: np.asarray(value)[None] for name, value in values.items()})[0])

    def spawn_many(self, count: int, here: NDArray[np.bool_] | None = None, **values: Any) -> NDArray[np.int64]:
        """Request ``count`` new entities and return their ids (count,) int64; rows are added by :meth:`apply_changes`.

        Parameters
        ----------
        count : int
            Number of entities.
        here : (count,) bool, optional
            Which of them get a row; the ids of the others are used up, as another world has them.
        **values : (count, ...) arrays or scalars
            Values of some columns; the others get their ``fill``.

        Raises
        ------
        KeyError
            If there is no such column.
        """
        unknown = values.keys() - set(self.column_names)
        if unknown:
            raise KeyError(f"no column named {', '.join(sorted(unknown))}")
        entities = np.arange(self._next_id, self._next_id + count, dtype=np.int64)
        self._next_id += count
        if here is None:
            self._spawning.append((entities, values))
        else:
            given = {name: np.asarray(value)[here] if np.ndim(value) else value for name, value in values.items()}
            self._spawning.append((entities[here], given))
        return entities

    def remove(self, *entities: int) -> None:
        """Request the removal of entities by :meth:`apply_changes`."""
        self._removing.append(np.array(entities, np.int64))

    @property
    def dtype(self) -> np.dtype[Any]:
        """Return the dtype of a record with all columns of a row."""
        return np.dtype([(c.name, c.dtype, c.shape) for c in self._columns])

    def records(self, rows: NDArray[np.int64]) -> NDArray[Any]:
        """Return all columns of the rows with numbers ``rows`` (k,) as records (k,)."""
        found = np.zeros(len(rows), self.dtype)
        for column in self._columns:
            found[column.name] = self._arrays[column.name][rows]
        return found

    def take_out(self, rows: NDArray[np.int64]) -> None:
        """Remove rows (k,) at once; the last rows fill the gaps, so that the order of the others changes.

        ``rows`` are numbers of live rows, each once. Views taken before are no longer valid.
        """
        # ``kept`` rows stay. As many of the rows from there on stay as rows before it go: they fill the gaps.
        kept = self.count - len(rows)
        gaps = rows[rows < kept]
        last = np.setdiff1d(np.arange(kept, self.count), rows)
        # Records are copied as plain bytes (`opaque`), which is faster.
        for array in map(opaque, self._arrays.values()):
            array[gaps] = array[last]
        self.count = kept

    def put_in(self, records: NDArray[Any]) -> None:
        """Append rows at once, with the ids that they have: ``records`` (k,) as :meth:`records` returns them."""
        end = self.count + len(records)
        while end > self._capacity:
            self._grow()
        for column in self._columns:
            self._arrays[column.name][self.count : end] = records[column.name]
        self.count = end

    def apply_changes(self) -> None:
        """Remove, then add, the rows requested since the last call; an entity without a row yet is not removed."""
        if self._removing:
            # Close the gaps; the remaining rows keep their order. Records are copied as plain bytes (`opaque`).
            keep = ~np.isin(self.column("id"), np.concatenate(self._removing))
            kept = int(keep.sum())
            for array in map(opaque, self._arrays.values()):
                array[:kept] = array[: self.count][keep]
            self.count = kept
            self._removing.clear()
        for entities, values in self._spawning:
            # Append the new rows in the order of their requests.
            end = self.count + len(entities)
            while end > self._capacity:
                self._grow()
            for column in self._columns:
                self._arrays[column.name][self.count : end] = values.get(column.name, column.fill)
            self._arrays["id"][self.count : end] = entities
            self.count = end
        self._spawning.clear()

    def _grow(self) -> None:
        """Double the memory of all columns."""
        self._capacity *= 2
        for column in self._columns:
            grown = np.full((self._capacity, *column.shape), column.fill, column.dtype)
            grown[: self.count] = self._arrays[column.name][: self.count]
            self._arrays[column.name] = grown
