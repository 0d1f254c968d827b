"""Rules of the house that no linter holds."""

import ast
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.support.bounded_loops import BOUNDED
from tests.support.loops import unbounded_loops
from tests.support.module_state import state_in

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "crowdsim"
SOURCES = sorted(path for folder in ("crowdsim", "tests", "tools") for path in (ROOT / folder).rglob("*.py"))
MAY_IMPORT_NUMBA = {
    "first_run.py",
    "jit.py",
    "numba_internals.py",
    "numba_tuples.py",
    "cli/doctor.py",
    "cli/progress.py",
}
MAY_READ_A_CLOCK = {"cli", "bench", "live", "playback"}
MAY_USE_ANY_SINE = {"analysis", "cli", "bench", "export", "live", "playback"}
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
def test_a_file_has_at_most_400_lines_and_of_tests_450(path):
    lines = path.read_text(encoding="utf-8").count("\n")
    assert lines <= (400 if PACKAGE in path.parents else 450)


def test_a_function_has_at_most_100_lines():
    long = [
        f"{name}:{node.lineno} {node.name}"
        for name, tree in package_trees()
        for node in ast.walk(tree)
        if isinstance(node, ast.FunctionDef) and node.end_lineno - node.lineno >= 100
    ]
    assert not long, "; ".join(long)


def test_few_calls_are_kept_from_the_formatter():
    kept = sum(path.read_text(encoding="utf-8").count("fmt: skip") for path in PACKAGE.rglob("*.py"))
    assert kept <= 10


def test_a_folder_holds_at_most_15_files_beside_its_subfolders():
    counts = {
        folder.relative_to(ROOT).as_posix(): sum(path.name != "__init__.py" for path in folder.glob("*.py"))
        for folder in {path.parent for path in PACKAGE.rglob("*.py")}
    }
    assert {folder: count for folder, count in counts.items() if count > 15} == {}


def imports_of_modules() -> dict[str, set[str]]:
    """Modules of the package, and which others each names in an import, in functions and for types too."""
    trees = {
        f"crowdsim.{name[:-3].replace('/', '.')}".removesuffix(".__init__"): tree for name, tree in package_trees()
    }
    return {name: {module for module in imported_modules(tree) if module in trees} for name, tree in trees.items()}


def circles_in(imports: dict[str, set[str]]) -> set[str]:
    """Modules that are left when those that import none of the rest are taken away, again and again."""
    left = set(imports)
    while leaves := {name for name in left if not imports[name] & left}:
        left -= leaves
    return left


def test_no_modules_import_each_other_in_a_circle():
    imports = imports_of_modules()
    # Whoever imports a module names its package, too, and the top one hands on names that it imports when asked.
    packages = {name for name in imports if any(other.startswith(f"{name}.") for other in imports)}
    assert circles_in({name: modules - packages for name, modules in imports.items()}) == set()


def test_the_rule_finds_circles():
    assert circles_in({"a": {"b"}, "b": {"c"}, "c": {"b"}, "d": set()}) == {"a", "b", "c"}


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


MAY_HOLD_STATE = {"cli", "bench", "playback"}
HELD = {
    # Settings of numba have to be made before the first kernel is; `kernel` is a decorator.
    ("jit.py", "numba.config"),
    ("jit.py", "kernel"),
    # The registry of detectors of features, which users add to before they build graphs.
    ("motion/graph/features.py", "DETECTORS[detector.name]"),
    # Poses of gaits that are constants of the package.
    ("motion/synthesis/synthesize.py", "_standing is cached"),
    ("motion/synthesis/synthesize.py", "_passing is cached"),
    # What numba knows of types and functions, for the process, as numba itself keeps it.
    ("numba_tuples.py", "_is_counted is cached"),
    ("numba_tuples.py", "_resolve_numbers is cached"),
    ("numba_tuples.py", "setattr(_owner"),
    ("numba_tuples.py", "_unboxers.functions"),
    ("numba_tuples.py", "default_manager._cache"),
}
"""What a module may hold all the same: its name, and words of what is found."""


def test_no_module_holds_what_changes():
    found = [
        (name, line, what)
        for name, tree in package_trees()
        if name.partition("/")[0] not in MAY_HOLD_STATE
        for line, what in state_in(tree)
    ]
    unnamed = [entry for entry in found if not any(n == entry[0] and words in entry[2] for n, words in HELD)]
    assert not unnamed, "\n".join(f"{name}:{line} {what}" for name, line, what in unnamed)
    idle = [(n, words) for n, words in HELD if not any(n == entry[0] and words in entry[2] for entry in found)]
    assert not idle, f"no longer needed: {idle}"


