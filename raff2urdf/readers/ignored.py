"""List the elements of a file that are not read, since nothing here depends on them: sensors, collisions, friction.

Elements that would remove degrees of freedom are never among them: those that can't be read are errors.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from raff2urdf.readers import drives, xacro_file
from raff2urdf.readers.loops import closing_frames, closing_joints, declared_loops, joint_couplings, loop_elements
from raff2urdf.readers.loops.declaration import tag_of
from raff2urdf.readers.options import ReadOptions
from raff2urdf.readers.urdf_file import by_name
from raff2urdf.readers.xml_file import parse_xml, read_text

ALL: frozenset[str] = frozenset("*")
"""An element of which everything is read."""

_URDF: Mapping[str, Collection[str]] = {
    "robot": ("link", "joint", "material", "gazebo"),
    "link": ("visual", "collision", "inertial"),
    "joint": ("parent", "child", "origin", "axis", "limit", "dynamics"),
    **dict.fromkeys(("visual", "collision", "inertial", "material", "limit", "origin", "axis", "dynamics"), ALL),
}

_SDF: Mapping[str, Collection[str]] = {
    "sdf": ("world", "model"),
    "world": ("model", "include"),
    "model": ("model", "include", "link", "joint", "frame", "pose", "static", "robot"),
    "link": ("pose", "visual", "inertial"),
    "inertial": ("pose", "mass", "inertia"),
    "visual": ("pose", "geometry", "material"),
    "joint": (
        *("parent", "child", "pose", "axis", "axis2", "gearbox_ratio", "gearbox_reference_body"),
        *("thread_pitch", "screw_thread_pitch"),
    ),
    "axis": ("xyz", "use_parent_model_frame", "limit", "mimic", "dynamics"),
    "axis2": ("xyz", "use_parent_model_frame", "limit", "mimic", "dynamics"),
    "dynamics": ("damping", "friction"),
    "limit": ("lower", "upper", "velocity", "effort"),
    "material": ("diffuse", "ambient"),
    **dict.fromkeys(("include", "frame", "geometry", "mimic", "robot", "xyz", "inertia"), ALL),
}

_MJCF: Mapping[str, Collection[str]] = {
    "mujoco": (
        *("compiler", "default", "asset", "worldbody", "equality", "tendon", "actuator", "keyframe", "include"),
        *("option", "size"),
    ),
    "worldbody": ("body", "geom", "site", "frame", "replicate", "attach", "include"),
    "body": ("body", "geom", "site", "frame", "joint", "freejoint", "inertial", "replicate", "attach", "include"),
    "frame": ("body", "geom", "site", "frame", "replicate", "attach", "include"),
    **dict.fromkeys(("compiler", "default", "asset", "equality", "tendon", "actuator", "keyframe", "inertial"), ALL),
}

_TABLES = {"robot": _URDF, "sdf": _SDF, "mujoco": _MJCF}


class IgnoredElements(NamedTuple):
    """Elements of one kind that are not read.

    Attributes:
        element: their tag, behind that of the element around them, such as `joint/dynamics`.
        number: how many there are.
        lines: of the file, or of what xacro makes of it; of the first ones.
    """

    element: str
    number: int
    lines: tuple[int, ...]


def ignored(path: Path, options: ReadOptions | None = None) -> list[IgnoredElements]:
    """Return the elements of a URDF, SDF or MJCF that are not read, in file order; `options` are those of `read`.

    Raises:
        RaffError: the file can't be read.
    """
    text = read_text(path)
    root = parse_xml(text, str(path))
    if root.tag == "robot" and xacro_file.is_xacro(path, root):
        root = parse_xml(xacro_file.expanded(path, options or ReadOptions()).text, str(path))
    kept = list(_read_elsewhere(root, str(path))) if root.tag == "robot" else []
    by_tag: dict[str, list[int]] = {}
    _walk(root, _TABLES.get(str(root.tag), {}), {id(element) for element in kept}, by_tag)
    return [IgnoredElements(name, len(lines), tuple(lines[:_MOST])) for name, lines in by_tag.items()]


_MOST = 10  # lines that are listed


def _read_elsewhere(root: Any, name: str) -> list[Any]:
    """Return the elements of a URDF that declare loops, couplings and what drives its joints."""
    if root.find("joint") is not None:
        by_name(root.findall("joint"), name)
    declared = [*joint_couplings.find(root), *loop_elements.find(root), *closing_joints.find(root, name)]
    read = [d.element for d in declared]
    unread = [d.element for d in declared_loops.find(root, {id(d) for d in read}) if d.element is not None]
    frames = [frame for frame in root.iterchildren("frame") if closing_frames.is_end(frame)]
    return [*read, *unread, *frames, *(element for _, element in drives.of_urdf(root))]


def _walk(parent: Any, table: Mapping[str, Collection[str]], kept: set[int], by_tag: dict[str, list[int]]) -> None:
    tag = str(parent.tag).rpartition("}")[2]
    known = table.get(tag, ())
    for element in parent.iterchildren("*"):
        name = str(element.tag).rpartition("}")[2].rpartition(":")[2]
        if known is ALL or id(element) in kept:
            continue
        if name in known:
            if table.get(name) is not ALL:
                _walk(element, table, kept, by_tag)
        elif any(id(inner) in kept for inner in element.iter("*")):  # one of its elements is read
            _walk(element, {}, kept, by_tag)
        else:
            by_tag.setdefault(f"{tag_of(parent)}/{tag_of(element)}", []).append(int(element.sourceline))
