"""What is written as YAML reads back as the same values, whatever their text looks like."""

from hypothesis import example, given, settings
from hypothesis import strategies as st

from crowdsim.yamlfile.document import read_document
from crowdsim.yamlfile.written import written_document

LOOKS_LIKE = [
    "no",
    "null",
    "~",
    "1:30",
    "0123",
    "0x1f",
    "0o7",
    "1e5",
    ".5",
    ".inf",
    "- a",
    "a: b",
    "# c",
    "",
    " x ",
    "'",
    '"',
    "a\nb",
    "&a",
    "*a",
    "!t",
    "%Y",
    "é",
    "‮abc",
    "\t",
    "y",
    "=",
    "<<",
    "|",
    ">",
    "[",
    "{",
    "@",
    "`",
    "true",
    "?",
    "---",
    "...",
]
TEXT = st.one_of(st.sampled_from(LOOKS_LIKE), st.text(st.characters(exclude_categories=("Cs",)), max_size=20))
NUMBERS = st.one_of(st.integers(-(2**63), 2**63), st.floats(allow_nan=False), st.booleans(), st.none())
VALUES = st.recursive(
    st.one_of(TEXT, NUMBERS),
    lambda inner: st.one_of(st.lists(inner, max_size=4), st.dictionaries(TEXT, inner, max_size=4)),
    max_leaves=12,
)


@settings(max_examples=300)
@given(st.dictionaries(TEXT, VALUES, max_size=4))
@example({each: each for each in LOOKS_LIKE})
@example({"a": LOOKS_LIKE, "b": [1e16, 1e22, -1e-300, 5e-324, 0.1, float("inf")]})
def test_reads_back_as_written(values: dict) -> None:
    document, problems = read_document(written_document(values), "text")
    assert problems == []
    assert document.value == values
    assert list(document.value) == list(values)
