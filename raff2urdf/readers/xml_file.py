"""XML as robots are published in: what breaks its rules, but can mean only one thing, is read all the same."""

from __future__ import annotations

import codecs
import re
from pathlib import Path
from typing import Any

from lxml import etree

from raff2urdf.errors import RaffError

_HARMLESS = (
    "NS_ERR_UNDEFINED_NAMESPACE",  # <drake:joint> where nothing says what drake is
    "NS_ERR_QNAME",  # <gz::joint>
    "ERR_HYPHEN_IN_COMMENT",  # <!-- a -- b -->
    "ERR_RESERVED_XML_NAME",  # lines before <?xml ...?>
    "ERR_UNKNOWN_VERSION",  # <?xml version="0.1"?>
)
"""What programs that read robots pass over, though XML forbids it."""

_INCLUDE = "{http://www.w3.org/2001/XInclude}include"
_MARKS = ((codecs.BOM_UTF8, "utf-8-sig"), (codecs.BOM_UTF16_LE, "utf-16"), (codecs.BOM_UTF16_BE, "utf-16"))


def read_text(path: Path) -> str:
    """The text of a file, in the encoding that its first bytes tell; UTF-8 unless they do.

    Raises:
        RaffError: it can't be read.
    """
    try:
        content = path.read_bytes()
    except (OSError, ValueError) as error:
        raise RaffError(f"{path}: can't be read: {error}") from None
    marked = next((name for mark, name in _MARKS if content.startswith(mark)), None)
    said = re.match(rb"""\s*<\?xml[^>]*?\sencoding\s*=\s*["']([\w.-]+)["']""", content[:1000])
    encoding = marked or (said[1].decode("ascii") if said else "utf-8")
    try:
        text = content.decode(encoding)
    except LookupError:
        raise RaffError(f"{path}:1: no encoding is called '{encoding}': save the file as UTF-8") from None
    except UnicodeError as error:
        line = content[: getattr(error, "start", 0)].count(b"\n") + 1
        raise RaffError(f"{path}:{line}: this is no text in {encoding}: save it as UTF-8") from None
    return text


def parse_xml(text: str, name: str) -> Any:
    """The first element of an XML text. No other file is read for it, and no entity that it defines.

    Elements in the same namespace as the first lose theirs: `<robot xmlns="...">` is a robot.

    Args:
        text: of the file.
        name: what errors call it.

    Raises:
        RaffError: no XML, or one with entities or inclusions.
    """
    parser = etree.XMLParser(encoding="utf-8", resolve_entities=False, no_network=True, load_dtd=False, recover=True)
    try:
        tree = etree.fromstring(text.encode(errors="replace"), parser)
    except etree.XMLSyntaxError as error:
        raise RaffError(f"{name}:{error.lineno or 1}: no XML: {error.msg}") from None
    for entry in parser.error_log:
        if entry.level_name != "WARNING" and entry.type_name not in _HARMLESS:
            raise RaffError(f"{name}:{entry.line or 1}: no XML: {' '.join(entry.message.split())}")
    if tree is None:
        raise RaffError(f"{name}:1: no XML: there is no element in it")
    subset = tree.getroottree().docinfo.internalDTD
    for entity in subset.iterentities() if subset is not None else ():
        raise RaffError(f"{name}:1: it defines the entity '{entity.name}': entities are not read")
    for found in tree.iter(etree.Entity, _INCLUDE):
        what = f"the entity '{found.name}'" if found.tag is etree.Entity else f"'{found.get('href')}' by XInclude"
        raise RaffError(f"{name}:{found.sourceline}: it uses {what}: write what that stands for into the file")
    own = etree.QName(tree).namespace
    if own is not None:
        for element in tree.iter(f"{{{own}}}*"):
            element.tag = etree.QName(element).localname
    return tree
