"""The words of the project: standard terms of robotics in documentation, docstrings, messages and page texts.

The terms of `REPLACED` have each one meaning here that the field calls by another word. Words with several meanings
("way", "place", "hold") need a reader and are not listed.
"""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]

REPLACED = {
    r"pulls?": "task",
    r"verdicts?": "status",
    r"(?<!stepper )(?<!choose )motors?(?! and gears| suits| allow)": "actuated joint, actuator",
    r"freedoms": "degrees of freedom, DoF",
    r"fathers?": "parent",
    r"surveys?": "map specification",
    r"without unit": "dimensionless",
    r"astray": "diverged",
    r"surplus": "redundant actuation",
    r"no number": "NaN",
    r"gestures?": "undo step, interaction",
    r"seekers?": "local IK solver",
    r"scouts?": "look-ahead",
    r"tempo": "playback speed",
    r"shells": "reach bounds",
    r"wish(es|ed)?": "null-space velocity, secondary task",
    r"led": "driven, guided, interpolated",
    r"unheld": "unsupported wrench",
    r"come to(?! rest| a stop)": "reached",
    r"(gain|loose|lose)s? a motion": "lose a DoF, gain an uncontrolled DoF",
    r"makes? (no )?sense": "is (in)valid: say why",
    r"nobody": "no user, no client",
    r"is told": "is reported",
    r"says? (so|why|what|how|where|which|that)": "reports, states",
}
WORDS = re.compile(r"\b(" + "|".join(f"(?:{term})" for term in REPLACED) + r")\b", re.IGNORECASE)
OPENINGS = re.compile(r"\s*(What|Whether|How|Of|Where|Who|Whose|Whom|That|Those)\b")
CODE = re.compile(r"```.*?```|`[^`]*`|\[[^\]]*\]\([^)]*\)", re.DOTALL)


def _python() -> list[Path]:
    return [file for package in ("cinegen", "raff2urdf") for file in sorted((ROOT / package).rglob("*.py"))]


def _docstrings(tree: ast.Module) -> dict[ast.AST, str]:
    kinds = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)
    found = {node: ast.get_docstring(node) for node in ast.walk(tree) if isinstance(node, kinds)}
    return {node: text for node, text in found.items() if text}


def _line(node: ast.AST) -> int:
    return getattr(node, "lineno", 1)


def _found(text: str, where: str) -> list[str]:
    return [f"{where}: '{match.group()}'" for match in WORDS.finditer(text)]


@pytest.mark.parametrize(
    "page", ["README.md", *(str(page.relative_to(ROOT)) for page in sorted((ROOT / "docs").rglob("*.md")))]
)
def test_pages_use_the_terms_of_the_field(page: str) -> None:
    text = CODE.sub(lambda code: "\n" * code.group().count("\n"), (ROOT / page).read_text())
    assert not [hit for i, line in enumerate(text.splitlines(), 1) for hit in _found(line, f"{page}:{i}")]


@pytest.mark.parametrize("package", ["cinegen", "raff2urdf"])
def test_docstrings_and_messages_use_the_terms_of_the_field(package: str) -> None:
    hits = []
    for file in (file for file in _python() if file.relative_to(ROOT).parts[0] == package):
        for node in ast.walk(ast.parse(file.read_text())):
            if isinstance(node, ast.Constant) and isinstance(node.value, str) and " " in node.value:
                hits += _found(CODE.sub("", node.value), f"{file.relative_to(ROOT)}:{_line(node)}")
    assert not hits


@pytest.mark.parametrize("package", ["cinegen", "raff2urdf"])
def test_docstrings_open_with_a_verb_or_a_noun(package: str) -> None:
    hits = []
    for file in (file for file in _python() if file.relative_to(ROOT).parts[0] == package):
        for node, text in _docstrings(ast.parse(file.read_text())).items():
            if OPENINGS.match(text):
                hits.append(f"{file.relative_to(ROOT)}:{_line(node)}: {text.splitlines()[0]}")
    assert not hits


def test_no_two_public_classes_share_a_name() -> None:
    places: dict[str, list[str]] = {}
    for file in _python():
        for node in ast.parse(file.read_text()).body:
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                places.setdefault(node.name, []).append(str(file.relative_to(ROOT)))
    assert not {name: files for name, files in places.items() if len(files) > 1}


def test_the_linter_finds_what_it_looks_for() -> None:
    assert _found("Its motors are told nothing.", "here") == ["here: 'motors'"]
    assert OPENINGS.match("Whether it is closed.")
    assert not OPENINGS.match("Return whether it is closed.")
