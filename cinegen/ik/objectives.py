"""Objectives: motions of a redundant mechanism in the null space of its loops and tasks.

Each objective returns a desired joint velocity. A tick projects their sum onto the null space of loops and tasks, and
adds it to its step: the gradient projection of A. Liégeois, "Automatic supervisory control of the configuration and
behavior of multibody mechanisms", IEEE Trans. Systems, Man, and Cybernetics 7, 1977.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import Any, Protocol

import numpy as np

from cinegen.arrays import Array, ArrayLike, Indices
from cinegen.errors import CinegenError
from cinegen.ik.equations import axes_of, equations
from cinegen.ik.given_task import rows_of
from cinegen.ik.state import State
from cinegen.ik.task import FrameTask
from cinegen.model import Mechanism

_STEP = 1e-5  # rad or lengths: step of central differences; their error is 1e-10
_LOST = 1e-6  # relative singular value below which it counts as 0


class Objective(Protocol):
    """Object with a method `velocity`."""

    def velocity(self, state: State) -> ArrayLike:
        """Return the desired joint velocity (nv,), rad/s and m/s, regardless of loops and tasks."""
        ...


class _Rated:
    """Objective with a rate, and a weight for each joint. Its attributes may be set at any time, with the errors of its
    arguments."""

    __slots__ = ("__weakref__", "_joints", "_rate", "_weighed")

    def __init__(self, joints: Iterable[str] | Mapping[str, float] | None, rate: float) -> None:
        self.joints, self.rate = joints, rate

    @property
    def rate(self) -> float:
        """Rate, 1/s."""
        return self._rate

    @rate.setter
    def rate(self, rate: float) -> None:
        if not 0.0 < rate < math.inf:
            raise CinegenError(f"an objective's rate must be above 0, not {rate}")
        self._rate = rate

    @property
    def joints(self) -> Mapping[str, float] | None:
        """Weight of each joint that moves; None: all joints, with equal weights. Setting it copies."""
        return None if self._joints is None else MappingProxyType(self._joints)

    @joints.setter
    def joints(self, joints: Iterable[str] | Mapping[str, float] | None) -> None:
        if joints is not None and not isinstance(joints, Mapping):
            joints = dict.fromkeys([joints] if isinstance(joints, str) else joints, 1.0)
        for joint, weight in (joints or {}).items():
            if not 0.0 <= weight < math.inf:
                raise CinegenError(f"the weight of '{joint}' must be finite and not below 0, not {weight}")
        self._joints = None if joints is None else dict(joints)
        self._weighed: tuple[Mechanism, Array] | None = None

    def _gain(self, state: State) -> float:
        """Return the gain of one tick, 1/s, such that the decay over many ticks does not depend on their period."""
        return -math.expm1(-self.rate * state.dt) / state.dt

    def _weights(self, mechanism: Mechanism) -> Array:
        """Return the weights of the columns (nv,): the largest is 1, that of a floating base 0."""
        if self._weighed is None or self._weighed[0] is not mechanism:
            joints = self._joints
            names = mechanism.joints if joints is None else joints
            weights = np.zeros(mechanism.model.nv)
            for name in names:
                column = mechanism.v_index(name)
                joint = mechanism.model.joints[mechanism.model.getJointId(name)]
                weights[column : column + joint.nv] = 1.0 if joints is None else joints[name]
            self._weighed = mechanism, weights / max(float(weights.max(initial=0.0)), 1e-300)
        return self._weighed[1]


class Posture(_Rated):
    """Posture task: joints move towards a configuration. Minimises half the sum of the squared distances,
    dimensionless.

    Args:
        q: (nq,) configuration; home unless given.
        joints: joints that move, or the weight of each; all joints, with equal weights, unless given.
        rate: rate at which distances decay, 1/s.

    Raises:
        CinegenError: the rate is not above 0, or a weight is negative.
    """

    __slots__ = ("_q",)

    def __init__(
        self, q: ArrayLike | None = None, joints: Iterable[str] | Mapping[str, float] | None = None, rate: float = 1.0
    ) -> None:
        super().__init__(joints, rate)
        self.q = q

    @property
    def q(self) -> Array | None:
        """(nq,) configuration, a copy; None: home."""
        return None if self._q is None else self._q.copy()

    @q.setter
    def q(self, q: ArrayLike | None) -> None:
        self._q = None if q is None else np.array(q, dtype=float)

    def velocity(self, state: State) -> Array:
        """Return the desired joint velocity (nv,), rad/s and m/s."""
        mechanism = state.mechanism
        return self._gain(state) * self._weights(mechanism) * self._difference(state) * mechanism.scale

    def value(self, state: State) -> float:
        """Return the value that is minimised."""
        return float(0.5 * self._weights(state.mechanism) @ self._difference(state) ** 2)

    def _difference(self, state: State) -> Array:
        """Return the difference to the desired configuration (nv,), dimensionless."""
        mechanism = state.mechanism
        desired = mechanism.q_home if self._q is None else mechanism.structure.checked(self._q)
        return mechanism.scaled_difference(state.q, desired)


class LimitMargin(_Rated):
    """Joints keep a margin from their position limits; outside the margins the velocity is 0.

    Minimises half the sum of the squared depths of joints in their margins, dimensionless, with equal weights: F.
    Chaumette and É. Marchand, "A redundancy-based iterative approach for avoiding joint limits: application to visual
    servoing", IEEE Trans. Robotics and Automation 17, 2001. It is finite at a limit and beyond, and a joint near its
    limit does not slow the others down, as barrier functions do.

    Args:
        margin: fraction of a joint's range at either end, up to 0.5: then the joint moves towards the middle.
        joints: joints that move, or the weight of each; all joints with limits unless given.
        rate: rate at which depths decay, 1/s.

    Raises:
        CinegenError: the rate is not above 0, a weight is negative, or the margin is not in (0, 0.5].
    """

    __slots__ = ("_margin", "_ranges")

    def __init__(
        self, margin: float = 0.1, joints: Iterable[str] | Mapping[str, float] | None = None, rate: float = 1.0
    ) -> None:
        super().__init__(joints, rate)
        self.margin = margin

    @property
    def margin(self) -> float:
        """Fraction of a joint's range at either end."""
        return self._margin

    @margin.setter
    def margin(self, margin: float) -> None:
        if not 0.0 < margin <= 0.5:
            raise CinegenError(f"the margin must be in (0, 0.5], not {margin}")
        self._margin = margin
        self._ranges: tuple[Mechanism, Indices, Indices, Array, Array] | None = None

    def velocity(self, state: State) -> Array:
        """Return the desired joint velocity (nv,), rad/s and m/s."""
        mechanism = state.mechanism
        return -self._gain(state) * self._weights(mechanism) * self._depth(state) * mechanism.scale

    def value(self, state: State) -> float:
        """Return the value that is minimised."""
        return float(0.5 * self._weights(state.mechanism) @ self._depth(state) ** 2)

    def _depth(self, state: State) -> Array:
        """Return the depth of each joint in its margins (nv,), dimensionless; negative at lower limits."""
        mechanism = state.mechanism
        if self._ranges is None or self._ranges[0] is not mechanism:
            self._ranges = mechanism, *_ranges(mechanism, self.margin)
        _, at_q, at_v, low, high = self._ranges
        q = state.q[at_q]
        depth = np.zeros(mechanism.model.nv)
        depth[at_v] = (q - np.minimum(np.maximum(q, low), high)) / mechanism.scale[at_v]
        return depth


