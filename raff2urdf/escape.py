"""Foreign text in other languages: one function a medium makes any text safe there.

Names of robots, links, joints and files are other people's text: in a comment they must not become code, at a terminal
no commands to it. Whatever writes text for another program calls a function of this module, or a library that encodes
(json, yaml, csv, lxml).
"""

from __future__ import annotations

import html
import itertools
import json
import re
import shlex
import unicodedata
from collections.abc import Container, Iterable
from typing import Any

_LINES = str.maketrans("", "", "\n\t")
_FORMULA = ("=", "+", "-", "@", "\t", "\r")


def one_line(text: str) -> str:
    r"""Return a text as one line that can be printed: for messages, labels and comments that end with the line.

    Control characters, line breaks, characters that reverse the direction of text or that can't be seen, and half
    characters are written as JSON escapes: `\n`, `\u202e`. Nothing else changes.
    """
    return text if text.isprintable() else "".join(map(_visible, text))


def terminal(text: str) -> str:
    """Return a text of several lines for a terminal: as `one_line`, but line breaks and tabs stay.

    JSON stays JSON of the same value.
    """
    if text.translate(_LINES).isprintable():
        return text
    return "".join(character if character in "\n\t" else _visible(character) for character in text)


def _visible(letter: str) -> str:
    if letter.isprintable() or unicodedata.category(letter) == "Zs":  # a wide or narrow space
        return letter
    return "\\u007f" if letter == "\x7f" else json.dumps(letter)[1:-1]


def block_comment(text: str) -> str:
    """Return a text for the inside of a comment of C or JavaScript, between `/*` and `*/`, in one line."""
    return one_line(text).replace("*/", "* /").replace("/*", "/ *")


def line_comment(text: str) -> str:
    """Return a text for a comment that ends with its line, as `#` of URScript and `//` of C begin it."""
    return f"{one_line(text)}." if text.endswith("\\") else one_line(text)  # C continues the line


def unique_name(name: str, taken: Container[str], mark: str = "#") -> str:
    """Return the name, with `#2` and so on appended if it is taken."""
    numbered = (f"{name}{mark}{number}" for number in itertools.count(2))
    return next(candidate for candidate in itertools.chain([name], numbered) if candidate not in taken)


def identifiers(texts: Iterable[str]) -> list[str]:
    """Return identifiers of C and JavaScript, different ones, for texts: what is no letter of ASCII, digit or `_`
    becomes `_`, since compilers differ in the other letters that they accept.

    They need a prefix: they may begin with a digit, or be reserved.
    """
    names: dict[str, None] = {}
    for text in texts:
        names[unique_name(re.sub("[^A-Za-z0-9_]", "_", text), names, "_")] = None
    return list(names)


def javascript(value: Any) -> str:
    """Return a value of JSON as a literal of JavaScript, in ASCII, also for a script in HTML."""
    return json.dumps(value).replace("<", "\\u003c").replace('"__proto__":', '["__proto__"]:')


def html_text(text: object) -> str:
    """Return a text for HTML: an element's text, or an attribute's value in quotation marks."""
    return html.escape(terminal(str(text)))


def xml_comment(text: str) -> str:
    """Return a text for a comment of XML or HTML, which two hyphens would end."""
    text = terminal(text)
    while "--" in text:
        text = text.replace("--", "- -")
    return f"{text} " if text.endswith("-") else text


def csv_cell(text: str) -> str:
    """Return a text for a cell of a CSV table: an apostrophe precedes what a spreadsheet would compute.

    Module `csv` writes the quotation marks that it needs.
    """
    text = one_line(text)
    return f"'{text}" if text.startswith(_FORMULA) else text


def csv_text(cell: str) -> str:
    """Return the text of a cell that `csv_cell` wrote."""
    return cell[1:] if cell.startswith("'") and cell[1:].startswith(_FORMULA) else cell


def shell_word(text: object) -> str:
    """Return a text as one word of a command line that users may copy into a shell."""
    return shlex.quote(str(text))


def path_segment(text: str, prefix: str = ":") -> str:
    """Return a text, behind a prefix, as one segment of a path of the viewer's scene.

    No segment is a key that objects of JavaScript have from the beginning, such as `constructor`; `segment` of
    `cockpit/static/base/names.js` returns the same.
    """
    return prefix + text.replace("%", "%25").replace("/", "%2F")
