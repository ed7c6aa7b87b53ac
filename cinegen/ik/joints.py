"""Joints under control at run time: locks, limits, weights of the least motion, and the branch of the loops."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, MutableMapping
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
    found, names = list[str](), names_of(mechanism)
    for joint in joints:
        if joint == "base" and joint not in names and mechanism.base is not None:
            joint = mechanism.base
        if joint == "base" and joint not in names:
            message = f"the base of {mechanism.name} does not float: it can't move, and has no limits or weights"
            raise CinegenError(message)
        if joint not in names:
            raise UnknownNameError("joint", str(joint), names)
        found.append(joint)
    return tuple(dict.fromkeys(found))


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
        model, here = self.held.model, self.held.structure.held_at
        joints = [model.joints[model.getJointId(name)] for name in self.held.held]
        places = [slice(joint.idx_q, joint.idx_q + joint.nq) for joint in joints]
        return all(np.array_equal(q[at], here[at]) for at in places)

    @property
    def limited(self) -> Mechanism:
        """The mechanism as it is controlled: with its locked joints and its present limits."""
        if self._limited is None:
            model, own, velocity = self.held.model, self.mechanism.limits, self.columns[VELOCITY.what]
            self._limited = self.held
            if self.lower is not own.lower or self.upper is not own.upper or velocity is not own.velocity:
                model = pin.Model(model)
                model.lowerPositionLimit, model.upperPositionLimit = self.lower, self.upper
                model.upperVelocityLimit = velocity
                self._limited = replace(self.held, model=model)
        return self._limited

    def set_columns(self, setting: Setting, values: Mapping[str, Any] | float | None, restore: bool = True) -> None:
        """Set values by joint; those of other joints become the model's if they are restored."""
        mechanism, model = self.mechanism, setting.of_model(self.mechanism)
        found = (model if restore else self.columns[setting.what]).copy()
        if values is None:
            values = {}
        elif not isinstance(values, Mapping):
            values = dict.fromkeys(names_of(mechanism), values)
        for given, value in values.items():
            (joint,) = checked_names(mechanism, [given])
            columns = mechanism.columns_of(joint)
            found[columns] = model[columns] if value is None else self._numbers(setting, joint, value, len(columns))
        unchanged = np.array_equal(found, model)
        self.columns[setting.what], self._limited = model if unchanged else found, None

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
        mechanism, own = self.mechanism, self.mechanism.limits
        lower, upper = (own.lower.copy(), own.upper.copy()) if restore else (self.lower.copy(), self.upper.copy())
        if values is not None and not isinstance(values, Mapping):
            raise CinegenError(f"position_limits takes a mapping from joints to (lower, upper), not {values!r:.60}")
        for given, value in (values or {}).items():
            joint = self._scalar(given)
            at = mechanism.q_index(joint)
            low, high = (own.lower[at], own.upper[at]) if value is None else _range(joint, value)
            check_joint(mechanism, joint, [x for x in (low, high) if math.isfinite(x)] or [0.0])
            lower[at], upper[at] = low, high
        unchanged = np.array_equal(lower, own.lower) and np.array_equal(upper, own.upper)
        self.lower, self.upper = (own.lower, own.upper) if unchanged else (lower, upper)
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


class JointMapping(MutableMapping[str, Any]):
    """Present values by joint; what is set takes effect in the next tick. None, or `del`, restores the model's.

    Args:
        what: name of the property that it is.
        joints: names.
        get: returns a joint's value.
        put: sets some, and leaves all others as they are.
    """

    __slots__ = ("_get", "_joints", "_put", "_what")

    def __init__(
        self, what: str, joints: tuple[str, ...], get: Callable[[str], Any], put: Callable[[Mapping[str, Any]], None]
    ) -> None:
        self._what, self._joints, self._get, self._put = what, joints, get, put

    def __getitem__(self, joint: str) -> Any:
        return self._get(joint)

    def __setitem__(self, joint: str, value: Any) -> None:
        self._put({joint: value})

    def __delitem__(self, joint: str) -> None:
        self._put({joint: None})

    def __contains__(self, joint: object) -> bool:
        return joint in self._joints

    def __iter__(self) -> Iterator[str]:
        return iter(self._joints)

    def __len__(self) -> int:
        return len(self._joints)

    def __repr__(self) -> str:
        return f"<{self._what}: {dict(self)}>"


