"""What a redundant mechanism does with the motions that its loops and tasks leave free.

Each objective says how fast the joints should move for its own sake. A tick adds these up, takes what neither opens a
loop nor moves a task, and adds that to its step: the gradient projection of A. Liégeois, "Automatic supervisory control
of the configuration and behavior of multibody mechanisms", IEEE Trans. Systems, Man, and Cybernetics 7, 1977.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cinegen.errors import CinegenError
from cinegen.ik.plain import axes_of, equations
from cinegen.ik.task import FrameTask
from cinegen.model import Mechanism

Array = NDArray[np.float64]

_STEP = 1e-5  # rad or lengths: between two configurations whose difference is a derivative; what is left is 1e-10
_LOST = 1e-6  # a singular value below this part of the largest is zero


@dataclass(frozen=True, slots=True)
class State:
    """What an objective is told before a tick.

    Attributes:
        mechanism: which moves.
        q: (nq,) where it is.
        dt: seconds that the tick will last.
        tasks: that hold.
        resting: how many of the first columns rest: those of a base that is not pulled.
    """

    mechanism: Mechanism
    q: Array
    dt: float
    tasks: Sequence[FrameTask] = ()
    resting: int = 0


class Objective(Protocol):
    """Anything with a method `velocity`."""

    def velocity(self, state: State) -> ArrayLike:
        """(nv,) how fast the joints should move for its sake, rad/s and m/s, loops and tasks apart."""
        ...


class _Rated:
    """An objective with a rate, and a weight for each joint."""

    def __init__(self, joints: Iterable[str] | Mapping[str, float] | None, rate: float) -> None:
        if not 0.0 < rate < math.inf:
            raise CinegenError(f"an objective's rate must be above 0, not {rate}")
        if joints is not None and not isinstance(joints, Mapping):
            joints = dict.fromkeys([joints] if isinstance(joints, str) else joints, 1.0)
        for joint, weight in (joints or {}).items():
            if not 0.0 <= weight < math.inf:
                raise CinegenError(f"the weight of '{joint}' must not be below 0, but is {weight}")
        self.joints, self.rate = joints, rate
        self._weighed: tuple[Mechanism, Array] | None = None

    def _part(self, state: State) -> float:
        """1/s: what is done in a tick, such that after many it does not matter how long each is."""
        return -math.expm1(-self.rate * state.dt) / state.dt

    def _weights(self, mechanism: Mechanism) -> Array:
        """(nv,) the largest is 1; a base that can move counts nothing."""
        if self._weighed is None or self._weighed[0] is not mechanism:
            names = mechanism.joints if self.joints is None else self.joints
            weights = np.zeros(mechanism.model.nv)
            for name in names:
                at = mechanism.v_index(name)
                joint = mechanism.model.joints[mechanism.model.getJointId(name)]
                weights[at : at + joint.nv] = 1.0 if self.joints is None else self.joints[name]
            self._weighed = mechanism, weights / max(float(weights.max(initial=0.0)), 1e-300)
        return self._weighed[1]


class Posture(_Rated):
    """Joints go back to a posture. Lowers half the sum of the squared distances, without unit.

    Args:
        q: (nq,) the posture; home unless given.
        joints: which joints count, or how much each does; all alike unless given.
        rate: 1/s: left alone, a distance falls to 37 % in 1 / rate seconds.

    Raises:
        CinegenError: a rate not above 0, or a weight below.
    """

    def __init__(
        self,
        q: ArrayLike | None = None,
        joints: Iterable[str] | Mapping[str, float] | None = None,
        rate: float = 1.0,
    ) -> None:
        super().__init__(joints, rate)
        self.q = None if q is None else np.array(q, dtype=float)

    def velocity(self, state: State) -> Array:
        """(nv,) rad/s and m/s."""
        mechanism = state.mechanism
        return self._part(state) * self._weights(mechanism) * self._way(state) * mechanism.scale

    def value(self, state: State) -> float:
        """What is lowered."""
        return float(0.5 * self._weights(state.mechanism) @ self._way(state) ** 2)

    def _way(self, state: State) -> Array:
        """(nv,) to the posture, without unit."""
        mechanism = state.mechanism
        there = mechanism.q_home if self.q is None else mechanism.checked(self.q)
        return mechanism.scaled_difference(state.q, there)


class LimitMargin(_Rated):
    """Joints keep a margin from their position limits; where they do, nothing is done.

    Lowers half the sum of the squared ways that joints have gone into their margins, without unit: F. Chaumette and
    É. Marchand, "A redundancy-based iterative approach for avoiding joint limits: application to visual servoing", IEEE
    Trans. Robotics and Automation 17, 2001, all joints weighed alike. It is finite at a limit and beyond, and no joint
    near its limit slows the others down, as with barriers that are infinite there.

    Args:
        margin: part of a joint's range to be kept free at either end, up to 0.5: then it is drawn to the middle.
        joints: which joints count, or how much each does; all that have limits unless given.
        rate: 1/s: left alone, what a joint has gone into its margin falls to 37 % in 1 / rate seconds.

    Raises:
        CinegenError: a rate not above 0, a weight below, or a margin not in (0, 0.5].
    """

    def __init__(
        self,
        margin: float = 0.1,
        joints: Iterable[str] | Mapping[str, float] | None = None,
        rate: float = 1.0,
    ) -> None:
        super().__init__(joints, rate)
        if not 0.0 < margin <= 0.5:
            raise CinegenError(f"a margin must be in (0, 0.5], not {margin}")
        self.margin = margin
        self._ranges: tuple[Mechanism, NDArray[np.intp], NDArray[np.intp], Array, Array] | None = None

    def velocity(self, state: State) -> Array:
        """(nv,) rad/s and m/s."""
        mechanism = state.mechanism
        return -self._part(state) * self._weights(mechanism) * self._inside(state) * mechanism.scale

    def value(self, state: State) -> float:
        """What is lowered."""
        return float(0.5 * self._weights(state.mechanism) @ self._inside(state) ** 2)

    def _inside(self, state: State) -> Array:
        """(nv,) how far joints are in their margins, without unit: below 0 at their lower limits."""
        mechanism = state.mechanism
        if self._ranges is None or self._ranges[0] is not mechanism:
            self._ranges = mechanism, *_ranges(mechanism, self.margin)
        _, at_q, at_v, low, high = self._ranges
        here = state.q[at_q]
        inside = np.zeros(mechanism.model.nv)
        inside[at_v] = (here - np.minimum(np.maximum(here, low), high)) / mechanism.scale[at_v]
        return inside


def _ranges(mechanism: Mechanism, margin: float) -> tuple[NDArray[np.intp], NDArray[np.intp], Array, Array]:
    """Of the joints with two limits: where they stand in q and in v, and where their margins end, rad and m."""
    at_q, at_v = mechanism.scalar_joints
    wide = mechanism.limits.upper[at_q] - mechanism.limits.lower[at_q]
    limited = (wide > 0.0) & np.isfinite(wide)
    at_q, at_v, width = at_q[limited], at_v[limited], margin * wide[limited]
    low, high = mechanism.limits.lower[at_q] + width, mechanism.limits.upper[at_q] - width
    return at_q, at_v, low, np.maximum(low, high)


class Manipulability(_Rated):
    """Tasks stay far from singularities.

    Raises T. Yoshikawa's measure ("Manipulability of robotic mechanisms", International Journal of Robotics Research 4,
    1985): the product of the singular values of what is pulled, on the motions that the loops leave, all without unit.
    It is its logarithm that is raised, so that weights and the number of tasks do not matter; and not faster than
    `rate`, in rad/s or characteristic lengths.

    Args:
        node: whose measure it is; that of the tasks together unless given.
        translation: how many translations of the node count, along the axes it has (see `FrameTask`).
        rotation: how many rotations.
        rate: 1/s.

    Raises:
        CinegenError: a rate not above 0, or translation or rotation not 0 to 3.
    """

    def __init__(self, node: str | None = None, translation: int = 3, rotation: int = 3, rate: float = 1.0) -> None:
        super().__init__(None, rate)
        if translation not in range(4) or rotation not in range(4):
            raise CinegenError(f"0 to 3 translations and rotations can count, not {translation} and {rotation}")
        self.node, self.translation, self.rotation = node, translation, rotation

    def velocity(self, state: State) -> Array:
        """(nv,) rad/s and m/s."""
        gradient = self.gradient(state)
        slope = float(np.linalg.norm(gradient))
        return self._part(state) / max(1.0, slope) * gradient * state.mechanism.scale

    def value(self, state: State) -> float:
        """What is lowered: minus the measure's logarithm."""
        loops, _, rows = self._rows(state, self._measured(state), state.q)
        _, motions = _solved(loops, state.mechanism.loop_rank)
        sigma = np.linalg.svd(rows @ motions, compute_uv=False)
        return -float(np.log(sigma[sigma > _LOST * sigma.max(initial=0.0)]).sum())

    def gradient(self, state: State) -> Array:
        """(nv,) of the measure's logarithm by the free motions that no task asks for, without unit.

        With A = J V, V the free motions, it changes by the trace of A^+ dA; along a motion z that keeps loops closed,
        dV = -J_c^+ dJ_c V to what V does not span. The Jacobians' own changes are central differences: two evaluations
        for each motion that the tasks leave.
        """
        mechanism, measured = state.mechanism, self._measured(state)
        system, nv = mechanism.system, mechanism.model.nv
        gradient = np.zeros(nv)
        loops, pulled, rows = self._rows(state, measured, state.q)
        if not len(rows):
            return gradient
        with np.errstate(all="ignore"):  # what is no number is left out by the solver
            inverse, motions = _solved(loops, mechanism.loop_rank)
            u, sigma, wt = np.linalg.svd(rows @ motions, full_matrices=False)
            used = sigma > _LOST * sigma.max(initial=0.0)
            solved = wt[used].T / sigma[used] @ u[:, used].T
            for way in (motions @ _left(pulled @ motions)).T:
                step = np.concatenate([np.zeros(state.resting), _STEP * way])
                ahead = self._rows(state, measured, system.integrate(state.q, step))
                behind = self._rows(state, measured, system.integrate(state.q, -step))
                change = ahead[2] - behind[2] - rows @ inverse @ (ahead[0] - behind[0])
                slope = np.sum(solved.T * (change @ motions)) / (2.0 * _STEP)
                gradient[state.resting :] += slope * way
        return gradient

    def _measured(self, state: State) -> list[FrameTask] | None:
        """Whose measure it is; None where it is that of the tasks."""
        if self.node is None:
            return None
        frame = state.mechanism.frame_id(self.node)
        here = state.mechanism.placement(state.q, self.node)
        return [FrameTask(self.node, here, self.translation, self.rotation, frame=frame)]

    def _rows(self, state: State, measured: list[FrameTask] | None, q: Array) -> tuple[Array, Array, Array]:
        """The rows of loops, of tasks, and of what is measured, at q, without unit and without columns that rest."""
        mechanism = state.mechanism
        system = mechanism.system
        loops = system.evaluate(q)[1][:, state.resting :]
        found: list[Array] = []
        for tasks in (state.tasks, measured):
            if tasks is None:
                found.append(found[0])
                continue
            holding = [task for task in tasks if task.is_valid()]
            with_axes = [(task, axes_of(task, mechanism, system)) for task in holding]
            found.append(equations(mechanism, system, with_axes)[1][:, state.resting :])
        return loops, found[0], found[1]


def _solved(loops: Array, rank: int) -> tuple[Array, Array]:
    """The loops' pseudo-inverse (n, rows), and (n, n - rank) the motions that keep them closed."""
    if rank == 0:
        return np.zeros(loops.shape[::-1]), np.eye(loops.shape[1])
    u, sigma, vt = np.linalg.svd(loops, full_matrices=True)
    return vt[:rank].T / sigma[:rank] @ u[:, :rank].T, vt[rank:].T


def _left(rows: Array) -> Array:
    """(k, .) motions that rows (., k) leave free."""
    if not len(rows):
        return np.eye(rows.shape[1])
    _, sigma, vt = np.linalg.svd(rows, full_matrices=True)
    return vt[int(np.count_nonzero(sigma > _LOST * sigma.max(initial=0.0))) :].T
