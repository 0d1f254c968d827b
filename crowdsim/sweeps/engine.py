"""Name the code that runs points, so that a sweep never mixes results of two states of it."""

from __future__ import annotations

import hashlib
from functools import cache
from pathlib import Path

import crowdsim
from crowdsim.library import library_folder
from crowdsim.version import __version__


@cache
def engine() -> str:
    """Return the version of crowdsim, and a hash of its code and of the built-in behaviors."""
    package, behaviors = Path(crowdsim.__file__).parent, library_folder("behaviors")
    files = [(f"code/{file.relative_to(package).as_posix()}", file) for file in package.rglob("*.py")]
    files += [(f"behaviors/{file.relative_to(behaviors).as_posix()}", file) for file in behaviors.rglob("*.*")]
    digest = hashlib.sha256()
    for name, file in sorted(files):
        if file.is_file():
            content = file.read_bytes()
            digest.update(f"{name} {len(content)} ".encode() + content)
    return f"{__version__} {digest.hexdigest()[:16]}"
