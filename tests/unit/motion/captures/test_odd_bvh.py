"""BVH files that are odd: read right, or refused with an error that names the file; never read wrong."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

from crowdsim.errors import MotionError
from crowdsim.motion.captures.bvh import parse_bvh
from crowdsim.motion.captures.raw_motion import RawMotion

TEXT = """\
HIERARCHY
ROOT Hips
{
  OFFSET 0.0 0.0 0.0
  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
  JOINT LeftUpLeg
  {
    OFFSET 0.09 0.0 0.0
    CHANNELS 3 Zrotation Xrotation Yrotation
    End Site
    {
      OFFSET 0.0 -0.45 0.0
    }
  }
  JOINT RightUpLeg
  {
    OFFSET -0.09 0.0 0.0
    CHANNELS 3 Zrotation Xrotation Yrotation
    End Site
    {
      OFFSET 0.0 -0.45 0.0
    }
  }
}
MOTION
Frames: 3
Frame Time: 0.0333333
0.0 0.9 0.0 0 0 0 0 10 0 0 -10 0
0.0 0.9 0.1 0 0 0 0 0 0 0 0 0
0.0 0.9 0.2 0 0 0 0 -10 0 0 10 0
"""
HEAD, _, MOTION = TEXT.partition("MOTION")
END_SITE = "    End Site\n    {\n      OFFSET 0.0 -0.45 0.0\n    }\n"


def changed(old: str, new: str, count: int = -1) -> bytes:
    assert old in TEXT
    return TEXT.replace(old, new, count).encode()


def nested(depth: int) -> bytes:
    """A chain of so many joints."""
    begin = "".join(
        f"JOINT j{k}\n{{\nOFFSET 0 -0.01 0\nCHANNELS 3 Zrotation Xrotation Yrotation\n" for k in range(depth)
    )
    hips = "ROOT Hips\n{\nOFFSET 0 0 0\nCHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation\n"
    end = "End Site\n{\nOFFSET 0 -0.1 0\n}\n" + "}\n" * (depth + 1)
    row = " ".join(["0"] * (6 + 3 * depth))
    return f"HIERARCHY\n{hips}{begin}{end}MOTION\nFrames: 2\nFrame Time: 0.0333333\n{row}\n{row}\n".encode()


READ = {
    "line ends of old Macs": TEXT.replace("\n", "\r").encode(),
    "line ends of Windows": TEXT.replace("\n", "\r\n").encode(),
    "tabs": TEXT.replace("  ", "\t").replace(" ", "\t").replace("End\tSite", "End Site").encode(),
    "blank lines": TEXT.replace("\n", "\n\n").encode(),
    "trailing blanks": TEXT.replace("\n", "  \n").encode(),
    "no last line end": TEXT.rstrip("\n").encode(),
    "byte order mark": b"\xef\xbb\xbf" + TEXT.encode(),
    "one line": " ".join(TEXT.split()).encode(),
    "brace on the line of its joint": TEXT.replace("\n{", " {").replace("\n  {", " {").encode(),
    "offset on the line of its brace": TEXT.replace("{\n", "{ ").encode(),
    "rows over lines": (HEAD + "MOTION" + MOTION.replace(" 0 0 0 0 0 0\n", " 0 0 0\n0 0 0\n")).encode(),
    "all rows on one line": (HEAD + "MOTION" + MOTION.replace("0 0\n", "0 0 ").replace("10 0\n", "10 0 ")).encode(),
    "exponents": changed("0.9", "9E-1"),
    "signs and bare points": changed("0.9", "+.9"),
    "no blank after a colon": changed("Frames: 3", "Frames:3").replace(b"Time: ", b"Time:"),
}
"""Files that say the same as TEXT."""

REFUSED = {
    "nothing": b"",
    "blanks": b" \n \n",
    "another format": b'{"frames": 3}\n',
    "two bytes a letter": TEXT.encode("utf-16"),
    "zero bytes": TEXT.encode().replace(b"Hips", b"Hi\0ps").replace(b"0.9", b"\0"),
    "no HIERARCHY": changed("HIERARCHY\n", ""),
    "no MOTION": changed("MOTION\n", ""),
    "no hierarchy at all": ("HIERARCHY\nMOTION" + MOTION).encode(),
    "no Frames": changed("Frames: 3\n", ""),
    "no frame time": changed("Frame Time: 0.0333333\n", ""),
    "motion twice": (TEXT + "MOTION" + MOTION).encode(),
    "two roots": (HEAD + HEAD.partition("\n")[2] + "MOTION" + MOTION).encode(),
    "root is a joint": changed("ROOT", "JOINT"),
    "joint without a name": changed("JOINT LeftUpLeg", "JOINT"),
    "joint without an offset": changed("    OFFSET 0.09 0.0 0.0\n", ""),
    "joint without channels": changed("    CHANNELS 3 Zrotation Xrotation Yrotation\n", "", 1),
    "no brace after a joint": changed("JOINT LeftUpLeg\n  {", "JOINT LeftUpLeg\n"),
    "a brace too many": changed("MOTION", "}\nMOTION"),
    "a brace too few": changed("}\nMOTION", "\nMOTION"),
    "braces turned round": changed("ROOT Hips\n{", "ROOT Hips\n}"),
    "two numbers in an offset": changed("OFFSET 0.09 0.0 0.0", "OFFSET 0.09 0.0"),
    "four numbers in an offset": changed("OFFSET 0.09 0.0 0.0", "OFFSET 0.09 0.0 0.0 0.0"),
    "offset that is no number": changed("0.09 0.0 0.0", "0.09 0.0 up"),
    "offset that is infinite": changed("0.09 0.0 0.0", "0.09 0.0 inf"),
    "fewer channels than told": changed(
        "CHANNELS 3 Zrotation Xrotation Yrotation", "CHANNELS 3 Zrotation Xrotation", 1
    ),
    "more channels than told": changed("CHANNELS 3 Zro", "CHANNELS 3 Xposition Zro", 1),
    "a channel twice": changed("3 Zrotation Xrotation Yrotation", "3 Zrotation Zrotation Yrotation", 1),
    "an unknown channel": changed("3 Zrotation", "3 Wrotation", 1),
    "channels that are no number": changed("CHANNELS 3", "CHANNELS three", 1),
    "fewer than no channels": changed("CHANNELS 3", "CHANNELS -3", 1),
    "frames below zero": changed("Frames: 3", "Frames: -3"),
    "half a frame": changed("Frames: 3", "Frames: 2.5"),
    "more rows than frames": changed("Frames: 3", "Frames: 2"),
    "fewer rows than frames": changed("Frames: 3", "Frames: 4"),
    "frames that are no number": changed("Frames: 3", "Frames: three"),
    "a time of zero": changed("0.0333333", "0"),
    "a time below zero": changed("0.0333333", "-0.0333333"),
    "a time that is no number": changed("0.0333333", "nan"),
    "a time without end": changed("0.0333333", "inf"),
    "one value too many in a row": changed("10 0 0 -10 0\n", "10 0 0 -10 0 0\n"),
    "one value too few in a row": changed("10 0 0 -10 0\n", "10 0 0 -10\n"),
    "a value from row to row": changed("10 0 0 -10 0\n", "10 0 0 -10\n").replace(b"0.0 0.9 0.1", b"0 0.0 0.9 0.1"),
    "a value that is infinite": changed("0.9 0.1", "inf 0.1"),
    "a value beyond all numbers": changed("0.9 0.1", "1e400 0.1"),
    "a value in other digits": changed("0.9 0.1", "0x1 0.1"),
    "a value with a blank inside": changed("0.9 0.1", "0 .9 0.1"),
    "a value with an underscore": changed("0.9 0.1", "1_0 0.1"),
    "a minus of typographers": changed("-10 0\n", "\u221210 0\n"),
    "words after the rows": (TEXT + "end of file\n").encode(),
    "a chain of 20,000 joints": nested(20_000),
}

EITHER = {
    "no end site": changed(END_SITE, "", 1),
    "words of small letters": changed("OFFSET", "offset"),
    "a name with a blank": changed("LeftUpLeg", "Left Up Leg"),
    "a name of other letters": changed("LeftUpLeg", "ЛеваяНога"),
    "a comment": ("# made by hand\n" + TEXT).encode(),
    "a chain of 150 joints": nested(150),
}
"""Read, or refused with a typed error."""


def parsed(tmp_path: Path, content: bytes) -> RawMotion:
    path = tmp_path / "clip.bvh"
    path.write_bytes(content)
    return parse_bvh(path)


@pytest.mark.parametrize("name", READ)
def test_odd_files_are_read_right(tmp_path: Path, name: str) -> None:
    expected, found = parsed(tmp_path, TEXT.encode()), parsed(tmp_path, READ[name])
    assert found.names == expected.names
    assert found.rate == expected.rate == 30.0
    for part in ("parents", "offsets", "end_parents", "end_offsets", "root_positions", "rotations"):
        np.testing.assert_array_equal(getattr(found, part), getattr(expected, part), part)


@pytest.mark.parametrize("name", REFUSED)
def test_wrong_files_are_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(MotionError, match=r"clip\.bvh: \w"):
        parsed(tmp_path, REFUSED[name])


@pytest.mark.parametrize("name", EITHER)
def test_others_are_read_or_refused(tmp_path: Path, name: str) -> None:
    with suppress(MotionError):  # of its type; any other error fails
        found = parsed(tmp_path, EITHER[name])
        assert np.isfinite(found.rotations).all()
        assert len(found.rotations) in (2, 3)
