"""Home: all loops closed, all joints within their limits; and which joints are actuated there."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from cinegen.arrays import Array, Indices
from cinegen.errors import ClosureError, warn
from cinegen.joints import scalar_joints, translations
from cinegen.loops.closed_loops import ClosedLoops
from cinegen.loops.clusters import subsystems
from cinegen.loops.idle import idle_motions, idle_spins
from cinegen.model.limits import Limits
from raff2urdf import closure
from raff2urdf.coupling import followed
from raff2urdf.loops.home import Beyond, close_within, moved_within, outside
from raff2urdf.loops.open_loops import why_open
from raff2urdf.loops.selection import Candidate, determined
from raff2urdf.readers.actuation import RAFF, syntax_of

_SAMPLES = 20  # configurations of which home is chosen if the file has none and all joints at 0 is singular


class Home(NamedTuple):
    """A configuration at which a mechanism begins.

    Attributes:
        q: (nq,) closed, within all limits if possible.
        ranks: the generic rank of each cluster of loops.
        determined: joints that loops and the other joints determine.
        is_drawn: whether it is near the configuration as written, not another one.
        notes: what was moved.
    """

    q: Array
    ranks: tuple[int, ...]
    determined: frozenset[str]
    is_drawn: bool
    notes: tuple[str, ...]


def find_home(
    system: ClosedLoops,
    written: Array,
    limits: Limits,
    actuated: Mapping[str, bool | None],
    drawn: bool,
    name: str,
    robot: str,
    remark: str | None = None,
) -> Home:
    """Close all clusters of loops, each by itself, near to the configuration as written; within the limits if possible.

    Args:
        system: the loops and couplings.
        written: (nq,) the configuration as written.
        limits: of all joints.
        actuated: whether joints are, in file order; None: not stated.
        drawn: whether that is only how the file draws the robot: where it is singular, another one is chosen.
        name: the file's, in errors.
        robot: of the file, in errors.
        remark: a warning about loops that are open as written, if they can be closed.

    Raises:
        ClosureError: clusters can't be closed.
    """
    closed, q, other, generic = (written.copy() for _ in range(4))
    ranks, problems, is_drawn, parts = list[int](), list[str](), True, subsystems(system)
    for cluster, at in parts:
        closing = closure.close_from_afar(cluster, written[at])
        if not closing.closed:
            names = [*(loop.name for loop in cluster.loops), *(coupling.name for coupling in cluster.couplings)]
            problems.append(why_open(cluster, names, written[at], closing, syntax_of(Path(name)) == RAFF))
            continue
        closed[at], q[at] = closing.q, _within(cluster, written[at], closing.q, limits.lower[at], limits.upper[at])
        rank, generic[at] = closure.generic_rank(cluster, q[at])
        other[at] = next(closure.closed_walk(cluster, generic[at], 1), generic[at])
        ranks.append(rank)
        if drawn and closure.rank(cluster.evaluate(q[at])[1]) < rank:
            closed[at] = _regular(cluster, q[at], rank)
            q[at] = _within(cluster, written[at], closed[at], limits.lower[at], limits.upper[at])
            is_drawn = False
    if problems:
        raise ClosureError(f"{name}: {robot}: " + "\n".join(problems))
    if remark is not None:
        warn(f"{name}: {robot}: {remark}")
    indices, columns = scalar_joints(system.model)
    free = indices[~np.isin(columns, np.concatenate([np.zeros(0, np.intp), *system.columns]))]
    q[free] = np.clip(q[free], limits.lower[free], limits.upper[free])
    notes: tuple[str, ...] = () if is_drawn else ("all joints at 0 is singular: home is a configuration near it",)
    still = limits.exceeded(q)
    moved = {joint: limit for joint, limit in limits.exceeded(closed).items() if joint not in still}
    if still:
        warn(f"{name}: {robot}: {outside(_beyond(system, q, still))}")
    elif moved:
        notes += (moved_within(_beyond(system, closed, moved)),)
    return Home(q, tuple(ranks), _determined(system, parts, (q, other, generic), actuated), is_drawn, notes)


def _within(system: ClosedLoops, written: Array, closed: Array, lower: Array, upper: Array) -> Array:
    columns = dict(zip(*map(np.ndarray.tolist, scalar_joints(system.model)), strict=True))
    return close_within(system, written, closed, lower, upper, columns)


def _beyond(system: ClosedLoops, q: Array, beyond: Mapping[str, float]) -> list[Beyond]:
    joints = [(name, system.model.joints[system.model.getJointId(name)], limit) for name, limit in beyond.items()]
    return [Beyond(name, translations(joint) == 1, float(q[joint.idx_q]), limit) for name, joint, limit in joints]


def _regular(system: ClosedLoops, q: Array, rank: int) -> Array:
    """Return the least singular of closed configurations (nq,) around a closed one; `rank` is their generic rank."""
    samples = closure.closed_walk(system, q, _SAMPLES)
    return max(samples, key=lambda q: float(np.linalg.svd(system.evaluate(q)[1], compute_uv=False)[rank - 1]))


def _determined(
    system: ClosedLoops,
    parts: Sequence[tuple[ClosedLoops, Indices]],
    configurations: Sequence[Array],
    actuated: Mapping[str, bool | None],
) -> frozenset[str]:
    """Return the joints that the others determine, see `raff2urdf.loops.selection`.

    Args:
        system: the loops.
        parts: its clusters.
        configurations: (nq,) closed: home, others, and one where the generic rank is reached.
        actuated: whether joints are, in file order; None: not stated.
    """
    dependent: set[str] = set()
    spins = idle_spins(system, configurations, [name for name, has in actuated.items() if has])
    idle = [idle_motions(system, spins, q) for q in configurations]
    followers = {coupling.follower for coupling in system.couplings}
    for part, at in parts:
        model = part.model
        starts = [system.model.joints[system.model.getJointId(name)].idx_v for name in model.names[1:]]
        parts_of = [start + np.arange(nv) for start, nv in zip(starts, model.nvs[1:], strict=True)]
        columns = np.concatenate([np.zeros(0, np.intp), *parts_of])
        jacobians = [
            np.vstack([part.evaluate(q[at])[1], rows[:, columns]]) for q, rows in zip(configurations, idle, strict=True)
        ]
        joints = [(name, model.joints[model.getJointId(name)]) for name in actuated if model.existJointName(name)]
        turning = np.abs(idle[-1][:, columns]).max(axis=0, initial=0.0) > 0.0
        candidates = [
            Candidate(
                name,
                int(joint.idx_v),
                depth=len(model.supports[joint.id]),
                actuated=actuated[name],
                follows=name in followers,
                prismatic=translations(joint) == 1,
                driven=_is_driven(system.model, name),
                spins=bool(turning[joint.idx_v]),
            )
            for name, joint in joints
        ]
        others = [column for joint in model.joints if joint.nv == 3 for column in range(joint.idx_v, joint.idx_v + 3)]
        dependent.update(determined(jacobians, candidates, others))
    return frozenset(dependent)


def _is_driven(model: pin.Model, name: str) -> bool:
    """Return whether a joint has limits of position, velocity or effort."""
    joint = model.joints[model.getJointId(name)]
    velocities = (of[joint.idx_v] for of in (model.upperVelocityLimit, model.upperEffortLimit))
    return bool(np.isfinite([model.upperPositionLimit[joint.idx_q], *velocities]).any())


def near_successive(system: ClosedLoops, written: Array) -> Array | None:
    """Return the configuration (nq,) in which the loops are closed if ball joints are three revolute joints, as
    raff2urdf closes them for files in other formats; None if that fails."""
    q = follow(system, written)
    for cluster, at in subsystems(system) if system.rows else ():
        closing = closure.close_from_afar(cluster, q[at])
        if not closing.closed:
            return None
        model = system.model
        q[at] = _within(cluster, q[at], closing.q, model.lowerPositionLimit[at], model.upperPositionLimit[at])
    return q


def follow(system: ClosedLoops, q: Array) -> Array:
    """Return q (nq,) with joints that follow others in couplings where these drive them."""
    joints = {name: joint.idx_q for name, joint in zip(system.model.names, system.model.joints, strict=True)}
    names = {name for coupling in system.couplings for name in coupling.terms}
    moved, driven = q.copy(), followed(system.couplings, {name: float(q[joints[name]]) for name in names})
    for name, value in driven.items():
        moved[joints[name]] = value
    return moved
