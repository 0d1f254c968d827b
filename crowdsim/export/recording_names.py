"""Names of recordings that a command may write."""

from __future__ import annotations

from pathlib import Path

from crowdsim.errors import CrowdSimError
from crowdsim.export.formats import FORMATS
from crowdsim.whole_files import require_writable

_OTHERS = frozenset({"yaml", "yml", "json", "png", "jpg", "jpeg", "svg", "pdf", "mp4"})
"""Endings of scenarios, schemas, pictures and films; those of exports come from the exports."""


def require_recording_name(file: Path) -> None:
    """Raise CrowdSimError if ``file`` cannot be written, or its ending is that of another kind of file.

    Programs would take such a recording for what it is not, and the page of ``--page`` or the scenario beside it could
    take its place.
    """
    ending = file.suffix.lower().removeprefix(".")
    if ending in FORMATS or ending in _OTHERS:
        named = file.with_suffix(".h5")
        then = f", and then: crowdsim export {named} -o {file}" if ending in FORMATS else ""
        raise CrowdSimError(f"{file}: a recording is an HDF5 file; name it {named}{then}")
    require_writable(file)


def require_not_the_scenario(file: Path, scenario: str) -> None:
    """Raise CrowdSimError if ``file``, to be written beside a recording, is the file of the ``scenario`` that runs."""
    source = Path(scenario)
    if source.is_file() and file.exists() and file.samefile(source):
        raise CrowdSimError(f"{file} is the scenario itself and would be replaced; give the recording another name")
