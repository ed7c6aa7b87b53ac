"""No folder of the packages is longer than a page, no file longer than a walk through it, no function than a screen.

Complexity is bounded by ruff (C901, `tool.ruff.lint.mccabe` in pyproject.toml).
"""

import ast
from collections import Counter

import pytest

FOLDER, FILE, FUNCTION = 25, 400, 60
"""Modules of a folder, lines of a file, lines of a function without its docstring."""


@pytest.fixture(scope="module")
def modules(root):
    """All modules of both packages, relative to the clone, with their texts."""
    paths = (path for package in ("cinegen", "raff2urdf") for path in (root / package).rglob("*.py"))
    return {path.relative_to(root): path.read_text(encoding="utf-8") for path in paths}


def test_a_folder_is_read_at_a_glance(modules):
    counts = Counter(path.parent for path in modules)
    assert {folder: count for folder, count in counts.items() if count > FOLDER} == {}


def test_a_file_is_one_module_and_not_two(modules):
    assert {path.as_posix() for path, text in modules.items() if text.count("\n") > FILE} == set()


def test_a_function_is_one_idea(modules):
    too_long = {}
    for path, text in modules.items():
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                described = node.body[0].end_lineno - node.body[0].lineno + 1 if ast.get_docstring(node) else 0
                if node.end_lineno - node.lineno + 1 - described > FUNCTION:
                    too_long[f"{path}: {node.name}"] = node.end_lineno - node.lineno + 1 - described
    assert {name for name in too_long if "cinegen/proof/" not in name} == set()
