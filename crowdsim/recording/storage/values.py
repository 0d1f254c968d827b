"""Read whole datasets, and name those that are damaged; the packing that lets HDF5 notice damage."""

from __future__ import annotations

from typing import Any

import h5py

from crowdsim.errors import RecordingError

PACKED = {"compression": "gzip", "compression_opts": 1, "shuffle": True, "fletcher32": True}
"""Packing of columns and larger arrays, with a checksum of each chunk."""

PACKED_TEXTS = {**PACKED, "fletcher32": False}
"""Packing of columns of strings, which HDF5 keeps outside of their chunks and has no checksum for."""

PACKED_QUICKLY = {**PACKED, "compression": "lzf", "compression_opts": None}
"""Packing of steps of steered crowds: larger than gzip but faster. Other programs may lack this filter. See
docs/recordings.md."""


def values_of(group: h5py.Group, name: str) -> Any:
    """Return all values of a dataset, strings as str; raise RecordingError that names it if they cannot be read."""
    dataset = group[name]
    try:
        return dataset.asstr()[()] if h5py.check_string_dtype(dataset.dtype) else dataset[()]
    except (OSError, RuntimeError, MemoryError) as error:
        raise RecordingError(f"{group.name.strip('/')}/{name}: {error}") from None
