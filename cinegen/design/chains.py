"""Chains of elementary motions that place the joints, the ends of loops and the nodes of a mechanism.

Each of Kleinfinger's parameters is a rotation about, or a translation along, an axis of the frame that the ones before
it have reached:

    T = Rz(gamma) Tz(epsilon) Rx(alpha) Tx(d) Rz(theta) Tz(r)

so each is a frozen joint. A joint's own variable is one of them, too: with value 0 it is the joint as written, with
another one the joint with an offset of its encoder. Play of a joint is up to six more motions, along and about the axes
of the joint's frame, between its placement and its variable.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import numpy as np
import pinocchio as pin

from cinegen.arrays import Array
from cinegen.design._kernels.evaluate import PX, PZ, RX, RZ
from cinegen.design.errors import DesignError
from cinegen.design.parameters import WORDS, Parameters
from cinegen.model.mechanism import Mechanism
from raff2urdf.errors import did_you_mean
from raff2urdf.raff.compound import expanded
from raff2urdf.raff.document import JointType, RaffLink, RaffPart, RaffRobot
from raff2urdf.tree import kleinfinger

KINDS = dict(zip(WORDS, (RZ, PZ, RX, PX, RZ, PZ), strict=True))
"""The elementary motion of each parameter."""

COMPONENTS = ("x", "y", "z", "rx", "ry", "rz")
"""The motions of play: translations along, and rotations about, the axes of a joint's frame."""

Step: TypeAlias = Any
"""A motion, `tuple[int, int]`: its kind and its index among all motions; or a constant frame, `pin.SE3`."""


@dataclass(frozen=True)
class Chain:
    """Steps on a joint of the model, by its index; 0 is the world."""

    joint: int
    steps: tuple[Step, ...] = ()

    def then(self, *steps: Step) -> Chain:
        """Return the chain with further steps."""
        return Chain(self.joint, (*self.steps, *steps))


@dataclass
class Chains:
    """All chains of a mechanism.

    Attributes:
        values: of all motions in the file: those of `Parameters.all`, then of play (0); a joint's own variable is 0.
        joints: chains of all joints of the model but the world, by their indices, on their parents.
        nodes: of all nodes, by name.
        ends: of both ends of each loop.
        kinds: of all motions.
    """

    values: Array
    kinds: list[int]
    joints: dict[int, Chain] = field(default_factory=dict)
    nodes: dict[str, Chain] = field(default_factory=dict)
    ends: list[tuple[Chain, Chain]] = field(default_factory=list)


