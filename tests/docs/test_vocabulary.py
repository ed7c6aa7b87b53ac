"""The words of the project: standard terms of robotics in pages, docstrings, helps and messages; see `prose.py`."""

from __future__ import annotations

import ast
import re
from functools import cache
from pathlib import Path

import prose
import pytest

ROOT = Path(__file__).parents[2]

OPENINGS = re.compile(r"\s*(What|Whether|How|Of|Where|Who|Whose|Whom|That|Those)\b")


def _python() -> list[Path]:
    return [file for package in ("cinegen", "raff2urdf") for file in sorted((ROOT / package).rglob("*.py"))]


def _docstrings(tree: ast.Module) -> dict[ast.AST, str]:
    kinds = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)
    found = {node: ast.get_docstring(node) for node in ast.walk(tree) if isinstance(node, kinds)}
    return {node: text for node, text in found.items() if text}


@cache
def _tree(file: Path) -> ast.Module:
    return ast.parse(file.read_text(encoding="utf-8"))


def _line(node: ast.AST) -> int:
    return getattr(node, "lineno", 1)


@pytest.mark.parametrize("package", ["cinegen", "raff2urdf"])
def test_docstrings_open_with_a_verb_or_a_noun(package: str) -> None:
    hits = []
    for file in (file for file in _python() if file.relative_to(ROOT).parts[0] == package):
        for node, text in _docstrings(_tree(file)).items():
            if OPENINGS.match(text):
                hits.append(f"{file.relative_to(ROOT)}:{_line(node)}: {text.splitlines()[0]}")
    assert not hits


def test_no_two_public_classes_share_a_name() -> None:
    places: dict[str, list[str]] = {}
    for file in _python():
        for node in _tree(file).body:
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                places.setdefault(node.name, []).append(str(file.relative_to(ROOT)))
    assert not {name: files for name, files in places.items() if len(files) > 1}


@pytest.mark.parametrize("term", prose.TERMS, ids=lambda term: term.use)
def test_a_term_is_found_where_it_is_wrong_and_only_there(term: prose.Term) -> None:
    assert list(term.hits(term.bad))
    assert not prose.words_of(term.good, "good")


def test_findings_name_file_line_and_term() -> None:
    assert prose.words_of("A link.\n`pull`, the\nmotor of a link.", "page.md", 7) == [
        "page.md:9: 'motor': actuated joint, actuator; a motor is a machine in a catalogue"
    ]


def test_names_of_code_in_what_is_shown_are_found() -> None:
    shown = "Take control: HandDrag control to drag (WebGL, JavaScript)."
    assert prose.code_names_of(shown, "page.js", 3) == ["page.js:3: 'HandDrag': words, not a name of code"]


def test_long_sentences_and_passive_pages_are_found(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text(
        "# Head\n\n" + "It moves. " * 20 + "Word" + " word" * 35 + " (A. Author, 1999).\n\n| " + "cell " * 50 + "|\n"
    )
    long, passive = prose.style_of(page)
    assert [(line, words) for line, words, _ in long] == [(3, 36)]
    assert passive == 0.0
    page.write_text("It is moved. The loop is closed by it. " * 10 + "It moves. " * 5)
    assert prose.style_of(page) == ([], 0.8)
