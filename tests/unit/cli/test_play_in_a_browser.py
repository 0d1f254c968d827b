"""``crowdsim play`` where it opens a page, and where it says how to make one."""

from pathlib import Path
from urllib.parse import urlparse
from urllib.request import url2pathname

import pytest
import typer
from typer.testing import CliRunner

from crowdsim.cli.app import app
from crowdsim.errors import DrawingUnavailable
from tests.support.small_recording import write_small_recording


@pytest.fixture
def recording(tmp_path, monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    return write_small_recording(tmp_path / "small.h5", steps=10)


def test_a_browser_opens_a_page_in_a_temporary_file(recording, monkeypatch):
    opened = []
    monkeypatch.setattr(typer, "launch", opened.append)
    result = CliRunner().invoke(app, ["play", str(recording), "--browser", "--agent", "1", "--view", "follow"])
    assert result.exit_code == 0, result.output
    address = urlparse(opened[0])
    assert address.fragment == "agent=1&view=follow"
    page = Path(url2pathname(address.path))
    assert page.name == "small.html"
    assert page.read_bytes().decode("utf-16").startswith("<!doctype html>")
    assert str(page) in result.output


def test_without_a_display_it_says_how_to_make_a_page(recording, monkeypatch):
    def unavailable(*_, **__):
        raise DrawingUnavailable("there is no display to open a window on")

    monkeypatch.setattr("crowdsim.playback.window.window", unavailable)
    result = CliRunner().invoke(app, ["play", str(recording)])
    assert result.exit_code == 3
    assert f"crowdsim export {recording} -o {recording.with_suffix('.html')}" in result.output


def test_a_browser_and_a_picture_are_two_things(recording):
    result = CliRunner().invoke(app, ["play", str(recording), "--browser", "--shot", "a.png"])
    assert result.exit_code == 2
    assert "choose one" in result.output
