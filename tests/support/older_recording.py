"""Recordings as they were before they had checksums."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py


def make_older(path: Path) -> Path:
    """Remove all checksums of a recording."""
    with h5py.File(path, "r+", locking=False) as file:
        names: list[str] = []
        file.visititems(lambda name, item: names.append(name) if _is_checked(item) else None)
        for name in names:
            values, attributes = file[name][()], dict(file[name].attrs)
            del file[name]
            file.create_dataset(name, data=values, compression="gzip", shuffle=True)
            file[name].attrs.update(attributes)
    return path


def _is_checked(item: Any) -> bool:
    return isinstance(item, h5py.Dataset) and item.fletcher32
