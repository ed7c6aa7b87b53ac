"""Read the sidecar file `loop_closures.yaml` of a URDF, in two formats.

That of scikit-robot and of JSK's exporter from SolidWorks: hinges, in the frame of the root link with all joints at 0.

    closures: [{link_a: A, link_b: B, point: [x, y, z], axis: [x, y, z]}, ...]
    dependent: [...]            joints that follow; their <mimic> is only an approximation, and is left out
    independent: [...]          joints that are driven

That of RoboNex: each end in the frame of its link.

    ball_loops: [{name: N, parent: A, child: B, parent_xyz: [...], child_xyz: [...]}, ...]
    pin_loops: [{..., axis: [...]}, ...]    the axis in the frames of both links
    ball_upgrades: [...]        joints that are ball joints, whatever their type
    actuated_joints: [...]
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from raff2urdf.arrays import Array
from raff2urdf.errors import RaffError, did_you_mean
from raff2urdf.files import note
from raff2urdf.placement import inverse, translation
from raff2urdf.readers.loops.declaration import Declaration
from raff2urdf.readers.loops.loop_joint import LoopJoint
from raff2urdf.readers.urdf import LARGEST, SIZE
from raff2urdf.readers.urdf_tree import UrdfTree, along
from raff2urdf.readers.yaml_file import values_of

FILE = "loop_closures.yaml"

_JSK = ("closures", "dependent", "independent")
_ROBONEX = ("ball_loops", "pin_loops", "ball_upgrades", "ball_limit_deg", "actuated_joints")


class LoopClosures(NamedTuple):
    """The contents of a file.

    Attributes:
        declared: its loops.
        actuated: joints that are driven; None if the file does not declare any.
        following: joints whose <mimic> the file replaces.
        spherical: joints that are ball joints, whatever their type.
    """

    declared: list[Declaration]
    actuated: tuple[str, ...] | None
    following: tuple[str, ...]
    spherical: tuple[str, ...]


def sidecar_of(urdf: Path, tree: UrdfTree) -> Path | None:
    """Return the file of this kind that belongs to a URDF: next to it, or in the folder `config` of its package."""
    for path in (urdf.with_name(FILE), urdf.parent.parent / "config" / FILE, urdf.parent.parent / FILE):
        note(path)
        if path.is_file():
            words = {word for word in _words(_values(path)) if word in tree.links or word in tree.joints}
            if len(words) > 1:
                return path
    return None


def read(path: Path, tree: UrdfTree) -> LoopClosures:
    """Read a file.

    Args:
        path: of the file.
        tree: of the URDF.

    Raises:
        RaffError: it is of neither format; it names a link or a joint that the URDF lacks.
    """
    values = _values(path)
    for key in values:
        if key not in (*_JSK, *_ROBONEX):
            raise RaffError(f"{path}: unknown key '{key}'{did_you_mean(str(key), [*_JSK, *_ROBONEX])}")
    for key in ("dependent", "independent", "ball_upgrades", "actuated_joints"):
        for joint in _list(path, values, key):
            if str(joint) not in tree.joints:
                near = did_you_mean(str(joint), list(tree.joints))
                raise RaffError(f"{path}: {key} names '{str(joint)[:60]}', which is not a joint{near}")
    declared = [_hinge(path, tree, entry) for entry in _list(path, values, "closures")]
    for key, kind in (("pin_loops", "revolute"), ("ball_loops", "ball")):
        declared += [_pair(path, tree, entry, kind) for entry in _list(path, values, key)]
    driven = [key for key in ("independent", "actuated_joints") if key in values]
    actuated = tuple(str(joint) for joint in _list(path, values, driven[0])) if driven else None
    following, spherical = (
        [str(joint) for joint in _list(path, values, key)] for key in ("dependent", "ball_upgrades")
    )
    return LoopClosures(declared, actuated, tuple(following), tuple(spherical))


def _hinge(path: Path, tree: UrdfTree, entry: Any) -> Declaration:
    links = _links(path, tree, entry, ("link_a", "link_b"))
    base = along(translation(_vector(path, entry, "point")), _unit(path, entry))
    placed = [inverse(tree.zero[link]) @ base for link in links]
    return _declaration(path, LoopJoint("revolute", *links, (placed[0], placed[1])), "-".join(links))


def _pair(path: Path, tree: UrdfTree, entry: Any, kind: str) -> Declaration:
    links = _links(path, tree, entry, ("parent", "child"))
    axis = _unit(path, entry) if kind == "revolute" else np.array([0.0, 0.0, 1.0])
    placed = [along(translation(_vector(path, entry, word)), axis) for word in ("parent_xyz", "child_xyz")]
    name = str(entry.get("name") or "-".join(links))
    return _declaration(path, LoopJoint(kind, *links, (placed[0], placed[1])), name)


def _declaration(path: Path, cut: LoopJoint, name: str) -> Declaration:
    label = f"loop '{name}' of {path.name}"
    return Declaration(0, FILE, label, f"{label} declares a loop", name, read=lambda tree: cut)


def _links(path: Path, tree: UrdfTree, entry: Any, words: Sequence[str]) -> tuple[str, str]:
    links = []
    for word in words:
        link = entry.get(word) if isinstance(entry, dict) else None
        if str(link) not in tree.links:
            near = did_you_mean(str(link), list(tree.links))
            raise RaffError(f"{path}: {word} of a loop must be a link of the URDF, not '{str(link)[:60]}'{near}")
        links.append(str(link))
    if tree.body(links[0])[0] == tree.body(links[1])[0]:
        raise RaffError(f"{path}: a loop joins '{links[0]}' to '{links[1]}', which are one rigid body")
    return links[0], links[1]


def _vector(path: Path, entry: Any, word: str) -> Array:
    try:
        vector = np.array(entry.get(word), dtype=float)
    except (TypeError, ValueError, OverflowError):
        vector = np.zeros(0)
    if vector.shape != (3,) or not np.all(np.abs(vector) <= LARGEST):
        raise RaffError(f"{path}: {word} of a loop must be three numbers{SIZE}, not {str(entry.get(word))[:60]}")
    return vector


def _unit(path: Path, entry: Any) -> Array:
    axis = _vector(path, entry, "axis")
    if np.linalg.norm(axis) <= 1e-9:
        raise RaffError(f"{path}: the axis of a loop must not be 0 0 0")
    return np.asarray(axis / np.linalg.norm(axis))


def _list(path: Path, values: Any, key: str) -> list[Any]:
    entries = values.get(key) or []
    if not isinstance(entries, list):
        raise RaffError(f"{path}: {key} must be a list")
    return entries


def _values(path: Path) -> Any:
    values = values_of(path)
    return values if isinstance(values, dict) else {}


def _words(value: Any) -> list[str]:
    """Return all texts in a value."""
    if isinstance(value, dict):
        return [word for inner in value.values() for word in _words(inner)]
    return [word for inner in value for word in _words(inner)] if isinstance(value, list) else [str(value)]
