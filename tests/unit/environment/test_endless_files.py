"""Files that are none: devices, pipes, and areas with holes beside them."""

import os

import pytest

from crowdsim.environment.floor_plans import read_floor_plan
from crowdsim.errors import PlaceError
from crowdsim.yamlfile.document import read_text


@pytest.mark.parametrize("suffix", [".wkt", ".dxf"])
@pytest.mark.parametrize("kind", ["pipe", "endless"])
def test_plans_that_never_end_are_refused(tmp_path, suffix, kind):
    path = tmp_path / f"plan{suffix}"
    os.mkfifo(path) if kind == "pipe" else path.symlink_to("/dev/zero")
    with pytest.raises(PlaceError, match="no regular file"):
        read_floor_plan(path)


def test_yaml_that_never_ends_is_refused(tmp_path):
    os.mkfifo(tmp_path / "pipe.yaml")
    text, problems = read_text(tmp_path / "pipe.yaml", "pipe.yaml")
    assert text == ""
    assert "no regular file" in problems[0].message


def test_a_hole_outside_of_its_polygon_is_refused(tmp_path):
    path = tmp_path / "plan.wkt"
    path.write_text("POLYGON((0 0,9 0,9 9,0 9,0 0),(20 20,21 20,21 21,20 20))")
    with pytest.raises(PlaceError, match=r"hole at \(20, 20\) is outside"):
        read_floor_plan(path)
    path.write_text("POLYGON((0 0,9 0,9 9,0 9,0 0),(8 4,12 4,12 5,8 5,8 4))")
    assert read_floor_plan(path).floor.area == pytest.approx(80.0)
