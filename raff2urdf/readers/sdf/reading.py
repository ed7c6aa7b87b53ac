"""Read SDF, Gazebo's Simulation Description Format, as a URDF and the loops that it closes."""

from __future__ import annotations

from collections.abc import Callable, Collection
from pathlib import Path
from typing import Any

from raff2urdf.constraints import Constraints
from raff2urdf.graphics.names import find
from raff2urdf.readers.loops import closing_frames
from raff2urdf.readers.loops.declaration import label_of, leave_out, local, tag_of
from raff2urdf.readers.loops.declared_loops import LOOP_LIKE, named_in, own_words
from raff2urdf.readers.loops.loop_joint import LoopJoint
from raff2urdf.readers.sdf.conversion import SdfConversion
from raff2urdf.readers.sdf.included import robot_of
from raff2urdf.readers.sdf.model import SdfModel, SdfModelReader
from raff2urdf.readers.urdf_builder import Converted
from raff2urdf.readers.urdf_file import parse
from raff2urdf.readers.urdf_tree import UrdfTree
from raff2urdf.readers.xml_file import NAMESPACE, error_at, parse_xml


def read(
    text: str,
    name: str,
    robot: str | None = None,
    ignore: Collection[str] = (),
    find: Callable[[str, Path], Path] = find,
) -> Converted:
    """Read an SDF.

    Args:
        text: of the file.
        name: of the file, in errors.
        robot: which model; the first with joints by default.
        ignore: names of joints whose loop or coupling is to be left out.
        find: the search for the files that it includes.

    Raises:
        RaffError: not an SDF, no such model, or something in it that has no counterpart; with the element's line.
    """
    root = parse_xml(text, name)
    chosen = robot_of(root, name, robot, find)
    model = SdfModelReader(name).model(chosen)
    conversion = SdfConversion(name, model, ignore)
    urdf, values = conversion.run()
    frames = _close_frames(name, urdf, values, ignore)
    ignored = [*conversion.ignored, *frames, *_unread(name, chosen, model, ignore)]
    return Converted(urdf, values, ignored, conversion.notes, conversion.driven)


def _close_frames(name: str, urdf: str, values: Constraints, ignore: Collection[str]) -> list[str]:
    """Add loops for pairs of frames that coincide (`closing_frames`), unless a joint joins their bodies already.

    Returns:
        the frames that are ignored.
    """
    root = parse(urdf, name)
    declared = list(closing_frames.find(root))
    if not declared:
        return []
    tree, ignored = UrdfTree(root, name), []
    joined = [{tree.body(loop[end]["node"])[0] for end in ("first", "second")} for loop in values["loops"]]
    for declaration in declared:
        if declaration.read is None or {*declaration.words} & {*ignore}:
            ignored.append(f"'{declaration.name}' (frames)")
            continue
        joint = declaration.read(tree)
        assert isinstance(joint, LoopJoint)
        if {tree.body(joint.first)[0], tree.body(joint.second)[0]} not in joined:
            values["loops"].append(joint.add_to(tree, declaration.name)[0])
    return ignored


def _unread(name: str, element: Any, model: SdfModel, ignore: Collection[str]) -> list[str]:
    """Return what seems to declare a loop or a coupling that is not read, and is to be left out.

    Raises:
        RaffError: such an element is not to be left out.
    """
    names = {*model.links, *(joint.name for joint in model.joints)}
    names |= {full.rpartition("::")[2] for full in names}
    left_out = []
    pending = [element]
    if element.getparent().tag == "world":
        pending += [e for e in element.getparent().iterchildren("*") if e.tag not in ("model", "actor", "light")]
    while pending:
        candidate = pending.pop()
        word, parent = local(candidate), candidate.getparent().tag
        likely, plugin = bool(LOOP_LIKE.search(word)), word == "plugin" and LOOP_LIKE.search(own_words(candidate))
        in_place = parent in ("model", "world", "joint") or candidate is element
        elsewhere = word == "joint" and parent != "model" and len(candidate) > 0
        two_ends = (
            candidate.tag != "joint" and candidate.find("parent") is not None and candidate.find("child") is not None
        )
        likely, in_place = likely or two_ends, in_place or two_ends
        read = parent in _READ.get(word, ()) or NAMESPACE in str(candidate.tag)
        if (
            not read
            and (likely or plugin or elsewhere)
            and ((likely and in_place) or len(named_in(candidate, names)) > 1)
        ):
            label, known_as = label_of(candidate), candidate.get("name") or tag_of(candidate)
            if known_as not in ignore:
                what = f"{label} seems to declare a loop or a coupling, which can't be read"
                raise error_at(name, candidate, f"{what}: {leave_out(known_as)}")
            left_out.append(f"'{known_as}' (line {candidate.sourceline})")
        elif not read and word not in _SOLID:
            pending += candidate.iterchildren("*")
    return left_out


_READ = {
    "mimic": ("axis", "axis2"), "gearbox_ratio": ("joint",), "gearbox_reference_body": ("joint",),
    "must_be_loop_joint": ("simbody",),
}  # fmt: skip
"""Elements of SDF that sound like loops or couplings, and those around them."""


_SOLID = ("visual", "collision", "inertial", "light", "sensor", "audio_source")  # parts of links
