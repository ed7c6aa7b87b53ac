"""What a `robot.yaml` beside a URDF adds, as Gepetto's example-parallel-robots has it.

    closed_loop: [[A, B], ...]      pairs of frames that coincide, named by their links or by the joints before these
    type: ['6d', ...]               of each: 6d, rigid, or 3d, only the origins
    name_mot: [...]                 the joints that have a motor
    joint_name: [...]               joints to be replaced ...
    joint_type: ['SPHERICAL', ...]  ... by SPHERICAL, UJOINT_XY (turns about x, then y, of the joint's own frame) or
                                    FIXED

Such models are exported from CAD: all joints are written as revolute ones, and a loop's two ends lie apart.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml
from lxml import etree

from raff2urdf.constraints import IDENTITY, Constraints
from raff2urdf.errors import RaffError, RaffWarning, did_you_mean
from raff2urdf.graphics.names import find
from raff2urdf.readers import successive
from raff2urdf.readers.urdf import ends, joints, parse, remove, root_first
from raff2urdf.readers.xml_file import read_text

_WORDS = ("closed_loop", "type", "name_mot", "joint_name", "joint_type")
_OURS = ("closed_loop", "name_mot", "joint_name")
_KINDS = {"6d": "rigid", "3d": "ball"}


def beside(path: Path) -> Path | None:
    """The file of this kind that belongs to a URDF: `<stem>.yaml` or `robot.yaml`; None without any.

    Other programs keep a `<stem>.yaml` of their own beside a URDF: it must hold one of the words that are only ours.
    """
    own, shared = path.with_suffix(".yaml"), path.with_name("robot.yaml")
    if own.is_file() and (own == shared or any(word.encode() in own.read_bytes() for word in _OURS)):
        return own
    return shared if shared.is_file() else None


def read(path: Path, urdf: str, name: str) -> tuple[str, Constraints]:
    """The URDF with the joints that the file asks for, and what else it says.

    Args:
        path: the YAML file.
        urdf: the URDF's text.
        name: what errors call the URDF.

    Raises:
        RaffError: no such YAML; it names a frame or a joint that the URDF lacks; a type that is none.
        raff2urdf.RaffError: no URDF.
    """
    said = _Said(path)
    tree = parse(urdf, name)
    _drop_missing(tree, path.parent, name)
    nodes = root_first(tree)
    carried = {joint.get("name"): ends(joint)[1] for joint in joints(tree)}  # what a joint's frame moves with
    became: dict[str, list[str]] = {}
    by_name = {joint.get("name"): joint for joint in joints(tree)}
    for joint, kind in said.pairs("joint_name", "joint_type"):
        said.check_word(joint, kind)
        if joint.value not in by_name:  # published files name some that are gone, or spelt otherwise
            message = said.error(joint, f"joint '{joint.value}' is not in the URDF, nothing is replaced", list(by_name))
            warnings.warn(str(message), RaffWarning, stacklevel=4)
            continue
        became[joint.value] = _replaced(tree, by_name[joint.value], kind, said, name)
    became |= successive.replace_compound(tree, name, keep_root=True)
    moving = [joint.get("name") for joint in joints(tree) if joint.get("type") not in ("fixed", "floating")]
    motors = _motors(said, moving, became)
    loops: list[dict[str, Any]] = []
    for ends_of, kind in said.pairs("closed_loop", "type"):
        said.check_word(kind)
        if kind.value.lower() not in _KINDS:
            raise said.error(kind, f"a loop's type is 3d or 6d, not '{kind.value}'")
        pair = list(ends_of.value) if isinstance(ends_of, yaml.SequenceNode) else []
        if len(pair) != 2:
            raise said.error(ends_of, "a closed loop is a pair of frames")
        said.check_word(*pair)
        for end in pair:
            if end.value not in carried and end.value not in nodes:
                raise said.error(end, f"no joint or link '{end.value}'", [*carried, *nodes])
        first, second = (carried.get(end.value, end.value) for end in pair)
        if first == second:
            raise said.error(ends_of, f"the loop joins '{first}' with itself")
        called = f"{pair[0].value}-{pair[1].value}"
        again = sum(loop["name"].partition("#")[0] == called for loop in loops)
        loops.append(
            {
                "name": f"{called}#{again + 1}" if again else called,
                "kind": _KINDS[kind.value.lower()],
                "first": {"node": first, "placement": IDENTITY},
                "second": {"node": second, "placement": IDENTITY},
            }
        )
    entries = [{"name": joint, **({"actuated": joint in motors} if motors else {})} for joint in moving]
    text: str = etree.tostring(tree, encoding="unicode")
    return text, {"nodes": nodes, "joints": entries, "loops": loops}


def _drop_missing(tree: Any, folder: Path, name: str) -> None:
    """Such models are handed on without their meshes too: one warning, and they are left out."""
    lost = []
    for visual in list(tree.iter("visual")):
        mesh = visual.find("geometry/mesh")
        if mesh is None:
            continue
        try:
            find(mesh.get("filename", ""), folder)
        except RaffError as error:
            lost.append(f"{name}:{mesh.sourceline}: {error}")
            remove(visual)
    if lost:
        more = f" (and {len(lost) - 1} more like it)" if len(lost) > 1 else ""
        warnings.warn(f"{lost[0]}{more}: left out", RaffWarning, stacklevel=5)


def _replaced(tree: Any, joint: Any, kind: Any, said: _Said, name: str) -> list[str]:
    """Replaces a joint of the URDF; names of those it became."""
    word = str(kind.value).upper()
    axes = re.fullmatch("UJOINT_([XYZ])([XYZ])", word)
    if word == "FIXED":
        joint.set("type", "fixed")
        return []
    if word == "SPHERICAL":
        return successive.replace(tree, joint, successive.SPHERICAL, name)
    if axes is None or axes[1] == axes[2]:
        raise said.error(kind, f"a joint's type is SPHERICAL, FIXED or UJOINT_XY (any two axes), not '{kind.value}'")
    return successive.replace(tree, joint, [successive.TURNS[axis] for axis in axes.groups()], name)


def _motors(said: _Said, moving: list[str], became: Mapping[str, list[str]]) -> set[str]:
    """Names of the joints with a motor; of one that became several, all."""
    motors: set[str] = set()
    for entry in said.entries("name_mot"):
        said.check_word(entry)
        found = became.get(entry.value, [entry.value])
        for joint in found:
            if joint not in moving:
                raise said.error(entry, f"the motor '{joint}' is no joint that moves", moving)
        motors |= set(found)
    return motors


class _Said:
    """The YAML, with the line of each of its words."""

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            root = yaml.compose(read_text(path), yaml.SafeLoader)
        except RecursionError:
            raise RaffError(f"{path}:1: its lists stand in one another too deeply") from None
        except yaml.YAMLError as error:
            line = getattr(getattr(error, "problem_mark", None), "line", 0) + 1
            raise RaffError(
                f"{path}:{line}: no YAML: {' '.join(str(getattr(error, 'problem', error)).split())}"
            ) from None
        self.values: dict[str, Any] = {}
        if not isinstance(root, yaml.MappingNode):
            raise RaffError(f"{path}:1: it must say closed_loop, type and name_mot, each with a list")
        for word, value in root.value:
            self.check_word(word)
            if word.value not in _WORDS:
                raise self.error(word, f"'{word.value}' is none of its words", list(_WORDS))
            if word.value in self.values:
                raise self.error(word, f"'{word.value}' is said a second time")
            self.values[word.value] = value

    def entries(self, word: str) -> list[Any]:
        """The entries of a list; none if it is left out."""
        value = self.values.get(word)
        if value is None or value.value in ("", "null", "~"):
            return []
        if not isinstance(value, yaml.SequenceNode):
            raise self.error(value, f"{word} must be a list")
        return list(value.value)

    def check_word(self, *nodes: Any) -> None:
        """Raises RaffError where one of them is a list or a mapping."""
        for node in nodes:
            if not isinstance(node, yaml.ScalarNode):
                raise self.error(node, "here must stand a word, not a list")

    def pairs(self, word: str, other: str) -> list[tuple[Any, Any]]:
        """The entries of two lists that belong together."""
        first, second = self.entries(word), self.entries(other)
        if len(first) != len(second):
            at = self.values[other if other in self.values else word]
            raise self.error(at, f"{word} has {len(first)} entries and {other} {len(second)}: one for each is wanted")
        return list(zip(first, second, strict=True))

    def error(self, node: Any, message: str, known: list[str] | None = None) -> RaffError:
        """What to raise: message, with the node's line, and what exists."""
        near = did_you_mean(str(node.value), known) if known else ""
        return RaffError(f"{self.path}:{node.start_mark.line + 1}: {message}{near}")
