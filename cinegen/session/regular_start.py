"""The configuration in which a robot that follows a path starts."""

from __future__ import annotations

import numpy as np

from cinegen.arrays import Array
from cinegen.ik.local_ik import LocalIK
from cinegen.model import Mechanism
from cinegen.tolerances import NEAR_SINGULAR

_SAMPLES = 200
_ZERO = 1e-6  # singular value (dimensionless)


def regular_start(mechanism: Mechanism) -> Array:
    """Return home (nq,); for a serial arm that is singular there, the one of 200 samples that is furthest from it.

    Many descriptions have their arms stretched at home, where they can't move in all directions.
    """
    home = mechanism.q_home
    if mechanism.is_constrained or mechanism.floating:
        return home
    samples = LocalIK(mechanism).samples(_SAMPLES, np.random.default_rng(0))
    sigma = np.array([_singular_values(mechanism, q) for q in samples])
    dof = int(np.count_nonzero(np.median(sigma, axis=0) > _ZERO))
    if dof == 0 or _singular_values(mechanism, home)[dof - 1] >= NEAR_SINGULAR:
        return home
    return np.asarray(samples[sigma[:, dof - 1].argmax()])


def _singular_values(mechanism: Mechanism, q: Array) -> Array:
    """Return the singular values of the end's motion by the joints' at q (nq,), dimensionless, largest first."""
    rows = mechanism.jacobian(q, mechanism.end) * mechanism.scale
    rows[:3] /= mechanism.length
    return np.asarray(np.linalg.svd(rows, compute_uv=False))