@pytest.mark.parametrize(
    "code",
    [
        "_kept = {}", "_kept: dict[int, int] = {}", "kept = dict()", "_kept = [x for x in y]", "_a, _b = [], 1",
        "KEPT = threading.Lock()", "KEPT = weakref.WeakKeyDictionary()", "KEPT = (Lock(), 1)", "KEPT = Holder(RLock())",
        "_kept = Cache()", "_kept = defaultdict[int, list](list)", "_kept = [] if x else None", "_kept = x or {}",
        "if x:\n    _kept = []", "try:\n    pass\nexcept E:\n    _kept = []", "(kept := [])", "NUMBERS = count()",
        "KEPT = {}\nKEPT[1] = 2", "KEPT = {}\ndef f(k):\n    KEPT[k] = 1", "KEPT = []\ndef f(k):\n    KEPT.append(k)",
        "KEPT = {}\ndef f(k):\n    KEPT.setdefault(k, []).append(1)", "KEPT = {}\ndef f(k):\n    del KEPT[k]",
        "KEPT = {1: []}\ndef f(k):\n    KEPT[1].append(k)", "KEPT = {}\ndef f(k):\n    kept = KEPT\n    kept[k] = 1",
        "KEPT = []\nKEPT += [1]", "KEPT = []\ndef f():\n    def g():\n        KEPT.pop()\n    return g",
        "KEPT = {}\nf = lambda k: KEPT.update(k)", "def f():\n    global last\n    last = 1",
        "from crowdsim.a import KEPT\nKEPT[0] = 1", "from crowdsim import a\ndef f():\n    a.KEPT.append(1)",
        "def f():\n    from crowdsim import a\n    a.last = 1", "def f():\n    globals()['x'] = 1",
        "def f():\n    f.calls = 1", "class A:\n    kept = []", "class A:\n    kept: ClassVar[dict] = {}",
        "class A:\n    KEPT = {}\n    def f(self):\n        self.KEPT[1] = 2", "class A:\n    LOCK = Lock()",
        "class A:\n    KEPT = []\ndef f():\n    A.KEPT.append(1)", "class A:\n    last = 0\ndef f():\n    A.last = 1",
        "class A:\n    @classmethod\n    def f(cls):\n        cls.last = 1",
        "class A:\n    def f(self):\n        type(self).last = 1",
        "class A:\n    def f(self):\n        self.__class__.last = 1", "def f(kept={}):\n    pass",
        "def f(*, kept=dict()):\n    pass", "def f(k):\n    setattr(f, 'calls', k)", "@cache\ndef f(k):\n    pass",
        "class A:\n    @functools.lru_cache(maxsize=None)\n    def f(self):\n        pass", "_f = cache(g)",
    ],
)  # fmt: skip
def test_the_rule_finds_what_modules_hold(code):
    assert state_in(ast.parse(code))


@pytest.mark.parametrize(
    "code",
    [
        "TABLE = {1: [2]}", "_TABLE = dict(a=1)", "__all__ = ['a']", "Floats = NDArray[np.float64]", "last = 0",
        "T = TypeVar('T')", "NAMES = tuple(x for x in y)", "ROW = np.dtype([('x', float)])", "AREA = box(0, 0, 1, 1)",
        "TABLE = {}\ndef f(TABLE):\n    TABLE[1] = 2", "TABLE = [1]\ndef f():\n    kept = list(TABLE)\n    kept[0] = 2",
        "import numpy as np\ndef f(x):\n    return np.append(x, 1)", "def f(x):\n    kept = []\n    kept.append(x)",
        "class A:\n    def __init__(self):\n        self.kept = {}\n        self.kept[1] = 2", "def f(x=()):\n    pass",
        "class A:\n    kept: list[int] = field(default_factory=list)", "@cache\ndef f():\n    return 1",
        "class A:\n    @cached_property\n    def f(self):\n        return []", "def f():\n    n = 0\n    n += 1",
    ],
)  # fmt: skip
def test_the_rule_lets_constants_through(code):
    assert not state_in(ast.parse(code))


def test_loops_of_kernels_have_a_bound_or_stand_in_a_list_with_the_reason_why_they_end():
    found = Counter(
        f"{name} {function}"
        for name, tree in package_trees()
        if name.endswith("_kernels.py")
        for function, _ in unbounded_loops(tree)
    )
    listed = Counter(name for names in BOUNDED.values() for name in names)
    assert not found - listed, f"no bound (see tests/support/bounded_loops.py): {found - listed}"
    assert not listed - found, f"no longer needed: {listed - found}"


@pytest.mark.parametrize(
    "code",
    [
        "while True:\n  h = a[h]\n  if h == b:\n    break", "while h >= 0:\n  h = a[h]", "while x:\n  x = f(x)",
        "while i < n:\n  i -= 1", "while i > n:\n  i += 1", "while i < n:\n  i += k", "while i < n:\n  i += 0",
        "while i < n:\n  i += 1\n  n += 1", "while i < n:\n  i += 1\n  if x:\n    i = 0", "while i < n:\n  f(i)",
        "while i < n:\n  if x:\n    i += 1", "while i < n:\n  if x:\n    continue\n  i += 1",
        "while i < w[0].n:\n  i += 1", "while i < n or x:\n  i += 1", "while i < f():\n  i += 1",
        "while top > 0:\n  top -= 1\n  if x:\n    top += 2",
        "while top > 0:\n  if x:\n    continue\n  if is_spent(w):\n    return 1",
    ],
)  # fmt: skip
def test_the_rule_finds_loops_without_a_bound(code):
    function = f"def f():\n  {code.replace(chr(10), chr(10) + '  ')}"
    assert list(unbounded_loops(ast.parse(function)))


@pytest.mark.parametrize(
    "code",
    [
        "while i < n:\n  i += 1", "while k > 0 and a[k] > x:\n  k -= 1", "while i < a.shape[0] - 1:\n  f(i)\n  i += 1",
        "while top > 0:\n  if is_spent(w):\n    return 1\n  top = f(top)", "while x and not is_spent(w):\n  x = f(x)",
        "while h >= 0:\n  n += 1\n  if n > a.size:\n    raise BoundExceeded\n  h = a[h]", "for i in range(n):\n  f(i)",
    ],
)  # fmt: skip
def test_the_rule_lets_through_loops_with_a_bound(code):
    function = f"def f():\n  {code.replace(chr(10), chr(10) + '  ')}"
    assert not list(unbounded_loops(ast.parse(function)))
