"""The built wheel, installed into an environment of its own and used from another folder."""

import json
import os
import subprocess
import sys
import sysconfig
import venv
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def wheel(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("wheel")
    command = [sys.executable, "-m", "build", "--wheel", "--no-isolation", "--outdir", str(folder), str(ROOT)]
    built = subprocess.run(command, capture_output=True, text=True)
    assert built.returncode == 0, built.stdout + built.stderr
    (file,) = folder.glob("*.whl")
    return file


@pytest.fixture(scope="module")
def installed(wheel, tmp_path_factory) -> Path:
    """The ``bin`` folder of a new environment that holds the wheel; dependencies come from this one."""
    folder = tmp_path_factory.mktemp("environment")
    venv.create(folder, with_pip=False)
    python = folder / "bin" / "python"
    install = ["install", "--quiet", "--no-deps", "--no-index", str(wheel)]
    subprocess.run([sys.executable, "-m", "pip", "--python", str(python), *install], check=True, capture_output=True)
    site_packages = sysconfig.get_path("purelib", vars={"base": str(folder), "platbase": str(folder)})
    # A path in a .pth file comes after the environment's own packages, and .pth files found there are not read, so
    # that an editable install of crowdsim here stays invisible.
    Path(site_packages, "dependencies.pth").write_text(sysconfig.get_path("purelib") + "\n", encoding="utf-8")
    return folder / "bin"


def clean_environment() -> dict[str, str]:
    return {name: value for name, value in os.environ.items() if name not in ("PYTHONPATH", "VIRTUAL_ENV")}


def test_the_wheel_holds_the_libraries_and_no_tests(wheel):
    names = zipfile.ZipFile(wheel).namelist()
    for folder in ("behaviors", "scenarios"):
        shipped = {name.removeprefix("crowdsim/library/") for name in names if f"/library/{folder}/" in name}
        kept = {path.relative_to(ROOT).as_posix() for path in (ROOT / folder).rglob("*") if path.is_file()}
        assert kept
        assert shipped == kept
    assert not [name for name in names if name.startswith(("tests/", "tools/"))]
    assert "crowdsim/py.typed" in names
    page = {name.removeprefix("crowdsim/export/page/") for name in names if name.startswith("crowdsim/export/page/")}
    assert {"viewer.min.js", "loader.min.js", "page.html", "page.css", "THIRD_PARTY.txt"} <= page
    assert not [name for name in page if name.startswith("viewer/")]


def test_the_installed_wheel_runs_a_built_in_scenario_from_any_folder(installed, tmp_path):
    where = subprocess.run(
        [installed / "python", "-c", "import crowdsim; print(crowdsim.__file__)"],
        cwd=tmp_path, env=clean_environment(), capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert Path(where.stdout.strip()).is_relative_to(installed.parent)

    run = subprocess.run(
        [installed / "crowdsim", "run", "corridor", "--json", "--set", "agents.0.count=1"],
        cwd=tmp_path, env=clean_environment(), capture_output=True, text=True,
    )  # fmt: skip
    assert run.returncode == 0, run.stderr
    summary = json.loads(run.stdout)
    assert summary["characters"] == 1
    assert summary["arrived"] == 1
    assert (tmp_path / "corridor.h5").is_file()
