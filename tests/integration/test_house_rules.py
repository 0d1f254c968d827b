"""Rules of the house that no linter holds."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "crowdsim"
SOURCES = sorted(path for folder in ("crowdsim", "tests", "tools") for path in (ROOT / folder).rglob("*.py"))
MAY_IMPORT_NUMBA = {"jit.py", "cli/doctor.py", "cli/progress.py"}
MAY_READ_A_CLOCK = {"cli", "bench", "playback"}
FORBIDDEN_CALLS = {"hash", "id"}
FORBIDDEN_IMPORTS = {"random", "datetime", "uuid", "secrets"}


def package_trees() -> Iterator[tuple[str, ast.Module]]:
    for path in sorted(PACKAGE.rglob("*.py")):
        yield path.relative_to(PACKAGE).as_posix(), ast.parse(path.read_text(encoding="utf-8"))


def imported_modules(tree: ast.AST) -> Iterator[str]:
    """Full names of imported modules; for ``from a import b`` both ``a`` and ``a.b``, as ``b`` may be a module."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (name.name for name in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            yield node.module
            yield from (f"{node.module}.{name.name}" for name in node.names)


@pytest.mark.parametrize("path", SOURCES, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_a_file_has_at_most_450_lines(path):
    lines = path.read_text(encoding="utf-8").count("\n")
    assert lines <= 450


def test_every_kernel_file_is_imported_by_a_test():
    tested = {
        module
        for path in (ROOT / "tests").rglob("*.py")
        for module in imported_modules(ast.parse(path.read_text(encoding="utf-8")))
    }
    kernel_files = {".".join(path.relative_to(ROOT).with_suffix("").parts) for path in PACKAGE.rglob("*_kernels.py")}
    assert kernel_files
    untested = sorted(kernel_files - tested)
    assert not untested, ", ".join(untested)


def test_modules_print_nothing_when_imported():
    for name, tree in package_trees():
        for statement in tree.body:
            is_call = isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Call)
            assert not (is_call and ast.unparse(statement.value.func) == "print"), name


def test_numba_is_reached_through_one_door():
    users = {
        name
        for name, tree in package_trees()
        if any(module.partition(".")[0] == "numba" for module in imported_modules(tree))
    }
    assert users <= MAY_IMPORT_NUMBA


def test_results_depend_on_no_clock_no_hash_and_no_address():
    for name, tree in package_trees():
        if name.partition("/")[0] in MAY_READ_A_CLOCK:
            continue
        modules = {module.partition(".")[0] for module in imported_modules(tree)}
        assert not modules & FORBIDDEN_IMPORTS, name
        for node in ast.walk(tree):
            if isinstance(node, ast.Call):
                called = ast.unparse(node.func)
                assert called not in FORBIDDEN_CALLS, f"{name}:{node.lineno} calls {called}()"
                assert called != "time.time", f"{name}:{node.lineno} reads the time of day"
