"""Find the folders of the built-in behaviors and scenarios: beside the package in a checkout, inside it in a wheel."""

from __future__ import annotations

from pathlib import Path

_PACKAGE = Path(__file__).parent


def library_folder(name: str) -> Path:
    """Return the folder of the built-in library ``name``, either ``"behaviors"`` or ``"scenarios"``."""
    installed = _PACKAGE / "library" / name
    return installed if installed.is_dir() else _PACKAGE.parent / name
