"""Joints under control at run time: locks, limits, weights of the least motion, and the branch of the loops."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pinocchio as pin

from cinegen.arrays import Array
from cinegen.errors import CinegenError, UnknownNameError
from cinegen.ik._kernels.memory import SolverMemory
from cinegen.ik.setup import second_derivative
from cinegen.ik.thresholds import STEP_CAP
from cinegen.model import Mechanism
from cinegen.model.plausible import check_joint, check_speed

Value = float | tuple[float, ...]
"""A number of a joint of one variable; of a floating base six, of a ball joint three."""


def names_of(mechanism: Mechanism) -> tuple[str, ...]:
    """Return the names by which joints are locked, limited and weighted: all joints, ball joints, and the base."""
    return (*mechanism.joints, *mechanism.balls, *([] if mechanism.base is None else [mechanism.base]))


def checked_names(mechanism: Mechanism, joints: Iterable[str]) -> tuple[str, ...]:
    """Return names of joints, each once; "base" is a floating base, too.

    Raises:
        UnknownNameError: no such joint.
        CinegenError: a single text, or what is no name.
    """
    if isinstance(joints, str):
        raise CinegenError(f"joints are named in a list, such as ['{joints}'], not by one text")
    checked, names = list[str](), names_of(mechanism)
    for joint in joints:
        if joint == "base" and joint not in names and mechanism.base is not None:
            joint = mechanism.base
        if joint == "base" and joint not in names:
            message = f"the base of {mechanism.name} does not float: it can't move, and has no limits or weights"
            raise CinegenError(message)
        if joint not in names:
            raise UnknownNameError("joint", str(joint), names)
        checked.append(joint)
    return tuple(dict.fromkeys(checked))


@dataclass(frozen=True, slots=True)
class Setting:
    """Setting of the joints by one number for each column.

    Attributes:
        what: the name, in errors.
        of_model: values (nv,) of a mechanism.
        check: raises what is wrong with a value of a joint.
    """

    what: str
    of_model: Callable[[Mechanism], Array]
    check: Callable[[Mechanism, str, float], None]


def _positive(what: str, remedy: str, joint: str, value: float, is_finite: bool = False) -> None:
    if not (value > 0.0 and (not is_finite or math.isfinite(value))):
        wanted = "positive and finite" if is_finite else "positive"
        raise CinegenError(f"{what} of '{joint}' must be {wanted}, not {value}{remedy}")


def _check_velocity(mechanism: Mechanism, joint: str, value: float) -> None:
    _positive("the velocity limit", f": lock('{joint}') holds it", joint, value)
    check_speed(mechanism, joint, value)


def _check_acceleration(mechanism: Mechanism, joint: str, value: float) -> None:
    _positive("the acceleration", f": lock('{joint}') holds it", joint, value)


def _check_weight(mechanism: Mechanism, joint: str, value: float) -> None:
    _positive("the weight", f": lock('{joint}') holds it", joint, value, True)


def _unlimited(mechanism: Mechanism) -> Array:
    return np.full(mechanism.model.nv, np.inf)


def _unweighted(mechanism: Mechanism) -> Array:
    """Return 1 for the columns whose motion counts: of actuated joints, a floating base, and joints in no loop."""
    weights, columns = (
        np.ones(mechanism.model.nv),
        np.concatenate([np.zeros(0, int), *mechanism.structure.system.columns]),
    )
    weights[np.intersect1d(mechanism.structure.passive_columns, columns)] = 0.0
    return weights


VELOCITY = Setting("velocity_limits", lambda mechanism: mechanism.limits.velocity, _check_velocity)
ACCELERATION = Setting("acceleration_limits", _unlimited, _check_acceleration)
WEIGHT = Setting("joint_weights", _unweighted, _check_weight)


class JointSettings:
    """Settings of the joints of a mechanism that a program changes.

    Attributes:
        mechanism: the mechanism.
        held: the same with its joints locked; itself without any.
        columns: values (nv,) of each setting, rad and m.
        lower: (nq,) least positions, rad and m.
        upper: (nq,) greatest positions.
    """

    __slots__ = ("_limited", "columns", "held", "lower", "mechanism", "upper")

    def __init__(self, mechanism: Mechanism) -> None:
        self.mechanism = self.held = mechanism
        self.columns = {setting.what: setting.of_model(mechanism) for setting in (VELOCITY, ACCELERATION, WEIGHT)}
        self.lower, self.upper = mechanism.limits.lower, mechanism.limits.upper
        self._limited: Mechanism | None = None

    def take(self, other: JointSettings, accelerations: bool) -> None:
        """Take over the values of another, those of accelerations if asked to; they are replaced, never changed."""
        self.held, self._limited, self.lower, self.upper = other.held, other._limited, other.lower, other.upper
        self.columns |= {what: values for what, values in other.columns.items() if accelerations or _is_taken(what)}

    def is_same(self, other: JointSettings, accelerations: bool) -> bool:
        """Return whether another's values, those of accelerations if asked to, are these very arrays."""
        same = self.held is other.held and self.lower is other.lower and self.upper is other.upper
        for what, values in self.columns.items():
            same = same and (values is other.columns[what] or not (accelerations or _is_taken(what)))
        return same

    def hold(self, joints: tuple[str, ...], q: Array) -> None:
        """Lock these joints, and no others, where q (nq,) has them."""
        self.held = self.mechanism.with_held(joints, q) if joints else self.mechanism
        self._limited = None

    def holds(self, q: Array) -> bool:
        """Return whether q (nq,) has the locked joints where they were locked."""
        model, held_at = self.held.model, self.held.structure.held_at
        joints = [model.joints[model.getJointId(name)] for name in self.held.held]
        places = [slice(joint.idx_q, joint.idx_q + joint.nq) for joint in joints]
        return all(np.array_equal(q[at], held_at[at]) for at in places)

    @property
    def limited(self) -> Mechanism:
        """The mechanism as it is controlled: with its locked joints and its present limits."""
        if self._limited is None:
            model, limits, velocity = self.held.model, self.mechanism.limits, self.columns[VELOCITY.what]
            self._limited = self.held
            if self.lower is not limits.lower or self.upper is not limits.upper or velocity is not limits.velocity:
                model = pin.Model(model)
                model.lowerPositionLimit, model.upperPositionLimit = self.lower, self.upper
                model.upperVelocityLimit = velocity
                self._limited = replace(self.held, model=model)
        return self._limited

    def set_columns(self, setting: Setting, values: Mapping[str, Any] | float | None, restore: bool = True) -> None:
        """Set values by joint; those of other joints become the model's if they are restored."""
        mechanism, model = self.mechanism, setting.of_model(self.mechanism)
        updated = (model if restore else self.columns[setting.what]).copy()
        if values is None:
            values = {}
        elif not isinstance(values, Mapping):
            values = dict.fromkeys(names_of(mechanism), values)
        for name, value in values.items():
            (joint,) = checked_names(mechanism, [name])
            columns = mechanism.columns_of(joint)
            updated[columns] = model[columns] if value is None else self._numbers(setting, joint, value, len(columns))
        unchanged = np.array_equal(updated, model)
        self.columns[setting.what], self._limited = model if unchanged else updated, None

    def _numbers(self, setting: Setting, joint: str, value: Any, count: int) -> Array:
        try:
            numbers = np.asarray(value, dtype=float)
        except (TypeError, ValueError):
            numbers = np.zeros(0)
        if numbers.shape not in ((), (count,)):
            many = "" if count == 1 else f" or {count}"
            raise CinegenError(f"{setting.what}['{joint}'] takes one number{many}, not {value!r:.60}")
        for number in np.atleast_1d(numbers).tolist():
            setting.check(self.mechanism, joint, number)
        return numbers

    def get_columns(self, setting: Setting, joint: str) -> Value:
        """Return the present value of a joint."""
        (name,) = checked_names(self.mechanism, [joint])
        numbers = self.columns[setting.what][self.mechanism.columns_of(name)].tolist()
        return float(numbers[0]) if len(numbers) == 1 else tuple(numbers)

    def set_positions(self, values: Mapping[str, Any] | None, restore: bool = True) -> None:
        """Set limits of positions by joint; those of other joints become the model's if they are restored."""
        mechanism, limits = self.mechanism, self.mechanism.limits
        lower, upper = (limits.lower.copy(), limits.upper.copy()) if restore else (self.lower.copy(), self.upper.copy())
        if values is not None and not isinstance(values, Mapping):
            raise CinegenError(f"position_limits takes a mapping from joints to (lower, upper), not {values!r:.60}")
        for name, value in (values or {}).items():
            joint = self._scalar(name)
            at = mechanism.q_index(joint)
            low, high = (limits.lower[at], limits.upper[at]) if value is None else _range(joint, value)
            check_joint(mechanism, joint, [x for x in (low, high) if math.isfinite(x)] or [0.0])
            lower[at], upper[at] = low, high
        unchanged = np.array_equal(lower, limits.lower) and np.array_equal(upper, limits.upper)
        self.lower, self.upper = (limits.lower, limits.upper) if unchanged else (lower, upper)
        self._limited = None

    def get_positions(self, joint: str) -> tuple[float, float]:
        """Return the present limits of the position of a joint."""
        at = self.mechanism.q_index(self._scalar(joint))
        return float(self.lower[at]), float(self.upper[at])

    def _scalar(self, joint: str) -> str:
        (name,) = checked_names(self.mechanism, [joint])
        if name not in self.mechanism.joints:
            raise CinegenError(
                f"'{name}' of {self.mechanism.name} is not one number, and has no limits of position: lock it, or keep "
                "it in a region by a barrier"
            )
        return name

    # --- the kernel's memory --------------------------------------------------------------------------------------

    def write(self, memory: SolverMemory, lifted: tuple[bool, bool] = (False, False)) -> None:
        """Write limits and weights into a solver's memory, which is set up for `held`.

        Args:
            memory: its period is `memory.dt`.
            lifted: whether limits of velocity, and of position, are ignored.
        """
        mechanism, free = self.mechanism, np.ones(memory.n)
        free[self.held.structure.held_columns] = 0.0
        at_q, at_v = mechanism.structure.scalar_joints
        speeds, accelerations = self.columns[VELOCITY.what], self.columns[ACCELERATION.what]
        memory.lower[:] = -np.inf
        memory.upper[:] = memory.longest_step[:] = memory.longest_change[:] = np.inf
        if not lifted[1]:
            memory.lower[at_v], memory.upper[at_v] = self.lower[at_q], self.upper[at_q]
        if not lifted[0]:
            steps = speeds * memory.dt / mechanism.scale
            limited = np.isfinite(speeds)
            limited[at_v] = True
            memory.longest_step[limited] = np.minimum(steps[limited], STEP_CAP)
        if np.isfinite(accelerations).any():
            memory.longest_change[:] = accelerations / mechanism.scale * (memory.dt * memory.dt)
        memory.has_acceleration_limits = int(np.isfinite(accelerations).any())
        held = free == 0.0
        memory.lower[held], memory.upper[held] = -np.inf, np.inf  # they do not move: nothing limits them
        memory.longest_step[held] = memory.longest_change[held] = np.inf
        for steps in (memory.last, memory.drift, memory.secondary, memory.fresh, memory.step, memory.attempted,
                      memory.braking, memory.correction, memory.delta, memory.moved):  # fmt: skip
            steps[held] = 0.0
        memory.second_derivative = np.inf if memory.others else second_derivative(self.held, self.lower, self.upper)
        self._write_weights(memory)

    def _write_weights(self, memory: SolverMemory) -> None:
        weights = self.columns[WEIGHT.what]
        counted = weights[weights > 0.0]
        differ = counted.size > 0 and bool((counted != counted[0]).any())
        memory.resize(weighted=memory.mobility if differ else 0, weighted_dof=memory.n if differ else 0)
        if differ:
            memory.root_weight[:] = np.sqrt(weights / counted.min())


def _is_taken(what: str) -> bool:
    return what != ACCELERATION.what


def _range(joint: str, value: Any) -> tuple[float, float]:
    try:
        low, high = map(float, value)
    except (TypeError, ValueError):
        low = high = math.nan
    if not low <= high:
        raise CinegenError(f"position_limits['{joint}'] takes (lower, upper) in rad or m, not {value!r:.60}")
    return low, high
