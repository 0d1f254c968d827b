"""What docs/python.md shows runs as it stands there, block after block."""

from pathlib import Path

import pytest

from tests.support.doc_blocks import printed_by


def test_blocks_run_in_order(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert printed_by("python.md") == [
        "6 of 6 arrive",
        "6 of 6 arrive",
        "1 of 1 arrives with seed 1",
        "1 of 1 arrives with seed 2",
        "3 in the world after 4.0 s",
        "[0 1 2] [3] [1 2 3]",
        "True (4, 4)",
        "True",
    ]
