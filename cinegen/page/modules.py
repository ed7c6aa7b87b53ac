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

_COMMENT = re.compile(r"^[ \t]*(?:/\*\*(?:(?!\*/).)*\*/|//[^\n]*)[ \t]*\n", re.MULTILINE | re.DOTALL)
"""A comment that has its lines to itself. No text of several lines in the modules has such lines."""

_EXPORT = re.compile(r"^export (?=(?:async )?(?:function\*?|class|const) (\w+|\[[\w, ]+\]))", re.MULTILINE)
_NAMED_IMPORT = re.compile(r'^import \{([^}]*)\} from "([^"]+)";', re.MULTILINE)


def import_map(given: Mapping[str, str], line: str = "session/link.js") -> dict[str, str]:
    """Return the addresses of all modules of the page by name.

    Args:
        given: texts of further modules, which import nothing, by name.
        line: module of `static` that stands for the line to a session.
    """
    found = {_name(path): text for path, text in _modules(_ENTRY, f"cinegen/page/static/{line}")}
    found["three"] = source("cinegen/cockpit/static/base/three.js")
    return {name: _address(text) for name, text in (found | dict(given)).items()}


def linked(entry: str) -> str:
    """Return a module of `static` and all that it imports as one script, for a worker: there is no import map for it.

    Args:
        entry: path of the module in `static`. Modules export functions, classes and constants by name.

    Raises:
        ValueError: modules import each other in a circle.
    """
    lines, numbers = ['"use strict";'], dict[str, int]()

    def named(names: str) -> str:
        return " ".join(names.split()).replace(" as ", ": ")

    def link(path: str, above: tuple[str, ...]) -> str:
        if path in above:
            raise ValueError(f"modules import each other: {' -> '.join((*above, path))}")
        if path not in numbers:
            text = source(path)
            imports = [
                f"const {{ {named(names)} }} = {link(_resolved(path, target), (*above, path))};"
                for names, target in _NAMED_IMPORT.findall(text)
            ]
            names = ", ".join(name.strip("[]") for name in _EXPORT.findall(text))
            text = _EXPORT.sub("", _NAMED_IMPORT.sub("", text))
            numbers[path] = len(numbers)
            imported = "\n".join(imports)
            lines.append(f"const m{numbers[path]} = (() => {{\n{imported}\n{text}\nreturn {{ {names} }};\n}})();")
        return f"m{numbers[path]}"

    link(f"cinegen/page/static/{entry}", ())
    return "\n".join(lines)


def _modules(entry: str, line: str) -> Iterator[tuple[str, str]]:
    """Yield the paths and texts of a module and all that it imports, with `line` for the line to a session."""
    waiting, seen = [entry], {entry}
    while waiting:
        path = waiting.pop()
        text = source(path)
        imported: dict[str, str] = {}
        for match in _IMPORT.finditer(text):
            target = _resolved(path, match[2])
            target = line if target == _SEAM else target
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
    return text if "/vendor/" in path else _COMMENT.sub("", text)


def _address(text: str) -> str:
    return "data:text/javascript;charset=utf-8," + quote(text, safe=_KEPT)
