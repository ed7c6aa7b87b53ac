"""The data of a mechanism; its joints, nodes and configurations by name."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple, cast

import numpy as np
import pinocchio as pin

from cinegen.arrays import Array, ArrayLike
from cinegen.errors import ConfigurationError, UnknownNameError
from cinegen.joints import translations
from cinegen.loops.closed_loops import LoopConstraint
from cinegen.model.jacobian import COMPONENTS
from cinegen.model.spherical import SphericalJoints
from cinegen.model.structure import Structure
from raff2urdf.coupling import Coupling
from raff2urdf.readers.srdf import Srdf

if TYPE_CHECKING:
    from cinegen.model.mechanism import Mechanism


class MechanismSource(NamedTuple):
    """The input that a mechanism was built from, see `cinegen.model.build.build`.

    Attributes:
        urdf: its text.
        constraints: everything that a URDF cannot express, as `raff2urdf.constraints` describes; None for a tree.
        folder: where the URDF's meshes are searched; None where it names them absolutely.
        name: the file's, for errors.
        dialects: in which loops and couplings are declared, such as "URDF+" or "mimic".
        notes: about what was read.
        srdf: the pairs of links that an SRDF disables; None without one.
        owner: the folder of the recording or map that holds all this: it has no access to graphics elsewhere. None
            where it is the robot's own file.
        packages: names and folders of ROS packages that the user gave, in which meshes are searched first.
    """

    urdf: str
    constraints: Mapping[str, Any] | None
    folder: str | None
    name: str
    dialects: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    srdf: Srdf | None = None
    owner: str | None = None
    packages: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class MechanismModel:
    """The data of a `Mechanism`, which describes them, and what follows from its model alone."""

    name: str
    model: pin.Model
    nodes: tuple[str, ...]
    joints: tuple[str, ...]
    actuated: tuple[str, ...]
    loops: tuple[LoopConstraint, ...]
    length: float
    floating: bool
    q_home: Array
    cluster_ranks: tuple[int, ...]
    gap_as_written: float
    sensors: Mapping[int, Mapping[str, Any]]
    sensor_constraints: tuple[tuple[str, tuple[int, ...]], ...]
    source: MechanismSource
    couplings: tuple[Coupling, ...] = ()
    spherical: SphericalJoints | None = None
    uncontrolled: tuple[str, ...] = ()
    dependent: tuple[str, ...] = ()
    held: tuple[str, ...] = ()
    held_q: Array | None = None

    @cached_property
    def structure(self) -> Structure:
        """The loops as equations, ranks and sample configurations: for algorithms."""
        return Structure(cast("Mechanism", self))

    @property
    def loop_rank(self) -> int:
        """Number of independent equations of all loops and couplings (generic rank)."""
        return sum(self.cluster_ranks)

    @property
    def balls(self) -> tuple[str, ...]:
        """Names of the ball joints that have a quaternion in q; they are passive."""
        return () if self.spherical is None else self.spherical.names

    def columns_of(self, joint: str) -> list[int]:
        """Return the columns of a joint, a ball joint or a floating base (`base`) in every Jacobian.

        Raises:
            UnknownNameError: no such joint.
        """
        model_joint = self._joint(joint)
        return list(range(model_joint.idx_v, model_joint.idx_v + model_joint.nv))

    @cached_property
    def base(self) -> str | None:
        """Name of the joint of a floating base, for `lock` and limits; None where the base can't move."""
        return next(name for name in self.model.names if name != "universe") if self.floating else None

    @property
    def is_constrained(self) -> bool:
        """True if there are loops or couplings: joint values are not independent."""
        return bool(self.loops or self.couplings)

    @cached_property
    def constraint_names(self) -> tuple[str, ...]:
        """Names of the loops, then of the couplings."""
        return (*(loop.name for loop in self.loops), *(coupling.name for coupling in self.couplings))

    @cached_property
    def scale(self) -> Array:
        """(nv,) size of one dimensionless step: `length` (m) for translations, 1 rad for rotations; more for joints
        that only drive others, see `raff2urdf.coupling.coupled_scales`."""
        return self.structure.system.scale

    def frame_id(self, node: str) -> int:
        """Return Pinocchio's index of a node's frame.

        Raises:
            UnknownNameError: no such node.
        """
        frame = self._frame_ids.get(node)
        if frame is None:
            raise UnknownNameError("node", node, self.nodes)
        return frame

    @cached_property
    def _frame_ids(self) -> dict[str, int]:
        return {node: self.model.getFrameId(node, pin.FrameType.BODY) for node in self.nodes}

    def _joint(self, joint: str) -> Any:
        if joint not in self._joint_ids:
            raise UnknownNameError("joint", joint, self.joints)
        return self.model.joints[self._joint_ids[joint]]

    @cached_property
    def _joint_ids(self) -> dict[str, int]:
        return {name: i for i, name in enumerate(self.model.names) if i > 0}

    def q_index(self, joint: str) -> int:
        """Return the index of a joint's variable in q.

        Raises:
            UnknownNameError: no such joint.
        """
        return int(self._joint(joint).idx_q)

    def v_index(self, joint: str) -> int:
        """Return the index of a joint's velocity in v, which is its column in every Jacobian.

        Raises:
            UnknownNameError: no such joint.
        """
        return int(self._joint(joint).idx_v)

    def is_prismatic(self, joint: str) -> bool:
        """Return whether a joint is prismatic: its variable is in metres.

        Raises:
            UnknownNameError: no such joint.
        """
        return translations(self._joint(joint)) > 0

    @cached_property
    def columns(self) -> tuple[str, ...]:
        """For each column of a Jacobian the joint it belongs to; a free base has six, `joint0.x` and so on, a ball
        joint three, such as `joint5.rx`."""
        names = [""] * self.model.nv
        for name, joint in zip(self.model.names, self.model.joints, strict=True):
            for i in range(joint.nv if name != "universe" else 0):
                first = 3 if joint.nv == 3 and not translations(joint) else 0
                names[joint.idx_v + i] = name if joint.nv == 1 else f"{name}.{COMPONENTS[first + i]}"
        return tuple(names)

    def configuration(self, values: Mapping[str, ArrayLike], q: ArrayLike | None = None) -> Array:
        """Return a configuration with some joints set by name.

        Args:
            values: joint name -> value, rad or m; of a ball joint a quaternion x y z w of any size but 0, of a free
                base its position and quaternion.
            q: (nq,) that gives the other joints; home unless given.

        Raises:
            UnknownNameError: no such joint.
            ConfigurationError: a number that is not finite, too few or too many of them, or q of the wrong shape.
        """
        full = self.structure.checked(self.q_home if q is None else q).copy()
        for name, value in values.items():
            joint = self._joint(name)
            if joint.nq == 1:
                full[joint.idx_q] = value
                continue
            numbers = np.asarray(value, dtype=float)
            if numbers.shape != (joint.nq,) or not numbers.any():
                raise ConfigurationError(f"joint '{name}' of {self.name} takes {joint.nq} numbers, not {value!r:.60}")
            full[joint.idx_q : joint.idx_q + joint.nq] = numbers
        return self.structure.normalized(self.structure.checked(full))

    def values(self, q: Array) -> dict[str, float | list[float]]:
        """Return the values of all joints in q (nq,) by name, rad or m; of ball joints the quaternion x y z w."""
        values: dict[str, float | list[float]] = {name: float(q[self.q_index(name)]) for name in self.joints}
        for name in self.balls:
            values[name] = [float(x) for x in q[self.q_index(name) : self.q_index(name) + 4]]
        return values

    def difference(self, start: ArrayLike, end: ArrayLike) -> Array:
        """Return the velocity (nv,) that leads from one configuration (nq,) to another in 1 s; rad/s and m/s."""
        return np.asarray(pin.difference(self.model, start, end))

    def scaled_difference(self, start: ArrayLike, end: ArrayLike) -> Array:
        """Return the `difference` (nv,) of two configurations in rad and characteristic lengths."""
        return self.difference(start, end) / self.scale

    def distance(self, start: ArrayLike, end: ArrayLike) -> float:
        """Return the largest motion of a joint between two configurations (nq,), in rad or characteristic lengths."""
        return float(np.abs(self.scaled_difference(start, end)).max(initial=0.0))

    def integrate(self, q: ArrayLike, step: ArrayLike) -> Array:
        """Return the configuration (nq,) reached from q (nq,) by a step (nv,) in rad and m."""
        return np.asarray(pin.integrate(self.model, q, step))

    def interpolate(self, start: ArrayLike, end: ArrayLike, part: float) -> Array:
        """Return the configuration (nq,) at a part, 0 to 1, of the shortest path between two others; loops may open."""
        return np.asarray(pin.interpolate(self.model, start, end, part))