def _ranges(mechanism: Mechanism, margin: float) -> tuple[Indices, Indices, Array, Array]:
    """Return the joints with two limits: their indices in q and v, and the inner ends of their margins, rad and m."""
    at_q, at_v = mechanism.structure.scalar_joints
    wide = mechanism.limits.upper[at_q] - mechanism.limits.lower[at_q]
    limited = (wide > 0.0) & np.isfinite(wide)
    at_q, at_v, width = at_q[limited], at_v[limited], margin * wide[limited]
    low, high = mechanism.limits.lower[at_q] + width, mechanism.limits.upper[at_q] - width
    return at_q, at_v, low, np.maximum(low, high)


class Manipulability(_Rated):
    """Tasks stay far from singularities.

    Maximises the manipulability of T. Yoshikawa ("Manipulability of robotic mechanisms", International Journal of
    Robotics Research 4, 1985): the product of the dimensionless singular values of the tasks in the null space of the
    loops. The gradient is that of its logarithm, so that weights and the number of tasks do not matter; the velocity is
    at most `rate`, in rad/s or characteristic lengths per second.

    Args:
        node: node whose manipulability it is; that of all tasks unless given.
        translation: number of translations of the node that count, along its own axes; see `FrameTask.translation`.
        rotation: number of rotations that count.
        rate: largest velocity, 1/s.

    Raises:
        CinegenError: the rate is not above 0, or translation or rotation is not 0 to 3.
    """

    __slots__ = ("_rotation", "_translation", "node")

    def __init__(self, node: str | None = None, translation: int = 3, rotation: int = 3, rate: float = 1.0) -> None:
        super().__init__(None, rate)
        self.node, self.translation, self.rotation = node, translation, rotation

    @property
    def translation(self) -> int:
        """Number of translations of the node that count."""
        return self._translation

    @translation.setter
    def translation(self, count: int) -> None:
        self._translation = _count(count, "translations")

    @property
    def rotation(self) -> int:
        """Number of rotations of the node that count."""
        return self._rotation

    @rotation.setter
    def rotation(self, count: int) -> None:
        self._rotation = _count(count, "rotations")

    def velocity(self, state: State) -> Array:
        """Return the desired joint velocity (nv,), rad/s and m/s."""
        gradient = self.gradient(state)
        slope = float(np.linalg.norm(gradient))
        return self._gain(state) / max(1.0, slope) * gradient * state.mechanism.scale

    def value(self, state: State) -> float:
        """Return the value that is minimised: minus the logarithm of the manipulability."""
        loops, _, rows = self._rows(state, self._measured(state), state.q)
        _, motions = _inverse(loops, state.mechanism.loop_rank)
        sigma = np.linalg.svd(rows @ motions, compute_uv=False)
        return -float(np.log(sigma[sigma > _LOST * sigma.max(initial=0.0)]).sum())

    def gradient(self, state: State) -> Array:
        """Return the gradient (nv,) of the logarithm in the null space of loops and tasks, dimensionless.

        With A = J V, V the free motions, the logarithm changes by the trace of A^+ dA; along a motion that keeps loops
        closed, dV = -J_c^+ dJ_c V outside the span of V. The changes of the Jacobians are central differences: two
        evaluations for each motion in the null space of the tasks.
        """
        mechanism, measured = state.mechanism, self._measured(state)
        system, nv = mechanism.structure.system, mechanism.model.nv
        gradient = np.zeros(nv)
        loops, tasks, rows = self._rows(state, measured, state.q)
        if not len(rows):
            return gradient
        with np.errstate(all="ignore"):  # the solver leaves out velocities that are not finite
            inverse, motions = _inverse(loops, mechanism.loop_rank)
            u, sigma, wt = np.linalg.svd(rows @ motions, full_matrices=False)
            used = sigma > _LOST * sigma.max(initial=0.0)
            pseudo_inverse = wt[used].T / sigma[used] @ u[:, used].T
            for direction in (motions @ _null_space(tasks @ motions)).T:
                ahead = self._rows(state, measured, system.integrate(state.q, _STEP * direction))
                behind = self._rows(state, measured, system.integrate(state.q, -_STEP * direction))
                change = ahead[2] - behind[2] - rows @ inverse @ (ahead[0] - behind[0])
                slope = np.sum(pseudo_inverse.T * (change @ motions)) / (2.0 * _STEP)
                gradient += slope * direction
        return gradient

    def _measured(self, state: State) -> list[Any] | None:
        """Return a task of the node; None if all tasks of the solver count."""
        if self.node is None:
            return None
        frame = state.mechanism.frame_id(self.node)
        pose = state.mechanism.placement(state.q, self.node)
        return [FrameTask(self.node, pose, self.translation, self.rotation, frame=frame)]

    def _rows(self, state: State, measured: list[Any] | None, q: Array) -> tuple[Array, Array, Array]:
        """Return the Jacobians of loops, tasks, and measured tasks at q, dimensionless."""
        mechanism = state.mechanism
        system = mechanism.structure.system
        loops = system.evaluate(q)[1]
        jacobians: list[Array] = []
        for tasks in (state.tasks, measured):
            if tasks is None:
                jacobians.append(jacobians[0])
                continue
            frames = [task for task in tasks if isinstance(task, FrameTask) and task.is_valid()]
            rows = [equations(mechanism, system, [(task, axes_of(task, mechanism, system)) for task in frames])[1]]
            at_q = State(mechanism, q, state.dt)
            rows += [rows_of(task, at_q) for task in tasks if not isinstance(task, FrameTask)]
            jacobians.append(np.vstack(rows))
        return loops, jacobians[0], jacobians[1]


def _count(count: int, what: str) -> int:
    if count not in range(4):
        raise CinegenError(f"0 to 3 {what} can count, not {count}")
    return count


def _inverse(loops: Array, rank: int) -> tuple[Array, Array]:
    """Return the pseudo-inverse of the loops' Jacobian (n, rows), and the motions that keep loops closed (n, n -
    rank)."""
    if rank == 0:
        return np.zeros(loops.shape[::-1]), np.eye(loops.shape[1])
    u, sigma, vt = np.linalg.svd(loops, full_matrices=True)
    return vt[:rank].T / sigma[:rank] @ u[:, :rank].T, vt[rank:].T


def _null_space(rows: Array) -> Array:
    """Return an orthonormal basis (k, .) of the null space of rows (., k)."""
    if not len(rows):
        return np.eye(rows.shape[1])
    _, sigma, vt = np.linalg.svd(rows, full_matrices=True)
    return vt[int(np.count_nonzero(sigma > _LOST * sigma.max(initial=0.0))) :].T
