"""What is missing for runs on several processes is named, with what to do."""

import sys
from pathlib import Path

import pytest

from crowdsim.crowd.ranks import launch


@pytest.mark.parametrize(
    ("script", "told"),
    [
        ("echo no slots >&2; exit 3", "does not start two processes: no slots"),
        ("exit 3", "does not start two processes: exit code 3"),
        # That of another library starts processes which do not know of each other.
        ("printf '1\\tLibrary 1.0\\n1\\tLibrary 1.0\\n'", "is not that of the library that mpi4py loads (Library 1.0)"),
    ],
)
def test_an_mpiexec_that_does_not_work_is_named(tmp_path: Path, monkeypatch, script: str, told: str) -> None:
    mpiexec = tmp_path / "mpiexec"
    mpiexec.write_text(f"#!/bin/sh\n{script}\n")
    mpiexec.chmod(0o755)
    monkeypatch.setattr(launch, "find_mpiexec", lambda: str(mpiexec))
    found = launch.try_mpi()
    assert found.library is None
    assert found.remedy is not None
    assert f"{mpiexec} {told}" in found.remedy


def test_what_is_missing_is_named(monkeypatch) -> None:
    monkeypatch.setattr(launch, "find_mpiexec", lambda: None)
    assert launch.try_mpi().remedy == f"mpiexec is missing; for runs on several processes: {launch.INSTALL}"
    monkeypatch.setattr(launch, "find_mpiexec", lambda: sys.executable)
    monkeypatch.setattr(launch, "find_spec", lambda name: None)
    assert launch.try_mpi().remedy == f"mpi4py is missing; for runs on several processes: {launch.INSTALL}"
