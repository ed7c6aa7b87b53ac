"""Forward kinematics of mechanisms with loops: the positions of all joints, given those of the actuated ones."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Mapping
from numbers import Real

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cinegen.errors import CinegenError, ClosureError, ConfigurationError, UnknownNameError
from cinegen.jit.compiled import prepare
from cinegen.loops._kernels.follow import follow
from cinegen.loops._kernels.memory import NOWHERE, LoopMemory
from cinegen.loops.arrays import actuate, set_up
from cinegen.model.mechanism import Mechanism
from cinegen.tolerances import CLOSED, CLOSURE

Array = NDArray[np.float64]

_TOLERANCE = 1e-13  # rad or lengths: loops are closed to this, or to rounding
_STRIDE = 0.1  # rad or lengths: a longer motion of a joint is divided into steps, to stay on the branch
_ASTRAY = 0.25  # part of a step that closing the loops may add
_FURTHEST = 1000.0  # rad or lengths: a joint that should move further at once is an error


class ForwardKinematics:
    """Forward kinematics on one branch: the mechanism stays in its assembly mode.

    The actuated joints move straight to their values, in steps, and the loops are closed after each step. A step is
    accepted only if closing the loops added little to its prediction; else half of it is tried. So a jump of any length
    ends where a slow motion would. `Mechanism.close` instead returns a closed configuration near the given one, which
    after a jump may be on another branch.

    For one thread at a time; the mechanism may serve others meanwhile. Joint limits are not considered.

    Args:
        mechanism: the mechanism.
        q: (nq,) where to begin, closed (`cinegen.tolerances.CLOSURE`); home unless given. A free base stays there.

    Raises:
        ConfigurationError: q is no configuration.
        CinegenError: q leaves loops open, or an actuated joint is more than one number.
    """

    def __init__(self, mechanism: Mechanism, q: ArrayLike | None = None) -> None:
        self.mechanism = mechanism
        self._model = mechanism.model
        names = mechanism.actuated
        for name in names:
            if self._model.joints[self._model.getJointId(name)].nq != 1:
                raise CinegenError(f"joint '{name}' of {mechanism.name} is more than one number: it can't be actuated")
        self._places = [mechanism.q_index(name) for name in names]
        columns = [mechanism.v_index(name) for name in names]
        self._motors = {
            name: (i, float(mechanism.scale[column]))
            for i, (name, column) in enumerate(zip(names, columns, strict=True))
        }
        self._memory = memory = set_up(LoopMemory(), mechanism.system, mechanism.loop_rank)
        actuate(memory, columns)
        memory.tolerance, memory.longest_stride, memory.most_added = _TOLERANCE, _STRIDE, _ASTRAY
        self._goal = memory.goal
        if mechanism.loops:
            self._follow_goal = prepare(follow, LoopMemory)
        self.q = mechanism.q_home if q is None else q

    def __reduce__(self) -> tuple[type[ForwardKinematics], tuple[Mechanism, Array]]:
        return type(self), (self.mechanism, self.q)

    @property
    def q(self) -> Array:
        """(nq,) the present configuration. Setting it moves the mechanism there at once, and to that branch.

        Raises:
            ConfigurationError: it is no configuration.
            CinegenError: it leaves loops open.
        """
        return self._q.copy()

    @q.setter
    def q(self, q: ArrayLike) -> None:
        full = self.mechanism.checked(q)
        gap = self.mechanism.closure(full)
        if gap > CLOSURE:
            raise CinegenError(f"q leaves loops of {self.mechanism.name} open by {gap:.2g}: call close(q) first")
        self._stand(full.copy())

    def _stand(self, q: Array) -> None:
        self._q = q
        self._goal[:] = q[self._places]
        self._memory.q[:] = q
        self._memory.factored_at, self._memory.alike = NOWHERE, 0

    def move(self, values: Mapping[str, float]) -> Array:
        """Move actuated joints; those that are not named stay. If that fails, nothing moves.

        Args:
            values: joint name -> value, rad or m.

        Returns:
            (nq,) the positions of all joints: those named have exactly their values, and loops are closed to 1e-12.

        Raises:
            UnknownNameError: no such joint.
            ConfigurationError: a value is not a finite number, or too far away.
            CinegenError: a joint is not actuated.
            ClosureError: the loops can't be closed along that motion on this branch; says where it ended.
        """
        goal, motors = self._goal, self._motors
        try:
            for name, value in values.items():
                motor, scale = motors[name]
                if type(value) is not float:
                    value = _number(name, value)
                if not abs(value - goal[motor]) <= _FURTHEST * scale:
                    raise ConfigurationError(_too_far(name, value, float(goal[motor])))
                goal[motor] = value
        except (KeyError, CinegenError) as error:
            goal[:] = self._q[self._places]
            raise (self._not_actuated(name) if isinstance(error, KeyError) else error) from None
        if not self.mechanism.loops:
            self._q = self._q.copy()
            self._q[self._places] = goal
        elif self._model.nv > 0:
            self._follow()
        return self._q.copy()

    def _follow(self) -> None:
        """Leads the actuated joints to their goal."""
        memory = self._memory
        if self._follow_goal(memory.handle) and memory.closure <= CLOSED:
            self._q = memory.q.copy()
            return
        reached = ", ".join(f"{name} {memory.q[i]:.5g}" for name, i in zip(self._motors, self._places, strict=True))
        self._stand(self._q)
        raise ClosureError(
            f"the actuated joints of {self.mechanism.name} can't reach these values on this branch: "
            f"the motion ends at {reached}"
        )

    def _not_actuated(self, name: str) -> CinegenError:
        joints, actuated = self.mechanism.joints, self.mechanism.actuated
        if name not in joints:
            return UnknownNameError("joint", name, actuated)
        return CinegenError(f"joint '{name}' is passive (actuated: {', '.join(actuated)})")


def _number(name: str, value: object) -> float:
    if not isinstance(value, bool) and isinstance(value, Real):
        with contextlib.suppress(OverflowError):
            return float(value)
    raise ConfigurationError(f"the value of joint '{name}' is not a finite number: {value!r:.40}")


def _too_far(name: str, value: float, now: float) -> str:
    if not math.isfinite(value):
        return f"the value of joint '{name}' is not a finite number: {value}"
    return f"joint '{name}' would move from {now:.5g} to {value:.5g} at once: that is too far"