class JointControl:
    """Control of a solver's joints at run time. What is set takes effect in the next tick."""

    __slots__ = ()

    mechanism: Mechanism
    _joints: JointSettings
    _used: Callable[[], Any]
    _rewrite_joints: Callable[[bool], None]
    _q: Array

    # --- locks ---------------------------------------------------------------------------------------------------

    @property
    def locked(self) -> tuple[str, ...]:
        """Names of the joints that are locked."""
        return self._joints.held.held

    @property
    def held_mechanism(self) -> Mechanism:
        """The mechanism in which the locked joints are fixed, see `Mechanism.with_held`; itself without any."""
        return self._joints.held

    def lock(self, *joints: str) -> None:
        """Lock joints: they do not move at all, whatever tasks and objectives need.

        Their columns are left out. Mobility, ranks, singular values, motion and statuses are those of the mechanism in
        which these joints are fixed. A joint in a loop may be locked: the loop then moves without it, or not at all.
        The first tick afterwards takes longer, since ranks are counted anew.

        Args:
            joints: names of joints, ball joints, or of the floating base: `Mechanism.base`, or "base".

        Raises:
            UnknownNameError: no such joint; no joint is locked then.
            CinegenError: the base does not float, or another thread uses the solver.
        """
        self._lock((*self.locked, *checked_names(self.mechanism, joints)))

    def unlock(self, *joints: str) -> None:
        """Unlock joints; all joints unless some are named. Those that are not locked stay as they are.

        Raises:
            UnknownNameError: no such joint.
            CinegenError: the base does not float, or another thread uses the solver.
        """
        names = checked_names(self.mechanism, joints) if joints else self.locked
        self._lock(tuple(name for name in self.locked if name not in names))

    def _lock(self, joints: tuple[str, ...]) -> None:
        joints = tuple(dict.fromkeys(joints))
        if joints == self.locked:
            return
        with self._used():
            self._joints.hold(joints, self._q.copy())
            self._rewrite_joints(True)

    # --- limits --------------------------------------------------------------------------------------------------

    @property
    def velocity_limits(self) -> MutableMapping[str, Any]:
        """Largest speed of each joint, rad/s or m/s; inf where there is none. It may be set at any time: one entry, a
        mapping, or a number for all joints. With a mapping, joints that it does not name have the model's limits, and
        so have all joints after `= None`.

        A floating base takes one number, or six: of the linear velocity along its own axes, then of the angular
        velocity. A ball joint takes one or three.

        Raises:
            UnknownNameError: no such joint.
            CinegenError: a limit is not above 0, or was meant in degrees/s or mm/s; nothing is changed then.
        """
        return self._mapping(VELOCITY)

    @velocity_limits.setter
    def velocity_limits(self, values: Mapping[str, Any] | float | None) -> None:
        self._change(lambda: self._joints.set_columns(VELOCITY, values))

    @property
    def acceleration_limits(self) -> MutableMapping[str, Any]:
        """Largest acceleration of each joint, rad/s^2 or m/s^2; inf, the default, where there is none. It may be set
        as `velocity_limits`.

        Raises:
            UnknownNameError: no such joint.
            CinegenError: a limit is not above 0; nothing is changed then.
        """
        return self._mapping(ACCELERATION)

    @acceleration_limits.setter
    def acceleration_limits(self, values: Mapping[str, Any] | float | None) -> None:
        self._change(lambda: self._joints.set_columns(ACCELERATION, values))

    @property
    def position_limits(self) -> MutableMapping[str, Any]:
        """Least and greatest position (lower, upper) of each joint, rad or m. It may be set as `velocity_limits`. A
        joint that is beyond a limit may only move back.

        Raises:
            UnknownNameError: no such joint.
            CinegenError: a joint is not one number, limits are not two numbers in this order, or they were meant in
                degrees or mm; nothing is changed then.
        """
        settings = self._joints
        return JointMapping(
            "position_limits", self.mechanism.joints, settings.get_positions,
            lambda values: self._change(lambda: settings.set_positions(values, restore=False)),
        )  # fmt: skip

    @position_limits.setter
    def position_limits(self, values: Mapping[str, Any] | None) -> None:
        self._change(lambda: self._joints.set_positions(values))

    # --- weights -------------------------------------------------------------------------------------------------

    @property
    def joint_weights(self) -> MutableMapping[str, Any]:
        """Weight of each joint in the motion that tasks and loops leave free: of all motions that do the same for the
        tasks, the one is chosen for which sum w_j dq_j^2 is least, in rad and characteristic lengths. It may be set as
        `velocity_limits`.

        The sum is over the actuated joints, a floating base and joints in no loop; of others, passive joints in loops,
        the weight is 0 unless it is set. Only proportions matter: equal weights, the default of 1, change nothing.
        Weights change neither singular values nor what can be reached, and a mechanism without redundancy does not
        notice them. What a weighted motion would make faster than a limit allows is left as it is.

        Raises:
            UnknownNameError: no such joint.
            CinegenError: a weight is not above 0 and finite; nothing is changed then.
        """
        return self._mapping(WEIGHT)

    @joint_weights.setter
    def joint_weights(self, values: Mapping[str, Any] | float | None) -> None:
        self._change(lambda: self._joints.set_columns(WEIGHT, values))

    def _mapping(self, setting: Setting) -> JointMapping:
        settings = self._joints
        return JointMapping(
            setting.what, names_of(self.mechanism), lambda joint: settings.get_columns(setting, joint),
            lambda values: self._change(lambda: settings.set_columns(setting, values, restore=False)),
        )  # fmt: skip

    def _copy_joints(self, other: JointControl, accelerations: bool = True) -> None:
        """Take over locks, limits and weights of a solver of the same mechanism."""
        if not self._joints.is_same(other._joints, accelerations):
            relocked = self._joints.held is not other._joints.held
            self._joints.take(other._joints, accelerations)
            self._rewrite_joints(relocked)

    def _change(self, change: Callable[[], None]) -> None:
        with self._used():
            change()
            self._rewrite_joints(False)
