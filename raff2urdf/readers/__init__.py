"""Read robots from other formats, as the text of a URDF and the contents of a constraints file.

SDF and MJCF declare loops and couplings themselves; for URDF there are many dialects, which `dialects` collects. A new
format is a new module here, and a line in `READERS`.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from raff2urdf.errors import RaffError, warn
from raff2urdf.files import STANDARD, read_bytes
from raff2urdf.readers.xml_file import error_at, parse_xml, read_text

if TYPE_CHECKING:  # each format is imported when it is read
    from raff2urdf.constraints import Constraints
    from raff2urdf.readers.loops.declaration import IgnoreList
    from raff2urdf.readers.options import ReadOptions
    from raff2urdf.readers.urdf_builder import Converted


class Description(NamedTuple):
    """A robot as it was read.

    Attributes:
        urdf: the text of a URDF.
        constraints: the contents of its constraints file; None if nothing more is known.
        dialects: in which its loops and couplings are declared.
        notes: about what was read.
        left_out: loops and couplings that were ignored, as requested.
        ignored: elements that were ignored.
        is_driven: whether the constraints state as actuated what the file names as driven (`drives`), which may be
            incomplete.
    """

    urdf: str
    constraints: Constraints | None
    dialects: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    left_out: tuple[str, ...] = ()
    ignored: tuple[str, ...] = ()
    is_driven: bool = False


TEXT = "<text>"
"""Name, in errors, of a robot's text that is no file. It names other files relative to the current folder."""

ENDINGS = (".urdf", ".xml", ".sdf", ".world", ".mjcf", ".xacro")
"""Endings of files that are read here. They hold XML; the root element determines the format."""


def holds_xml(path: Path) -> bool:
    """Return whether a file is read here: by its ending; of standard input (`-`) by its first character."""
    return path.suffix.lower() in ENDINGS or (path == STANDARD and read_bytes(path).lstrip()[:1] == b"<")


def is_text(source: object) -> bool:
    """Return whether a robot is given as text, not as a path: it begins with `<`, or has several lines."""
    return isinstance(source, str) and (source.lstrip().startswith("<") or "\n" in source)


def read(
    path: Path,
    robot: str | None = None,
    ignore_loops: bool = False,
    ignore: Sequence[str] = (),
    options: ReadOptions | None = None,
    text: str | None = None,
) -> Description:
    """Read the robot of a URDF, SDF or MJCF. A URDF may be xacro: then errors name lines of what xacro makes of it.

    Args:
        path: of the file.
        robot: which robot of a file with several; the first by default.
        ignore_loops: leave out all loops and couplings; one warning lists them.
        ignore: loops and couplings to be left out, by name or by element, such as "pin" or "loop_joint", and files next
            to a URDF, such as "robot.yaml"; one warning lists them.
        options: others; `ReadOptions.check` then refuses those without effect.
        text: of a robot that is no file. The path is only its name then, in errors, which name lines of the text;
            nothing is next to it, and files that it names are searched relative to the current folder.

    Raises:
        RaffError: the file, or its sidecar file, can't be read or is wrong: where and why. A file declares a loop or a
            coupling that can't be read, and that is not ignored. `ignore` names none. The text is xacro.
    """
    from raff2urdf.readers import xacro_file
    from raff2urdf.readers.loops.declaration import IgnoreList
    from raff2urdf.readers.options import ReadOptions

    options, is_file, name = options or ReadOptions(), text is None, str(path)
    text = read_text(path) if text is None else text
    root = parse_xml(text, name)
    if root.tag == "robot" and xacro_file.is_xacro(path, root):
        if not is_file:
            raise RaffError(f"{path}: xacro is a program: load its file, .urdf.xacro, or the output of `xacro`")
        expanded = xacro_file.expanded(path, options)
        xacro_file.check_calls(path, expanded)
        text = expanded.text
    kind = str(root.tag)
    if kind not in READERS:
        known = ", ".join(f"<{word}>" for word in READERS)
        why = _OTHER_ROOTS.get(kind, f"this is not a robot (known: {known})")
        raise error_at(name, root, f"its first element is <{kind}>: {why}")
    source = _Source(text, path, is_file, robot, ignore_loops, IgnoreList(ignore), options)
    described = READERS[kind](source)
    options.met("package", *re.findall(r"(?:package|model)://([^/\"']+)", described.urdf))
    return checked(described, path, source.ignore, ignore_loops)


class _Source(NamedTuple):
    """A robot that is read, and how: see `read`."""

    text: str
    path: Path
    is_file: bool
    robot: str | None
    ignore_loops: bool
    ignore: IgnoreList
    options: ReadOptions


