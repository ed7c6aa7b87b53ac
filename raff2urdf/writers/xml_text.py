"""Text of XML files: numbers that read back to the same double, and comments."""

from __future__ import annotations

from collections.abc import Iterable

from lxml import etree

from raff2urdf.escape import xml_comment


def numeral(value: float) -> str:
    """Return the shortest text that reads back to the same double; no -0.0."""
    return repr(float(value) + 0.0).removesuffix(".0")


def numerals(values: Iterable[float]) -> str:
    """Return several numbers with spaces between."""
    return " ".join(map(numeral, values))


def comment(lines: Iterable[str]) -> etree._Element:
    """Return a comment of several lines."""
    text = xml_comment("\n  ".join(lines))
    return etree.Comment(f"\n  {text}\n")


def text_of(root: etree._Element) -> str:
    """Return the text of a whole file."""
    text: bytes = etree.tostring(root, xml_declaration=True, encoding="utf-8", pretty_print=True)
    return text.decode()
