"""Convert a model of an SDF to a URDF, and the loops that it closes.

SDF gives every link a pose in the model, at the configuration where all joint variables are 0, and joints between
any two links: a joint between links that the tree contains already closes a loop. Axes that mimic others and joints of
the type gearbox become couplings, and so does a screw, with the revolute and the prismatic joint that it consists of.
A joint that closes a loop and has two axes, or takes part in a coupling, gets a link of its own, which it moves and
which the loop joins to its child.

Versions 1.4 to 1.12 are read: links, their masses and visuals, joints, frames, nested and included models; not what is
for simulators only (collisions, sensors, plugins).
The elements that raff2urdf adds (`raff:robot`: zeros of joints, actuated joints, ends of loops) are read too.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from raff2urdf.arrays import Array
from raff2urdf.constraints import IDENTITY, Constraints
from raff2urdf.errors import did_you_mean
from raff2urdf.inertia import Inertia
from raff2urdf.joint_dynamics import JointDynamics
from raff2urdf.placement import inverse, with_z
from raff2urdf.readers import uncounted
from raff2urdf.readers.loops.declaration import leave_out, local, tag_of
from raff2urdf.readers.sdf.link_parts import inertia_of, visuals_of
from raff2urdf.readers.sdf.model import GEARBOX, LOOP_KINDS, SdfAxis, SdfJoint, SdfModel
from raff2urdf.readers.sdf.spanning_tree import spanning_tree
from raff2urdf.readers.urdf import SIZE, check_friction, numbers
from raff2urdf.readers.urdf_builder import GRAVITY, UrdfBuilder
from raff2urdf.readers.xml_file import NAMESPACE, error_at
from raff2urdf.tree import BASE_JOINT, WORLD

_ON_AXIS = 1e-12  # m: a link whose origin is this near a joint's axis rotates about its origin
_PARALLEL = 1e-3  # rad: axes of a gear train are parallel up to this; poses are written with few digits


_OWN_NAMES = ("joint", "loop", "coupling")
_OWN = tuple(f"{{{NAMESPACE}}}{word}" for word in _OWN_NAMES)
"""Elements in `raff:robot`."""


class _Step(NamedTuple):
    """A step from a link to the link that carries it.

    Attributes:
        parent: the link that carries it.
        joint: the revolute joint between them; empty if there is none.
        axis: (3,) of that joint, in the model's frame.
    """

    parent: str
    joint: str
    axis: Array


class SdfConversion:
    """Conversion of one model.

    Args:
        name: of the file, in errors.
        model: its model.
        ignore: names of joints whose loop or coupling is to be left out.

    Attributes:
        ignored: what was left out, with its line.
        notes: about what was read.
        driven: joints of the URDF that plugins control.
    """

    def __init__(self, name: str, model: SdfModel, ignore: Collection[str]) -> None:
        self.name, self.model, self.ignore = name, model, ignore
        self.ignored: list[str] = []
        self.notes, self.driven = model.notes, set[str]()
        self.placements = {**model.placements, WORLD: np.eye(4)}
        names = [*model.links, *model.frames, *(joint.name for joint in model.joints)]
        self.urdf = UrdfBuilder(model.name, names)
        self.entries = {}
        for element in () if model.raff_robot is None else model.raff_robot.iterchildren("*"):
            if element.tag not in _OWN:
                what = f"<{tag_of(element)}> is unknown in raff:robot{did_you_mean(local(element), _OWN_NAMES)}"
                raise error_at(name, element, what)
            self.entries[element.get("name")] = element
        self.states_actuated = any("actuated" in element.attrib for element in self.entries.values())
        self.axes: dict[str, list[str]] = {}  # by joint: the joint of the URDF for each axis
        self.homes: dict[str, float] = {}  # of joints of the URDF: to be added to SDF's values, rad or m
        self.carried: dict[str, _Step] = {}
        self.resisting: list[str] = []  # joints with friction that close loops

    def run(self) -> tuple[str, Constraints]:
        """Return the URDF and its constraints."""
        model, urdf = self.model, self.urdf
        tree, cut, detached, root = spanning_tree(self.model)
        floating = model.raff_robot is not None and root != WORLD
        if root == WORLD or floating:
            urdf.add_link(WORLD)
        for link in detached:
            urdf.add_fixed(urdf.free_name(f"{link}_fixed"), root, link, self._relative(root, link))
        if floating:  # raff2urdf fixes a base to the world unless it can move
            urdf.add_fixed(BASE_JOINT, WORLD, root, self.placements[root], "floating")
        self._add_links()
        nodes = [root, *(n for n in (*model.links, *model.frames) if n != root)]
        if model.raff_robot is not None and root == WORLD and "base" in nodes:  # raff2urdf's own robots
            nodes = ["base", *(node for node in nodes if node not in (WORLD, "base"))]
        for joint, reversed_ends in tree:
            self._add_joint(joint, reversed_ends)
        coupled = {axis.mimic.joint for joint in model.joints for axis in joint.axes if axis.mimic}
        for joint in cut:
            if not self._is_ignored(joint, f"{joint.kind} joint", ", which closes a loop"):
                nodes += self._add_loop(joint, joint.name in coupled)
        for joint in model.joints:
            self._add_couplings(joint)
        for element in () if model.raff_robot is None else model.raff_robot.iterchildren(f"{{{NAMESPACE}}}coupling"):
            self._add_own_coupling(element)
        for joint in model.joints:
            self.driven |= {
                name for i, name in enumerate(self.axes.get(joint.name, ())) if (joint.name, i) in model.driven
            }
        self._note_left_out()
        seen = np.eye(3) if root == WORLD or floating else self.placements[root][:3, :3]
        return urdf.result(nodes, BASE_JOINT if floating else None, self._gravity(seen))

    def _add_links(self) -> None:
        """Add the links and frames of the model."""
        for name, element in self.model.links.items():
            self.urdf.add_link(name, visuals_of(element, self.name), self._inertia(name, element))
        for frame in self.model.frames:
            self.urdf.add_link(frame)
        for frame, link in self.model.frames.items():
            name = self.urdf.free_name(f"{frame}_attached")
            self.urdf.add_fixed(name, link, frame, self._relative(link, frame))

    def _inertia(self, name: str, link: Any) -> Inertia | None:
        """Return the inertia of a link in its own axes; None if the file gives none, or leaves it open."""
        element = link.find("inertial")
        if element is not None and element.get("auto", "false") in ("1", "true"):
            what = f"inertial of link '{name}' (line {element.sourceline}), which auto=\"true\" leaves open"
            self.ignored.append(what)
            return None
        return None if element is None else inertia_of(element, name, self.name)

    def _note_left_out(self) -> None:
        """Note what URDF has no element for."""
        springs = [
            name
            for joint in self.model.joints
            for name, word in zip(self.axes.get(joint.name) or [joint.name] * 2, ("axis", "axis2"), strict=False)
            if uncounted.is_given(joint.element.find(f"{word}/dynamics"), "spring_stiffness")
        ]
        off = ("0", "false")
        unlike = [name for name, link in self.model.links.items() if link.findtext("gravity", "1").strip() in off]
        left_out = {"friction": self.resisting, "springs": springs, "disabled gravity": unlike}
        self.notes += uncounted.note_of(left_out)

    def _gravity(self, rotation: Array) -> Sequence[float]:
        """Return the acceleration of the world around the model, that of raff:robot, or the default, in axes (3, 3) of
        the root."""
        gravity: Sequence[float] = GRAVITY
        element, ours = self.model.gravity, self.model.raff_robot
        element = ours if element is None else element
        text = None if element is None else element.get("gravity") if element is ours else element.text or ""
        if text is not None:
            vector = numbers(text)
            if vector is None or len(vector) != 3:
                what = f"the gravity '{text.strip()[:60]}' must be three numbers{SIZE}"
                raise error_at(self.name, element, what)
            gravity = vector
        seen: Array = rotation.T @ gravity
        if np.allclose(seen, GRAVITY, 0.0, 1e-12):
            return GRAVITY
        return [0.0 if abs(x) < 1e-12 else float(x) for x in seen]

    def _relative(self, parent: str, child: str) -> Array:
        """Return the placement of a link or frame on another one."""
        return inverse(self.placements[parent]) @ self.placements[child]

    def _add_joint(self, joint: SdfJoint, reversed_ends: bool) -> None:
        """Add one joint for each axis, and a fixed one if the axis does not pass through the link's origin."""
        parent, child = (joint.child, joint.parent) if reversed_ends else (joint.parent, joint.child)
        sign = -1.0 if reversed_ends else 1.0
        steps = self._steps(joint)
        self.homes |= {name: self._own_values(name)[0] for name, _, _ in steps}
        self.axes[joint.name] = [name for (name, _, _), _ in zip(steps, joint.axes, strict=False)]
        if joint.kind == "screw":
            (rotation, _, _), (translation, _, _) = steps
            if not self._is_ignored(joint, "screw"):
                self._add_coupling(f"{translation}-{rotation}", {translation: 1.0, rotation: -joint.lead})
        if reversed_ends:
            steps.reverse()
        if joint.kind == "ball":
            self.urdf.add_ball(joint.name, [name for name, _, _ in steps])
        at = joint.placement.copy()
        arms = [np.cross(axis.direction, self.placements[child][:3, 3] - at[:3, 3]) for _, axis, _ in steps]
        on_axis = joint.kind == "prismatic" or all(np.abs(arm).max() <= _ON_AXIS for arm in arms)
        if on_axis and len(steps) <= 1:
            at = self.placements[child]
        before = self.placements[parent]
        for i, (name, axis, prismatic) in enumerate(steps):
            home, actuated, armature = self._own_values(name)
            link, (low, high) = child, axis.limits
            dynamics = JointDynamics(armature, axis.damping, axis.friction)
            if i < len(steps) - 1 or not np.array_equal(at, self.placements[child]):
                link = self.urdf.free_name(f"{name}_axis")
                self.urdf.add_link(link, (), Inertia() if i < len(steps) - 1 else None)
            self.urdf.add_joint(
                name, prismatic, (parent, link), inverse(before) @ at, sign * (at[:3, :3].T @ axis.direction),
                zero=home, home=home, limits=(low + home, high + home), velocity=axis.velocity, effort=axis.effort,
                dynamics=dynamics, actuated=actuated,
            )  # fmt: skip
            self.carried[link] = _Step(parent, "" if prismatic else name, sign * axis.direction)
            parent, before = link, at
        if parent != child:
            name = self.urdf.free_name(f"{joint.name}_fixed") if steps else joint.name
            self.urdf.add_fixed(name, parent, child, inverse(before) @ self.placements[child])
            self.carried[child] = _Step(parent, "", np.zeros(3))

    def _steps(self, joint: SdfJoint) -> list[tuple[str, SdfAxis, bool]]:
        """Return the joints of one degree of freedom that a joint consists of: name, axis, whether it is prismatic."""
        if joint.kind == "ball":
            axes = joint.placement[:3, :3].T
            return [(f"{joint.name}_{'XYZ'[i]}", SdfAxis(axis), False) for i, axis in enumerate(axes)]
        if joint.kind == "screw":
            (axis,) = joint.axes
            along = self.urdf.free_name(f"{joint.name}_T")
            return [(joint.name, axis, False), (along, SdfAxis(axis.direction), True)]
        if len(joint.axes) == 2:
            return [(f"{joint.name}_{i}", axis, False) for i, axis in enumerate(joint.axes, 1)]
        return [(joint.name, axis, joint.kind == "prismatic") for axis in joint.axes]

    def _own_values(self, joint: str) -> tuple[float, bool | None, float]:
        """Return raff2urdf's entries for a joint: its value at the links' poses; whether it is actuated, None if that
        is stated of no joint; and the inertia of its rotors."""
        entry = self.entries.get(joint)
        if entry is None:
            return 0.0, False if self.states_actuated else None, 0.0
        home, actuated = numbers(entry.get("home", "0")), entry.get("actuated", "false")
        armature = check_friction(entry, entry.get("armature", "0"), "armature", f"joint '{joint}'", self.name)
        if home is None or len(home) != 1:
            raise error_at(self.name, entry, f"home='{entry.get('home')}' of a raff:joint is not a number")
        if actuated not in ("true", "false"):
            raise error_at(self.name, entry, f"actuated='{actuated}' of a raff:joint must be true or false")
        return home[0], actuated == "true" if self.states_actuated else None, armature

    def _add_loop(self, joint: SdfJoint, coupled: bool) -> list[str]:
        """Add a loop for a joint that was cut; return the links that were added for it.

        Of two axes, the first becomes a joint of the tree; a screw and a joint of a coupling do so as a whole.
        """
        first, kind, axes, added = joint.parent, joint.kind, joint.axes, []
        whole = kind == "screw" or coupled or any(axis.mimic for axis in axes)
        if whole or len(axes) == 2:
            link = self.urdf.free_name(f"{joint.name}_cross")
            self.placements[link] = joint.placement
            self.urdf.add_link(link, (), None if whole else Inertia())  # as a whole, it is the child
            added = [link]
            if whole:
                self._add_joint(replace(joint, child=link), False)
                kind, axes = "fixed", []
            else:
                half = replace(joint, name=f"{joint.name}_1", kind="revolute", child=link, axes=axes[:1])
                self._add_joint(half, False)
                kind, axes = "revolute", axes[1:]
            first = link
        if any(axis.damping or axis.friction for axis in axes):
            self.resisting.append(joint.name)
        if any(math.isfinite(limit) for axis in axes for limit in axis.limits):
            self.ignored.append(f"limits of joint '{joint.name}', which closes a loop")
        at = joint.placement.copy()
        if axes and kind != "fixed":
            at[:3, :3] = with_z(axes[0].direction)
        ends = [(node, inverse(self.placements[node]) @ at) for node in (first, joint.child)]
        entry = self.entries.get(joint.name)
        if entry is not None and all(entry.get(word) in self.placements for word in ("first", "second")):
            ends = [(entry.get(word), IDENTITY) for word in ("first", "second")]  # SDF keeps only one of them
        self.urdf.add_loop(joint.name, LOOP_KINDS[kind], *ends)
        return added

    # --- couplings ----------------------------------------------------------------------------------------------

    def _add_couplings(self, joint: SdfJoint) -> None:
        """Add the couplings that a joint declares by its axes that mimic others, or as a gearbox."""
        if joint.kind == GEARBOX:
            if self._is_ignored(joint, "gearbox"):
                return
            terms: dict[str, float] = {}
            for axis, link, factor in zip(joint.axes, (joint.parent, joint.child), (joint.ratio, 1.0), strict=True):
                for name, sign in self._angle(joint, link, axis.direction).items():
                    terms[name] = terms.get(name, 0.0) + factor * sign
            reached = {name: c for name, c in reversed(terms.items()) if c != 0.0}
            if not reached:
                raise error_at(
                    self.name, joint.element, f"gearbox '{joint.name}' couples no joints: {leave_out(joint.name)}"
                )
            self._add_coupling(joint.name, reached)
            return
        for i, axis in enumerate(joint.axes):
            if axis.mimic is None or self._is_ignored(joint, "mimic of joint"):
                continue
            leaders, where = self.axes.get(axis.mimic.joint, []), axis.mimic.element
            if axis.mimic.axis >= len(leaders):
                near = "" if leaders else did_you_mean(axis.mimic.joint, [*self.axes])
                what = f"joint '{joint.name}' mimics '{axis.mimic.joint}', which has no such axis{near}"
                raise error_at(self.name, where, what)
            follower, leader, factor = self.axes[joint.name][i], leaders[axis.mimic.axis], axis.mimic.multiplier
            if follower == leader:
                raise error_at(self.name, where, f"joint '{joint.name}' mimics itself: name another joint")
            constant = axis.mimic.offset - factor * axis.mimic.reference
            name = where.get(f"{{{NAMESPACE}}}name", f"{follower}-{leader}")
            self._add_coupling(name, {follower: 1.0, leader: -factor}, constant)

    def _add_coupling(self, name: str, terms: Mapping[str, float], constant: float = 0.0) -> None:
        """Add a linear coupling of SDF's values of joints, whose zero may differ."""
        shift = sum(c * self.homes[joint] for joint, c in terms.items())
        self.urdf.add_coupling(name, {joint: [c] for joint, c in terms.items()}, constant + shift)

    def _add_own_coupling(self, element: Any) -> None:
        """Add a coupling that SDF has no element for, of the robot's own values."""
        name, terms = element.get("name", ""), dict[str, list[float]]()
        if name in self.ignore:
            self.ignored.append(f"raff:coupling '{name}' (line {element.sourceline})")
            return
        constant = numbers(element.get("constant", "0")) or []
        if element.find("*") is None:
            raise error_at(self.name, element, f"raff:coupling '{name}' has no terms: give raff:term elements")
        for term in element.iterchildren("*"):
            joint, coefficients = term.get("joint", ""), numbers(term.get("coefficients", ""))
            if joint not in self.homes or not coefficients or len(constant) != 1:
                near = did_you_mean(joint, [*self.homes])
                what = f"raff:coupling '{name}' must have numbers, and names of joints that move"
                raise error_at(self.name, term, f"{what}; '{joint}'{near}")
            if joint in terms:
                raise error_at(self.name, term, f"raff:coupling '{name}' lists '{joint}' twice: join the two terms")
            if not any(coefficients):
                raise error_at(self.name, term, f"raff:coupling '{name}': the coefficients of '{joint}' are 0")
            terms[joint] = coefficients
        self.urdf.add_coupling(name, terms, constant[0])

    def _is_ignored(self, joint: SdfJoint, what: str, why: str = "") -> bool:
        """Return whether a joint is to be left out; note it."""
        if joint.name in self.ignore:
            self.ignored.append(f"{what} '{joint.name}' (line {joint.element.sourceline}){why}")
        return joint.name in self.ignore

    def _angle(self, gearbox: SdfJoint, link: str, axis: Array) -> dict[str, float]:
        """Return the angle of a link about an axis, as seen from a gearbox's reference, as a sum of joint values.

        Returns:
            the sign of each joint between the two, by its name.
        """
        chains = [self._chain(end) for end in (gearbox.reference, link)]
        signs: dict[str, float] = {}
        for sign, chain, other in zip((-1.0, 1.0), chains, reversed(chains), strict=True):
            for end in chain.keys() - other.keys():
                step = chain[end]
                if not step.joint:
                    continue
                if np.abs(np.cross(step.axis, axis)).max() > _PARALLEL:
                    what = f"gearbox '{gearbox.name}': the angle of '{link}' about its axis, as seen from"
                    why = f"is not determined by joint values: joint '{step.joint}' rotates about another axis"
                    remedy = leave_out(gearbox.name)
                    raise error_at(self.name, gearbox.element, f"{what} '{gearbox.reference}', {why}: {remedy}")
                signs[step.joint] = sign if step.axis @ axis > 0.0 else -sign
        return signs

    def _chain(self, link: str) -> dict[str, _Step]:
        """Return the steps from a link inwards, by the links that they carry."""
        steps: dict[str, _Step] = {}
        while link in self.carried:
            steps[link] = self.carried[link]
            link = steps[link].parent
        return steps
