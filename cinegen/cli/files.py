"""Files that commands read and write, and JSON on standard output."""

from __future__ import annotations

import io
import json
import sys
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cinegen.errors import CinegenError
from raff2urdf.command.command_line import UsageError
from raff2urdf.errors import counted, first_of, raised_as, run_all
from raff2urdf.escape import terminal
from raff2urdf.files import GENERATED, STANDARD, check_new, write_all, writing

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from cinegen.model import Mechanism

_MOST_LINKS = 8  # that a line names

_METADATA: dict[str, dict[str, str | None]] = {
    "png": {"Software": GENERATED},
    "svg": {"Creator": GENERATED, "Date": None},
    "pdf": {"Creator": GENERATED, "CreationDate": None},
}
# The same file each time; texts of a PDF in TrueType fonts, which programs can edit.
_REPRODUCIBLE: dict[Any, Any] = {"svg.hashsalt": "cinegen", "pdf.fonttype": 42}


def check_outputs(*paths: Path | None, force: bool = False, json: bool = False, remakeable: bool = True) -> None:
    """Refuse files that would replace others, before anything is computed; if one is `-`, print to standard error.

    Args:
        paths: files to be written; None is left out.
        force: whether any file may be replaced.
        json: whether JSON is printed to standard output.
        remakeable: whether files of this type can be made again: they are replaced then unless they were changed, see
            `raff2urdf.files.check_new`.

    Raises:
        UsageError: two outputs go to standard output.
        raff2urdf.RaffError: files exist; names all of them.
    """
    outputs = [path for path in paths if path is not None]
    if STANDARD in outputs:
        if json or outputs.count(STANDARD) > 1 or sys.stdout is sys.stderr:
            raise UsageError("only one output can go to standard output (-): name a file for the other")
        sys.stdout = sys.stderr  # `raff2urdf.command.output.run` restores it
    run_all(partial(check_new, path, remakeable) for path in outputs if not force)


def write(path: Path, content: str | bytes) -> None:
    """Write a file as a whole, and create the folder that it is in.

    Raises:
        CinegenError: it can't be written.
    """
    with writing(CinegenError):
        write_all({path: content.encode(errors="backslashreplace") if isinstance(content, str) else content})


def write_figure(path: Path, figure: Figure, quiet: bool = False) -> None:
    """Write a picture in the format of the path's suffix, PNG without one; print its path unless `quiet`.

    A picture that is written again is the same file: it has no date.

    Raises:
        CinegenError: it can't be written, or there is no such format.
    """
    from matplotlib import rc_context

    picture = io.BytesIO()
    with raised_as(CinegenError, ValueError, f"{path}: can't be written: "):  # matplotlib lists the formats
        form = path.suffix[1:].lower() or "png"
        with rc_context(_REPRODUCIBLE):
            figure.savefig(picture, format=form, dpi=150, metadata=_METADATA.get(form))
    content = picture.getvalue()
    write(path, terminal(content.decode()) if form == "svg" else content)  # comments quote all texts
    if not quiet:
        print(f"picture: {path}", flush=True)


def print_result(document: Any, text: object, as_json: bool) -> None:
    """Print a result: a document as JSON, or its text."""
    print(json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False) if as_json else text, flush=True)


def disabled_pairs(mechanism: Mechanism) -> str:
    """Return how many pairs of links the SRDF of a robot disables, as text; empty without one."""
    srdf = mechanism.source.srdf
    return "" if srdf is None else f"not checked, by {srdf['file']}: {counted(len(srdf['disabled']), 'pair')} of links"


def unchecked_links(mechanism: Mechanism) -> str:
    """Return which links no check of collisions covers, and why, as text; empty if all are checked."""
    lost = mechanism.unchecked_links
    names = first_of(list(lost), _MOST_LINKS)
    return f"not checked: {names}, whose meshes are missing or unreadable; sticks are used instead" if lost else ""
