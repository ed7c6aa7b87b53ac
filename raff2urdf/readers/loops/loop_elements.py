"""Read the elements of a URDF that declare a loop by its two ends, each with its placement.

    <loop>                     URDF+ (Chignoli et al., arXiv:2411.19753)
    <constraint>               the proposal ros/urdfdom_headers#108; `raff2urdf --loops constraint` writes it
    <loop_joint>               Isaac Sim, with <link1> and <link2>; exporters of Fusion 360, with <parent> and <child>
    <drake:ball_constraint>    Drake: two points coincide
    <drake:linear_bushing_rpy> Drake: read as the joint that it stands for, by the stiffnesses that are 0

An axis is in the frame of the end that it belongs to, unless the element declares another one; x by default.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from raff2urdf.arrays import Array
from raff2urdf.errors import did_you_mean
from raff2urdf.placement import translation
from raff2urdf.readers.loops.declaration import Declaration, declared, label_of, local, tag_of
from raff2urdf.readers.loops.joint_couplings import COUPLING
from raff2urdf.readers.loops.loop_joint import KINDS, LoopJoint
from raff2urdf.readers.urdf import origin, placement, three
from raff2urdf.readers.urdf_tree import UrdfTree, along

_Reader = Callable[[UrdfTree, Any], LoopJoint]

_STIFF = ("bushing_torque_stiffness", "bushing_force_stiffness")


def find(root: Any) -> Iterator[Declaration]:
    """Yield the declarations of these dialects."""
    for element in root.iterchildren("*"):
        word = local(element)
        if word not in READERS or element.get("type") == COUPLING:
            continue
        dialect, reader = READERS[word]
        notes = (f"{label_of(element)}: its stiffness is read as rigid",) if "bushing" in word else ()
        yield declared(element, dialect, reader, notes=notes)


def kind_of(tree: UrdfTree, element: Any, word: str | None) -> str:
    """Return the kind of joint by its word in the element.

    Raises:
        RaffError: no such kind, or none that constrains anything.
    """
    kind = (word or "").strip().lower()
    if kind not in KINDS:
        label = label_of(element)
        if not kind:
            raise tree.error(element, f'{label} declares a loop, but has no type: add type="revolute", for example')
        near = did_you_mean(kind, list(KINDS)) or f" (known: {', '.join(KINDS)})"
        why = "constrains nothing" if kind in ("floating", "free", "6dof") else f"is not a kind of joint{near}"
        raise tree.error(element, f"the type '{kind}' of {label} {why}: leave it out with --ignore {tag_of(element)}")
    return KINDS[kind] or kind


def child(tree: UrdfTree, element: Any, *words: str) -> Any:
    """Return the first child of an element that has one of these names, without a namespace.

    Raises:
        RaffError: it has none.
    """
    for inner in element.iterchildren("*"):
        if local(inner) in words:
            return inner
    leave = f"add it, or leave the loop out with --ignore {tag_of(element)}"
    raise tree.error(element, f"{label_of(element)} declares a loop, but has no <{words[0]}>: {leave}")


def _optional(element: Any, word: str) -> Any | None:
    return next((inner for inner in element.iterchildren("*") if local(inner) == word), None)


def _loop(tree: UrdfTree, element: Any) -> LoopJoint:
    if _optional(element, "predecessor") is None and _optional(element, "parent") is not None:
        return _constraint(tree, element)
    ends = [child(tree, element, word) for word in ("predecessor", "successor")]
    links = [tree.link(end, end.get("link"), f"<{end.tag}> of {label_of(element)}") for end in ends]
    return _with_axes(tree, element, links, [origin(end, tree.name) for end in ends])


def _constraint(tree: UrdfTree, element: Any) -> LoopJoint:
    if _optional(element, "predecessor") is not None:
        return _loop(tree, element)
    kind = kind_of(tree, element, element.get("type"))
    links, starts = [], []
    axes: list[Array | None] = []
    for word in ("parent", "child"):
        end = child(tree, element, word)
        links.append(tree.link(end, end.get("link"), f"<{word}> of {label_of(element)}"))
        at = _optional(element, f"{word}_origin")
        at = at if at is not None else end.find("origin")
        starts.append(np.eye(4) if at is None else placement(at, tree.name))
        stated = _optional(element, f"{word}_axis")
        axes.append(None if stated is None else tree.vector(stated))
    shared = _optional(element, "axis")
    if shared is not None and shared.get("frame") in ("parent", "child"):  # in that link's axes; alike at zero
        which = 0 if shared.get("frame") == "parent" else 1
        direction = tree.zero[links[which]][:3, :3] @ tree.vector(shared)
        axes = [
            start[:3, :3].T @ tree.zero[link][:3, :3].T @ direction for link, start in zip(links, starts, strict=True)
        ]
    default = tree.vector(shared)
    first, other = (default if axis is None else axis for axis in axes)
    if kind == "universal" and _optional(element, "child_axis") is None and shared is None:
        other = np.array([0.0, 1.0, 0.0])
    near = None
    if kind == "prismatic" and not np.array_equal(first, other):  # the format leaves the rotation open: as at zero
        world = tree.zero[links[0]][:3, :3] @ along(starts[0], first)[:3, 0]
        near = starts[1][:3, :3].T @ tree.zero[links[1]][:3, :3].T @ world
    placed = [along(starts[0], first), along(starts[1], other, near)]
    return _cut(tree, element, kind, links, placed)


def _loop_joint(tree: UrdfTree, element: Any) -> LoopJoint:
    ends = [inner for inner in element.iterchildren("*") if local(inner) in ("link1", "link2")]
    if not ends:
        return _constraint(tree, element)
    if len(ends) != 2:
        raise tree.error(element, f"{label_of(element)} must name two links, by <link1> and <link2>")
    links = [tree.link(end, end.get("link"), f"<{end.tag}> of {label_of(element)}") for end in ends]
    return _with_axes(tree, element, links, [placement(end, tree.name) for end in ends])


def _with_axes(tree: UrdfTree, element: Any, links: list[str], starts: list[Array]) -> LoopJoint:
    """Return a joint whose <axis> is in the frames of both ends; the second axis of a universal joint is <axis2>."""
    kind, axis = kind_of(tree, element, element.get("type")), tree.vector(_optional(element, "axis"))
    second = tree.vector(_optional(element, "axis2"), default="0 1 0") if kind == "universal" else axis
    return _cut(tree, element, kind, links, [along(starts[0], axis), along(starts[1], second)])


def _ball_constraint(tree: UrdfTree, element: Any) -> LoopJoint:
    links, placed = [], []
    for word, point in (("a", "p_ap"), ("b", "p_bq")):
        end = child(tree, element, f"ball_constraint_body_{word}")
        links.append(tree.link(end, end.get("name"), f"<{tag_of(end)}>"))
        at = child(tree, element, f"ball_constraint_{point}")
        placed.append(translation(three(at, "value", tree.name)))
    return _cut(tree, element, "ball", links, placed)


def _bushing(tree: UrdfTree, element: Any) -> LoopJoint:
    """Return the joint that Drake's <drake:linear_bushing_rpy> stands for, between its frames A and C.

    Stiff directions are held, the others free: none is free in a rigid joint, one rotation in a revolute joint, all
    rotations in a ball joint, one translation in a prismatic joint, both about and along one axis in a cylindrical one.

    Raises:
        RaffError: no joint has these free directions.
    """
    frames = {str(frame.get("name")): frame for frame in tree.root.iterchildren("*") if local(frame) == "frame"}
    links, starts = [], []
    for word in ("a", "c"):
        end = child(tree, element, f"bushing_frame{word}")
        frame = frames.get(str(end.get("name")))
        placed = end if frame is None else frame
        links.append(tree.link(placed, end.get("name") if frame is None else frame.get("link"), f"<{tag_of(end)}>"))
        starts.append(np.eye(4) if frame is None else placement(frame, tree.name))
    stiffness = [three(child(tree, element, word), "value", tree.name) for word in _STIFF]
    rotations, translations = ([i for i in range(3) if not values[i] > 0.0] for values in stiffness)
    kinds = {(0, 0): "rigid", (1, 0): "revolute", (3, 0): "ball", (0, 1): "prismatic", (1, 1): "cylindrical"}
    kind = kinds.get((len(rotations), len(translations)))
    if kind is None or (kind == "cylindrical" and rotations != translations):
        raise tree.error(
            element,
            f"{label_of(element)} is stiff in directions that no joint has: declare the joint that it stands for, or "
            f"leave it out with --ignore {tag_of(element)}",
        )
    axis = np.eye(3)[(rotations or translations or [2])[0] if kind != "ball" else 2]
    return _cut(tree, element, kind, links, [along(start, axis) for start in starts])


def _cut(tree: UrdfTree, element: Any, kind: str, links: list[str], placed: list[Array]) -> LoopJoint:
    cut = LoopJoint(kind, links[0], links[1], (placed[0], placed[1]))
    bodies = cut.on_bodies(tree)
    if bodies.first == bodies.second:
        same = f"'{links[0]}' to itself" if links[0] == links[1] else f"'{links[0]}' to '{links[1]}', one rigid body"
        raise tree.error(element, f"{label_of(element)} joins {same}: name two links that move relative to each other")
    return cut


READERS: dict[str, tuple[str, _Reader]] = {
    "loop": ("URDF+", _loop),
    "constraint": ("constraint elements", _constraint),
    "loop_joint": ("loop_joint elements", _loop_joint),
    "ball_constraint": ("Drake", _ball_constraint),
    "linear_bushing_rpy": ("Drake", _bushing),
}
"""By the element's name: the dialect, and the function that reads it."""
