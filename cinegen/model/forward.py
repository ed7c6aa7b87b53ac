"""Forward kinematics of mechanisms with loops: the positions of all joints, given those of the actuated ones."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Mapping
from functools import partial
from numbers import Real
from threading import get_ident
from types import MappingProxyType

import numpy as np

from cinegen.arrays import Array, ArrayLike, Indices
from cinegen.errors import CinegenError, ClosureError, ConfigurationError, LimitError, UnknownNameError
from cinegen.jit.one_thread import OneThread, in_one_thread, other_thread
from cinegen.jit.starting import start
from cinegen.loops._kernels.follow import follow
from cinegen.loops._kernels.memory import NOWHERE, LoopMemory
from cinegen.loops.setup import actuate, set_up
from cinegen.model.mechanism import Mechanism
from cinegen.tolerances import AT_LIMIT, CLOSED, CLOSURE
from raff2urdf.closure import RANK

_TOLERANCE = 2e-15  # rad or lengths: loops are closed to rounding
_STRIDE = 0.1  # rad or lengths: longest step of a joint, to stay on the branch
_CORRECTION = 0.25  # largest correction of the loops, as a fraction of the step
FURTHEST = 1000.0  # rad or lengths: longest motion of a joint in one call


class ForwardKinematics(OneThread):
    """Forward kinematics on one branch: the mechanism stays in its assembly mode.

    The actuated joints move along a straight line to their values, in steps, and the loops are closed after each step.
    A step is accepted only if it is proved to stay on the branch, up to rounding (`cinegen.loops._kernels.proof`);
    otherwise half of it is tried. So a motion of any length ends where a slow one would, and one that meets a
    singularity, where branches meet, fails. There is no proof where the actuated joints do not determine the others, as
    at a singular start, or where couplings are not linear: then steps are accepted if closing the loops corrects their
    prediction little, and `is_proved` is False. `Mechanism.close` instead returns a closed configuration near the given
    one, which after a long motion may be on another branch.

    For one thread at a time: another one that sets `q`, or moves it, meanwhile gets a `CinegenError`. The mechanism
    may be shared.

    Args:
        mechanism: mechanism to move.
        q: (nq,) initial configuration, closed (`cinegen.tolerances.CLOSURE`); home unless given. A floating base is
            fixed there.
        within_limits: refuse motions on which a joint would pass a limit, even if it came back: on proved steps no
            joint passes one in between, either. A joint beyond a limit may come back. Unless set, limits don't count.

    Raises:
        ConfigurationError: q has a wrong shape or is not finite.
        CinegenError: q leaves loops open, or an actuated joint has more than one variable.
    """

    def __init__(self, mechanism: Mechanism, q: ArrayLike | None = None, within_limits: bool = False) -> None:
        self.mechanism, self.within_limits = mechanism, within_limits
        self._model = mechanism.model
        names = mechanism.actuated
        for name in names:
            if self._model.joints[self._model.getJointId(name)].nq != 1:
                raise CinegenError(
                    f"joint '{name}' of {mechanism.name} has more than one variable: it can't be actuated"
                )
        self._q_indices = [mechanism.q_index(name) for name in names]
        columns = [mechanism.v_index(name) for name in names]
        self._actuated = {
            name: (i, float(mechanism.scale[column]))
            for i, (name, column) in enumerate(zip(names, columns, strict=True))
        }
        self._memory = memory = set_up(LoopMemory(), mechanism.structure.system, mechanism.cluster_ranks)
        actuate(memory, columns)
        set_up_path(memory)
        if within_limits:
            self._limit(memory)
        self._goal = memory.goal
        if mechanism.is_constrained:
            self._follow_goal = start(follow, LoopMemory, install=partial(setattr, self, "_follow_goal"))
        self.q = mechanism.q_home if q is None else q

    def __reduce__(self) -> tuple[type[ForwardKinematics], tuple[Mechanism, Array, bool]]:
        return type(self), (self.mechanism, self.q, self.within_limits)

    def _limit(self, memory: LoopMemory) -> None:
        """Let the kernel keep the limits of the joints."""
        memory.resize(limited=memory.n)
        memory.lowest[:], memory.highest[:] = -np.inf, np.inf
        for name, limit in self.mechanism.limits.items():
            k = self.mechanism.v_index(name) - memory.fixed
            memory.lowest[k], memory.highest[k] = limit.lower, limit.upper

    @property
    def q(self) -> Array:
        """(nq,) present configuration, a copy. Setting it moves the mechanism there at once, and to that branch.

        Raises:
            ConfigurationError: set to an array of wrong shape, or one that is not finite.
            CinegenError: set to a configuration with open loops.
        """
        return self._q.copy()

    @q.setter
    @in_one_thread
    def q(self, q: ArrayLike) -> None:
        full = self.mechanism.structure.checked(q)
        gap = self.mechanism.closure(full)
        if gap > CLOSURE:
            raise CinegenError(
                f"q leaves loops of {self.mechanism.name} open by {gap:.2g} rad or characteristic lengths: "
                "use mechanism.close(q)"
            )
        self._set(full.copy())

    @property
    def is_proved(self) -> bool:
        """True if the present configuration is proved to be on the branch to which `q` was set last, up to rounding."""
        return bool(self._memory.is_proved)

    def _set(self, q: Array) -> None:
        self._q = q
        self._goal[:] = q[self._q_indices]
        self._memory.q[:] = q
        self._memory.factored_at, self._memory.alike, self._memory.is_proved = NOWHERE, 0, 1

    def move(self, values: Mapping[str, float]) -> Array:
        """Move actuated joints; the others keep their values. If that fails, nothing moves.

        Args:
            values: joint name -> value, rad or m.

        Returns:
            (nq,) configuration: the named joints have exactly their values, and loops are closed to 1e-12.

        Raises:
            UnknownNameError: no such joint.
            ConfigurationError: a value is not a finite number, or too far away.
            CinegenError: a joint is not actuated.
            LimitError: a joint would pass its limit, if they count: reports where.
            ClosureError: the loops can't be closed along that motion on this branch; reports where it ended.
            CinegenError: another thread moves it meanwhile.
        """
        if self._user:  # as `in_one_thread` does, in less time
            raise other_thread(self)
        self._user = get_ident()
        try:
            return self._move(values)
        finally:
            self._user = 0

    def _move(self, values: Mapping[str, float]) -> Array:
        goal, actuated = self._goal, self._actuated
        try:
            for name, value in values.items():
                index, scale = actuated[name]
                if type(value) is not float:
                    value = _number(name, value)
                if not abs(value - goal[index]) <= FURTHEST * scale:
                    raise ConfigurationError(_too_far(name, value, float(goal[index])))
                if self.within_limits:
                    self._check_limits(name, value, float(goal[index]))
                goal[index] = value
        except (KeyError, CinegenError) as error:
            goal[:] = self._q[self._q_indices]
            raise (self._not_actuated(name) if isinstance(error, KeyError) else error) from None
        if not self.mechanism.is_constrained:
            self._q = self._q.copy()
            self._q[self._q_indices] = goal
        elif self._model.nv > 0:
            self._follow()
        return self._q.copy()

    def rates(
        self, velocities: Mapping[str, float], accelerations: Mapping[str, float] = MappingProxyType({})
    ) -> tuple[Array, Array]:
        """Compute how all joints move at the present configuration, from how the actuated joints move.

        With the columns J_p of the passive joints in the loops' Jacobian: J_p v_p = -J_a v_a, and J_p a_p = -J_a a_a -
        (dJ/dt) v. What the actuated joints don't determine, as a strut's rotation about itself, is at rest; so are a
        floating base and the joints that are not named.

        Args:
            velocities: actuated joint -> velocity, rad/s or m/s.
            accelerations: actuated joint -> acceleration, rad/s^2 or m/s^2.

        Returns:
            velocities (nv,) and accelerations (nv,) of all joints: rad/s and m/s, rad/s^2 and m/s^2.

        Raises:
            UnknownNameError: no such joint.
            ConfigurationError: a value is not a finite number.
            CinegenError: a joint is not actuated.
            ClosureError: no motion of the passive joints keeps the loops closed: the configuration is singular, or more
                joints are actuated than there are degrees of freedom, and contradict each other.
        """
        v, a = np.zeros((2, self._model.nv))
        for rates, vector in ((velocities, v), (accelerations, a)):
            for name, value in rates.items():
                if name not in self._actuated:
                    raise self._not_actuated(name)
                number = _number(name, value)
                if not math.isfinite(number):
                    raise ConfigurationError(f"the rate of joint '{name}' is not a finite number: {value}")
                vector[self.mechanism.v_index(name)] = number
        if self.mechanism.is_constrained:
            system, scale = self.mechanism.structure.system, self.mechanism.scale
            jacobian, passive = system.evaluate(self._q)[1], self.mechanism.structure.passive_columns
            self._complete(jacobian, v, -jacobian @ (v / scale), passive)
            self._complete(jacobian, a, -jacobian @ (a / scale) - system.drift(self._q, v), passive)
        return v, a

    def _complete(self, jacobian: Array, vector: Array, wanted: Array, passive: Indices) -> None:
        """Write the rates of the passive joints, whose rows of the loops are wanted (rows,)."""
        columns = jacobian[:, passive]
        motion = np.linalg.lstsq(columns, wanted, rcond=RANK)[0]
        if np.abs(columns @ motion - wanted).max(initial=0.0) > CLOSURE * np.abs(wanted).max(initial=0.0):
            raise ClosureError(
                f"these rates of the actuated joints of {self.mechanism.name} open its loops: the configuration is "
                "singular, or they contradict each other"
            )
        vector[passive] = motion * self.mechanism.scale[passive]

    def _follow(self) -> None:
        """Move the actuated joints to their goal."""
        memory = self._memory
        if self._follow_goal(memory.handle) and memory.closure <= CLOSED:
            self._q = memory.q.copy()
            return
        is_proved = memory.is_proved
        error = self._passed(memory.beyond - 1 + memory.fixed) if memory.beyond > 0 else self._unreachable()
        self._set(self._q)
        memory.is_proved = is_proved
        raise error

    def _unreachable(self) -> ClosureError:
        reached = ", ".join(
            f"{name} {self._memory.q[i]:.5g}" for name, i in zip(self._actuated, self._q_indices, strict=True)
        )
        return ClosureError(
            f"the actuated joints of {self.mechanism.name} can't reach these values on this branch: "
            f"the motion ends at {reached}{', near a singularity' if self._memory.is_proved else ''}"
        )

    def _passed(self, column: int) -> LimitError:
        """Return the error for the passive joint of a column whose limit ended the motion."""
        mechanism, begin, end = self.mechanism, self._q[self._q_indices], self._memory.q[self._q_indices]
        name = next(name for name in mechanism.joints if mechanism.v_index(name) == column)
        value, limits = float(self._memory.q[mechanism.q_index(name)]), mechanism.limits[name]
        limit = min(limits.lower, limits.upper, key=lambda limit: abs(value - limit))
        moves = self._goal - begin
        furthest = int(np.abs(moves).argmax())
        part = abs((end[furthest] - begin[furthest]) / moves[furthest]) if moves[furthest] != 0.0 else 0.0
        at = ", ".join(
            f"{joint} at {end[i]:.6g} {self._unit(joint)}" for i, joint in enumerate(self._actuated) if moves[i] != 0.0
        )
        where = "with" if self._memory.is_proved else "past"  # steps that are not proved are not shortened up to it
        return LimitError(
            name,
            f"{name} would pass its limit {limit:.6g} {self._unit(name)}, as it follows, {where} {at} "
            f"({100.0 * part:.3g} % of the motion): nothing moves",
        )

    def _check_limits(self, name: str, value: float, now: float) -> None:
        """Raise a `LimitError` if the value of an actuated joint is beyond a limit, and further than now."""
        limits = self.mechanism.limits[name]
        if not min(limits.lower - AT_LIMIT, now) <= value <= max(limits.upper + AT_LIMIT, now):
            limit = limits.lower if value < limits.lower else limits.upper
            unit = self._unit(name)
            why = f"{name} would be at {value:.6g} {unit}, beyond its limit {limit:.6g} {unit}: nothing moves"
            raise LimitError(name, why)

    def _unit(self, joint: str) -> str:
        return "m" if self.mechanism.is_prismatic(joint) else "rad"

    def _not_actuated(self, name: str) -> CinegenError:
        joints, actuated = self.mechanism.joints, self.mechanism.actuated
        if name not in joints:
            return UnknownNameError("joint", name, actuated)
        return CinegenError(f"joint '{name}' is passive (actuated: {', '.join(actuated)})")


def set_up_path(memory: LoopMemory) -> None:
    """Set how the kernels follow a path of the actuated joints."""
    memory.tolerance, memory.longest_stride, memory.most_added = _TOLERANCE, _STRIDE, _CORRECTION
    memory.proves = 1
    for cluster in memory.cluster_memories:
        cluster.resize(proved=cluster.n, proof_width=cluster.n + cluster.rows)


def _number(name: str, value: object) -> float:
    if not isinstance(value, bool) and isinstance(value, Real):
        with contextlib.suppress(OverflowError):
            return float(value)
    raise ConfigurationError(f"the value of joint '{name}' is not a finite number: {value!r:.40}")


def _too_far(name: str, value: float, now: float) -> str:
    if not math.isfinite(value):
        return f"the value of joint '{name}' is not a finite number: {value}"
    return f"joint '{name}' would move from {now:.5g} to {value:.5g} at once: that is too far"
