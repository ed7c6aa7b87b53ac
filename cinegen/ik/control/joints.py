"""Control of a solver's joints at run time: locks, limits and weights."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, MutableMapping
from typing import Any

from cinegen.arrays import Array
from cinegen.ik.joint_settings import ACCELERATION, VELOCITY, WEIGHT, JointSettings, Setting, checked_names, names_of
from cinegen.model import Mechanism


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
    _check_thread: Callable[[], None]
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
