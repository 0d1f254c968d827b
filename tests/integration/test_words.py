"""Words of the package: no riddles in docstrings, comments and pages, and comments above the stages of kernels."""

import ast
import io
import re
import tokenize
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SOURCES = sorted(path for folder in ("crowdsim", "tools") for path in (ROOT / folder).rglob("*.py"))
PAGES = sorted([*(ROOT / "docs").glob("*.md"), ROOT / "README.md", ROOT / "CONTRIBUTING.md"])
KERNELS = sorted((ROOT / "crowdsim").rglob("*_kernels.py"))

RIDDLES = re.compile(
    r"\b(somebody|someone|anybody|whoever|whomever|what is asked|told by|lest|nobody knows)\b", re.IGNORECASE
)
"""Words that a stranger stumbles over; the field's terms are agent, character and obstacle."""

PERSON = re.compile(r"\bcharacters?\b", re.IGNORECASE)
"""A simulated person is an agent, as docs/glossary.md says; ``Character`` are the motions and the body that agents
share."""

CODE = re.compile(r"`[^`]*`")

OF_TEXTS = (
    "yamlfile/",
    "export/tables/text_rows.py",
    "export/tables/csv_file.py",
    "cli/run.py",
    "export/scenes/usd.py",
)
WITH_RIGS = (
    "following/follower/character.py",
    "following/follower/path_follower.py",
    "following/follower/exact_following.py",
    "following/coverage.py",
    "bench/motions/map_trials.py",
    "motion/clips/joint_roles.py",
)
"""Files about ``Character``; above, files about texts. Their characters are no agents."""

LEAST_SHARE = 0.05
"""Share of comment lines among the lines of kernels; box2d has 7.7 %, Recast 12.6 %."""


def name(path: Path) -> str:
    return str(path.relative_to(ROOT))


def comments(text: str) -> list[tokenize.TokenInfo]:
    return [token for token in tokenize.generate_tokens(io.StringIO(text).readline) if token.type == tokenize.COMMENT]


def said_in(path: Path) -> list[tuple[int, str]]:
    """Comments and docstrings of a file, with their lines."""
    text = path.read_text(encoding="utf-8")
    said = [(token.start[0], token.string) for token in comments(text)]
    return said + [
        (node.lineno, node.value.value)
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)
    ]


@pytest.mark.parametrize("path", SOURCES, ids=name)
def test_docstrings_and_comments_hold_no_riddles(path: Path) -> None:
    said = said_in(path)
    found = [f"{name(path)}:{line}: {match[0]!r}" for line, words in said for match in RIDDLES.finditer(words)]
    assert not found


@pytest.mark.parametrize("path", SOURCES, ids=name)
def test_a_simulated_person_is_an_agent(path: Path) -> None:
    file = path.relative_to(ROOT).as_posix().removeprefix("crowdsim/")
    if file.startswith((*OF_TEXTS, *WITH_RIGS)):
        return
    said = [(line, CODE.sub("", words)) for line, words in said_in(path)]
    assert not [f"{name(path)}:{line}: {match[0]!r}" for line, words in said for match in PERSON.finditer(words)]


@pytest.mark.parametrize("path", PAGES, ids=name)
def test_pages_hold_no_riddles(path: Path) -> None:
    lines = path.read_text(encoding="utf-8").splitlines()
    found = [f"{name(path)}:{k}: {match[0]!r}" for k, line in enumerate(lines, 1) for match in RIDDLES.finditer(line)]
    assert not found


def test_kernels_say_what_their_stages_are() -> None:
    lines = said = 0
    for path in KERNELS:
        text = path.read_text(encoding="utf-8")
        commented = {token.start[0] for token in comments(text)}
        for node in ast.parse(text).body:
            if isinstance(node, ast.FunctionDef):
                lines += node.end_lineno - node.lineno + 1
                said += sum(node.lineno <= line <= node.end_lineno for line in commented)
    assert lines > 10_000
    assert said / lines >= LEAST_SHARE


def without_docstring(tree: ast.Module) -> list[tuple[int, str]]:
    """Functions of six lines or more that say nothing of themselves, but for those within others and dunders."""
    functions = [node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)]
    within = {inner for outer in functions for inner in ast.walk(outer) if inner is not outer}
    return [
        (node.lineno, node.name)
        for node in functions
        if node not in within
        and not node.name.startswith("__")
        and node.end_lineno - node.lineno >= 5
        and not ast.get_docstring(node)
    ]


@pytest.mark.parametrize("path", [path for path in SOURCES if path.is_relative_to(ROOT / "crowdsim")], ids=name)
def test_functions_say_what_they_do(path: Path) -> None:
    assert not without_docstring(ast.parse(path.read_text(encoding="utf-8")))
