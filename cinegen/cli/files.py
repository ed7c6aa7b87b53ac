"""Files that commands read and write, and JSON on standard output."""

from __future__ import annotations

import io
import json
from collections.abc import Sized
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cinegen.errors import CinegenError
from raff2urdf.files import write_all

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def read(file: Path) -> str:
    """Return a file's text.

    Raises:
        CinegenError: it can't be read.
    """
    try:
        return file.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise CinegenError(f"{file}: can't be read: {error}") from None


def write(path: Path, content: str | bytes) -> None:
    """Write a file as a whole, and create the folder that it is in.

    Raises:
        CinegenError: it can't be written.
    """
    try:
        write_all({path: content.encode(errors="backslashreplace") if isinstance(content, str) else content})
    except OSError as error:
        raise CinegenError(f"{path}: can't be written: {error.strerror}") from None


def write_figure(path: Path, figure: Figure, quiet: bool = False) -> None:
    """Write a picture in the format of the path's suffix, PNG without one; print its path unless `quiet`.

    Raises:
        CinegenError: it can't be written, or there is no such format.
    """
    picture = io.BytesIO()
    try:
        figure.savefig(picture, format=path.suffix[1:] or "png", dpi=150)
    except ValueError as error:  # matplotlib lists the formats
        raise CinegenError(f"{path}: can't be written: {error}") from None
    write(path, picture.getvalue())
    if not quiet:
        print(f"picture: {path}", flush=True)


def print_result(document: Any, text: object, as_json: bool) -> None:
    """Print a result: a document as JSON, or its text."""
    print(json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False) if as_json else text, flush=True)


def count(things: Sized, name: str) -> str:
    """Return `3 joints` or `1 joint`."""
    return f"{len(things)} {name}{'s' * (len(things) != 1)}"
