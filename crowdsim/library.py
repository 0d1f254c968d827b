"""Where the behavior and scenario libraries are: beside the package in a checkout, inside it in a wheel."""

from __future__ import annotations

from pathlib import Path

_PACKAGE = Path(__file__).parent


def library_folder(name: str) -> Path:
    """Folder of the built-in library ``name`` (``"behaviors"`` or ``"scenarios"``)."""
    installed = _PACKAGE / "library" / name
    return installed if installed.is_dir() else _PACKAGE.parent / name
