"""The templates of messages that propose something, found in the sources."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

VERBS = (
    "add|allow|build|change|check|choose|close|convert|copy|correct|declare|download|export|give|join|leave|let|load|"
    "make|move|name|pipe|put|remove|rename|replace|restore|run|save|state|swap|turn|use|write"
)
PROPOSAL = re.compile(rf"(?:^|[:;,.(] )(?:or |then )?(?:{VERBS})\b|--[a-z]{{2}}\S* |did you mean|if it was meant", re.I)
"""An imperative after a mark, an option of a command, or a guess."""
ANYTHING = "\0"


def text_of(node: ast.AST) -> str | None:
    """A text of the sources, in which one character stands for every placeholder."""
    match node:
        case ast.Constant(value=str(text)):
            return text
        case ast.JoinedStr(values=values):
            return "".join(ANYTHING if isinstance(value, ast.FormattedValue) else value.value for value in values)
    return None


def templates(node: ast.AST) -> Iterator[tuple[int, str]]:
    """Lines and texts below a node of a source, without its docstrings."""
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.Expr) and isinstance(child.value, ast.Constant):
            continue
        text = text_of(child)
        if text is not None:
            yield child.lineno, text
        if not isinstance(child, ast.Constant):
            inside = child
            if isinstance(child, ast.JoinedStr):
                inside = ast.Tuple([v for v in child.values if isinstance(v, ast.FormattedValue)], ast.Load())
            yield from templates(inside)


def proposals(path: Path) -> list[tuple[int, str]]:
    """Lines and texts of the templates in a source that propose something."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    return [(n, t) for n, t in templates(tree) if " " in t.strip() and PROPOSAL.search(t)]


def pattern(template: str) -> re.Pattern[str]:
    """What a template becomes, without the placeholders at its ends."""
    return re.compile(r"[^\n]*?".join(map(re.escape, template.strip(ANYTHING).split(ANYTHING))))
