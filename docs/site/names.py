"""Links from names in code font to the reference: of each name that means one public thing, wherever it is written.

A name is linked if it is that of a class, a function with an underscore or arguments, an attribute of a class
(`Solver.step`), or has its package before it (`cinegen.load`). Words such as `plan` are names of commands, too.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import cache
from importlib import import_module
from typing import Any

_NAME = re.compile(r"((?:[^\W\d]\w*\.)*[^\W\d]\w*)(\((?:[^()]|\([^()]*\))*\))?")
_ALONE = ("class", "exception", "function", "data")
"""Kinds of entries that are written without what holds them."""
_PACKAGES = ("cinegen", "raff2urdf")


@cache
def _thing(path: str) -> Any:
    """Return what a path such as cinegen.ik.Solver leads to; a new object if there is nothing."""
    first, *parts = path.split(".")
    named: Any = import_module(first)
    for count, part in enumerate(parts, 1):
        try:
            named = getattr(named, part) if hasattr(named, part) else import_module(".".join([first, *parts[:count]]))
        except ImportError:
            return object()
    return named


def entry_of(text: str, kinds: Mapping[str, str]) -> str | None:
    """Return the entry that a text in code font names, or None if there is none, or more than one.

    Args:
        text: what is in code font.
        kinds: kind (class, function, method, ...) of each entry of the reference, by its path.
    """
    match = _NAME.fullmatch(text)
    if match is None:
        return None
    name = match[1]
    *holders, last = name.split(".")
    if holders and holders[0] in _PACKAGES:
        entries = [path for path in kinds if path.endswith(f".{last}") and _thing(path) is _thing(name)]
    elif holders:
        entries = [path for path in kinds if path.endswith(f".{name}") and path.split(".")[-2][0].isupper()]
    elif last[0].isupper() or "_" in last or match[2]:
        entries = [path for path, kind in kinds.items() if path.endswith(f".{last}") and kind in _ALONE]
    else:
        return None
    return min(entries) if len({id(_thing(path)) for path in entries}) == 1 else None


def link_names(app: Any, doctree: Any, page: str) -> None:
    """Make names of the reference links, but for those in headings and in links."""
    from docutils import nodes
    from sphinx.addnodes import desc_signature
    from sphinx.util.nodes import make_refnode

    objects = app.env.get_domain("py").objects
    kinds = {path: entry.objtype for path, entry in objects.items()}
    outside = (nodes.reference, nodes.title, desc_signature)
    for literal in list(doctree.findall(nodes.literal)):
        path = entry_of(literal.astext(), kinds)
        parent = literal.parent
        while parent is not None and not isinstance(parent, outside):
            parent = parent.parent
        if path is None or parent is not None:
            continue
        entry = objects[path]
        literal.replace_self(make_refnode(app.builder, page, entry.docname, entry.node_id, literal.deepcopy(), path))


def setup(app: Any) -> dict[str, bool]:
    """Connect what is above."""
    app.connect("doctree-resolved", link_names)
    return {"parallel_read_safe": True}
