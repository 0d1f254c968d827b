"""Values of options."""

import pytest
import typer

from crowdsim.cli.options import read_map_depth, read_point, read_size


def test_a_point_is_two_numbers():
    assert read_point("1.5,-2", "--from") == (1.5, -2.0)
    assert read_point(" 1e1 , .5 ", "--from") == (10.0, 0.5)


@pytest.mark.parametrize("text", ["", "1", "1,2,3", "a,b", "nan,0", "0,inf", "1;2"])
def test_anything_else_is_no_point(text):
    with pytest.raises(typer.BadParameter):
        read_point(text, "--from")


def test_a_size_is_width_by_height():
    assert read_size("1600x900") == (1600, 900)
    assert read_size("64X32") == (64, 32)


@pytest.mark.parametrize("text", ["", "1600", "x", "1600x", "0x900", "-64x64", "1600x900x3", "1e3x900", "99999x99999"])
def test_anything_else_is_no_size(text):
    with pytest.raises(typer.BadParameter):
        read_size(text)


@pytest.mark.parametrize("text", ["0", "-1", "1000", "1000m", "nan m", "nanm", "3.5", "deep"])
def test_a_depth_of_maps_is_bounded(text):
    with pytest.raises(typer.BadParameter, match="above 0 and below 1000"):
        read_map_depth(text)
