"""Robots, scenes and examples that are shipped: inside the installed packages, or in a clone next to them."""

from __future__ import annotations

import ast
import os
import re
from collections import Counter
from collections.abc import Sequence
from functools import cache
from importlib.metadata import PackageNotFoundError, distribution
from importlib.resources import files
from pathlib import Path

from raff2urdf.errors import RaffError, did_you_mean, near_names


def folder(package: str, name: str) -> Path:
    """Return a folder that is shipped with a package."""
    root = Path(str(files(package)))
    return root / name if (root / name).is_dir() else root.parent / name


def robots() -> dict[str, Path]:
    """Return the RAFF files of the shipped robots by name."""
    return {path.stem: path for path in sorted(folder("raff2urdf", "robots").glob("*.raff"))}


@cache
def reference_robots() -> dict[str, Path]:
    """Return the URDFs of the package example-robot-data by name; none if it is not installed.

    A name is that of the file; of several files of one name, that of the robot's folder, without `_description`.
    """
    try:
        package = distribution("example-robot-data")
    except PackageNotFoundError:
        return {}
    share = Path(str(package.locate_file("cmeel.prefix/share/example-robot-data/robots")))
    paths = sorted(share.rglob("*.urdf"), key=lambda path: path.stem.lower())
    count = Counter(path.stem for path in paths)
    names = {
        path: path.stem if count[path.stem] == 1 else path.relative_to(share).parts[0].removesuffix("_description")
        for path in paths
    }
    return {name: path for path, name in names.items()}


def scenes() -> dict[str, Path]:
    """Return the files of the shipped scenes by name."""
    return {path.stem: path for path in sorted(folder("raff2urdf", "robots").glob("scenes/*.toml"))}


def find_robot(path: str | Path) -> Path:
    """Return the file at a path; or, if there is none and the path is the name of a shipped or reference robot, that
    robot's file.

    Raises:
        RaffError: the path is a name, and neither a file nor a robot has it.
    """
    from raff2urdf.readers import ENDINGS

    return _shipped(Path(path), {**reference_robots(), **robots()}, "robot", (".raff", *ENDINGS))


def find_scene(path: str | Path) -> Path:
    """Return the file at a path; or, if there is none and the path is the name of a shipped scene, that scene's file.

    Raises:
        RaffError: the path is a name, and neither a file nor a scene has it.
    """
    return _shipped(Path(path), scenes(), "scene", (".toml", ".json"))


def similar_file(path: str | Path, endings: Sequence[str] = ()) -> str:
    """Return `": did you mean 'robots/delta4.raff'?"` for a path that does not exist: a file in the same folder, or the
    name of a shipped robot or scene; empty if no name is similar. Files have the path's ending; if it has none, one of
    those in `endings`, or any if there are none."""
    path = Path(path)
    try:
        if path.exists():
            return ""
        names = sorted(os.listdir(path.parent)) if path.parent.is_dir() else []
    except (OSError, ValueError):
        return ""
    endings = (path.suffix,) if path.suffix else endings
    stems = {Path(name).stem: path.with_name(name) for name in names if not endings or Path(name).suffix in endings}
    shipped = {**robots(), **scenes()}
    known = {name: Path(name) for name, file in shipped.items() if not endings or file.suffix in endings}
    for candidates in (stems, known):
        if near := near_names(path.stem, candidates):
            return f": did you mean '{candidates[near[0]]}'?"
    return ""


def description(path: Path) -> str:
    """Return a file's own description: the first line of a program's docstring; of a RAFF or TOML file the comment
    at its top, up to the first colon or full stop."""
    content = path.read_text(encoding="utf-8")
    if path.suffix == ".py":
        return (ast.get_docstring(ast.parse(content)) or "").partition("\n")[0]
    match = re.search(r"^(?://|#) (.+(?:\n(?://|#) .+)*)", content, flags=re.MULTILINE)
    text = re.sub(r"\n(//|#) ", " ", match[1]) if match else ""
    return re.split(r"[.:](?:\s|$)", text, maxsplit=1)[0]


def _shipped(path: Path, known: dict[str, Path], what: str, endings: Sequence[str]) -> Path:
    folder_of_that_name = path.name in known and path.is_dir()
    if path.name != str(path) or path.suffix or str(path) == "-" or (path.exists() and not folder_of_that_name):
        return path
    if path.name not in known:
        near = similar_file(path, endings) or did_you_mean(path.name, tuple(known))
        raise RaffError(f"{path}: there is no such file, and no {what} of this name is shipped{near}")
    return known[path.name]
