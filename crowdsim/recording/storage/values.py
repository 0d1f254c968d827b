"""Read whole datasets, and name those that are damaged; packings of datasets, with checksums if HDF5 has them."""

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
    """Return all values of a dataset, texts as str; raise RecordingError with its name if they cannot be read."""
    dataset = group[name]
    try:
        return dataset.asstr()[()] if h5py.check_string_dtype(dataset.dtype) else dataset[()]
    # h5py raises OSError for a chunk that cannot be read or whose checksum is wrong, RuntimeError for other errors of
    # HDF5, MemoryError for a damaged size, and ValueError for text that is not UTF-8.
    except (OSError, RuntimeError, MemoryError, ValueError) as error:
        raise RecordingError(f"{group.name.strip('/')}/{name}: {error}") from None
