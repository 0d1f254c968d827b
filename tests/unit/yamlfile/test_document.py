"""YAML reading: values by the core schema of YAML 1.2, exact places, and nothing that surprises."""

import json
import math
import time

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from crowdsim.yamlfile.document import MAX_BYTES, MAX_DEPTH, Position, dotted, read_document


def value_of(text: str):
    document, problems = read_document(text, "f")
    assert problems == []
    return document.value


def first_problem(text: str) -> str:
    problems = read_document(text, "f")[1]
    assert problems
    return str(problems[0])


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("no", "no"),
        ("on", "on"),
        ("True", True),
        ("false", False),
        ("~", None),
        ("", None),
        ("0123", 123),
        ("0o17", 15),
        ("0x1F", 31),
        ("-7", -7),
        ("1_000", "1_000"),
        ("1:30", "1:30"),
        ("1,5", "1,5"),
        ("1e-2", 0.01),
        ("1e3", 1000.0),
        (".5", 0.5),
        ("5.", 5.0),
        (".inf", math.inf),
        ("-.INF", -math.inf),
        ("'1'", "1"),
        ('"no"', "no"),
        ("|-\n  1", "1"),
        ("2026-11-21", "2026-11-21"),
        ("{a: 1, b: [x, {c: 2}]}", {"a": 1, "b": ["x", {"c": 2}]}),
    ],
)
def test_values(text, value):
    read = value_of(f"key: {text}\n")["key"]
    assert read == value
    assert type(read) is type(value)


def test_not_a_number():
    assert math.isnan(value_of("key: .nan")["key"])


def test_places_of_keys_and_values_count_from_one():
    document, _ = read_document("a: 1\nb:\n  - {c: 2,  d: x}\n  - y\n", "f")
    assert document.position(("a",)) == Position("f", 1, 4)
    assert document.position(("b", 0, "d")) == Position("f", 3, 16)
    assert document.position(("b", 0, "d"), of_key=True) == Position("f", 3, 13)
    assert document.position(("b", 1)) == Position("f", 4, 5)
    assert document.position(("b", 0, "missing", "deeper")) == Position("f", 3, 5)
    assert document.position(("missing",)) == Position("f", 1, 1)


def test_an_absent_value_stands_where_its_key_does():
    document, _ = read_document("a: 1\nb:\n\n\nc: {d: , e: 2}\n", "f")
    assert document.position(("b",)) == Position("f", 2, 1)
    assert document.position(("c", "d")) == Position("f", 5, 5)


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("a:\n\tb: 1\n", "f:2:1: a tab cannot indent YAML; use spaces"),
        ("r: 1\nr: 2\n", "f:2:1: r: key given twice; it is at line 1 already"),
        ("x: {r: 1, r: {y: [1]}}\n", "f:1:11: x.r: key given twice; it is at line 1 already"),
        ("a: &x 1\n", "f:1:4: a: anchors are not allowed ('&x')"),
        ("a: *x\n", "f:1:4: a: aliases are not allowed ('*x'); write the value out"),
        ("a: !!python/object:os.system 1\n", "f:1:4: a: tags are not allowed ('tag:yaml.org,2002:python/object:os.s"),
        ("a: !mine {b: 1}\n", "f:1:4: a: tags are not allowed ('!mine')"),
        ("a: 1\n? [b, {c: d}]\n: 2\n", "f:2:3: a key must be a plain word"),
        ("a: 1\n---\nb: 1\n", "f:2:1: a second document begins here"),
        ("%YAML 1.1\n---\na: 1\n", "f:2:1: files are YAML 1.2"),
        ("a: 'x\n", "f:2:1: not YAML: found unexpected end of stream"),
        ("a: {b: 1\n", "f:2:1: not YAML: expected ',' or '}'"),
        ("a: b: c\n", "f:1:5: not YAML: mapping values are not allowed here"),
        ("a: \x01\n", "f:1:4: not YAML: unacceptable character #x0001"),
        ('a: "\\UFFFFFFFF"\n', "f:1:1: not YAML: "),
        ('a: "\\ud800"\n', "f:1:4: a: half of a surrogate pair"),
        (f"a: 1{'0' * 5000}\n", "f:1:4: a: a number of 5001 digits is too large"),
        ("[" * (MAX_DEPTH + 1), f"f:1:{MAX_DEPTH + 1}: nested more than {MAX_DEPTH} levels deep"),
        ("{a: " * 40, f"f:1:129: nested more than {MAX_DEPTH} levels deep"),
    ],
)
def test_problems(text, problem):
    assert first_problem(text).startswith(problem)


def test_reading_goes_on_after_a_duplicate_and_keeps_the_first():
    document, problems = read_document("a: 1\na: {a: 2}\nb: *x\nc: 3\nc: 4\n", "f")
    assert document.value == {"a": 1, "b": None, "c": 3}
    assert [(p.line, p.key) for p in problems] == [(2, "a"), (3, "b"), (5, "c")]
    assert document.broken == {("b",)}
    assert document.complete


def test_reading_that_breaks_off_is_not_complete():
    assert not read_document("a: [1\n", "f")[0].complete


def test_a_file_larger_than_the_limit_is_refused_at_once():
    assert "larger than 1 MB" in first_problem("a" * (MAX_BYTES + 1))


def test_the_bad_files(shared):
    folder = shared / "faults" / "yaml"
    expected = json.loads((folder / "EXPECT.json").read_text())
    wanted = {
        "alias_bomb": "anchors are not allowed",
        "comma": {"speed": "1,5"},
        "dupkey": "key given twice",
        "inf": {"speed": math.inf},  # refused by the schema, see test_loader
        "nan": None,
        "norway": {"name": "no"},
        "octal": {"seed": 123},
        "recursive": "aliases are not allowed",
        "sci": {"dt": 0.01},
        "tab": "a tab cannot indent YAML",
    }
    assert wanted.keys() == expected.keys()
    for name, outcome in wanted.items():
        begin = time.perf_counter()
        document, problems = read_document((folder / f"{name}.yaml").read_text(), name)
        assert time.perf_counter() - begin < 5.0, name
        if isinstance(outcome, str):
            assert outcome in str(problems[0]), name
        elif outcome is not None:
            assert (document.value, problems) == (outcome, []), name
        else:
            assert math.isnan(document.value["radius"])


_PIECES = st.sampled_from(
    ["\t", "\n", "\n  ", "- ", "? ", ": ", "{", "}", "[", "]", ", ", "&a ", "*a", "!!int ", "!x ", "%YAML 1.1\n"]
    + ["---\n", "...\n", "|\n", ">-\n", "'", '"', '"\\uD800"', "\\", "#", "\x00", "\x85", "\u2028", "é", "0123", ".inf"]
    + ["1e999", "9" * 500, "~", "true", "<<: ", "@", "`", "\r", "1:30", "\ufeff", "[" * 50, "a", "name", "!<", " "]
)


@settings(max_examples=50, deadline=None, derandomize=True)
@given(st.lists(_PIECES | st.text(max_size=4), max_size=12).map("".join))
def test_any_text_gives_a_value_or_problems_with_places(text):
    document, problems = read_document(text, "f")
    assert document.complete or problems
    for problem in problems:
        assert problem.line is not None
        assert problem.line >= 1
        assert problem.column is not None
        assert problem.column >= 1
        str(problem).encode()
        assert "\n" not in str(problem)


def test_dotted_paths_fit_a_line():
    assert dotted(("a", 0, "b")) == "a.0.b"
    assert dotted(("x\ny" * 100,)).endswith("...")
