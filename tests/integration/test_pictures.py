"""One command draws every picture that README and docs show; figures have a tool and tests of their own."""

import importlib.util
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]


@pytest.fixture(scope="module")
def drawn() -> set[str]:
    """Files that the tool draws, below the root."""
    spec = importlib.util.spec_from_file_location("draw_pictures", ROOT / "tools" / "draw_pictures.py")
    assert spec is not None
    assert spec.loader is not None
    tool = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(tool)
    return set(tool.PICTURES)


def shown(page: Path) -> set[str]:
    """Files of the pictures on a page, below the root."""
    links = re.findall(r"!\[[^\]]*\]\(([^)]+)\)", page.read_text(encoding="utf-8"))
    return {(page.parent / link).resolve().relative_to(ROOT).as_posix() for link in links}


def test_every_picture_is_drawn_by_the_tool_and_there(drawn: set[str]) -> None:
    # Those of validation are made with their page.
    pages = [page for page in PAGES if page.stem not in ("validation", "validation-auto")]
    wanted = {file for page in pages for file in shown(page) if not file.startswith("docs/figures/")}
    assert len(wanted) >= 9
    assert wanted <= drawn
    assert all((ROOT / file).is_file() for file in drawn)
