"""`singularity`: whether a mechanism is singular at a configuration, of which type, and why.

C. Gosselin and J. Angeles, "Singularity analysis of closed-loop kinematic chains", IEEE Trans. Robotics and Automation
6, 1990. Type 1: the end loses a degree of freedom, and the structure supports a wrench by itself. Type 2: the end moves
with all actuated joints locked, and these can't support some wrench. For a platform on six legs the second is a
dependence of the legs' lines, classified by Grassmann geometry (J-P. Merlet, "Symbolic computation for the
determination of the minimal direct kinematics polynomial and the singular configurations of parallel manipulators").
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cinegen.errors import ClosureError
from cinegen.html import table
from cinegen.ik.equations import free_motions
from cinegen.model import Mechanism
from cinegen.singularities.ball_joints import CountedJacobians, counted
from cinegen.singularities.grassmann import Dependence, classify, near
from cinegen.singularities.leg_lines import leg_lines
from cinegen.singularities.pluecker import LineAtInfinity, LineFrame, PlueckerLine, Screw
from raff2urdf.closure import rank
from raff2urdf.quantities import LENGTH, shown_scale

Array = NDArray[np.float64]

SINGULAR = 1e-6
"""A singular value (dimensionless) up to this is 0."""

NEAR = 0.02
"""... and up to this it is near."""

_EVER = 1e-6  # a direction in which the end moves less than this part of the best is none
_OPEN = 1e-9  # rad or characteristic lengths


class SingularityType(Enum):
    """Types of singularities."""

    NONE = "regular"
    TYPE_1 = "type 1"
    TYPE_2 = "type 2"
    BOTH = "type 1 and type 2"

    @classmethod
    def of(cls, first: bool, second: bool) -> SingularityType:
        """Return the type of a configuration that is singular of the first type, of the second, of both or of none."""
        return (cls.NONE, cls.TYPE_1, cls.TYPE_2, cls.BOTH)[first + 2 * second]


@dataclass(frozen=True, eq=False, repr=False)
class Singularity:
    """The singularities at a configuration, or near it.

    Screws are in the world, m and rad; which wrench belongs to which motion depends on the characteristic length by
    which metres are compared with radians, at the node's origin.

    Attributes:
        kind: the type, up to the tolerance.
        near: the type that is near, or reached.
        node: whose motion is analysed.
        first: singular values of the node's motion in the free motions, dimensionless, largest first (type 1).
        second: singular values of the passive joints in the loops, likewise (type 2).
        lost_dof: the motion that the node loses, or is nearest to lose; None if it can't move at all.
        supported_wrench: the wrench that the structure supports there without the actuated joints.
        uncontrolled_dof: the motion of the node that the actuated joints don't control, or control least; None if there
            are no passive joints, or the node does not move in it.
        unsupported_wrench: the wrench on the node that the actuated joints can't support, or support worst.
        motion: (nv,) the uncontrolled motion of all joints, rad and m; None as `uncontrolled_dof`.
        legs: the lines of the legs, if the mechanism is a platform on legs that are lines.
        dependence: why they are dependent, or nearly so; None if they are not.
    """

    kind: SingularityType
    near: SingularityType
    node: str
    first: Array
    second: Array
    lost_dof: Screw | None
    supported_wrench: Screw | None
    uncontrolled_dof: Screw | None
    unsupported_wrench: Screw | None
    motion: Array | None
    legs: tuple[PlueckerLine, ...]
    dependence: Dependence | None

    def __bool__(self) -> bool:
        """Return whether it is singular."""
        return self.kind is not SingularityType.NONE

    def __repr__(self) -> str:
        return f"<Singularity: {self._status}, of {self.node[:80]}>"

    def _repr_html_(self) -> str:
        title, *rows = self.message.split("; ")
        return table(title, ["reason"], [[row] for row in rows])

    @property
    def sigma(self) -> tuple[float, float]:
        """The smallest singular values of both types; infinite if there are none."""
        smallest = [float(values[-1]) if len(values) else np.inf for values in (self.first, self.second)]
        return smallest[0], smallest[1]

    @property
    def _status(self) -> str:
        values = zip(self.sigma, ("type 1", "type 2"), strict=True)
        listed = ", ".join(f"{value:.2g} of {name}" for value, name in values if value < np.inf) or "none"
        name = f"near {self.near.value}" if not self and self.near is not SingularityType.NONE else self.kind.value
        return f"{name} (smallest singular values: {listed})"

    @property
    def message(self) -> str:
        """The result as a text."""
        parts, both = [self._status], SingularityType.BOTH
        if self.near in (SingularityType.TYPE_1, both) and self.lost_dof and self.supported_wrench:
            parts.append(f"{self.node} loses, or nearly, {screw_text(self.lost_dof)}")
            wrench = screw_text(self.supported_wrench, wrench=True)
            parts.append(f"the structure supports {wrench} without its actuated joints")
        if self.near in (SingularityType.TYPE_2, both) and self.uncontrolled_dof and self.unsupported_wrench:
            parts.append(f"with all actuated joints locked {self.node} can make {screw_text(self.uncontrolled_dof)}")
            wrench = screw_text(self.unsupported_wrench, wrench=True)
            parts.append(f"the actuated joints can't support {wrench}")
        if self.dependence is not None:
            parts.append(f"{self.dependence.grassmann_class.title}: {self.dependence.text(unit='m')}")
        return "; ".join(parts)

    def as_dict(self) -> dict[str, Any]:
        """Return what JSON shows: m and rad."""
        names = "lost_dof", "supported_wrench", "uncontrolled_dof", "unsupported_wrench"
        screws = {name: getattr(self, name) for name in names}
        return {
            "kind": self.kind.value,
            "near": self.near.value,
            "node": self.node,
            "singular_values": {"type 1": self.first.tolist(), "type 2": self.second.tolist()},
            **{name: None if screw is None else screw.coordinates.tolist() for name, screw in screws.items()},
            "class": None if self.dependence is None else self.dependence.grassmann_class.title,
            "legs": None if self.dependence is None else [[i + 1 for i in one.lines] for one in self.dependence.sets],
            "message": self.message,
        }


def singularity(
    mechanism: Mechanism, q: ArrayLike, node: str | None = None, tolerance: float = SINGULAR, within: float = NEAR
) -> Singularity:
    """Analyse the singularities of a mechanism at a configuration: type, motions, wrenches, geometric reason.

    Args:
        mechanism: any.
        q: (nq,) loops closed.
        node: whose motion is analysed; the mechanism's end by default.
        tolerance: up to which a singular value, dimensionless (lengths divided by the characteristic length), is 0.
        within: up to which it is near.

    Raises:
        ClosureError: loops are open at q.
        ConfigurationError: q is no configuration.
        UnknownNameError: no such node.
    """
    here, name = mechanism.checked(q), mechanism.end if node is None else node
    gap = mechanism.closure(here)
    if gap > _OPEN:
        raise ClosureError(f"{mechanism.name}: loops are open by {gap:.2g} (rad or lengths): close(q) first")
    frame = LineFrame(mechanism.placement(here, name).translation, mechanism.length)
    jacobians = counted(mechanism, here, name)
    first, direction = _first(mechanism, jacobians, name)
    second, weakest = _second(mechanism, jacobians)
    none: tuple[Screw | None, Screw | None] = (None, None)
    lost, uncontrolled, motion = none if direction is None else _screws(frame, direction), none, None
    if weakest is not None:
        motion = jacobians.joints @ weakest * mechanism.scale
        twist = jacobians.node @ weakest
        size = float(np.linalg.norm(twist))
        if size > _EVER:
            uncontrolled = _screws(frame, twist / size)
    legs, dependence = leg_lines(mechanism, here), None
    if legs:
        exact = classify(legs, mechanism.length, tolerance)
        dependence = exact or near(legs, mechanism.length, within, tolerance)
    return Singularity(
        _kind(first, second, tolerance), _kind(first, second, within), name, first, second, lost[0], lost[1],
        uncontrolled[0], uncontrolled[1], motion, legs, dependence,
    )  # fmt: skip


def _kind(first: Array, second: Array, threshold: float) -> SingularityType:
    return SingularityType.of(*(bool(len(values)) and float(values[-1]) <= threshold for values in (first, second)))


def _images(mechanism: Mechanism, jacobians: CountedJacobians) -> Array:
    """Return the node's motions (6, k) in the free motions, in the world, dimensionless."""
    return np.asarray(jacobians.node @ free_motions(jacobians.loops, mechanism.loop_rank)[0])


