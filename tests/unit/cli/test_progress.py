"""What a run says while it goes on, where stderr is no terminal."""

import numba

from crowdsim.cli.progress import RunProgress


def test_nothing_is_said_when_nothing_compiles(capsys):
    with RunProgress("corridor") as progress:
        progress.step(1, 10, None)
        progress.step(2, 10, None)
    assert progress.steps_done == 2
    captured = capsys.readouterr()
    assert captured.out == captured.err == ""


def test_compiling_is_said_once(capsys):
    @numba.njit
    def one(x):
        return x + 1

    @numba.njit
    def two(x):
        return one(x) + 1

    with RunProgress("corridor"):
        assert two(1) == 3
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.count("\n") == 1
    assert "compiling" in captured.err


def test_nothing_is_said_after_the_run(capsys):
    with RunProgress("corridor"):
        pass

    @numba.njit
    def three(x):
        return x + 3

    assert three(1) == 4
    assert capsys.readouterr().err == ""
