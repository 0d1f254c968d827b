"""What docs/captures.md shows runs as it stands there, and folders that runs refuse are refused by checks."""

import json
import re
import shutil
from pathlib import Path

import pytest

from crowdsim.library import library_folder

TEXT = (Path(__file__).parents[2] / "docs" / "captures.md").read_text(encoding="utf-8")
MINE = re.search(r"cat > mine.yaml <<'EOF'\n(.*?)^EOF$", TEXT, re.M | re.S)[1]


@pytest.fixture
def mine(tmp_path: Path) -> Path:
    """The files of the page, with three walks of the library as the captures."""
    (tmp_path / "my_captures").mkdir()
    for clip in ("walk_slow", "walk_long_start", "walk_left_10"):
        shutil.copy(library_folder("behaviors") / "frontal" / "clips" / f"{clip}.bvh", tmp_path / "my_captures")
    (tmp_path / "mine.yaml").write_text(MINE, encoding="utf-8")
    return tmp_path / "my_captures"


def test_everybody_of_the_page_arrives(mine: Path, crowdsim_here) -> None:
    # A file that cannot be read, and an ending in upper case, as cameras write it.
    (mine / "broken.bvh").write_text("HIERARCHY\n", encoding="utf-8")
    (mine / "walk_slow.bvh").rename(mine / "walk_slow.BVH")
    info = crowdsim_here("motion", "info", "my_captures")
    assert info.returncode == 0, info.stderr
    assert "file 'broken.bvh' is left out: MOTION is not followed by" in info.stdout
    assert "walk_slow.BVH" in info.stdout
    checked = crowdsim_here("check", "mine.yaml")
    assert checked.returncode == 0, checked.stderr
    assert "note: made of a cycle of clip" in checked.stdout
    finished = crowdsim_here("run", "mine.yaml", "-o", "mine.h5", "--json")
    assert finished.returncode == 0, finished.stderr
    assert json.loads(finished.stdout)["arrived"] == 6


def test_a_check_refuses_captures_as_a_run_does(mine: Path, crowdsim_here) -> None:
    for file in mine.iterdir():
        file.unlink()
    shutil.copy(library_folder("behaviors") / "frontal" / "clips" / "stand.bvh", mine)
    refused = [crowdsim_here(*command) for command in (("check", "mine.yaml"), ("run", "mine.yaml"))]
    assert [each.returncode for each in refused] == [2, 2]
    assert refused[0].stderr == refused[1].stderr
    assert "add a clip that walks straight on for four steps or more" in refused[0].stderr


def test_captures_in_folders_below_are_named(mine: Path, crowdsim_here) -> None:
    (mine / "one").mkdir()
    for file in list(mine.glob("*.bvh")):
        file.rename(mine / "one" / file.name)
    refused = crowdsim_here("check", "mine.yaml")
    assert refused.returncode == 2
    assert "there are some in its folders one: give one of these" in refused.stderr
