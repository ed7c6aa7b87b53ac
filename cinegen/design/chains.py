"""Chains of elementary motions that place the joints, the ends of loops and the nodes of a mechanism.

Each of Kleinfinger's parameters is a rotation about, or a translation along, an axis of the frame that the ones before
it have reached:

    T = Rz(gamma) Tz(epsilon) Rx(alpha) Tx(d) Rz(theta) Tz(r)

so each is a frozen joint. A joint's own variable is none of them: it offsets the joint. Play of a joint is up to six
more motions, along and about the axes of the joint's frame, between its placement and its variable.
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
        values: of all motions in the file: those of `Parameters.all`, then of play (0); joints' own variables are in no
            chain.
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
    return _Builder(parameters, play).chains


class _Builder:
    """Chains of a mechanism, built outwards from its base.

    Args: see `chains_of`.

    Attributes:
        chains: all chains.
    """

    def __init__(self, parameters: Parameters, play: Sequence[tuple[str, str]]) -> None:
        mechanism, robot = parameters.mechanism, parameters.robot
        self._mechanism, self._model, self._document = mechanism, mechanism.model, parameters.document
        values = [parameter.value for parameter in parameters.all]
        kinds = [KINDS[parameter.word] for parameter in parameters.all]
        play_kinds = [_kind(component) for _, component in play]
        self.chains = Chains(np.array([*values, *(0.0 for _ in play)]), kinds + play_kinds)
        links = expanded(robot)
        self._slots = _slots(parameters, links)
        self._balls = {joint: ball for ball, joints in _balls(mechanism).items() for joint in joints}
        self._play: dict[str, list[Step]] = {}
        for k, ((name, _), kind) in enumerate(zip(play, play_kinds, strict=True), len(kinds)):
            self._play.setdefault(name, []).append((kind, k))
        self._placed = {0: self._base(robot)}  # by part
        self.chains.nodes[mechanism.nodes[0]] = self._placed[0]
        for part in links.outward:
            if isinstance(part, RaffLink) and part.joint in self._balls:
                self._place_in_ball(part, part.number in robot.nodes)
            else:
                self._placed[part.number] = self._part(part)
            if part.number in robot.nodes:
                self.chains.nodes[part.node] = self._placed[part.number]
        for loop in mechanism.loops:
            first, second = self.chains.nodes[loop.first], self.chains.nodes[loop.second]
            first = first.then(loop.first_placement, *self._play.pop(loop.name, ()))
            self.chains.ends.append((first, second.then(loop.second_placement)))
        for name in self._play:
            known = [*mechanism.joints, *mechanism.balls, *(loop.name for loop in mechanism.loops)]
            raise DesignError(f"{mechanism.name} has no joint or loop '{name}' to have play{did_you_mean(name, known)}")

    def _base(self, robot: RaffRobot) -> Chain:
        """Return the chain of the base."""
        chain = Chain(0, self._steps(0, kleinfinger(self._document, robot.base.parameters)))
        frame = self._model.frames[self._mechanism.frame_id(self._mechanism.nodes[0])]
        if not self._mechanism.floating:
            return self._corrected(chain, frame.placement)
        joint = frame.parentJoint
        self.chains.joints[joint] = self._corrected(chain, self._model.jointPlacements[joint])
        return Chain(joint, (frame.placement,))

    def _steps(self, number: int, written: Sequence[float]) -> tuple[Step, ...]:
        """Return the six steps of a part: motions, or constants where its numbers are no parameters."""
        slots = self._slots
        return tuple(
            (KINDS[word], slots[number, word]) if (number, word) in slots else motion(KINDS[word], value)
            for word, value in zip(WORDS, written, strict=True)
        )

    def _place_in_ball(self, part: RaffLink, is_last: bool) -> None:
        """Place one of the three links of a spherical joint, of which the last has a node."""
        self._placed[part.number] = before = self._placed[part.pred]
        if is_last:
            self._placed[part.number] = self._behind(self._balls[part.joint], before, part.node)

    def _part(self, part: RaffPart) -> Chain:
        """Return the chain of a link or frame."""
        kind = part.type if isinstance(part, RaffLink) else JointType.FIXED
        written = kleinfinger(self._document, part.parameters)
        if kind is not JointType.FIXED:
            written = written._replace(**{"r" if kind is JointType.PRISMATIC else "theta": 0.0})
        chain = self._placed[part.pred].then(*self._steps(part.number, written))
        if isinstance(part, RaffLink) and kind is not JointType.FIXED:
            return self._behind(part.joint, chain, part.node)
        return self._corrected(chain, _frame(self._model, part.node).placement)

    def _behind(self, joint: str, chain: Chain, node: str) -> Chain:
        """Return the chain of a node behind a joint, to which a chain leads."""
        index = self._model.getJointId(joint)
        chain = self._corrected(chain, self._model.jointPlacements[index])
        self.chains.joints[index] = chain.then(*self._play.pop(joint, ()))
        return Chain(index, (_frame(self._model, node).placement,))

    def _corrected(self, chain: Chain, wanted: pin.SE3) -> Chain:
        """Return the chain followed by the constant with which it leads to a placement in the mechanism's model."""
        rest = placement(chain, self.chains.kinds, self.chains.values).actInv(wanted)
        exact = np.abs(rest.homogeneous - np.eye(4)).max() < 1e-15 * max(1.0, float(np.abs(wanted.translation).max()))
        return chain if exact else chain.then(rest)


