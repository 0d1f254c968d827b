"""Runs the Python blocks of a page of docs, in order."""

import contextlib
import doctest
import io
import re
from pathlib import Path

DOCS = Path(__file__).parents[2] / "docs"


def printed_by(page: str) -> list[str]:
    """Lines that the Python blocks of a page print, run one after another; blocks with prompts are doctests."""
    text = (DOCS / page).read_text(encoding="utf-8")
    names: dict[str, object] = {}
    printed = io.StringIO()
    for number, block in enumerate(re.findall(r"^```python\n(.*?)^```", text, re.M | re.S)):
        if block.startswith(">>>"):
            test = doctest.DocTestParser().get_doctest(block, names, f"block {number}", None, 0)
            assert doctest.DocTestRunner().run(test, clear_globs=False).failed == 0
            names |= test.globs
        else:
            with contextlib.redirect_stdout(printed):
                exec(compile(block, f"docs/{page}, block {number}", "exec"), names)
    return printed.getvalue().splitlines()