def _first(mechanism: Mechanism, jacobians: CountedJacobians, node: str) -> tuple[Array, Array | None]:
    """Return the singular values of type 1, and the direction (6,) of the smallest, dimensionless.

    Rotations count if they don't follow from the translations. A direction that the node never has is not lost.
    """
    everywhere = [_images(mechanism, counted(mechanism, q, node)) for q in mechanism.samples]
    here = _images(mechanism, jacobians)
    ranks = [max(rank(images[:count]) for images in everywhere) for count in (3, 6)]
    count = 6 if ranks[1] > ranks[0] else 3
    generic = max(ranks)
    if generic == 0:
        return np.zeros(0), None
    u, sigma, _ = np.linalg.svd(np.hstack([*everywhere, here])[:count], full_matrices=False)
    ever = u[:, sigma > _EVER * sigma[0]]
    directions, values, _ = np.linalg.svd(ever.T @ here[:count], full_matrices=False)
    generic = min(generic, len(values))
    lost = np.zeros(6)
    lost[:count] = ever @ directions[:, generic - 1]
    return values[:generic], lost


def _second(mechanism: Mechanism, jacobians: CountedJacobians) -> tuple[Array, Array | None]:
    """Return the singular values of type 2, and the motion (nv,) that actuated joints control least, dimensionless."""
    if mechanism.passive_rank == 0:
        return np.zeros(0), None
    columns = mechanism.passive_columns
    _, sigma, vt = np.linalg.svd(jacobians.loops[:, columns], full_matrices=False)
    weakest = np.zeros(mechanism.model.nv)
    weakest[columns] = vt[mechanism.passive_rank - 1]
    sign = -1.0 if weakest[np.argmax(np.abs(weakest))] < 0.0 else 1.0
    return sigma[: mechanism.passive_rank], sign * weakest


