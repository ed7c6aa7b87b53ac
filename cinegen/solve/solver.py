"""The resolved-rate solver: moves any mechanism after any pulls, one tick at a time, loops closed at every tick."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from cinegen.errors import CinegenError
from cinegen.model import Mechanism
from cinegen.solve.damping import NEAR
from cinegen.solve.pull import Pull
from cinegen.solve.resolve import free_motions, resolve
from raff2urdf.closure import close, rank

Array = NDArray[np.float64]

CLOSURE = 1e-10
"""A tick whose loops can't be closed to this (rad, characteristic lengths) is refused."""

_STEP_CAP = 0.1  # rad or lengths in a tick: what the linearisation is good for, even without a velocity limit
_ERROR_CAP = 0.2  # rad or lengths: what a tick tries to make good at most; a far target is approached
_CORRECTION = 0.5  # part of the step that closing the loops again may add; more would be another assembly mode
_ARMIJO = 0.1  # part of what a step should win that it must win
_NOISE = 1e-26  # of `_distance`: rounding where a target is reached
_TRIES = 10  # times a step that tears is tried shorter
_NEAR_TYPE_2 = 1e-3  # a singular value of the loops below this is near a type 2 singularity
_ARRIVED = 1e-6  # rad or lengths: a pull this near to its target has reached it
_FULL = 1.0 - 1e-9  # part of a velocity limit that is used: rounding never goes beyond it
_REST = 1e-7  # rad or lengths in a tick: slower than this nothing moves


class Verdict(Enum):
    """What became of a tick. Where several are true, this one is said: BAD_TARGET, IDLE, REFUSED, FOLLOWING (all
    targets reached), AT_LIMIT, OUT_OF_REACH, SINGULAR, FOLLOWING (on the way)."""

    BAD_TARGET = "a pull was set to what can't be followed: it is left out"
    REFUSED = "the loops could not be closed after any part of the step: the last state stays"
    AT_LIMIT = "a joint limit holds the motion back"
    SINGULAR = "near a singularity: damped"
    OUT_OF_REACH = "nothing moves any more and a target is not reached"
    FOLLOWING = "every pull is followed"
    IDLE = "nothing is pulled"


@dataclass(frozen=True, slots=True)
class Step:
    """What one tick did.

    Attributes:
        q: (nq,) the new configuration.
        v: (nv,) the velocity that led there, rad/s and m/s.
        closure: largest loop residual at q, rad or characteristic lengths.
        errors: for each pull, in the order they were made, what is left: metres and radians.
        singular_values: of the pulls on what the loops leave, largest first, as many as their generic rank (type 1
            where one vanishes).
        loop_singular_values: of the loops (type 2 where one vanishes).
        saturated: joints that stand at a position limit which holds the motion back.
        pace: the part of the wanted motion that velocity limits (and the longest step that a tick's linearisation
            is good for, 0.1 rad or characteristic lengths) let through, 0 to 1.
        verdict: in one word.
    """

    q: Array
    v: Array
    closure: float
    errors: tuple[tuple[float, float], ...]
    singular_values: Array
    loop_singular_values: Array
    saturated: tuple[str, ...]
    pace: float
    verdict: Verdict


