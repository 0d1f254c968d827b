"""BVH files that others write, and such that no one should."""

from pathlib import Path

import numpy as np
import pytest

from crowdsim.errors import MotionError
from crowdsim.library import library_folder
from crowdsim.motion.captures.bvh import parse_bvh

CLIP = library_folder("behaviors") / "frontal" / "clips" / "stand.bvh"


def written(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "clip.bvh"
    path.write_text(text)
    return path


@pytest.mark.parametrize("lines", [1, 2])
def test_a_file_in_one_line_is_as_good_as_any(tmp_path, lines):
    text = CLIP.read_text()
    head, _, rest = text.partition("MOTION")
    joined = " ".join(head.split()) + ("\n" if lines == 2 else " ") + "MOTION " + " ".join(rest.split())
    raw, expected = parse_bvh(written(tmp_path, joined)), parse_bvh(CLIP)
    assert raw.names == expected.names
    assert raw.rate == expected.rate
    np.testing.assert_array_equal(raw.rotations, expected.rotations)


def test_braces_that_do_not_match_are_refused(tmp_path):
    text = CLIP.read_text()
    with pytest.raises(MotionError, match="not closed"):
        parse_bvh(written(tmp_path, text.replace("}\nMOTION", "\nMOTION", 1)))
    with pytest.raises(MotionError, match="not opened"):
        parse_bvh(written(tmp_path, text.replace("MOTION", "}\nMOTION", 1)))


@pytest.mark.parametrize("seconds", ["1e9", "1e-9"])
def test_rates_that_no_capture_has_are_refused(tmp_path, seconds):
    lines = [f"Frame Time: {seconds}" if "Frame Time" in line else line for line in CLIP.read_text().splitlines()]
    with pytest.raises(MotionError, match="frames a second; captures have"):
        parse_bvh(written(tmp_path, "\n".join(lines) + "\n"))


def test_devices_are_refused(tmp_path):
    (tmp_path / "endless.bvh").symlink_to("/dev/zero")
    with pytest.raises(MotionError, match="no regular file"):
        parse_bvh(tmp_path / "endless.bvh")
