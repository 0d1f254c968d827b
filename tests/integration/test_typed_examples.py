"""Commands of the gallery and of docs/live.md run as they are written there, example after example."""

import os
import re
import shlex
import signal
import subprocess
import sys
from pathlib import Path
from urllib.parse import urlsplit

import numpy as np
import pytest
from websockets.sync.client import connect

from crowdsim import Recording
from crowdsim.cli.errors_shown import INTERRUPTED
from crowdsim.live.pictures import MAGIC

DOCS = Path(__file__).parents[2] / "docs"
LIVE = (DOCS / "live.md").read_text(encoding="utf-8")
CAPTURES = (DOCS / "captures.md").read_text(encoding="utf-8")
EXAMPLES = (DOCS / "gallery.md").read_text(encoding="utf-8").split("\n## ")[1:]
SERVED = 20
"""Number of steps after which a served simulation is ended."""


def commands_of(text: str) -> list[list[str]]:
    lines = [line for body in re.findall(r"^```sh\n(.*?)^```", text, re.M | re.S) for line in body.splitlines()]
    return [shlex.split(line, comments=True)[1:] for line in lines if line.startswith("crowdsim ")]


def serve(arguments: list[str], folder: Path, environment: dict[str, str]) -> None:
    """Serve until some steps have come to a page; end it as Ctrl-C does. No browser is opened."""
    with subprocess.Popen(
        [sys.executable, "-m", "crowdsim", *arguments],
        cwd=folder,
        env={**environment, "BROWSER": "true"},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        try:
            parts = urlsplit(process.stdout.readline().strip())
            with connect(f"ws://{parts.netloc}/live?{parts.query}", origin=f"http://{parts.netloc}") as socket:
                step = -1
                while step < SERVED:
                    message = socket.recv(timeout=60)
                    if isinstance(message, bytes) and message.startswith(MAGIC):
                        step = int(np.frombuffer(message, "<u4", 1, len(MAGIC))[0])
            os.kill(process.pid, signal.SIGINT)
            _, said = process.communicate(timeout=120)
        finally:
            process.kill()
    assert process.returncode == INTERRUPTED, said
    assert "Traceback" not in said


def shortened(arguments: list[str]) -> list[str]:
    """A command that films one second, of which each takes six of a processor, and runs a session for half a minute.

    A session of the hall lasts ten minutes, and this one was served for a second.
    """
    if arguments[:2] == ["run", "session.yaml"]:
        return [*arguments, "--set", "duration=30"]
    if not {"--film", "--start", "--end"} <= set(arguments):
        return arguments
    start, end = arguments.index("--start") + 1, arguments.index("--end") + 1
    return [*arguments[:end], f"{float(arguments[start]) + 1.0:g}", *arguments[end + 1 :]]


def run_all(commands: list[list[str]], folder: Path, crowdsim, environment: dict[str, str]) -> None:
    """Run commands in order; without a way to draw, those that draw say so."""
    plays = any(arguments[0] == "play" for arguments in commands)
    draws = plays and crowdsim("doctor", "--json").stdout.find('"backend": null') < 0
    for arguments in commands:
        if arguments[0] == "serve":
            serve(arguments, folder, environment)
            continue
        finished = crowdsim(*shortened(arguments))
        wanted = 3 if arguments[0] == "play" and not draws else 0
        assert finished.returncode == wanted, f"crowdsim {shlex.join(arguments)}: {finished.stderr}"
        if wanted == 0 and "-o" in arguments:
            assert (folder / arguments[arguments.index("-o") + 1]).stat().st_size > 0


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda example: example.partition("\n")[0])
def test_an_example_of_the_gallery_runs(
    example: str, tmp_path: Path, crowdsim_here, environment: dict[str, str]
) -> None:
    commands = commands_of(example)
    assert commands
    named = {argument for arguments in commands for argument in arguments if argument.endswith(".yaml")}
    for scenario in re.findall(r"^```yaml\n(.*?)^```", example, re.M | re.S):
        (tmp_path / named.pop()).write_text(scenario, encoding="utf-8")
    run_all(commands, tmp_path, crowdsim_here, environment)


def test_captured_crowds_in_three_styles_arrive(
    shared: Path, tmp_path: Path, crowdsim_here, environment: dict[str, str]
) -> None:
    if not (shared / "mocap").is_dir():
        pytest.skip(f"the captures {shared / 'mocap'} are absent")
    (tmp_path / "mocap").symlink_to(shared / "mocap")
    scenario = re.search(r"cat > mine.yaml <<'EOF'\n(.*?)^EOF$", CAPTURES, re.M | re.S)[1]
    (tmp_path / "mine.yaml").write_text(scenario, encoding="utf-8")
    commands = commands_of(CAPTURES.partition("## Slow, brisk and dancing crowds")[2].partition("\n## ")[0])
    assert len(commands) == 3
    run_all(commands, tmp_path, crowdsim_here, environment)
    for style in ("slow", "brisk", "dancing"):
        with Recording.open(tmp_path / f"{style}.h5") as recording:
            assert recording.summary["arrived"] == recording.summary["characters"] == 6


def test_the_commands_of_live_simulations_run(tmp_path: Path, crowdsim, environment: dict[str, str]) -> None:
    commands = commands_of(LIVE)
    assert [arguments[0] for arguments in commands] == ["serve", "serve", "run", "serve"]
    run_all(commands, tmp_path, crowdsim, environment)
    # The served session is the beginning of the run of its scenario.
    (file,) = tmp_path.glob("session.h5")
    with Recording.open(file) as recording:
        assert recording.complete
        assert recording.steps >= SERVED