def _screws(frame: LineFrame, twist: Array) -> tuple[Screw, Screw]:
    """Return the screw of a twist (6,), linear above angular, dimensionless, at the frame's origin, and that of the
    wrench that does work on it and has the same numbers: force and couple change places."""
    return frame.screw(np.roll(twist, 3), _EVER), frame.screw(twist, _EVER)


def screw_text(screw: Screw, wrench: bool = False) -> str:
    """Return a text for a twist, or a wrench, in the user's unit of length."""
    if isinstance(screw.axis, LineAtInfinity):
        return f"a {'couple about' if wrench else 'translation along'} {_vector(screw.axis.normal)}"
    scale, unit = shown_scale(LENGTH)
    where = f"through {_vector(scale * screw.axis.nearest(np.zeros(3)))} {unit} along {_vector(screw.axis.direction)}"
    if abs(screw.pitch) < 1e-9:
        return f"a force {where}" if wrench else f"a rotation about the axis {where}"
    pitch = f"{scale * screw.pitch:.4g} {unit}{'' if wrench else '/rad'}"
    return f"a {'wrench' if wrench else 'screw'} of pitch {pitch} about the axis {where}"


def _vector(vector: Array) -> str:
    return "(" + ", ".join(f"{value:.4g}" for value in np.where(np.abs(vector) < 1e-9, 0.0, vector)) + ")"
