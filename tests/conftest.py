"""Fixtures that several test folders use."""

import os
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="session")
def shared() -> Path:
    """The folder of real captures, worlds and oracles; tests that need it skip where it is absent."""
    folder = Path(os.environ.get("CROWDSIM_SHARED", ROOT.parent / "shared"))
    if not folder.is_dir():
        pytest.skip(f"the reference data folder {folder} is absent")
    return folder
