"""Folders of captures as the sources of one motion graph."""

from __future__ import annotations

import pytest

from crowdsim.errors import MotionError
from crowdsim.motion.analysis.capture_sets import read_folder


def test_no_captures_are_named() -> None:
    with pytest.raises(MotionError, match="no captures are given"):
        read_folder([])
