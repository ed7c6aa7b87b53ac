"""Reactions: the wrenches that joints and loops transmit, and which of their components statics determines.

Where loop equations are redundant, stresses Z (the null space of J^T) can be added to the multipliers of the loops, and
no joint moves: an over-constrained mechanism can be assembled under stress. A component of a reaction to which these
stresses contribute depends on elasticity, on errors of manufacture, and on where the loops were cut: it is NaN.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin

from cinegen.arrays import Array
from cinegen.dynamics import plain
from cinegen.dynamics.loads import LoadedTree
from cinegen.joints import axis
from cinegen.typed_json import as_json
from raff2urdf.residual import loop_residual

_STRESSED = 1e-5
"""A component to which a unit stress contributes less, dimensionless, is determined."""

_NOISE = 1e-9  # N or N m: shown as 0
_ALONG = 1e-9  # an axis that differs by less from a coordinate axis is that
_SCALAR = ("R", "P")  # joints with an axis, by the first letter of Pinocchio's name


@dataclass(frozen=True, eq=False, repr=False)
class Reaction:
    """The wrench that a joint, or the joint where a loop was cut, exerts on a body; its actuator's torque included.

    Attributes:
        name: of the joint or loop.
        kind: "joint" or "loop".
        body: the node that the wrench acts on; the reaction acts on the body at the other end of the joint.
        frame: as text, the frame of the numbers: where its origin is, and whose axes it has.
        placement: of that frame in the world, m.
        wrench: (6,) force (N), then moment (N m) about the origin; NaN for what is undetermined, and everywhere if no
            torques hold the load.
        stresses: (6, k) what independent stresses of the loops add to it, dimensionless: 0 for what is determined.
    """

    name: str
    kind: str
    body: str
    frame: str
    placement: pin.SE3
    wrench: Array
    stresses: Array

    @property
    def is_determined(self) -> bool:
        """True if statics determines all components."""
        return bool(np.isfinite(self.wrench).all())

    @property
    def force(self) -> Array:
        """(3,) N."""
        return self.wrench[:3]

    @property
    def moment(self) -> Array:
        """(3,) N m."""
        return self.wrench[3:]

    def __repr__(self) -> str:
        numbers = ", ".join("?" if np.isnan(x) else f"{0.0 if abs(x) < _NOISE else x:.4g}" for x in self.wrench)
        return f"<Reaction of {self.kind} {self.name} on {self.body}: {numbers} (N, N m), {self.frame}>"

    def as_dict(self) -> dict[str, Any]:
        """Return what JSON shows: N, N m and m; null for what is undetermined."""
        return as_json(
            self, "name", "kind", "force", "moment", "frame", on=self.body, determined=self.is_determined,
            origin=self.placement.translation, axes=self.placement.rotation.T,
        )  # fmt: skip


def reactions(tree: LoadedTree, balance: plain.Balance) -> tuple[Reaction, ...]:
    """Return the reactions of all joints, then of all loops.

    Args:
        tree: whose data has the placements, and the wrenches that its joints transmit while loops are open.
        balance: the balance there.
    """
    mechanism, data, model = tree.mechanism, tree.data, tree.model
    system, stresses = mechanism.structure.system, balance.motions.stresses
    efforts = np.column_stack([plain.multipliers(mechanism, balance, tree.step), stresses])  # of the load, each stress
    through = np.zeros((model.njoints, 6, efforts.shape[1]))  # wrenches at the world's origin, in its axes
    for j in range(1, model.njoints):
        through[j, :, 0] = data.oMi[j].act(data.f[j]).vector
    loops, row = list[Reaction](), 0
    for loop, (first, on_first, second, on_second) in zip(system.loops, system.anchors, strict=True):
        end = data.oMi[first] * on_first
        residual = loop_residual(loop.kind, end.actInv(data.oMi[second] * on_second).homogeneous, system.length)
        local = residual[1].T @ efforts[row : row + loop.rows]
        row += loop.rows
        in_world = end.toDualActionMatrix() @ local
        supports = np.zeros(model.njoints)
        supports[list(model.supports[second])] -= 1.0
        supports[list(model.supports[first])] += 1.0
        through += supports[:, None, None] * in_world
        words = f"at the end of the loop on {loop.first}, in its axes"
        loops.append(_reaction(tree, balance, loop.name, "loop", loop.second, words, end, local))
    joints = []
    for j in range(1, model.njoints):
        placement, words = _frame(tree, j)
        local = placement.toActionMatrix().T @ through[j]
        joints.append(_reaction(tree, balance, model.names[j], "joint", _body(tree, j), words, placement, local))
    return (*joints, *loops)


def coupling_torques(tree: LoadedTree, balance: plain.Balance) -> dict[str, dict[str, float]]:
    """Return the torque (N m) or force (N) that each coupling exerts on each of its joints; NaN where the couplings are
    redundant, and where no torques hold the load."""
    mechanism, result = tree.mechanism, dict[str, dict[str, float]]()
    first = len(balance.motions.jacobian) - len(mechanism.couplings)
    efforts = plain.multipliers(mechanism, balance, tree.step)[first:]
    stressed = np.abs(balance.motions.stresses[first:]).max(axis=1, initial=0.0)
    for i, coupling in enumerate(mechanism.couplings):
        known = balance.is_held and stressed[i] <= _STRESSED
        columns = {name: mechanism.v_index(name) for name in coupling.terms}
        slopes = balance.motions.jacobian[first + i]
        skipped = plain.columns_of(mechanism).start
        result[coupling.name] = {
            name: float(efforts[i] * slopes[k - skipped] / mechanism.scale[k]) if known else np.nan
            for name, k in columns.items()
        }
    return result


def _reaction(
    tree: LoadedTree, balance: plain.Balance, name: str, kind: str, body: str, words: str, frame: pin.SE3, local: Array
) -> Reaction:
    """Return a reaction; local (6, 1 + stresses) in its frame."""
    lengths = np.repeat([tree.mechanism.length, 1.0], 3)
    added = local[:, 1:] * lengths[:, None]
    added[np.abs(added) <= _STRESSED] = 0.0
    wrench = np.where(added.any(axis=1) | (not balance.is_held), np.nan, local[:, 0])
    return Reaction(name, kind, body, words, frame, wrench, added)


def _body(tree: LoadedTree, joint: int) -> str:
    """Return the node behind a joint: the one with the joint's frame, or else the first on its body."""
    mechanism = tree.mechanism
    frames = {node: mechanism.model.frames[mechanism.frame_id(node)] for node in mechanism.nodes}
    on = [node for node, frame in frames.items() if frame.parentJoint == joint]
    same = [node for node in on if frames[node].placement.isIdentity(_ALONG)]
    return next(iter([*same, *on]), str(mechanism.model.names[joint]))


def _frame(tree: LoadedTree, joint: int) -> tuple[pin.SE3, str]:
    """Return the frame in which a joint's reaction is written, in the world, and its description: the joint's own, or
    rotated so that z is its axis, where the axis is none of its own."""
    placement, model = tree.data.oMi[joint], tree.model
    words = f"at joint {model.names[joint]}, in the axes of {_body(tree, joint)}"
    turned = axes_of_reaction(model, joint)
    if (turned == np.eye(3)).all():
        return placement.copy(), words
    return placement * pin.SE3(turned, np.zeros(3)), f"{words}, rotated until z is the joint's axis"


def axes_of_reaction(model: pin.Model, joint: int) -> Array:
    """Return the axes (3, 3), as columns, in which a joint's reaction is written, in the joint's frame: its own, or
    rotated so that z is its axis, where the axis is none of its own."""
    kind = model.joints[joint].shortname().removeprefix("JointModel")
    if model.joints[joint].nv == 1 and kind.startswith(_SCALAR):
        along = axis(model.joints[joint])
        if np.abs(along).max() < 1.0 - _ALONG:
            return np.array(pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), along).toRotationMatrix())
    return np.eye(3)
