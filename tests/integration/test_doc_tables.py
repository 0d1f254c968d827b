"""A table of measurements in the docs stands in a section that names the command which prints it."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGES = sorted((ROOT / "docs").glob("*.md"))

COMMAND = re.compile(r"crowdsim (bench|validate|run|sweep|analyze|motion|behaviors|play)|python tools/|pytest tests/")
NUMBER = re.compile(r"[-~<>]?\*{0,2}\d")

WHOLE_PAGES = ("validation.md", "validation-auto.md")
"""Pages that one command writes, which stands at their beginning."""

OTHERWISE = {
    ("captures.md", "What to capture"): "advice, no measurements",
    ("guidance.md", "Crowds"): "how a constant was chosen: `crowdsim bench drills` with other values of it",
    ("motion.md", "Other manners"): "tests/unit/motion/synthesis/test_gait_bands.py holds the bands of gaits",
    (
        "motion.md",
        "Transitions and feet",
    ): "tests/unit/motion/graph/test_foot_contacts.py holds the drift of the default set",
    ("steering.md", "Parties"): "tests/unit/crowd/steered/test_parties.py holds the shares",
}
"""Sections whose figures no command prints, and why."""


def tables_of(text: str) -> list[tuple[str, str, bool]]:
    """Return, for each table of numbers, the heading of its section, the section, and if a command stands in it."""
    found = []
    for section in re.split(r"^(?=#+ )", text, flags=re.MULTILINE):
        heading = section.splitlines()[0].lstrip("# ") if section.startswith("#") else ""
        for table in re.findall(r"(?:^\|.*\n)+", section, re.MULTILINE):
            rows = [line.strip("|\n").split("|") for line in table.splitlines()[2:]]
            cells = [cell.strip() for row in rows for cell in row]
            if cells and sum(NUMBER.match(cell) is not None for cell in cells) > 0.3 * len(cells):
                found.append((heading, section, COMMAND.search(section) is not None))
    return found


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_tables_of_numbers_name_their_command(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    if page.name in WHOLE_PAGES:
        assert COMMAND.search(text[:2000])
        return
    without = {heading for heading, _, is_named in tables_of(text) if not is_named}
    assert not {heading for heading in without if (page.name, heading) not in OTHERWISE}
    listed = {heading for name, heading in OTHERWISE if name == page.name}
    assert not listed - without, "a command stands there now, or the section is gone: take it out of OTHERWISE"


def test_a_table_without_a_command_is_found() -> None:
    text = "# Page\n\n## Speed\nFast.\n\n| a | s |\n|---|---|\n| one | 2 |\n| two | 3 |\n\n## More\n"
    text += "`crowdsim bench startup`\n"
    assert [(heading, is_named) for heading, _, is_named in tables_of(text)] == [("Speed", False)]
