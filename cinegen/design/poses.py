"""Random poses within the limits of a robot's joints, reached along straight lines of its actuated joints from home."""

from __future__ import annotations

import math

import numpy as np

from cinegen.arrays import Array, Bools
from cinegen.design.design import Design
from cinegen.errors import CinegenError
from cinegen.model.mechanism import Mechanism
from raff2urdf import closure

_STEPS = 16  # of the line to a target
_FAR = 1.0  # rad or characteristic lengths: how far from home joints without limits go
_JUMP = 0.5  # rad or characteristic lengths: no joint moves farther in a step
_SINGULAR = 1e-3  # smallest singular value of the loops
_REGULAR = 0.25  # the same, relative to that at home


def random_poses(design: Design, count: int, seed: int = 0, part: float = 1.0) -> Array:
    """Return random closed configurations, reached from home without leaving joint limits or crossing a singularity.

    Args:
        design: whose fixed joints, the actuated ones unless others were given, are driven; at the file's parameters.
        count: number of configurations.
        seed: of the random numbers.
        part: of the fixed joints' ranges around home, 0 to 1.

    Returns:
        (count, nq).

    Raises:
        CinegenError: hardly any target can be approached.
    """
    mechanism, rng = design.mechanism, np.random.default_rng(seed)
    at = [mechanism.q_index(joint) for joint in design.fixed]
    home = mechanism.q_home
    low, high = (np.array([_range(mechanism, joint)[end] for joint in design.fixed]) for end in (0, 1))
    poses: list[Array] = []
    for _ in range(20):
        targets = home[at] + part * (rng.uniform(low, high, (2 * count, len(at))) - home[at])
        q, far = np.tile(home, (len(targets), 1)), np.zeros(len(targets))
        alive = np.ones(len(targets), dtype=bool)
        for step in range(1, _STEPS + 1):
            trial = q.copy()
            trial[:, at] += (targets - home[at]) / _STEPS
            closed = design.evaluate(q=trial)
            alive &= (closed.gap <= closure.CLOSED) & _allowed(mechanism, closed.q) & _regular(design, closed.jacobians)
            alive &= np.abs(closed.q - q).max(axis=1) < _JUMP * max(1.0, mechanism.length)
            q[alive], far[alive] = closed.q[alive], step / _STEPS
        poses += list(q[far > 0.2])
        if len(poses) >= count:
            return np.array(poses[:count])
    raise CinegenError(f"{mechanism.name}: only {len(poses)} of {count} poses were found within the joints' limits")


def _range(mechanism: Mechanism, joint: str) -> tuple[float, float]:
    """Return the values between which targets of a joint are, m or rad."""
    home = float(mechanism.q_home[mechanism.q_index(joint)])
    far = _FAR * (mechanism.length if mechanism.is_prismatic(joint) else 1.0)
    low, high = mechanism.limits[joint][:2]
    return (low if math.isfinite(low) else home - far), (high if math.isfinite(high) else home + far)


def _allowed(mechanism: Mechanism, q: Array) -> Bools:
    """Return which configurations (count, nq) are within the limits of all joints."""
    allowed = np.ones(len(q), dtype=bool)
    for joint in mechanism.joints:
        low, high = mechanism.limits[joint][:2]
        value, home = q[:, mechanism.q_index(joint)], mechanism.q_home[mechanism.q_index(joint)]
        allowed &= (value >= min(low, home)) & (value <= max(high, home))
    return allowed


def _regular(design: Design, jacobians: Array) -> Bools:
    """Return in which configurations the loops, (count, rows, nv), determine the joints that move well."""
    if not design.rank:
        return np.ones(len(jacobians), dtype=bool)
    home = design.mechanism.structure.system.evaluate(design.mechanism.q_home)[1][:, design.moving]
    least = np.linalg.svd(home, compute_uv=False)[design.rank - 1]
    s = np.linalg.svd(jacobians[:, :, design.moving], compute_uv=False)[:, design.rank - 1]
    return np.asarray(s > max(_SINGULAR, _REGULAR * least))
