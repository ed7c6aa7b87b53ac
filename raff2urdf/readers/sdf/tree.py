"""A model of an SDF as a tree of joints, and the loops that its other joints close."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import yourdfpy
from numpy.typing import NDArray

from raff2urdf.constraints import IDENTITY, Constraints
from raff2urdf.errors import RaffError, RaffWarning
from raff2urdf.placement import inverse, rotation
from raff2urdf.readers import visuals
from raff2urdf.readers.sdf.model import COUPLING, LOOPS, ONE, TWO, SdfJoint, SdfModel
from raff2urdf.readers.sdf.poses import WORLD, pose
from raff2urdf.readers.urdf import UNLIMITED, numbers
from raff2urdf.residual import skew
from raff2urdf.tree import BASE_JOINT
from raff2urdf.writers.urdf import dumps

Array = NDArray[np.float64]

_STRAIGHT = 1e-12  # m: a joint whose axis passes this near a link's origin turns about it


class Writer:
    """A model as a tree of joints, and loops."""

    def __init__(self, name: str, model: SdfModel) -> None:
        self.name, self.model = name, model
        self.placements = {**model.placements, WORLD: np.eye(4)}
        self.links: list[yourdfpy.Link] = []
        self.joints: list[yourdfpy.Joint] = []
        self.entries: list[dict[str, Any]] = []
        self.loops: list[dict[str, Any]] = []
        self.taken = {*model.links, *model.frames, *(joint.name for joint in model.joints)}
        self.said = {} if model.ours is None else {e.get("name"): e for e in model.ours if isinstance(e.tag, str)}

    def write(self) -> tuple[str, Constraints]:
        """The URDF and what it can't say."""
        tree, cut, root = self._spanned()
        free = self.model.ours is not None and root != WORLD
        if root == WORLD or free:
            self.links.append(yourdfpy.Link(name=WORLD))
        if free:  # raff2urdf fixes a base to the world unless it can move
            freed = yourdfpy.Joint(name=BASE_JOINT, type="floating", parent=WORLD, child=root)
            freed.origin = self.placements[root]
            self.joints.append(freed)
        self.links += [yourdfpy.Link(name=n, visuals=self._visuals(e)) for n, e in self.model.links.items()]
        self.links += [yourdfpy.Link(name=frame) for frame in self.model.frames]
        for frame, holder in self.model.frames.items():
            held = yourdfpy.Joint(name=self._free(f"{frame}_attached"), type="fixed", parent=holder, child=frame)
            held.origin = inverse(self.placements[holder]) @ self.placements[frame]
            self.joints.append(held)
        nodes = [root, *(n for n in (*self.model.links, *self.model.frames) if n != root)]
        if self.model.ours is not None and root == WORLD and "base" in nodes:  # as raff2urdf has it
            nodes = ["base", *(node for node in nodes if node not in (WORLD, "base"))]
        for joint, turned in tree:
            self._tree_joint(joint, turned)
        for joint in cut:
            self._loop(joint)
        urdf = dumps(yourdfpy.Robot(name=self.model.name, links=self.links, joints=self.joints))
        said: Constraints = {
            "robot": self.model.name,
            "nodes": nodes,
            "floating": BASE_JOINT if free else None,
            "joints": self.entries,
            "loops": self.loops,
        }
        return urdf, said

    def _spanned(self) -> tuple[list[tuple[SdfJoint, bool]], list[SdfJoint], str]:
        """Joints that make a tree, each with whether it is walked from child to parent; those that close loops; root.

        A link stands on the first joint of the file that reaches it: from its parent if any does, else from its child.
        """
        couplings = [j for j in self.model.joints if j.kind == COUPLING or j.element.find("axis/mimic") is not None]
        if couplings:
            first, more = couplings[0], len(couplings) - 1
            others = f" and {more} more" if more else ""
            warnings.warn(
                f"{self.name}:{first.element.sourceline}: joint '{first.name}'{others} couples two joints: left out, "
                "both move on their own",
                RaffWarning,
                stacklevel=6,
            )
        joints = [joint for joint in self.model.joints if joint.kind != COUPLING]
        fixed = self.model.fixed or any(WORLD in (joint.parent, joint.child) for joint in joints)
        root = WORLD if fixed else self.model.root or self._first(joints, set())
        reached, tree, left = {root}, [], list(joints)
        while True:
            step = next((j for j in left if j.parent in reached and j.child not in reached), None)
            ahead = step is not None
            step = step or next((j for j in left if j.child in reached and j.parent not in reached), None)
            if step is not None:
                left.remove(step)
                tree.append((step, not ahead))
                reached |= {step.parent, step.child}
            elif len(reached - {WORLD}) < len(self.model.links):
                link = self._first(left, reached)  # it stands where it is, on nothing, with all that stands on it
                stands = yourdfpy.Joint(name=self._free(f"{link}_stands"), type="fixed", parent=root, child=link)
                stands.origin = inverse(self.placements[root]) @ self.placements[link]
                self.joints.append(stands)
                reached.add(link)
            else:
                return tree, left, root

    def _first(self, joints: Sequence[SdfJoint], reached: set[str]) -> str:
        """The first link, of those not reached, that no joint holds, or the first at all."""
        held = {joint.child for joint in joints}
        left = [link for link in self.model.links if link not in reached]
        return next((link for link in left if link not in held), left[0])

    def _free(self, name: str) -> str:
        """A name for something that the file does not name."""
        while name in self.taken:
            name += "_"
        self.taken.add(name)
        return name

    def _tree_joint(self, joint: SdfJoint, turned: bool) -> None:
        """One joint for each axis; the last one holds the link, by a fixed joint where the axis passes beside it."""
        father, child = (joint.child, joint.parent) if turned else (joint.parent, joint.child)
        way = -1.0 if turned else 1.0
        steps = list(zip(joint.axes, joint.limits, joint.velocities, strict=True))
        kind = ONE.get(joint.kind, "revolute")
        if joint.kind == "ball":
            steps = [(joint.placement[:3, i], (-math.inf, math.inf), math.inf) for i in range(3)]
        if joint.kind == "fixed":
            steps = []
        if turned:
            steps.reverse()
        at = joint.placement.copy()
        beside = [skew(axis) @ (self.placements[child][:3, 3] - at[:3, 3]) for axis, _, _ in steps]
        through = kind == "prismatic" or all(np.abs(offset).max() <= _STRAIGHT for offset in beside)
        if through and len(steps) <= 1:
            at = self.placements[child]
        standing = self.placements[father]
        for i, (axis, limits, velocity) in enumerate(steps):
            name = joint.name if len(steps) == 1 else f"{joint.name}_{'XYZ'[i] if joint.kind == 'ball' else i + 1}"
            home, motor = self._own(name)
            last = i == len(steps) - 1 and np.array_equal(at, self.placements[child])
            holds = child if last else self._free(f"{name}_axis")
            if not last:
                self.links.append(yourdfpy.Link(name=holds))
            made = yourdfpy.Joint(name=name, type=kind, parent=father, child=holds)
            made.axis = way * (at[:3, :3].T @ axis)
            made.origin = inverse(standing) @ at @ inverse(_moved(kind, made.axis, home))
            made.limit = yourdfpy.Limit(effort=UNLIMITED, velocity=min(velocity, UNLIMITED))
            low, high = limits[0] + home, limits[1] + home
            made.limit.lower, made.limit.upper = max(low, -UNLIMITED), min(high, UNLIMITED)
            self.joints.append(made)
            self.entries.append({"name": name, "home": home, **motor})
            father, standing = holds, at
        if father != child:
            name = joint.name if not steps else self._free(f"{joint.name}_holds")
            made = yourdfpy.Joint(name=name, type="fixed", parent=father, child=child)
            made.origin = inverse(standing) @ self.placements[child]
            self.joints.append(made)

    def _own(self, joint: str) -> tuple[float, dict[str, bool]]:
        """What raff2urdf says of a joint: its value where the links stand, and whether it has a motor."""
        said = self.said.get(joint)
        if said is None:
            return 0.0, {}
        home = numbers(said.get("home", "0"))
        if home is None or len(home) != 1:
            raise RaffError(f"{self.name}:{said.sourceline}: home='{said.get('home')}' of a raff:joint is no number")
        return home[0], {"actuated": said.get("actuated") == "true"}

    def _loop(self, joint: SdfJoint) -> None:
        """A joint that was cut; of two axes, the first becomes a joint of the tree."""
        first, kind, axes = joint.parent, joint.kind, joint.axes
        if kind in TWO:
            helper = self._free(f"{joint.name}_cross")
            self.placements[helper] = joint.placement
            half = SdfJoint(joint.element, f"{joint.name}_1", "revolute", first, helper, joint.placement, [], [], [])
            half.axes, half.limits, half.velocities = axes[:1], joint.limits[:1], joint.velocities[:1]
            self.links.append(yourdfpy.Link(name=helper))
            self._tree_joint(half, False)
            first, kind, axes = helper, "revolute", axes[1:]
        at = joint.placement.copy()
        if axes and kind != "fixed":
            at[:3, :3] = _with_z(axes[0])
        ends = ((word, node) for word, node in (("first", first), ("second", joint.child)))
        placed = {
            word: {"node": node, "placement": (inverse(self.placements[node]) @ at).tolist()} for word, node in ends
        }
        said = self.said.get(joint.name)
        if said is not None and all(said.get(word) in self.placements for word in placed):
            for word in placed:  # the ends that it had, of which SDF could say but one
                placed[word] = {"node": said.get(word), "placement": IDENTITY}
        self.loops.append({"name": joint.name, "kind": LOOPS[kind], **placed})

    def _visuals(self, link: Any) -> list[yourdfpy.Visual]:
        found = []
        for visual in link.iterchildren("visual"):
            shapes = list(_geometry(visual.find("geometry")))
            for shape, offset in shapes:
                origin = pose(visual, self.name) @ offset
                found.append(yourdfpy.Visual(origin=origin, geometry=shape, material=_material(visual)))
        return found


