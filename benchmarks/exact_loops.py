"""Configurations with closed loops to 30 digits, by Newton's method in mpmath: a yardstick for rounding errors.

The numbers of a mechanism and the values of its actuated joints are taken as they are, as doubles. Kinematics and
residuals are computed here again, without Pinocchio and without the kernels; only the steps use a Jacobian in doubles,
which decides how fast they converge, and not where.
"""

from __future__ import annotations

import mpmath
import numpy as np
import pinocchio as pin

from cinegen import Mechanism
from raff2urdf.closure import RANK
from raff2urdf.raff.document import LoopKind

DIGITS = 40
_LAST_STEP = 1e-30  # rad or lengths
_STEPS = 30

Frame = tuple[mpmath.matrix, mpmath.matrix]
"""Rotation matrix and origin."""


def closed_exactly(mechanism: Mechanism, q: np.ndarray) -> mpmath.matrix:
    """Return the configuration near q at which loops are closed, the actuated joints where they are in q; all joints
    are revolute or prismatic about or along z."""
    with mpmath.workdps(DIGITS):
        solution, columns = mpmath.matrix(q.tolist()), mechanism.structure.passive_columns
        jacobian = mechanism.structure.system.evaluate(q)[1][:, columns]
        inverse = mpmath.matrix(np.linalg.pinv(jacobian, rcond=RANK).tolist())
        for _ in range(_STEPS):
            step = inverse * _residual(mechanism, solution)
            for value, column in zip(step, columns, strict=True):
                solution[int(column)] -= value * mpmath.mpf(float(mechanism.scale[column]))
            if max(abs(value) for value in step) < _LAST_STEP:
                return solution
    raise RuntimeError(f"{mechanism.name} can't be closed exactly")


def distance(q: np.ndarray, exact: mpmath.matrix) -> float:
    """Return the largest difference of a configuration from an exact one, rad or m."""
    with mpmath.workdps(DIGITS):
        return float(max(abs(mpmath.mpf(value) - other) for value, other in zip(q.tolist(), exact, strict=True)))


def _residual(mechanism: Mechanism, q: mpmath.matrix) -> mpmath.matrix:
    """Return residuals that are, near 0, those of `mechanism.structure.system`."""
    frames, residuals, length = _frames(mechanism, q), list[mpmath.mpf](), mpmath.mpf(mechanism.length)
    for loop, (body, on_body, other, on_other) in zip(mechanism.loops, mechanism.structure.system.anchors, strict=True):
        first, second = _product(frames[body], _exact(on_body)), _product(frames[other], _exact(on_other))
        seen, offset = first[0].T * second[0], first[0].T * (second[1] - first[1]) / length
        residuals += list(offset)[: 2 if loop.kind is LoopKind.PRISMATIC else 3]
        if loop.kind is LoopKind.REVOLUTE:
            residuals += [-seen[1, 2], seen[0, 2]]
        elif loop.kind is not LoopKind.BALL:
            residuals += [(seen[2, 1] - seen[1, 2]) / 2, (seen[0, 2] - seen[2, 0]) / 2, (seen[1, 0] - seen[0, 1]) / 2]
    for coupling, size in zip(mechanism.couplings, mechanism.structure.system.coupling_sizes, strict=True):
        value = -mpmath.mpf(coupling.constant)
        for name, coefficients in coupling.terms.items():
            variable = q[int(mechanism.q_index(name))]
            value += sum(mpmath.mpf(coefficient) * variable ** (k + 1) for k, coefficient in enumerate(coefficients))
        residuals.append(value / mpmath.mpf(float(size)))
    return mpmath.matrix(residuals)


def _frames(mechanism: Mechanism, q: mpmath.matrix) -> list[Frame]:
    model, frames = mechanism.model, [(mpmath.eye(3), mpmath.zeros(3, 1))]
    for joint in range(1, model.njoints):
        value, moved = q[int(model.joints[joint].idx_q)], (mpmath.eye(3), mpmath.zeros(3, 1))
        if model.joints[joint].shortname() == "JointModelRZ":
            sine, cosine = mpmath.sin(value), mpmath.cos(value)
            moved = mpmath.matrix([[cosine, -sine, 0], [sine, cosine, 0], [0, 0, 1]]), moved[1]
        else:
            assert model.joints[joint].shortname() == "JointModelPZ"
            moved = moved[0], mpmath.matrix([0, 0, value])
        frames.append(_product(_product(frames[model.parents[joint]], _exact(model.jointPlacements[joint])), moved))
    return frames


def _exact(placement: pin.SE3) -> Frame:
    return mpmath.matrix(placement.rotation.tolist()), mpmath.matrix(placement.translation.tolist())


def _product(a: Frame, b: Frame) -> Frame:
    return a[0] * b[0], a[0] * b[1] + a[1]