def motion(kind: int, value: float) -> pin.SE3:
    """Return an elementary motion by a value, m or rad."""
    unit = np.eye(3)[kind % 3]
    if kind >= PX:
        return pin.SE3(np.eye(3), value * unit)
    return pin.SE3(pin.AngleAxis(value, unit).toRotationMatrix(), np.zeros(3))


def placement(chain: Chain, kinds: Sequence[int], values: Array) -> pin.SE3:
    """Return where a chain leads on its joint, for the values of all motions."""
    reached = pin.SE3.Identity()
    for step in chain.steps:
        reached = reached * (step if isinstance(step, pin.SE3) else motion(kinds[step[1]], float(values[step[1]])))
    return reached


def _kind(component: str) -> int:
    if component not in COMPONENTS:
        raise DesignError(f"'{component}' is no component of play{did_you_mean(component, COMPONENTS)}")
    index = COMPONENTS.index(component)
    return PX + index if index < 3 else RX + index - 3


def _balls(mechanism: Mechanism) -> dict[str, list[str]]:
    entries = (mechanism.source.constraints or {}).get("balls", [])
    return {entry["name"]: entry["joints"] for entry in entries if entry["name"] in mechanism.balls}


def _slots(parameters: Parameters, links: RaffRobot) -> dict[tuple[int, str], int]:
    """Return where a chain takes its values from: the index of a parameter, by number of a part and word of a column.

    A universal, cylindrical or ball joint is one row of RAFF, but several successive links of the expanded robot, of
    which the last has the row's number. The parameters of such a row belong to the first.

    Args:
        parameters: of a robot as its file has it.
        links: the same robot, `expanded`: each link has one joint.
    """
    slots: dict[tuple[int, str], int] = {}
    parts: dict[int, RaffPart] = {part.number: part for part in links.parts}
    for i, parameter in enumerate(parameters.all):
        node, number = parameters.robot.nodes[parameter.node], parameter.node
        if isinstance(node, RaffLink) and node.compound is not None:
            while parts[number].pred != node.pred:
                number = parts[number].pred
        if not parameter.joint:
            slots[number, parameter.word] = i
    return slots


def _frame(model: pin.Model, node: str) -> pin.Frame:
    return model.frames[model.getFrameId(node, pin.FrameType.BODY)]
