"""Read XML files: common violations of XML's rules are accepted if they can mean only one thing."""

from __future__ import annotations

import codecs
import re
from pathlib import Path
from typing import Any

from lxml import etree

from raff2urdf.errors import RaffError
from raff2urdf.files import read_bytes

_HARMLESS = (
    "NS_ERR_UNDEFINED_NAMESPACE",  # <drake:joint> without a declaration of drake
    "NS_ERR_QNAME",  # <gz::joint>
    "ERR_HYPHEN_IN_COMMENT",  # <!-- a -- b -->
    "ERR_RESERVED_XML_NAME",  # lines before <?xml ...?>
    "ERR_UNKNOWN_VERSION",  # <?xml version="0.1"?>
)
"""Violations that programs which read robots ignore."""

NAMESPACE = "urn:raff2urdf"
"""Namespace of the elements with which raff2urdf writes what a format has no notation for; its prefix is raff."""

FILE = f"{{{NAMESPACE}}}file"
"""Attribute of an element from another file than the one that is read: the path of that."""

_INCLUDE = "{http://www.w3.org/2001/XInclude}include"
_MARKS = ((codecs.BOM_UTF8, "utf-8-sig"), (codecs.BOM_UTF16_LE, "utf-16"), (codecs.BOM_UTF16_BE, "utf-16"))


def read_text(path: Path) -> str:
    """Return the text of a file, in the encoding that its first bytes declare; UTF-8 by default.

    Raises:
        RaffError: it can't be read.
    """
    content = read_bytes(path)
    marked = next((name for mark, name in _MARKS if content.startswith(mark)), None)
    declared = re.match(rb"""\s*<\?xml[^>]*?\sencoding\s*=\s*["']([\w.-]+)["']""", content[:1000])
    encoding = marked or (declared[1].decode("ascii") if declared else "utf-8")
    try:
        return content.decode(encoding)
    except LookupError:
        raise RaffError(f"{path}:1: unknown encoding '{encoding}': save the file as UTF-8") from None
    except UnicodeError as error:
        line = content[: getattr(error, "start", 0)].count(b"\n") + 1
        raise RaffError(f"{path}:{line}: this is not text in {encoding}: save the file as UTF-8") from None


def parse_xml(text: str, name: str) -> Any:
    """Return the root element of an XML text. No other file is read for it, and no entity that it defines.

    Elements in the same namespace as the root lose it: `<robot xmlns="...">` is a robot.

    Args:
        text: of the file.
        name: of the file, in errors.

    Raises:
        RaffError: invalid XML, or XML with entities or inclusions.
    """
    parser = etree.XMLParser(encoding="utf-8", resolve_entities=False, no_network=True, load_dtd=False, recover=True)
    try:
        tree = etree.fromstring(text.encode(errors="replace"), parser)
    except etree.XMLSyntaxError as error:
        raise RaffError(f"{name}:{error.lineno or 1}: invalid XML: {error.msg}") from None
    for entry in parser.error_log:
        if entry.level_name != "WARNING" and entry.type_name not in _HARMLESS:
            raise RaffError(f"{name}:{entry.line or 1}: invalid XML: {' '.join(entry.message.split())}")
    if tree is None:
        raise RaffError(f"{name}:1: invalid XML: the file has no element")
    subset = tree.getroottree().docinfo.internalDTD
    for entity in subset.iterentities() if subset is not None else ():
        raise RaffError(
            f"{name}:1: the entity '{entity.name}' is not read: write its text instead, and remove <!ENTITY>"
        )
    for inner in tree.iter(etree.Entity, _INCLUDE):
        what = f"the entity '{inner.name}'" if inner.tag is etree.Entity else f"'{inner.get('href')}' by XInclude"
        raise error_at(name, inner, f"{what} is not read: write its content into the file")
    if tree.tag.startswith("{"):
        space = tree.tag[: tree.tag.index("}") + 1]
        for element in tree.iter(f"{space}*"):
            element.tag = element.tag.removeprefix(space)
    return tree


def own_element(parent: Any, name: str) -> Any | None:
    """Return the element `raff:robot` in a robot or a model; None if it has none.

    Args:
        parent: the robot or the model.
        name: of the file, in errors.

    Raises:
        RaffError: another element of raff2urdf would not be read, because of its parent or its namespace.
    """
    robot = parent.find(f"{{{NAMESPACE}}}robot")
    for element in parent.getroottree().iter("*"):
        space, _, tag = element.tag.removeprefix("{").rpartition("}")
        if space != NAMESPACE and element.prefix != "raff" and not tag.startswith("raff:"):
            continue
        around = list(element.iterancestors())
        if element is robot or robot in around:
            continue
        if parent in around or not any(other.tag == "model" for other in around):
            word, twice = tag.removeprefix("raff:"), robot is not None and tag == "robot"
            place = "there is one already" if twice else f"only the element <raff:robot> of the <{parent.tag}> is read"
            space = "" if space == NAMESPACE else f', with the namespace xmlns:raff="{NAMESPACE}"'
            raise error_at(name, element, f"<raff:{word}> would be lost: {place}{space}")
    return robot


def error_at(name: str, element: Any, message: str) -> RaffError:
    """Return an error with the line of an element of the file of that name, or of the file that is noted in it."""
    around = (e.get(FILE) for e in (element, *element.iterancestors()))
    return RaffError(f"{next(filter(None, around), name)}:{element.sourceline}: {message}")
