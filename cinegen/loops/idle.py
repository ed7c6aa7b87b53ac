"""Idle motions of a Pinocchio model: see `raff2urdf.loops.idle`."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np

from cinegen.arrays import Array
from cinegen.loops.closed_loops import ClosedLoops
from raff2urdf.loops.idle import Edge, Spin, motions, spins
from raff2urdf.loops.length import cut_screws

_NOTHING = 1e-300  # what has no twist


def edges(system: ClosedLoops, q: Array) -> list[Edge]:
    """Return all joints, and then those that were cut, as connections of bodies, at q (nq,)."""
    model, data = system.model, system.data
    system.evaluate(q)
    unit = np.repeat([system.length, 1.0], 3)[:, None]
    columns, connections = np.asarray(data.J).reshape(6, -1) / unit, list[Edge]()
    for j in range(1, model.njoints):
        indices = range(model.idx_vs[j], model.idx_vs[j] + model.nvs[j])
        screws = columns[:, indices]
        turning = np.linalg.norm(screws[3:], axis=0)
        sizes = np.where(turning > 0.0, turning, np.linalg.norm(screws, axis=0))
        connections.append(Edge(model.parents[j], j, screws / np.maximum(sizes, _NOTHING), tuple(indices)))
    for loop, (first, placement, second, _) in zip(system.loops, system.anchors, strict=True):
        screws = cut_screws(loop.kind, (data.oMi[first] * placement).homogeneous)
        connections.append(Edge(first, second, screws / np.where(np.any(screws[3:], axis=0), unit, 1.0)))
    return connections


def idle_spins(system: ClosedLoops, configurations: Sequence[Array], actuated: Collection[str]) -> list[Spin]:
    """Return the idle motions of a mechanism.

    Args:
        system: its loops and couplings.
        configurations: (nq,) closed ones.
        actuated: joints that take no part, nor do coupled ones.
    """
    model = system.model
    fixed = {*actuated, *(name for coupling in system.couplings for name in coupling.terms)}
    still = np.setdiff1d(np.arange(model.nv), np.concatenate([np.zeros(0, np.intp), *system.columns])).tolist()
    still += [model.joints[model.getJointId(name)].idx_v for name in fixed if model.existJointName(name)]
    return spins([edges(system, q) for q in configurations], still)


def idle_motions(system: ClosedLoops, rotations: Sequence[Spin], q: Array) -> Array:
    """Return idle motions (n, nv) as steps of length 1 at q (nq,)."""
    return motions(edges(system, q), rotations, int(system.model.nv))
