"""Files of an MJCF: what it includes and attaches."""

from __future__ import annotations

from graphlib import CycleError, TopologicalSorter
from itertools import pairwise
from pathlib import Path
from typing import Any

from raff2urdf.errors import Problem, RaffError
from raff2urdf.graphics.names import check_mesh
from raff2urdf.readers.xml_file import parse_xml, read_text


def read_files(path: Path, text: str | None) -> tuple[dict[Path, Any], list[Problem]]:
    """Read a file, and the files that it includes or attaches, which must be near it, before MuJoCo does.

    Returns:
        the first elements of the files that can be read, by their paths, and the problems of the others.

    Raises:
        RaffError: the file itself can't be read, or one attaches itself.
    """
    folder, pending, met = path.absolute().parent, [path], {path.absolute()}
    named = dict[Path, dict[Path, str]]()  # by each file
    roots, problems = dict[Path, Any](), list[Problem]()
    while pending:
        inner = pending.pop(0)
        try:
            root = parse_xml(read_text(inner) if text is None or roots else text, str(inner))
        except RaffError as error:
            if not roots:
                raise
            problems += error.problems
            continue
        roots[inner] = root
        places = [folder, *(folder / e.get("assetdir") for e in root.iter("compiler") if e.get("assetdir"))]
        for element in root.iter("include", "model"):
            for file in (place / element.get("file", "") for place in (*places, inner.parent)):
                if not file.exists() or file.is_dir():
                    continue
                named.setdefault(inner.absolute(), {})[file.absolute()] = element.tag
                if file.absolute() in met:
                    continue
                met.add(file.absolute())
                label = f"{inner}:{element.sourceline}: the file '{element.get('file')}'"
                try:
                    if not file.is_file():
                        raise RaffError(f"{label} is not a regular file")
                    check_mesh(file, folder, label)
                except RaffError as error:
                    problems += error.problems
                    continue
                pending += [file] if file.suffix.lower() in ("", ".xml", ".mjcf", ".urdf") else []
    try:
        TopologicalSorter(named).prepare()
    except CycleError as error:
        *_, first, last = error.args[1]
        if "model" in (named[above][below] for below, above in pairwise(error.args[1])):  # MuJoCo would crash
            why = f"{last.name} names {first.name}, which names it in turn, also through others: leave one out"
            raise RaffError([*problems, Problem(f"{path}: a file attaches itself: {why}")]) from None
    return roots, problems
