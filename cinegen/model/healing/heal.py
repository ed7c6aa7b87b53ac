"""The smallest change of a description's numbers that makes nearly redundant loop equations exactly dependent.

Let c(q, p) be the residual of the loops at a configuration q, for a geometry p. A mechanism whose equations are
dependent closes at every configuration that its independent equations allow. So healing asks for a geometry at which
many such configurations are closed. With J = dc/dq, and U the left singular vectors of its (nearly) zero singular
values, no motion changes U^T c to first order: only the geometry does,

    U_k^T (c(q_k, p) + dc/dp dp) = 0    for all configurations q_k.

These equations together are solved by Gauss-Newton steps for the p nearest to the given one; after each, the q_k again
solve the independent equations. It needs no list of what may be parallel, coplanar or of equal length: a planar
four-bar and Bennett's linkage are healed alike.

A geometry is described by small twists of the joints' placements, in the joints' own axes: rotations in rad, lengths
in characteristic lengths.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pinocchio as pin

from cinegen.arrays import Array
from cinegen.loops.closed_loops import ClosedLoops
from cinegen.model.healing.intended import Relation, errors, relations
from raff2urdf.loops.near_redundancy import NearRedundancy, settle
from raff2urdf.residual import loop_residual

LARGEST_CHANGE = 5e-3
"""rad, or characteristic lengths: a larger change is more than rounding."""

_ITERATIONS = 15
_HEALED = 2e-14  # gap below which nothing but rounding is left
_WEAK = 1e-5  # singular values below this part of the largest are directions in which hardly anything changes


def twists_of(system: ClosedLoops) -> int:
    """Return the number of twists that describe a geometry: two for each joint, two for each loop."""
    return 2 * (int(system.model.njoints) - 1) + 2 * len(system.loops)


def by_geometry(system: ClosedLoops) -> Array:
    """Return the derivative (rows, 6 twists) of the residual by the geometry, at the configuration evaluated last.

    The twists are those of all joints' placements, then of the bodies behind all joints, then of the first and of the
    second end of each loop.
    """
    model, data, count = system.model, system.data, system.model.njoints - 1
    derivative, row = np.zeros((system.rows, 6 * twists_of(system))), 0
    unit = np.repeat([system.length, 1.0], 3)
    for i, (loop, (a, on_a, b, on_b)) in enumerate(zip(system.loops, system.anchors, strict=True)):
        first, second = data.oMi[a] * on_a, data.oMi[b] * on_b
        _, by_twist = loop_residual(loop.kind, first.actInv(second).homogeneous, system.length)
        supports = (set(model.supports[a]), set(model.supports[b]))
        frames = [(2 * count + i, first, -1.0), (2 * count + len(system.loops) + i, second, 1.0)]
        for j in (supports[0] ^ supports[1]) - {0}:
            sign = 1.0 if j in supports[1] else -1.0
            frames.append((j - 1, data.oMi[model.parents[j]] * model.jointPlacements[j], sign))
            frames.append((count + j - 1, data.oMi[j], sign))
        for twist, frame, sign in frames:
            moved_by = by_twist @ np.asarray(first.actInv(frame).action) * (sign * unit)
            derivative[row : row + loop.rows, 6 * twist : 6 * twist + 6] = moved_by
        row += loop.rows
    return derivative


def in_bodies(system: ClosedLoops, twists: Array, inverse: bool = False) -> Array:
    """Return twists (6 twists, n) in the frames of the bodies that carry joints and ends, instead of their own; or the
    other way round. Bodies' frames stay where they are when a file's numbers change a little; others may turn at once,
    where a file gives only an axis."""
    model = system.model
    frames = [*(model.jointPlacements[j] for j in range(1, model.njoints)), *[pin.SE3.Identity()] * (model.njoints - 1)]
    frames += [anchor[1] for anchor in system.anchors] + [anchor[3] for anchor in system.anchors]
    unit, converted = np.repeat([system.length, 1.0], 3)[:, None], np.empty_like(twists)
    for i, frame in enumerate(frames):
        rows = slice(6 * i, 6 * i + 6)
        converted[rows] = (frame.inverse() if inverse else frame).action @ (twists[rows] * unit) / unit
    return converted


def heal(
    redundancies: Sequence[NearRedundancy], make: Callable[[Array], Sequence[ClosedLoops]], directions: Sequence[Array]
) -> tuple[Array, float]:
    """Return the smallest change of a description that makes its loops exactly redundant, and the remaining gap.

    Args:
        redundancies: the near redundancy of each cluster of loops.
        make: returns these clusters in a description that is changed by (n,) dimensionless numbers.
        directions: of each cluster, (6 twists, n) the change of the geometry with these numbers, in bodies' frames.
    """
    change, gap = np.zeros(directions[0].shape[1]), np.inf
    best, wanted = change, [relations(system) for system in make(change)]
    for _ in range(_ITERATIONS):
        parts = zip(make(change), redundancies, directions, wanted, strict=True)
        values, rows = zip(*(_equations(*part) for part in parts), strict=True)
        open_by, by_change = np.concatenate(values), np.vstack(rows)
        now = float(np.abs(open_by).max(initial=0.0)) if len(open_by) else np.inf
        if not now < 0.5 * gap and gap < 1e-9:
            break
        best, gap = change, now
        if gap <= _HEALED or not np.isfinite(gap):
            break
        # directions that matter only because the geometry is not yet healed have singular values as small as the gap
        noise = min(max(30.0 * gap, _WEAK), 1e-2)
        change = np.linalg.pinv(by_change, rcond=noise) @ (by_change @ change - open_by)
    return best, gap


def _equations(
    system: ClosedLoops, redundancy: NearRedundancy, directions: Array, wanted: list[Relation]
) -> tuple[Array, Array]:
    """Return U^T c at all configurations and the errors of relations, and their derivative by the change of the
    description."""
    directions = in_bodies(system, directions, inverse=True)
    untrue, by_twists = errors(system, wanted, twists_of(system))
    values, rows = [untrue], [by_twists @ directions]
    for q in redundancy.samples:
        settled = settle(system, q, redundancy.small)
        if settled is not None and settled.rank == redundancy.rank:
            system.evaluate(settled.q)
            values.append(settled.left.T @ settled.c)
            rows.append(settled.left.T @ by_geometry(system) @ directions)
    return np.concatenate(values), np.vstack(rows)


def moved(system: ClosedLoops, twists: Array) -> ClosedLoops:
    """Return loops of another geometry: joints' placements and ends of loops changed by twists (see `by_geometry`);
    those of bodies behind joints are ignored."""
    model, count = system.model.copy(), system.model.njoints - 1
    steps = [pin.exp6(np.asarray(t) * np.repeat([system.length, 1.0], 3)) for t in np.reshape(twists, (-1, 6))]
    for j in range(count):
        model.jointPlacements[j + 1] = model.jointPlacements[j + 1] * steps[j]
    ends = steps[2 * count :]
    loops = [
        replace(
            loop,
            first_placement=loop.first_placement * ends[i],
            second_placement=loop.second_placement * ends[len(system.loops) + i],
        )
        for i, loop in enumerate(system.loops)
    ]
    return ClosedLoops(model, loops, system.length, system.couplings)
