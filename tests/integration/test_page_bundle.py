"""The viewer of pages: its bundles are what its source makes, byte by byte, and need no Node to be used."""

import json
import os
import shutil
import subprocess
from pathlib import Path

import pytest

from tests.support.browser import NPM_CI, missing

PAGE = Path(__file__).parents[2] / "crowdsim" / "export" / "page"
SOURCE = PAGE / "viewer"


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """A copy of the viewer's folder in which its bundle was made anew."""
    if shutil.which("npm") is None:
        missing("npm is not installed: apt-get install npm", NPM_CI)
    copy = tmp_path_factory.mktemp("page") / "viewer"
    shutil.copytree(SOURCE, copy, ignore=shutil.ignore_patterns("node_modules"))
    for command in (["npm", "ci", "--no-audit", "--no-fund", "--ignore-scripts"], ["npm", "run", "build"]):
        done = subprocess.run(command, cwd=copy, capture_output=True, text=True, timeout=600)
        if done.returncode and command[1] == "ci" and not os.environ.get(NPM_CI):
            pytest.skip(f"no npm registry is to be reached: {done.stderr[-300:]}")
        assert done.returncode == 0, done.stdout + done.stderr
    return copy.parent


@pytest.mark.parametrize("name", ["viewer.min.js", "live.min.js"])
def test_the_bundle_is_what_its_source_makes(built, name):
    assert (built / name).read_bytes() == (PAGE / name).read_bytes()


def test_the_bundle_is_small_and_asks_nobody():
    text = (PAGE / "viewer.min.js").read_text(encoding="ascii")
    assert len(text) <= 600_000
    assert "</script" not in text.lower()
    for asking in ("XMLHttpRequest(", "WebSocket(", "EventSource(", "sendBeacon"):
        assert asking not in text


def test_what_live_pages_add_is_small_and_holds_no_copy_of_the_viewer():
    text = (PAGE / "live.min.js").read_text(encoding="ascii")
    assert len(text) <= 30_000
    assert "</script" not in text.lower()


def test_every_module_can_be_read_by_node():
    if shutil.which("node") is None:
        missing("node is not installed: apt-get install nodejs", NPM_CI)
    for module in (*SOURCE.glob("source/**/*.js"), SOURCE / "build.mjs"):
        done = subprocess.run(["node", "--check", str(module)], capture_output=True, text=True)
        assert done.returncode == 0, done.stderr


def test_what_the_bundle_holds_of_others_is_named_with_its_license():
    lock = json.loads((SOURCE / "package-lock.json").read_text(encoding="utf-8"))
    version = lock["packages"]["node_modules/three"]["version"]
    words = (PAGE / "THIRD_PARTY.txt").read_text(encoding="utf-8")
    assert f"three.js {version}" in words
    assert "MIT License" in words


def test_modules_stay_as_short_as_files_of_the_package():
    for module in SOURCE.glob("source/**/*.js"):
        assert len(module.read_text(encoding="utf-8").splitlines()) <= 400, module