class Solver:
    """Moves a mechanism; owns q. One thread at a time; the mechanism may serve others meanwhile.

    Args:
        mechanism: what to move.
        dt: seconds between two ticks.
        q: (nq,) where to begin, loops closed; home unless given.
        gain: part of a pull's error that a tick makes good, 0 to 1.

    Raises:
        ConfigurationError: q is no configuration.
        CinegenError: q leaves loops open, or dt or gain make no sense.
    """

    def __init__(self, mechanism: Mechanism, dt: float, q: ArrayLike | None = None, gain: float = 1.0) -> None:
        if not (np.isfinite(dt) and dt > 0.0):
            raise CinegenError(f"dt must be a positive time in seconds, not {dt}")
        if not 0.0 < gain <= 1.0:
            raise CinegenError(f"gain must be in (0, 1], not {gain}")
        self.mechanism, self.dt, self.gain = mechanism, dt, gain
        self.q: Array = mechanism.checked(mechanism.q_home if q is None else q).copy()
        if mechanism.closure(self.q) > CLOSURE:
            raise CinegenError(f"q leaves loops of {mechanism.name} open by {mechanism.closure(self.q):.2g}: close it")
        self._system = mechanism.own_system()  # scratch of its own: no other thread or solver disturbs it
        self._pulls: list[Pull] = []
        self._bounded = _Bounds(mechanism, dt)
        self._ranks: dict[tuple[tuple[int, int, int], ...], int] = {}

    # --- pulls ---------------------------------------------------------------------------------------------------

    @property
    def pulls(self) -> tuple[Pull, ...]:
        """The pulls that hold, in the order they were made."""
        return tuple(self._pulls)

    def pull(self, node: str, target: pin.SE3 | None = None, translation: int = 3, rotation: int = 3) -> Pull:
        """Makes a node follow a pose. Set `pull.target` to move it on.

        Args:
            node: base, link or frame.
            target: where it should be, in the world; where it is unless given.
            translation: how many translations it holds, 0 to 3 (see `Pull`).
            rotation: how many rotations it holds, 0 to 3.

        Raises:
            UnknownNameError: no such node.
            CinegenError: translation or rotation not 0 to 3, or the target no SE3.
        """
        frame = self.mechanism.frame_id(node)
        if translation not in range(4) or rotation not in range(4):
            raise CinegenError(f"a pull holds 0 to 3 translations and rotations, not {translation} and {rotation}")
        if target is None:
            target = self.mechanism.placement(self.q, node)
        if not isinstance(target, pin.SE3):
            raise CinegenError(f"a pull's target is a pinocchio.SE3, not {type(target).__name__}")
        pull = Pull(node, target, translation, rotation, frame=frame)
        self._pulls.append(pull)
        return pull

    def release(self, pull: Pull) -> None:
        """Lets go; a pull that holds no longer is let go already."""
        if pull in self._pulls:
            self._pulls.remove(pull)

    # --- one tick ------------------------------------------------------------------------------------------------

    def step(self) -> Step:
        """One tick of dt. Never raises: the verdict says what happened."""
        system = self._system
        pulls = [pull for pull in self._pulls if pull.makes_sense()]
        rank_of_pulls = self._rank(pulls)
        _, loops = system.evaluate(self.q)
        error, rows, _ = self._equations(pulls)
        low, high = self._bounded.of(self.q, system.scale)
        # a base moves when it is pulled itself
        base_rests = self.mechanism.floating and all(pull.node != self.mechanism.nodes[0] for pull in pulls)
        moving = slice(6 if base_rests else 0, None)
        resolution = resolve(
            loops[:, moving],
            self.mechanism.loop_rank,
            rows[:, moving],
            rank_of_pulls,
            self.gain * error,
            low[moving],
            high[moving],
        )
        sigma = resolution.sigma[:rank_of_pulls]
        wanted = np.concatenate([np.zeros(moving.start), resolution.step])
        pace = min(1.0, _FULL / max(self._bounded.excess(wanted), 1e-300))
        there = self._there(wanted * pace, pulls, float(error @ rows @ wanted) * pace)
        refused = there is None
        q = self.q if there is None else there
        moved = self._moved(q)
        self.q = q
        closure = max(system.gaps(q), default=0.0)
        if not self.mechanism.loops:
            system.evaluate(q)
        _, _, errors = self._equations(pulls)
        saturated = tuple(self.mechanism.columns[moving.start + j] for j in resolution.frozen)
        left = max((max(metres / system.length, angle) for metres, angle in errors), default=0.0)
        resting = float(np.abs(moved).max(initial=0.0)) < _REST
        if len(pulls) < len(self._pulls):
            verdict = Verdict.BAD_TARGET
        elif not pulls:
            verdict = Verdict.IDLE
        elif refused:
            verdict = Verdict.REFUSED
        elif left <= _ARRIVED:
            verdict = Verdict.FOLLOWING
        elif saturated:
            verdict = Verdict.AT_LIMIT
        elif resting:
            verdict = Verdict.OUT_OF_REACH
        elif _smallest(sigma) < NEAR or _smallest(resolution.loop_sigma) < _NEAR_TYPE_2:
            verdict = Verdict.SINGULAR
        else:
            verdict = Verdict.FOLLOWING
        return Step(
            q=q.copy(),
            v=moved * system.scale / self.dt,
            closure=closure,
            errors=self._errors_of_all(pulls, errors),
            singular_values=sigma,
            loop_singular_values=resolution.loop_sigma,
            saturated=saturated,
            pace=pace,
            verdict=verdict,
        )

    def _equations(self, pulls: list[Pull]) -> tuple[Array, Array, list[tuple[float, float]]]:
        """Of all pulls together, without unit: what is left to do (capped, weighted), the rows that do it, and what
        is left of each in m and rad. Needs the Jacobians that `system.evaluate` left."""
        model, data, length = self.mechanism.model, self._system.data, self._system.length
        errors, rows, left = [], [], []
        heaviest = max((pull.weight for pull in pulls), default=1.0)  # only the weights' proportions matter
        for pull in pulls:
            placement = pin.updateFramePlacement(model, data, pull.frame)
            jacobian = np.zeros((6, model.nv))
            if model.nv:
                jacobian[:] = pin.getFrameJacobian(model, data, pull.frame, pin.ReferenceFrame.LOCAL).reshape(6, -1)
            error, row = pull.equations(placement, jacobian * self._system.scale)
            straight, turn = error[: pull.translation], error[pull.translation :]
            left.append((math.hypot(*straight), math.hypot(*turn)))
            unit = np.where(np.arange(pull.rows) < pull.translation, 1.0 / length, 1.0)
            capped = np.concatenate([_capped(straight / length), _capped(turn)])
            weight = pull.weight / heaviest
            errors.append(weight * capped)
            rows.append(weight * unit[:, None] * row)
        if not pulls:
            return np.zeros(0), np.zeros((0, model.nv)), left
        return np.concatenate(errors), np.vstack(rows), left

    def _rank(self, pulls: list[Pull]) -> int:
        """The generic rank of all pulls: a planar mechanism never moves along z, and is not singular for that."""
        key = tuple((pull.frame, pull.translation, pull.rotation) for pull in pulls)
        if key not in self._ranks:
            highest = 0
            for q in self.mechanism.samples:
                _, loops = self._system.evaluate(q)
                motions, _ = free_motions(loops, self.mechanism.loop_rank)
                highest = max(highest, rank(self._equations(pulls)[1] @ motions))
            self._ranks[key] = highest
        return self._ranks[key]

    def _errors_of_all(self, pulls: list[Pull], left: list[tuple[float, float]]) -> tuple[tuple[float, float], ...]:
        by_pull = {id(pull): error for pull, error in zip(pulls, left, strict=True)}
        return tuple(by_pull.get(id(pull), (np.nan, np.nan)) for pull in self._pulls)

    def _there(self, step: Array, pulls: list[Pull], gain: float) -> Array | None:
        """Where a step leads, loops closed and limits kept; a shorter step where the whole one tears, or brings the
        pulls no nearer to their targets than a tenth of what it should (Armijo's rule: no ping-pong).

        Args:
            step: (nv,) without unit.
            pulls: those that make sense.
            gain: by how much the step reduces `_distance`, to first order.

        Returns:
            None where no part of the step could be closed; the present q where none brings the pulls nearer.
        """
        if not step.any():
            return self.q
        before = self._distance(pulls, self.q)
        closes = False
        for _ in range(_TRIES):
            q = self._closed(step)
            if q is None:
                step, gain = 0.5 * step, 0.5 * gain
                continue
            moved = self._moved(q)
            excess = self._bounded.excess(moved)
            if excess > 1.0:  # closing the loops added a little
                step, gain = step * (0.98 / excess), gain * (0.98 / excess)
            elif float(np.abs(moved - step).max()) > _CORRECTION * float(np.abs(step).max()) + CLOSURE:
                step, gain = 0.5 * step, 0.5 * gain
            elif self._distance(pulls, q) > before - _ARMIJO * gain + _NOISE:
                closes = True
                step, gain = 0.5 * step, 0.5 * gain
            else:
                return q
        return self.q if closes else None

    def _distance(self, pulls: list[Pull], q: Array) -> float:
        """How far all pulls are from their targets, as one number that the capped errors are the gradient of: half
        the square up to the cap, linear beyond (Huber)."""
        model, data, length = self.mechanism.model, self._system.data, self._system.length
        pin.forwardKinematics(model, data, q)
        total = 0.0
        heaviest = max((pull.weight for pull in pulls), default=1.0)
        for pull in pulls:
            straight, turn = pull.errors(pin.updateFramePlacement(model, data, pull.frame))
            for part in (math.hypot(*straight) / length, math.hypot(*turn)):
                capped = min(part, _ERROR_CAP)
                total += (pull.weight / heaviest) ** 2 * capped * (part - 0.5 * capped)
        return total

    def _closed(self, step: Array) -> Array | None:
        """Newton on the loops after one step; joints beyond a limit are put on it and held there."""
        system, bounded = self._system, self._bounded
        q = system.integrate(self.q, step)
        free = np.ones(self.mechanism.model.nv, dtype=bool)
        if self.mechanism.floating:
            free[:6] = False
        for _ in range(4):
            q, held = bounded.inside(q, self.q)
            free[held] = False
            if self.mechanism.loops:
                closing = close(system, q, free, iterations=12)
                if closing.gap > CLOSURE:
                    return None
                q = closing.q
            if not bounded.beyond(q, self.q):
                return q
        return None

    def _moved(self, q: Array) -> Array:
        """(nv,) the dimensionless step from the present configuration to q."""
        return np.asarray(pin.difference(self.mechanism.model, self.q, q)) / self._system.scale