def _geometry(geometry: Any) -> Iterator[visuals.Shape]:
    """The shapes of a visual as a URDF has them, each with where it stands; what a URDF can't show is left out."""

    def three(path: str, default: str) -> Array:
        return np.array((numbers(geometry.findtext(path, default)) or numbers(default) or [])[:3])

    def one(path: str) -> float:
        return (numbers(geometry.findtext(path, "1")) or [1.0])[0]

    if geometry is None:
        return
    if geometry.find("box") is not None:
        yield visuals.box(three("box/size", "1 1 1"))
    if geometry.find("cylinder") is not None:
        yield visuals.cylinder(one("cylinder/radius"), one("cylinder/length"))
    if geometry.find("capsule") is not None:
        yield from visuals.capsule(one("capsule/radius"), one("capsule/length"))
    if geometry.find("sphere") is not None:
        yield visuals.sphere(one("sphere/radius"))
    if geometry.find("mesh") is not None:
        yield visuals.mesh(geometry.findtext("mesh/uri", "").strip(), three("mesh/scale", "1 1 1"))


def _material(visual: Any) -> yourdfpy.Material | None:
    for word in ("diffuse", "ambient"):
        found = numbers(visual.findtext(f"material/{word}", "none"))
        if found is not None and len(found) in (3, 4):
            return visuals.material([*found, 1.0][:4])
    return None


def _moved(kind: str, axis: Array, value: float) -> Array:
    """The placement (4, 4) that a joint brings about."""
    if kind != "prismatic":
        return rotation(axis, value)
    moved = np.eye(4)
    moved[:3, 3] = value * axis
    return moved


def _with_z(axis: Array) -> Array:
    """A rotation (3, 3) whose z is the axis."""
    aside = np.eye(3)[int(np.argmin(np.abs(axis)))]
    x = np.cross(aside, axis)
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(axis, x), axis])
