"""A file that others have written, as a RAFF file: everything is made before anything is written."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from raff2urdf import readers
from raff2urdf.analysis import loop_kind
from raff2urdf.check import check
from raff2urdf.errors import RaffError, RaffWarning, did_you_mean
from raff2urdf.files import is_stream, write_all
from raff2urdf.readers.urdf import joints, parse, several, silent
from raff2urdf.urdf2raff.graphics import Carried, units_of
from raff2urdf.urdf2raff.robot import Reversal, reverse
from raff2urdf.writer import write


def reverse_file(
    path: Path,
    out: Path | None = None,
    units: str | None = None,
    free_mimic: bool = False,
    graphics: bool = True,
    robot: str | None = None,
    loops: Mapping[str, str] | None = None,
    ignore_loops: bool = False,
) -> Reversal:
    """See `raff2urdf.reverse`."""
    text, beside = readers.read(path, robot, ignore_loops)
    for name, kind in (loops or {}).items():
        entries = {entry["name"]: entry for entry in (beside or {}).get("loops", [])}
        if name not in entries:
            raise RaffError(f"{path}: no loop '{name}'{did_you_mean(name, list(entries))}")
        entries[name]["kind"] = loop_kind(kind).name.lower()
    tree = parse(text, str(path))
    left_out = [joint for joint in joints(tree) if silent(joint)]
    if left_out:
        message = f"{several(left_out, str(path))}: no lower and upper limit are given; written without limits"
        warnings.warn(message, RaffWarning, stacklevel=3)
    found = reverse(tree, str(path), beside, units or units_of(tree), free_mimic)
    try:
        check(found.document)
    except RaffError as error:
        raise RaffError(
            f"{path}: RAFF can't say it: {'; '.join(problem.message for problem in error.problems)}"
        ) from None
    if out is None:
        return found
    written: dict[Path, bytes] = {}
    if graphics:
        folder = _folder(out)
        carried = Carried(tree, str(path), path.parent, folder or Path(), out.stem)
        found = replace(found, document=replace(found.document, robots=(carried.robot(found.document, found.nodes),)))
        written |= carried.written
        if written and folder is None:
            raise RaffError(f"{path}: no folder for graphics beside {out}: name a file, or give --no-graphics")
    try:
        written[out] = write(found.document, _head(path, found), found.notes).encode()
    except RaffError as error:
        raise RaffError(f"{path}: {error}") from None
    try:
        write_all(written)
    except OSError as error:
        raise RaffError(f"{error.filename}: can't be written: {error.strerror}") from None
    return found


def _folder(out: Path) -> Path | None:
    """The folder of a RAFF file; None where it is a device or a FIFO, which has no files beside it."""
    try:
        return None if is_stream(out) else out.parent
    except OSError as error:
        raise RaffError(f"{out}: can't be written: {error.strerror}") from None


def _head(path: Path, found: Reversal) -> Sequence[str]:
    """What a reader of the file should know first."""
    lines = [f"From {path.name}. Behind a link stands the joint's name there."]
    moved = sum(offset != 0.0 for offset in found.offsets.values())
    if moved:
        lines.append(f"Joint variables are those of {path.name}, but for {moved}, which count from another zero there.")
    renamed = {link: node for link, node in found.nodes.items() if link != node}
    if renamed:
        shown = ", ".join(f"{link} is {node}" for link, node in list(renamed.items())[:8])
        more = f" and {len(renamed) - 8} more" if len(renamed) > 8 else ""
        lines.append(f"Names that differ: {shown}{more}.")
    return lines
