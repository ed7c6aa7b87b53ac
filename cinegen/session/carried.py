"""Values that robots keep when they are read again from their files: those of joints, by name."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from cinegen.arrays import Array
from cinegen.errors import ClosureError
from cinegen.joints import scalar_joints, translations
from cinegen.loops.clusters import subsystems
from cinegen.model import Mechanism
from raff2urdf.loops.home import close_within

JointValues = Mapping[str, tuple[bool, Array]]
"""Of each joint, by its name and in the order of the model: whether it translates, and its numbers in q."""

Kept = Array | JointValues
"""A configuration (nq,), or the values of the joints of a robot that has been read again since."""


def detached(mechanism: Mechanism | None, kept: Kept) -> JointValues:
    """Return joint values of what is kept, by the mechanism that it is a configuration of."""
    if not isinstance(kept, np.ndarray):
        return kept
    return {} if mechanism is None else joint_values(mechanism, kept)


def attached(mechanism: Mechanism, kept: Kept, otherwise: Array) -> Array | None:
    """Return what is kept as a configuration (nq,) of a mechanism; see `carried_over`."""
    return kept if isinstance(kept, np.ndarray) else carried_over(mechanism, kept, otherwise)


def joint_values(mechanism: Mechanism, q: Array) -> JointValues:
    """Return the values of all joints in q (nq,): rad or m, the quaternion of a ball joint, seven numbers of a base."""
    model = mechanism.model
    pairs = zip(model.names, model.joints, strict=True)
    return {
        name: (bool(translations(joint)), q[joint.idx_q : joint.idx_q + joint.nq].copy())
        for name, joint in pairs
        if joint.nq > 0
    }


def carried_over(mechanism: Mechanism, values: JointValues, otherwise: Array) -> Array | None:
    """Return the closed configuration (nq,) of a mechanism in which joints have given values, as far as loops and
    limits allow.

    Joints are found by name. Those that are left over on both sides, if they are as many and of the same kinds, have
    been renamed: they are found by their order. Loops are closed with the actuated joints kept where that is possible
    within the limits, else with all joints free.

    Args:
        mechanism: the mechanism.
        values: of the joints of another one, of which this is a new version.
        otherwise: (nq,) values of the joints that the other does not have.

    Returns:
        None where the loops can't be closed from there, or only beyond a limit.
    """
    q, limits = otherwise.copy(), mechanism.limits
    ours = joint_values(mechanism, q)
    new, old = ([name for name in some if name not in others] for some, others in ((ours, values), (values, ours)))
    kinds = [[_kind(of[name]) for name in names] for of, names in ((ours, new), (values, old))]
    former = {name: name for name in ours if name in values}
    former |= dict(zip(new, old, strict=True)) if kinds[0] == kinds[1] else {}
    known = [name for name, before in former.items() if _kind(values[before]) == _kind(ours[name])]
    for name in known:
        joint = mechanism.model.joints[mechanism.model.getJointId(name)]
        q[joint.idx_q : joint.idx_q + joint.nq] = values[former[name]][1]
    q = mechanism.structure.normalized(np.clip(q, limits.lower, limits.upper))
    for locked in ([joint for joint in mechanism.actuated if joint in known], []):
        try:
            closed = mechanism.close(q, locked)
        except ClosureError:
            continue
        if limits.within(closed):
            return closed
    try:
        closed = mechanism.close(q)
    except ClosureError:
        return None
    for part, at in subsystems(mechanism.structure.system):
        columns = dict(zip(*map(np.ndarray.tolist, scalar_joints(part.model)), strict=True))
        closed[at] = close_within(part, closed[at], closed[at], limits.lower[at], limits.upper[at], columns)
    return closed if limits.within(closed) else None


def _kind(value: tuple[bool, Array]) -> tuple[bool, int]:
    return value[0], len(value[1])


def renamed(before: Sequence[str], after: Sequence[str]) -> dict[str, str]:
    """Return the new names of robots by their old ones: where one name has gone and one has come."""
    gone, new = [name for name in before if name not in after], [name for name in after if name not in before]
    return dict(zip(gone, new, strict=True)) if len(gone) == len(new) == 1 else {}
