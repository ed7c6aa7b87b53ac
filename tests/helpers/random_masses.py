"""Mechanisms whose links have random masses, and their motions, without the code that computes with them."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import scipy.linalg

import cinegen


def massive(mechanism: cinegen.Mechanism, seed: int = 0) -> cinegen.Mechanism:
    """Return the mechanism with random physical masses, centres and inertias of all its bodies."""
    rng, model = np.random.default_rng(seed), pin.Model(mechanism.model)
    for j in range(1, model.njoints):
        points, masses = rng.normal(scale=0.2, size=(5, 3)), rng.uniform(0.1, 1.0, size=5)
        body = pin.Inertia.Zero()
        for point, mass in zip(points, masses, strict=True):
            body = body + pin.Inertia(mass, point, np.zeros((3, 3)))
        model.inertias[j] = body
    return replace(mechanism, model=model)


def free_motions(mechanism: cinegen.Mechanism, q: np.ndarray) -> np.ndarray:
    """Return a basis (nv, k) of the motions, m and rad, that keep the loops closed."""
    if not mechanism.is_constrained:
        return np.eye(mechanism.model.nv)
    return scipy.linalg.null_space(mechanism.loop_jacobian(q), rcond=1e-9)


def drift(mechanism: cinegen.Mechanism, q: np.ndarray, v: np.ndarray, step: float = 1e-5) -> np.ndarray:
    """Return (dJ/dt) v of the loops by a central difference."""
    ahead, behind = (mechanism.loop_jacobian(mechanism.integrate(q, s * v)) @ v for s in (step, -step))
    return (ahead - behind) / (2.0 * step)


def random_motion(mechanism: cinegen.Mechanism, q: np.ndarray, rng: np.random.Generator):
    """Return a random velocity and acceleration (nv,) that keep the loops closed; accelerations to about 1e-9."""
    free = free_motions(mechanism, q)
    v, a = (free @ rng.normal(size=free.shape[1]) for _ in range(2))
    if mechanism.is_constrained:
        a = a - np.linalg.pinv(mechanism.loop_jacobian(q), rcond=1e-9) @ drift(mechanism, q, v)
    return v, a
