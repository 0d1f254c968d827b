"""Fixtures that several test folders use."""

import os
import signal
from pathlib import Path

import pytest
from hypothesis import settings

ROOT = Path(__file__).parents[1]

# The first example compiles kernels, so none is timed. No random seed: examples follow from the code alone.
settings.register_profile("crowdsim", deadline=None, derandomize=True)
settings.load_profile("crowdsim")


def pytest_configure() -> None:
    """Heed Ctrl-C, as tests send it to themselves and to commands: a shell's background job would ignore it."""
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(scope="session")
def shared() -> Path:
    """The folder of real captures, worlds and oracles; tests that need it skip where it is absent."""
    folder = Path(os.environ.get("CROWDSIM_SHARED", ROOT.parent / "shared"))
    if not folder.is_dir():
        pytest.skip(f"the reference data folder {folder} is absent")
    return folder