def _with_options(source: _Source) -> str:
    """Return a URDF as the options require it."""
    from raff2urdf.readers.urdf import swap_limits
    from raff2urdf.readers.urdf_tree import text_of

    root = parse_xml(source.text, str(source.path))
    swapped = swap_limits(root) if source.options.swap_limits else []
    if not swapped:
        return source.text
    source.options.met("swap-limits")
    warn(f"{source.path}: lower and upper limits exchanged, as requested: {', '.join(swapped)}")
    return text_of(root)


def checked(described: Description, path: Path, ignore: IgnoreList, ignore_loops: bool) -> Description:
    """Return a robot without what is ignored, once it is checked.

    Raises:
        RaffError: its constraints contradict each other, or `ignore` names none.
    """
    from raff2urdf.constraints import check_values

    described = _without(described, ignore, ignore_loops)
    if described.constraints is not None:
        check_values(described.constraints, str(path))
    if not ignore_loops:
        ignore.check(str(path))
    if described.left_out:
        moves = "; every joint moves independently" if ignore_loops else ""
        warn(f"{path}: left out, as requested{moves}: {', '.join(described.left_out)}")
    return described


def _without(described: Description, ignore: IgnoreList, all_of_them: bool) -> Description:
    """Return a robot without the loops and couplings that are ignored."""
    from raff2urdf.constraints import without_loops

    if described.constraints is None:
        return described
    kept, left_out = dict(described.constraints), list(described.left_out)
    for key, label in (("loops", "loop"), ("couplings", "coupling")):
        for entry in described.constraints.get(key, []):
            if all_of_them or ignore.takes(entry["name"]):
                kept[key] = [other for other in kept[key] if other is not entry]
                left_out.append(f"{label} '{entry['name']}'")
    if all_of_them:
        return described._replace(constraints=without_loops(kept), left_out=tuple(left_out))
    if len(left_out) > len(described.left_out):
        counted = dict.fromkeys(kept.keys() & {"mobility", "loop_rows", "loop_rank"})
        kept = {key: value for key, value in (kept | counted).items() if key != "couplings" or value}
    return described._replace(constraints=kept, left_out=tuple(left_out))


def _urdf(source: _Source) -> Description:
    from raff2urdf.readers import drives, uncounted
    from raff2urdf.readers.loops import dialects
    from raff2urdf.readers.loops.successive import moving
    from raff2urdf.readers.urdf import joints

    text, name = _with_options(source), str(source.path)
    described = dialects.read(text, source.path, source.ignore, source.ignore_loops, source.is_file)
    root = parse_xml(text, name)
    scalar = [
        str(joint.get("name"))
        for joint in joints(parse_xml(described.urdf, name))
        if joint.get("type") in ("revolute", "continuous", "prismatic")
    ]
    described = described._replace(notes=described.notes + tuple(uncounted.note_of(uncounted.of_urdf(root, scalar))))
    driven = {} if source.ignore_loops else dict(drives.of_urdf(root))
    return drives.declared(described, driven, moving(described.urdf, name)) if driven else described


def _sdf(source: _Source) -> Description:
    from raff2urdf.graphics.names import find
    from raff2urdf.readers import drives, sdf

    search = source.options.search

    def included(file: str, folder: Path) -> Path:
        source.options.met("package", *re.findall(r"^(?:package|model)://([^/]+)", file))
        return find(file, folder, packages=search)

    read = sdf.read(source.text, str(source.path), source.robot, source.ignore.words, included)
    described = _of_format("SDF", source.ignore, read)
    return described if source.ignore_loops else drives.declared(described, read.driven)


def _mjcf(source: _Source) -> Description:
    from raff2urdf.readers import mjcf

    text = None if source.is_file else source.text
    return _of_format("MJCF", source.ignore, mjcf.read(source.path, source.ignore.words, text))


def _of_format(dialect: str, ignore: IgnoreList, read: Converted) -> Description:
    """Return a robot of a format that declares loops and couplings itself."""
    values, ignored, notes = read.constraints, read.ignored, read.notes
    declares = values["loops"] or values.get("couplings")
    requested = tuple(text for text in ignored if ignore.takes(*re.findall("'([^']*)'", text)))
    if "gravity" in values:
        notes = [*notes, "gravity is {:g}, {:g}, {:g} m/s2".format(*values["gravity"])]
    unread = tuple(f"not read: {text}" for text in ignored if text not in requested)
    return Description(read.urdf, values, (dialect,) if declares else (), (*notes, *unread), requested, tuple(ignored))


_OTHER_ROOTS = {
    "mujocoinclude": "this is a part of a robot: load the file that includes it",
    "gazebo": "this is not SDF 1.4 or later: convert it with Gazebo's `gz sdf --convert`",
}

READERS = {"robot": _urdf, "sdf": _sdf, "mujoco": _mjcf}
