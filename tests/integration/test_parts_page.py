"""What docs/parts.md shows runs as it stands there, block after block."""

from pathlib import Path

import pytest

from tests.support.doc_blocks import printed_by


def test_blocks_run_in_order(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert printed_by("parts.md") == [
        "10.78 m, clearance 0.30 m in the gap",
        "10.81 m around the crate",
        "['frontal', 'lateral', 'frontal']",
        "10.94 m, at most 4 % above the cheapest there can be",
        "97 nodes, 238572 branches",
        "FOUND after 10.7 m with 12 nodes",
    ]