def chains_of(parameters: Parameters, play: Sequence[tuple[str, str]] = ()) -> Chains:
    """Return the chains of a mechanism.

    What its model has beyond its description (placements that were healed) is kept as constant frames.

    Args:
        parameters: its parameters.
        play: joints or loops, by name, and components of `COMPONENTS`.

    Raises:
        DesignError: no such joint or loop.
    """
    mechanism, robot, document = parameters.mechanism, parameters.robot, parameters.document
    model, links = mechanism.model, expanded(robot)
    own = [bool(one.joint) for one in parameters.all]
    values = np.array([0.0 if moves else one.value for one, moves in zip(parameters.all, own, strict=True)])
    kinds = [KINDS[one.word] for one in parameters.all]
    found = Chains(np.concatenate([values, np.zeros(len(play))]), kinds + [_kind(component) for _, component in play])
    slots = _slots(parameters, links)
    balls = {ball: set(joints) for ball, joints in _balls(mechanism).items()}
    inner = {joint for joints in balls.values() for joint in joints}
    play_of: dict[str, list[Step]] = {}
    for k, (name, component) in enumerate(play, len(parameters.all)):
        play_of.setdefault(name, []).append((_kind(component), k))
    placed = dict[int, Chain]()  # by part

    def steps(number: int, written: Sequence[float]) -> list[Step]:
        """Return the six steps of a part: motions, or constants where its numbers are no parameters."""
        return [
            (KINDS[word], slots[number, word]) if (number, word) in slots else motion(KINDS[word], value)
            for word, value in zip(WORDS, written, strict=True)
        ]

    base = Chain(0, tuple(steps(0, kleinfinger(document, robot.base.parameters))))
    frame = model.frames[mechanism.frame_id(mechanism.nodes[0])]
    if mechanism.floating:
        joint = frame.parentJoint
        found.joints[joint] = _corrected(base, found, model.jointPlacements[joint])
        base = Chain(joint, (frame.placement,))
    else:
        base = _corrected(base, found, frame.placement)
    placed[0] = found.nodes[mechanism.nodes[0]] = base
    for part in links.outward:
        kind = part.type if isinstance(part, RaffLink) else JointType.FIXED
        moving = kind is not JointType.FIXED
        if moving and part.joint in inner:  # one of the three of a spherical joint
            placed[part.number] = before = placed[part.pred]
            if part.number in robot.nodes:  # the last of them
                ball = next(name for name, joints in balls.items() if part.joint in joints)
                j = model.getJointId(ball)
                chain = _corrected(before, found, model.jointPlacements[j])
                found.joints[j] = chain.then(*play_of.pop(ball, ()))
                placed[part.number] = Chain(j, (_frame(model, part.node).placement,))
        else:
            written = kleinfinger(document, part.parameters)
            if moving:
                written = written._replace(**{"r" if kind is JointType.PRISMATIC else "theta": 0.0})
            chain = placed[part.pred].then(*steps(part.number, written))
            at = _frame(model, part.node)
            if moving:
                j = model.getJointId(part.joint)
                chain = _corrected(chain, found, model.jointPlacements[j])
                found.joints[j] = chain.then(*play_of.pop(part.joint, ()))
                placed[part.number] = Chain(j, (at.placement,))
            else:
                placed[part.number] = _corrected(chain, found, at.placement)
        if part.number in robot.nodes:
            found.nodes[part.node] = placed[part.number]
    for loop in mechanism.loops:
        first, second = found.nodes[loop.first], found.nodes[loop.second]
        first = first.then(loop.first_placement, *play_of.pop(loop.name, ()))
        found.ends.append((first, second.then(loop.second_placement)))
    for name in play_of:
        known = [*mechanism.joints, *mechanism.balls, *(loop.name for loop in mechanism.loops)]
        raise DesignError(f"{mechanism.name} has no joint or loop '{name}' to have play{did_you_mean(name, known)}")
    return found


def motion(kind: int, value: float) -> pin.SE3:
    """Return an elementary motion by a value, m or rad."""
    unit = np.eye(3)[kind % 3]
    if kind >= PX:
        return pin.SE3(np.eye(3), value * unit)
    return pin.SE3(pin.AngleAxis(value, unit).toRotationMatrix(), np.zeros(3))


def placement(chain: Chain, kinds: Sequence[int], values: Array) -> pin.SE3:
    """Return where a chain leads on its joint, for the values of all motions."""
    found = pin.SE3.Identity()
    for step in chain.steps:
        found = found * (step if isinstance(step, pin.SE3) else motion(kinds[step[1]], float(values[step[1]])))
    return found


def _kind(component: str) -> int:
    if component not in COMPONENTS:
        raise DesignError(f"'{component}' is no component of play{did_you_mean(component, COMPONENTS)}")
    index = COMPONENTS.index(component)
    return PX + index if index < 3 else RX + index - 3


def _corrected(chain: Chain, chains: Chains, wanted: pin.SE3) -> Chain:
    """Return the chain followed by the constant with which it leads to a placement in the mechanism's model."""
    rest = placement(chain, chains.kinds, chains.values).actInv(wanted)
    exact = np.abs(rest.homogeneous - np.eye(4)).max() < 1e-15 * max(1.0, float(np.abs(wanted.translation).max()))
    return chain if exact else chain.then(rest)


def _balls(mechanism: Mechanism) -> dict[str, list[str]]:
    entries = (mechanism.source.constraints or {}).get("balls", [])
    return {entry["name"]: entry["joints"] for entry in entries if entry["name"] in mechanism.balls}


def _slots(parameters: Parameters, links: RaffRobot) -> dict[tuple[int, str], int]:
    """Return the indices of the parameters, by the part of the expanded robot that has it, and the word there."""
    found: dict[tuple[int, str], int] = {}
    parts: dict[int, RaffPart] = {part.number: part for part in links.parts}
    for i, one in enumerate(parameters.all):
        node, number = parameters.robot.nodes[one.node], one.node
        if isinstance(node, RaffLink) and node.compound is not None:
            while parts[number].pred != node.pred and parts[number].joint != one.joint:
                number = parts[number].pred  # the first of the successive links, or the one with that joint
        found[number, one.word] = i
    return found


def _frame(model: pin.Model, node: str) -> pin.Frame:
    return model.frames[model.getFrameId(node, pin.FrameType.BODY)]
