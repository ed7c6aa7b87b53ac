"""Expand xacro, the macro language for URDFs, by the package of that name, if it is installed."""

from __future__ import annotations

import contextlib
import io
import warnings
from pathlib import Path
from typing import Any

from lxml import etree

from raff2urdf.errors import RaffError
from raff2urdf.extras import needs
from raff2urdf.files import LARGEST_FILE, STANDARD, note

ENDING = ".xacro"


def is_xacro(path: Path, root: Any) -> bool:
    """Return whether a file is xacro, by its ending or its elements."""
    return path.suffix.lower() == ENDING or any(_is_macro(element) for element in root.iter("*"))


def expanded(path: Path) -> str:
    """Return the URDF that xacro makes of a file.

    Raises:
        RaffError: xacro is not installed, or refuses the file.
    """
    if path == STANDARD:
        raise RaffError(
            f"{path}: xacro can't be read from standard input: pipe the output of `xacro`, or name the file"
        )
    with needs("xacro", f"{path}: files in xacro"):
        import xacro
    try:
        with contextlib.redirect_stderr(io.StringIO()), warnings.catch_warnings():  # its own traces
            warnings.simplefilter("ignore")  # of expressions in the file
            text = str(xacro.process_file(str(path)).toprettyxml(indent="  "))
        if len(text) > LARGEST_FILE:
            raise MemoryError(f"its result is larger than {LARGEST_FILE / 1e6:.0f} MB")
        return text
    except Exception as error:  # of xacro, of expressions in the file, of XML
        why = " ".join(str(error).split())[:500] or type(error).__name__
        if "ament_index" in why:
            why = "$(find PACKAGE) needs ROS (its package ament_index_python): load the output of `xacro` there"
        raise RaffError(f"{path}: xacro: {why}") from None
    finally:
        for included in xacro.all_includes:
            note(included)


def _is_macro(element: Any) -> bool:
    if any("$(optenv " in value for value in element.attrib.values()):
        return True
    uri = etree.QName(element).namespace if "{" in str(element.tag) else ""
    return str(element.tag).startswith("xacro:") or element.prefix == "xacro" or "/xacro" in (uri or "")
