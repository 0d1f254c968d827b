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
MAY_USE_ANY_SINE = {"cli", "bench", "playback"}
DRAWS = {"figures.py", "motion/analysis/graph_picture.py", "navmesh/picture.py", "scenario/picture.py"}
MULTIPLIES_EXACTLY = {"motion/graph/frame_distance.py", "motion/analysis/error_image.py"}
"""Matrix products of values that :func:`crowdsim.geometry.products.rounded_for_sums` rounded."""
BY_PROCESSOR = {
    *("sin", "cos", "tan", "sinh", "cosh", "tanh", "asin", "acos", "atan", "atan2", "arcsin", "arccos", "arctan"),
    *(
        "arctan2",
        "exp",
        "exp2",
        "expm1",
        "log",
        "log2",
        "log10",
        "log1p",
        "pow",
        "power",
        "float_power",
        "cbrt",
        "hypot",
    ),
    *(
        "dist",
        "angle",
        "sinc",
        "geomspace",
        "logspace",
        "hanning",
        "hamming",
        "kaiser",
        "einsum",
        "dot",
        "matmul",
        "inner",
        "vdot",
        "tensordot",
        "convolve",
        "correlate",
        "polyfit",
    ),
    *("linalg.det", "linalg.svd", "linalg.inv", "linalg.solve", "linalg.lstsq", "linalg.eigh", "linalg.eig"),
}
"""Functions of math and numpy whose last bits hang on the processor."""
ELSEWHERE = {
    "exponential": "a draw by the library's logarithm",
    "normal": "a draw by the library's logarithm",
    "buffer": "shapely's, see crowdsim.geometry.polygons.buffered",
    "rotate": "shapely's, see crowdsim.geometry.polygons.turned",
}
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


def hangs_on_the_processor(node: ast.AST, name: str) -> bool:
    """Whether the last bits of what ``node`` computes hang on the processor."""
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.MatMult):
        return name not in MULTIPLIES_EXACTLY
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Pow):
        # Kernels multiply out whole powers; elsewhere only those of two numbers are told before a run.
        whole = isinstance(node.right, ast.Constant) and isinstance(node.right.value, int)
        told = all(isinstance(each, ast.Constant | ast.UnaryOp) for each in (node.left, node.right))
        return not (told or (whole and name.endswith("_kernels.py")))
    if not isinstance(node, ast.Call):
        return False
    called = ast.unparse(node.func)
    module, _, function = called.partition(".")
    if module in ("math", "np", "numpy"):
        if function == "linalg.norm":  # of a whole array by BLAS, along an axis by plain sums
            return all(keyword.arg != "axis" for keyword in node.keywords)
        return function in BY_PROCESSOR and not (function == "matmul" and name in MULTIPLIES_EXACTLY)
    if name == "geometry/polygons.py" or module in ("crowdsim", "self"):
        return False
    return "." in called and called.rpartition(".")[2] in ELSEWHERE


def test_results_depend_on_no_sine_of_a_processor():
    found = [
        f"{name}:{node.lineno} {ast.unparse(node)}"
        for name, tree in package_trees()
        if name.partition("/")[0] not in MAY_USE_ANY_SINE and name not in DRAWS
        for node in ast.walk(tree)
        if hangs_on_the_processor(node, name)
    ]
    assert not found, "; ".join(found)


@pytest.mark.parametrize(
    "code",
    [
        "np.sin(x)", "math.atan2(y, x)", "a @ b", "x**2", "x**0.5", "np.linalg.norm(v)", "np.einsum('i,i', a, b)",
        "area.buffer(0.3)", "generator.exponential(2.0)", "np.linalg.det(m)",
    ],
)  # fmt: skip
def test_the_rule_finds_what_hangs_on_the_processor(code):
    assert any(hangs_on_the_processor(node, "crowd/some.py") for node in ast.walk(ast.parse(code)))


@pytest.mark.parametrize("code", ["np.sqrt(x)", "2.0**-50", "np.linalg.norm(v, axis=1)", "sin(x)", "buffered(a, 0.3)"])
def test_the_rule_lets_through_what_does_not(code):
    assert not any(hangs_on_the_processor(node, "crowd/some.py") for node in ast.walk(ast.parse(code)))
