"""Fixtures that several test folders use."""

import gc
import os
import signal
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import settings

ROOT = Path(__file__).parents[1]

# The first example compiles kernels, so none is timed. No random seed: examples follow from the code alone.
settings.register_profile("crowdsim", deadline=None, derandomize=True)
settings.load_profile("crowdsim")

LONGEST = (
    "integration/test_readme.py",
    "integration/test_numba_versions.py",
    "integration/test_typed_examples.py",
    "integration/test_sweeps.py",
    "integration/test_ranks.py",
    "integration/test_live.py",
    "integration/test_capture_folders.py",
    "integration/test_random_commands.py",
    "unit/bench/test_driven.py",
    "unit/bench/test_studies.py",
    "unit/bench/test_film.py",
    "integration/test_same_bits.py",
)
"""Test files that take longest. They go first: one at the end would run alone while all other processes are done."""


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Put the tests of the longest files first; all others stay in their order."""
    first = {ROOT / "tests" / name: number for number, name in enumerate(LONGEST)}
    assert not [file for file in first if not file.is_file()], "files of LONGEST that are not there"
    items.sort(key=lambda item: first.get(item.path, len(first)))


def pytest_collection_finish() -> None:
    """Let the garbage collector look at what tests make, not at nine thousand tests and all modules again and again."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(50_000, 20, 20)  # as the command line does


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


@pytest.fixture(scope="session", autouse=True)
def motion_read_once() -> Iterator[None]:
    """Runs of this process share built-in motion, which takes longer to read than most of them take to walk."""
    from crowdsim.crowd.state import assets
    from tests.support.shared_motion import SharedMotion

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(assets, "load_behavior_set", SharedMotion())
        yield


@pytest.fixture
def own_motion(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each run of the test reads its motion, as in a process of its own."""
    from crowdsim.behaviors.library import load_behavior_set
    from crowdsim.crowd.state import assets

    monkeypatch.setattr(assets, "load_behavior_set", load_behavior_set)
