"""Every way to fail has its exit code and message."""

import signal
import subprocess
import sys

import pytest
import typer

from crowdsim.cli.app import app as crowdsim_app
from crowdsim.cli.errors_shown import Commands, describe
from crowdsim.cli.options import Debug
from crowdsim.errors import CrowdSimError, DrawingUnavailable, PathNotFound, RecordingError, ScenarioError


def failing_app(error: BaseException) -> typer.Typer:
    app = typer.Typer(cls=Commands, rich_markup_mode=None, pretty_exceptions_enable=False)

    def fail(debug: Debug = False) -> None:
        raise error

    def succeed() -> None:
        typer.echo("done")

    app.command()(fail)
    app.command()(succeed)
    return app


def call(app: typer.Typer, *arguments: str) -> int:
    with pytest.raises(SystemExit) as leaving:
        app(list(arguments), prog_name="crowdsim")
    assert isinstance(leaving.value.code, int)
    return leaving.value.code


def test_an_import_that_an_interruption_made_fail_is_an_interruption():
    """Numpy raises an ImportError from what stopped the import of its parts."""
    error = ImportError("numpy._core.multiarray failed to import")
    error.__context__ = ValueError("another in between")
    error.__context__.__cause__ = KeyboardInterrupt()
    assert describe(error) == ("interrupted", 130)
    assert describe(ImportError("no module"))[1] == 1


def test_a_working_folder_that_is_gone_is_named(tmp_path, monkeypatch):
    folder = tmp_path / "gone"
    folder.mkdir()
    monkeypatch.chdir(folder)
    folder.rmdir()
    message, code = describe(FileNotFoundError(2, "No such file or directory"))
    assert (code, "does not exist any more" in message) == (2, True)


def test_termination_is_as_before_when_a_command_has_ended(capsys):
    before = signal.signal(signal.SIGTERM, signal.SIG_DFL)
    try:
        assert call(failing_app(CrowdSimError("too narrow")), "fail") == 2
        assert signal.getsignal(signal.SIGTERM) is signal.SIG_DFL
    finally:
        signal.signal(signal.SIGTERM, before)
    capsys.readouterr()


def test_an_interruption_before_the_command_line_is_there_is_no_traceback():
    program = (
        "import sys, runpy\n"
        "class Stop:\n"
        "    def find_spec(self, name, *_):\n"
        "        if name == 'crowdsim.cli.doctor': raise KeyboardInterrupt\n"
        "sys.meta_path.insert(0, Stop())\n"
        "runpy.run_module('crowdsim', run_name='__main__')\n"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "interrupted\n")


@pytest.mark.parametrize(
    ("error", "code", "message"),
    [
        (CrowdSimError("too narrow"), 2, "error: too narrow\n"),
        (ScenarioError("a.yaml:1:1: one\na.yaml:2:1: two"), 2, "error: a.yaml:1:1: one\nerror: a.yaml:2:1: two\n"),
        (PathNotFound("no path"), 2, "error: no path\n"),
        (RecordingError("unfinished"), 2, "error: unfinished\n"),
        (DrawingUnavailable("no display"), 3, "error: no display\n"),
        (FileNotFoundError(2, "No such file or directory", "a.h5"), 2, "error: a.h5: No such file or directory\n"),
        (
            OSError(28, "No space left on device"),
            2,
            "error: No space left on device; make room on the disk, or choose another place\n",
        ),
        (KeyboardInterrupt(), 130, "interrupted\n"),
        (KeyboardInterrupt("interrupted at step 3"), 130, "interrupted at step 3\n"),
        (ValueError("odd"), 1, "internal error: ValueError: odd; run again with --debug to see where\n"),
        (AssertionError(), 1, "internal error: AssertionError; run again with --debug to see where\n"),
    ],
    ids=lambda value: type(value).__name__ if isinstance(value, BaseException) else None,
)
def test_an_error_is_a_message_and_an_exit_code(capsys, error, code, message):
    assert call(failing_app(error), "fail") == code
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err == message


def test_debug_shows_the_traceback_first(capsys):
    assert call(failing_app(ValueError("odd")), "fail", "--debug") == 1
    errors = capsys.readouterr().err
    assert errors.startswith("Traceback")
    assert errors.endswith("internal error: ValueError: odd; run again with --debug to see where\n")


def test_a_command_that_succeeds_exits_with_0(capsys):
    assert call(failing_app(ValueError()), "succeed") == 0
    assert capsys.readouterr().out == "done\n"


def test_typer_shows_its_usage_errors_itself(capsys):
    assert call(failing_app(ValueError()), "fail", "--nonsense") == 2
    assert "--nonsense" in capsys.readouterr().err


def test_version(capsys):
    import crowdsim

    assert call(crowdsim_app, "--version") == 0
    assert capsys.readouterr().out == f"crowdsim {crowdsim.__version__}\n"
