"""Any text is text in each language: judged by that language's own reader."""

import csv
import html
import io
import json
import shlex

from hypothesis import example, given
from hypothesis import strategies as st
from lxml import etree

from raff2urdf import escape

TEXTS = st.text(st.characters(blacklist_categories=["Cs"]), max_size=40) | st.text(
    "*/-<>$=\\\"'\n\r\t %~\u202e", max_size=20
)


@given(TEXTS)
@example("\x1b[31m\r\n\x9b2J\x7f\u202e\u2028\u00ad\U000e0041")
def test_one_line_is_printable_and_has_the_text(text):
    shown = escape.one_line(text)
    assert all(char.isprintable() or (char.isspace() and char not in "\n\r\t\v\f\x85\u2028\u2029") for char in shown)
    if "\\" not in text and '"' not in text:
        assert json.loads(f'"{shown}"') == text  # JSON's escapes


@given(TEXTS)
def test_a_terminal_gets_line_breaks_and_tabs_but_no_other_controls(text):
    shown = escape.terminal(text)
    assert [shown.count(char) for char in "\n\t"] == [text.count(char) for char in "\n\t"]
    assert escape.one_line(shown.replace("\n", "").replace("\t", "")) == shown.replace("\n", "").replace("\t", "")
    document = json.dumps({text: [text]}, ensure_ascii=False, indent=1)
    assert json.loads(escape.terminal(document)) == {text: [text]}


@given(TEXTS)
@example("*/*/")
@example("/*/")
@example("*\n/")
def test_a_comment_ends_where_its_writer_ends_it(text):
    comment = f"/* {escape.block_comment(text)} */"
    assert "\n" not in comment
    assert (comment.find("*/"), comment.rfind("/*")) == (len(comment) - 2, 0)  # -Wcomment refuses /* in it
    line = escape.line_comment(text)
    assert len(f"# {line}".splitlines()) == 1
    assert not line.endswith("\\")


@given(TEXTS)
@example("-")
@example("--->")
def test_comments_of_xml(text):
    root = etree.fromstring(f"<a><!--{escape.xml_comment(text)}--><b/></a>".encode())
    assert [element.tag for element in root.iter("*")] == ["a", "b"]


@given(st.lists(TEXTS, max_size=6, unique=True))
@example(["a-b", "a_b", "a b", "a_b_2", "²", "ä", ""])
def test_identifiers_are_different_identifiers(texts):
    identifiers = escape.identifiers(texts)
    assert len(set(identifiers)) == len(texts)
    assert all(f"x{name}".isidentifier() for name in identifiers)


@given(st.recursive(TEXTS | st.integers(), lambda inner: st.lists(inner) | st.dictionaries(TEXTS, inner), max_leaves=5))
def test_literals_of_javascript(value):
    text = escape.javascript(value)
    assert "<" not in text
    assert text.isascii()
    assert json.loads(text.replace('["__proto__"]:', '"__proto__":')) == value


def test_a_key_is_no_prototype():
    assert escape.javascript({"__proto__": {"a": 1}}) == '{["__proto__"]: {"a": 1}}'


@given(TEXTS)
def test_html(text):
    shown = escape.html_text(text)
    assert not set('<>"') & set(shown)
    assert html.unescape(shown) == escape.terminal(text)


@given(TEXTS)
@example("=1+1")
@example("\t=1")
@example("'=1")
@example("-1")
def test_cells_compute_nothing_and_read_back(text):
    file = io.StringIO()
    csv.writer(file).writerow([escape.csv_cell(text), "end"])
    ((cell, _),) = csv.reader(io.StringIO(file.getvalue()))
    assert not cell.startswith(("=", "+", "-", "@", "\t", "\r"))
    if text.isprintable() and not text.startswith("'"):
        assert escape.csv_text(cell) == text


@given(TEXTS.filter(lambda text: "\0" not in text))
def test_words_of_a_shell(text):
    assert shlex.split(f"--loop {escape.shell_word(text)}=ball") == ["--loop", f"{text}=ball"]


@given(TEXTS, TEXTS)
def test_segments_of_paths_differ_where_names_do(name, other):
    first, second = escape.path_segment(name), escape.path_segment(other)
    assert (first == second) == (name == other)
    assert "/" not in first
    assert first.startswith(":")
    assert escape.path_segment("a/b%", "loop ") == "loop a%2Fb%25"  # tests/javascript/names.test.js
