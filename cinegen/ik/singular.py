"""Singularities: the direction that is about to be lost (type 1) and the motion that is about to be gained (type 2).

C. Gosselin and J. Angeles, "Singularity analysis of closed-loop kinematic chains", IEEE Trans. Robotics and
Automation 6, 1990. Type 1: what the motions that all loops allow do to the pulled nodes loses a rank. Type 2: the
columns of the passive joints in the loops' Jacobian lose a rank, and the mechanism moves though its motors are held.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from cinegen.ik.plain import equations, units
from cinegen.ik.pull import Pull
from cinegen.ik.resolve import free_motions
from cinegen.loops.closed_loops import ClosedLoops
from cinegen.model import Mechanism

Array = NDArray[np.float64]

NEAR_PASSIVE = 0.05
"""A singular value (dimensionless) of the passive joints below this is near a type 2 singularity."""

_EVER = 1e-6  # a direction along which pulls can move less than this part of the best is none


@dataclass(frozen=True, eq=False)
class Lost:
    """The direction that the pulls follow worst: where `sigma` vanishes, it is lost.

    A step of the joints by `joints` moves the pulled nodes by `sigma` times `twists`, as far as the pulls hold them.

    Attributes:
        sigma: the smallest singular value, without unit.
        joints: (nv,) the joint direction, rad and m: a unit vector once lengths are divided by the characteristic
            length.
        twists: (pulls, 6) the Cartesian direction: for each pull, in the order they were made, the twist of its node
            in the world's axes, linear (m) above angular (rad); a unit vector, all pulls together, once lengths are
            divided and each pull is multiplied by its weight over the largest. 0 for a pull that was left out.
    """

    sigma: float
    joints: Array
    twists: Array


@dataclass(frozen=True, eq=False)
class Gained:
    """The motion that the motors hold least: where `sigma` vanishes, the mechanism makes it though they stand still.

    Attributes:
        sigma: the smallest singular value of the passive joints, without unit: how fast the loops would open.
        joints: (nv,) the motion, rad and m: a unit vector once lengths are divided by the characteristic length; 0 for
            motors.
    """

    sigma: float
    joints: Array


def lost(
    mechanism: Mechanism, q: Array, pulls: Sequence[tuple[Pull, Array]], rank: int, resting: int = 0
) -> Lost | None:
    """The weakest direction of some pulls; None where they ask for nothing that can be done anywhere.

    Args:
        mechanism: which is pulled.
        q: (nq,) where, loops closed.
        pulls: that make sense, each with its axes in the world (3, 3).
        rank: the generic rank of all pulls together.
        resting: how many columns, the first, may not move.
    """
    if rank == 0:
        return None
    system = mechanism.system
    ever = _ever(mechanism, system, q, pulls, resting)
    rows, motions = _on_free_motions(mechanism, system, q, pulls, resting)
    rank = min(rank, *ever.shape)  # less where a target's rotation was set to what is none
    if rank == 0:
        return None
    u, sigma, wt = np.linalg.svd(ever.T @ rows @ motions, full_matrices=False)
    joints = np.concatenate([np.zeros(resting), motions @ wt[rank - 1]])
    sign = _sign(joints)
    twists = sign * _twists(mechanism, system, pulls, ever @ u[:, rank - 1])
    return Lost(float(sigma[rank - 1]), sign * joints * mechanism.scale, twists)


def passive_singular_values(mechanism: Mechanism, q: Array) -> Array:
    """Of the passive joints' columns in the loops' Jacobian at q (nq,), without unit, largest first, as many as their
    generic rank; the mechanism is at a type 2 singularity where the last vanishes."""
    return np.asarray(np.linalg.svd(_passive(mechanism, q), compute_uv=False)[: mechanism.passive_rank])


def gained(mechanism: Mechanism, q: Array) -> Gained | None:
    """The motion that the motors hold least at q (nq,); None where there are no loops with passive joints."""
    rank = mechanism.passive_rank
    if rank == 0:
        return None
    _, sigma, vt = np.linalg.svd(_passive(mechanism, q), full_matrices=False)
    joints = np.zeros(mechanism.model.nv)
    joints[mechanism.passive_columns] = vt[rank - 1]
    return Gained(float(sigma[rank - 1]), _sign(joints) * joints * mechanism.scale)


def _passive(mechanism: Mechanism, q: Array) -> Array:
    return mechanism.system.evaluate(q)[1][:, mechanism.passive_columns]


def _on_free_motions(
    mechanism: Mechanism, system: ClosedLoops, q: Array, pulls: Sequence[tuple[Pull, Array]], resting: int
) -> tuple[Array, Array]:
    """Rows of all pulls (rows, n) and the motions that keep all loops closed (n, k), at q."""
    loops = system.evaluate(q)[1][:, resting:]
    rows = equations(mechanism, system, pulls)[1][:, resting:]
    return rows, free_motions(loops, mechanism.loop_rank)[0]


def _ever(
    mechanism: Mechanism, system: ClosedLoops, q: Array, pulls: Sequence[tuple[Pull, Array]], resting: int
) -> Array:
    """(rows, .) orthonormal basis of where the pulls can move at all. At a singularity of a planar mechanism the
    direction out of its plane has a singular value of 0 too, but it is not lost: it was never there."""
    images = []
    for there in (*mechanism.samples, q):
        rows, motions = _on_free_motions(mechanism, system, there, pulls, resting)
        images.append(rows @ motions)
    together = np.hstack(images)
    if not np.isfinite(together).all():
        return np.zeros((len(together), 0))
    u, sigma, _ = np.linalg.svd(together, full_matrices=False)
    return np.asarray(u[:, sigma > _EVER * sigma[0]])


def _twists(mechanism: Mechanism, system: ClosedLoops, pulls: Sequence[tuple[Pull, Array]], along: Array) -> Array:
    """(pulls, 6) the shortest twists of what is pulled, in the world's axes, that the pulls see as `along` (rows,)."""
    heaviest = max(pull.weight for pull, _ in pulls)
    twists, row = np.zeros((len(pulls), 6)), 0
    for twist, (pull, axes) in zip(twists, pulls, strict=True):
        placement = pin.updateFramePlacement(mechanism.model, system.data, pull.frame) * pull.at
        seen = pull.equations(placement, np.eye(6), axes)[1]  # (rows, 6) of the node's twist in its own axes
        part = along[row : row + pull.rows] / units(pull, mechanism.length) * (heaviest / pull.weight)
        own = np.linalg.pinv(seen) @ part
        twist[:3], twist[3:] = placement.rotation @ own[:3], placement.rotation @ own[3:]
        row += pull.rows
    return twists


def _sign(joints: Array) -> float:
    """What makes the largest component positive: singular vectors may point either way."""
    return -1.0 if joints[np.argmax(np.abs(joints))] < 0.0 else 1.0
