"""A mechanism described by values that can be printed or written."""

from __future__ import annotations

from typing import Any

import numpy as np

from cinegen.loops.closed_loops import LoopConstraint
from cinegen.model.mechanism import Mechanism


def describe(mechanism: Mechanism) -> dict[str, Any]:
    """Return joints, loops, mobility, actuated joints, closure and singular values at home; SI units and radians.

    Singular values are dimensionless: lengths are divided by the characteristic length. Those of the loops are as many
    as their generic rank. Those of the end (`Mechanism.end`) are of its Jacobian in the loops' null space.
    """
    model, q = mechanism.model, mechanism.q_home
    motions, loop_sigma = np.eye(model.nv), np.zeros(0)
    if mechanism.loops:
        _, loop_sigma, vt = np.linalg.svd(mechanism.system.evaluate(q)[1])
        motions = vt[mechanism.loop_rank :].T
    end = mechanism.end
    units = np.array([mechanism.length] * 3 + [1.0] * 3)[:, None]
    end_sigma = np.linalg.svd(mechanism.jacobian(q, end) * mechanism.scale @ motions / units, compute_uv=False)
    return {
        "robot": mechanism.name,
        "nodes": list(mechanism.nodes),
        "joints": [describe_joint(mechanism, joint) for joint in mechanism.joints],
        "loops": [describe_loop(loop) for loop in mechanism.loops],
        "loop_rows": sum(loop.rows for loop in mechanism.loops),
        "loop_rank": mechanism.loop_rank,
        "mobility": mechanism.mobility,
        "uncontrolled_dof": len(mechanism.passive_columns) - mechanism.passive_rank,
        "actuated": list(mechanism.actuated),
        "characteristic_length": mechanism.length,
        "gap_as_written": mechanism.gap_as_written,
        "closure_at_home": mechanism.closure(q),
        "loop_singular_values": loop_sigma[: mechanism.loop_rank].tolist(),
        "end": end,
        "end_singular_values": end_sigma.tolist(),
    }


def describe_loop(loop: LoopConstraint) -> dict[str, str]:
    """Return a loop's name, its kind, and the two nodes that it joins."""
    return {"name": loop.name, "kind": loop.kind.name.lower(), "first": loop.first, "second": loop.second}


def describe_joint(mechanism: Mechanism, joint: str) -> dict[str, Any]:
    """Return a joint's name, type, home, limits (None where there are none; rad, m, s), and whether it is actuated."""
    limits = mechanism.limits[joint]
    bounds = {"lower": limits.lower, "upper": limits.upper, "velocity": limits.velocity}
    return {
        "name": joint,
        "type": "prismatic" if mechanism.is_prismatic(joint) else "revolute",
        "home": float(mechanism.q_home[mechanism.q_index(joint)]),
        **{word: value if np.isfinite(value) else None for word, value in bounds.items()},
        "actuated": joint in mechanism.actuated,
    }
