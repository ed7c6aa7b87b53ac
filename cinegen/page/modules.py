"""Modules of JavaScript in one HTML file: an import map gives each a name and holds its text.

An import of a file becomes an import of that name, since a module without an address of its own has no relative ones.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from importlib.resources import files
from pathlib import Path, PurePosixPath
from urllib.parse import quote

_IMPORT = re.compile(r'^([ \t]*(?:await )?(?:import|export)\b[^;"]*?|\} from )"(\.{1,2}/[^"]+)"(\)?;)', re.MULTILINE)
_KEPT = "".join(chr(code) for code in range(0x20, 0x7F) if chr(code) not in "%#")
"""Characters that stand for themselves in the data of an address (https://fetch.spec.whatwg.org/#data-urls)."""

_NAMES = {"cinegen/cockpit/static/": "cinegen/", "cinegen/page/static/": "cinegen/page/"}
_ENTRY = "cinegen/cockpit/static/start.js"
_SEAM = "cinegen/cockpit/static/base/link.js"
"""The only module of the cockpit that a page without a server replaces: its line to a session."""
_LINE = "cinegen/page/static/session/link.js"

_COMMENT = re.compile(r"^[ \t]*(?:/\*\*(?:(?!\*/).)*\*/|//[^\n]*)[ \t]*\n", re.MULTILINE | re.DOTALL)
"""A comment that has its lines to itself. No text of several lines in the modules has such lines."""


def import_map(further: Mapping[str, str]) -> dict[str, str]:
    """Return the addresses of all modules of the page by name.

    Args:
        further: texts of further modules, which import nothing, by name.
    """
    texts = {_name(path): text for path, text in _modules()}
    texts["three"] = source("cinegen/cockpit/static/base/three.js")
    return {name: _address(text) for name, text in (texts | dict(further)).items()}


def _modules() -> Iterator[tuple[str, str]]:
    """Yield the paths and texts of the page's first module and all that it imports."""
    waiting, seen = [_ENTRY], {_ENTRY}
    while waiting:
        path = waiting.pop()
        text = source(path)
        imported: dict[str, str] = {}
        for match in _IMPORT.finditer(text):
            target = _resolved(path, match[2])
            target = _LINE if target == _SEAM else target
            imported[match[2]] = target
            if target not in seen:
                seen.add(target)
                waiting.append(target)
        yield path, _IMPORT.sub(lambda match: f'{match[1]}"{_name(imported[match[2]])}"{match[3]}', text)  # noqa: B023


def _resolved(path: str, relative: str) -> str:
    """Return the path of the module that `path` imports as `relative`."""
    parts: list[str] = []
    for part in (PurePosixPath(path).parent / relative).parts:
        if part == "..":
            parts.pop()
        else:
            parts.append(part)
    return "/".join(parts)


def _name(path: str) -> str:
    return next(name + path.removeprefix(folder) for folder, name in _NAMES.items() if path.startswith(folder))


def source(path: str) -> str:
    """Return the text of a module, without comments unless it is another project's: they would be 7 % of the file."""
    package, _, rest = path.removeprefix("cinegen/").partition("/")
    text = Path(str(files(f"cinegen.{package}"))).joinpath(rest).read_text(encoding="utf-8")
    return _COMMENT.sub("", text)


def _address(text: str) -> str:
    return "data:text/javascript;charset=utf-8," + quote(text, safe=_KEPT)
