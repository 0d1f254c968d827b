"""Start-up stays quick because nothing heavy is imported before it is used."""

import json
import subprocess
import sys

HEAVY = {"pyvista", "vtkmodules", "trimesh", "matplotlib", "h5py", "scipy", "shapely", "pydantic", "triangle"}
NUMERIC = {"numba", "numpy"}


def modules_after(statements: str, environment: dict[str, str]) -> set[str]:
    """Top-level modules that are loaded once ``statements`` ran in a fresh interpreter."""
    report = (
        "import sys, json; sys.stderr.write('\\n' + json.dumps(sorted({m.partition('.')[0] for m in sys.modules})))"
    )
    child = subprocess.run(
        [sys.executable, "-c", f"{statements}\n{report}"], env=environment, capture_output=True, text=True, check=True
    )
    return set(json.loads(child.stderr.splitlines()[-1]))


def test_importing_crowdsim_loads_nothing_heavy(environment):
    loaded = modules_after("import crowdsim", environment)
    assert "crowdsim" in loaded
    assert not loaded & HEAVY


def test_help_loads_the_command_line_library_only(environment):
    show_help = """
import sys
sys.argv = ["crowdsim", "--help"]
from crowdsim.cli.app import main
try:
    main()
except SystemExit as leaving:
    assert leaving.code == 0
"""
    loaded = modules_after(show_help, environment)
    assert "typer" in loaded
    assert not loaded & (HEAVY | NUMERIC)
