"""The words of the project: standard terms of robotics in pages, docstrings, helps and messages; see `prose.py`."""

import prose
import pytest


@pytest.mark.parametrize("term", prose.TERMS, ids=lambda term: term.use)
def test_a_term_is_found_where_it_is_wrong_and_only_there(term):
    assert list(term.hits(term.bad))
    assert not prose.words_of(term.good, "good")


def test_findings_name_file_line_and_term():
    assert prose.words_of("A link.\n`pull`, the\nmotor of a link.", "page.md", 7) == [
        "page.md:9: 'motor': actuated joint, actuator; a motor is a machine in a catalogue"
    ]


def test_long_sentences_and_passive_pages_are_found(tmp_path):
    page = tmp_path / "page.md"
    page.write_text(
        "# Head\n\n" + "It moves. " * 20 + "Word" + " word" * 35 + " (A. Author, 1999).\n\n| " + "cell " * 50 + "|\n"
    )
    long, passive = prose.style_of(page)
    assert [(line, words) for line, words, _ in long] == [(3, 36)]
    assert passive == 0.0
    page.write_text("It is moved. The loop is closed by it. " * 10 + "It moves. " * 5)
    assert prose.style_of(page) == ([], 0.8)


def test_docstrings_that_open_with_a_clause_and_classes_that_share_a_name_are_found(tmp_path, monkeypatch):
    monkeypatch.setattr(prose, "ROOT", tmp_path)
    (tmp_path / "some").mkdir()
    (tmp_path / "some/a.py").write_text('"""Loops."""\n\nclass Loop:\n    """Whether it is closed."""\n')
    (tmp_path / "some/b.py").write_text('class Loop:\n    """Return whether."""\n\nclass _Own: ...\n')
    assert prose.code_findings_of("some") == [
        "some/a.py:3: opens with a clause: Whether it is closed.",
        "some/b.py:1: class Loop is also in some/a.py",
    ]