class _Bounds:
    """Position and velocity limits of all joints, one number of q each (a free base has none)."""

    def __init__(self, mechanism: Mechanism, dt: float) -> None:
        model = mechanism.model
        joints = [joint for joint in model.joints if joint.nq == 1 and joint.nv == 1 and joint.idx_v >= 0]
        self.at_q = np.array([joint.idx_q for joint in joints], dtype=np.intp)
        self.at_v = np.array([joint.idx_v for joint in joints], dtype=np.intp)
        self.low = model.lowerPositionLimit[self.at_q].copy()
        self.high = model.upperPositionLimit[self.at_q].copy()
        fastest = np.where(model.upperVelocityLimit > 0.0, model.upperVelocityLimit, np.inf)
        self.longest = np.minimum(fastest * dt / mechanism.scale, _STEP_CAP)

    def of(self, q: Array, scale: Array) -> tuple[Array, Array]:
        """(nv,) how far each joint may step down and up, without unit; a joint outside its limits may come back."""
        low, high = np.full(len(scale), -np.inf), np.full(len(scale), np.inf)
        here = q[self.at_q]
        low[self.at_v] = np.minimum(0.0, self.low - here) / scale[self.at_v]
        high[self.at_v] = np.maximum(0.0, self.high - here) / scale[self.at_v]
        return low, high

    def excess(self, step: Array) -> float:
        """By which factor a step is longer than velocity limits allow."""
        return float((np.abs(step) / self.longest).max(initial=0.0))

    def beyond(self, q: Array, before: Array) -> bool:
        """Whether some joint is beyond its limits, and further than it was before."""
        there, here = q[self.at_q], before[self.at_q]
        return bool(((there > np.maximum(self.high, here)) | (there < np.minimum(self.low, here))).any())

    def inside(self, q: Array, before: Array) -> tuple[Array, NDArray[np.intp]]:
        """q with the joints that went beyond their limits put on them, and the columns of all that stand on one."""
        there, here = q[self.at_q], before[self.at_q]
        low, high = np.minimum(self.low, here), np.maximum(self.high, here)
        out = (there >= high) | (there <= low)
        q = q.copy()
        q[self.at_q] = np.clip(there, low, high)
        return q, self.at_v[out]


def _capped(error: Array) -> Array:
    largest = float(np.abs(error).max(initial=0.0))
    if largest <= 0.5 * _ERROR_CAP:
        return error
    direction = error / largest  # first, so that no square overflows
    return error * min(1.0, _ERROR_CAP / largest / float(np.linalg.norm(direction)))


def _smallest(sigma: Array) -> float:
    return float(sigma[-1]) if len(sigma) else np.inf
