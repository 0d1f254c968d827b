"""Every argument of a kernel is named in its docstring, in that of its module, or in those of kernels they refer to."""

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
KERNELS = sorted((ROOT / "crowdsim").rglob("*_kernels.py"))

POINT = re.compile(r"([a-z]+)?([xy])(\d)?")
"""A coordinate: of a point with a letter, a number, or neither."""


def name(path: Path) -> str:
    return str(path.relative_to(ROOT))


def has_word(word: str, text: str) -> bool:
    return re.search(rf"(?<![A-Za-z_]){re.escape(word)}(?![A-Za-z_0-9])", text) is not None


def is_named(argument: str, arguments: list[str], said: str) -> bool:
    """Test if an argument is named; px and py are named by p, and plain x and y name themselves."""
    if argument in ("x", "y") or has_word(argument, said):
        return True
    match = POINT.fullmatch(argument)
    if match is None:
        return False
    letter, axis, number = match[1] or "", match[2], match[3] or ""
    other = letter + ("y" if axis == "x" else "x") + number
    return other in arguments and (has_word(letter, said) if letter else False)


def unnamed_in(text: str) -> list[str]:
    """Return ``kernel(argument)`` for every argument of a decorated function of a file that nothing names."""
    tree = ast.parse(text)
    functions = [node for node in tree.body if isinstance(node, ast.FunctionDef)]
    docs = {node.name: ast.get_docstring(node) or "" for node in functions}
    module = ast.get_docstring(tree) or ""
    found = []
    for node in functions:
        if not node.decorator_list:
            continue
        said = f"{docs[node.name]}\n{module}"
        referred = re.findall(r"`{1,2}(\w+)`{1,2}", said)
        said = "\n".join([said, *(docs[other] for other in referred if other in docs)])
        arguments = [each.arg for each in node.args.args]
        found += [f"{node.name}({each})" for each in arguments if not is_named(each, arguments, said)]
    return found


@pytest.mark.parametrize("path", KERNELS, ids=name)
def test_arguments_are_named(path: Path) -> None:
    assert not unnamed_in(path.read_text(encoding="utf-8"))


def test_an_argument_that_nothing_names_is_found() -> None:
    text = '"""A file: ``m`` is the mesh."""\n'
    text += '@helper\ndef cut(m, px, py, t, side):\n    """Cut at p; see :func:`hold`."""\n'
    text += '@kernel\ndef hold(side):\n    """Hold a ``side``."""\n'
    assert unnamed_in(text) == ["cut(t)"]
