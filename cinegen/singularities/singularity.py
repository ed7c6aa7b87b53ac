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

from cinegen.arrays import Array, ArrayLike
from cinegen.errors import ClosureError
from cinegen.html import table
from cinegen.loops.motions import free_motions, orthonormal
from cinegen.model import Mechanism
from cinegen.singularities.ball_joints import CountedJacobians, counted
from cinegen.singularities.grassmann import Dependence, classify, near
from cinegen.singularities.leg_lines import leg_lines
from cinegen.singularities.line_varieties import GrassmannClass, class_of_wrenches
from cinegen.singularities.pluecker import LineFrame, PlueckerLine, Screw, sense
from cinegen.singularities.screw_system import ScrewSystem
from cinegen.tolerances import NEAR_SINGULAR
from raff2urdf.closure import rank

SINGULAR = 1e-6
"""A singular value (dimensionless) up to this is 0."""

_EVER = 1e-6  # a direction in which the end moves less than this part of the best is none
_OPEN = 1e-9  # rad or characteristic lengths
_MARGIN = 10.0  # singular vectors may each be off by some multiple of their singular value
_UNKNOWN = 1e-2  # rad: largest inaccuracy that counts


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

    Screws are in the world, m and rad. If several singular values vanish, all motions and wrenches that belong to them
    are listed; if none does, those that are near 0; else the one that belongs to the smallest. A lost motion is a
    representative: motions that differ by a possible one are lost together. So is an unsupported wrench, up to
    supported ones. Both are normal to these at the node's origin, with metres compared with radians by the
    characteristic length; what is uncontrolled, and what the structure supports, does not depend on that.

    Attributes:
        kind: the type, up to the tolerance.
        near: the type that is near, or reached.
        node: whose motion is analysed.
        first: singular values of the node's motion in the free motions, dimensionless, largest first (type 1).
        second: singular values of the passive joints in the loops, likewise, and 0 for each motion of the node that the
            actuated joints control nowhere (type 2).
        lost: the motions that the node loses, or is nearest to lose; of order 0 if it can't move at all.
        keeps_rotations: whether only its position loses motions: with its rotations, which follow from the position
            elsewhere and do not count, the node has as many DoF as ever.
        supported: the wrenches that the structure supports there without the actuated joints.
        uncontrolled: the motions of the node that the actuated joints don't control, or control least; of order 0 if
            there are no passive joints, or the node does not move in them.
        unsupported: the wrenches on the node that the actuated joints can't support, or support worst.
        motions: (n, nv) uncontrolled motions of all joints, rad and m, one for each screw of `uncontrolled`; those of
            the joints alone if the node does not move.
        legs: the lines of the legs, if the mechanism is a platform on legs that are lines.
        dependence: why they are dependent, or nearly so; None if they are not.
    """

    kind: SingularityType
    near: SingularityType
    node: str
    first: Array
    second: Array
    lost: ScrewSystem
    keeps_rotations: bool
    supported: ScrewSystem
    uncontrolled: ScrewSystem
    unsupported: ScrewSystem
    motions: Array
    legs: tuple[PlueckerLine, ...]
    dependence: Dependence | None

    def __bool__(self) -> bool:
        """Return whether it is singular."""
        return self.kind is not SingularityType.NONE

    def __repr__(self) -> str:
        return f"<Singularity: {self.message}; of {self.node[:80]}>"

    def _repr_html_(self) -> str:
        title, *rows = self.message.split("; ")
        return table(title, ["reason"], [[row] for row in rows])

    @property
    def sigma(self) -> tuple[float, float]:
        """The smallest singular values of both types; infinite if there are none."""
        smallest = [float(values[-1]) if len(values) else np.inf for values in (self.first, self.second)]
        return smallest[0], smallest[1]

    @property
    def lost_dof(self) -> Screw | None:
        """The first screw of `lost`."""
        return _first_of(self.lost)

    @property
    def supported_wrench(self) -> Screw | None:
        """The first screw of `supported`."""
        return _first_of(self.supported)

    @property
    def uncontrolled_dof(self) -> Screw | None:
        """The first screw of `uncontrolled`."""
        return _first_of(self.uncontrolled)

    @property
    def unsupported_wrench(self) -> Screw | None:
        """The first screw of `unsupported`."""
        return _first_of(self.unsupported)

    @property
    def motion(self) -> Array | None:
        """(nv,) the first of `motions`; None if there are no passive joints."""
        return self.motions[0] if len(self.motions) else None

    @property
    def grassmann_class(self) -> GrassmannClass | None:
        """Class of all forces on the node that are supported with all actuated joints locked, of any mechanism; None
        away from type 2, and if couples are supported that no forces make up."""
        if self.near in (SingularityType.NONE, SingularityType.TYPE_1):
            return None
        return class_of_wrenches(self.uncontrolled.reciprocal)

    @property
    def _status(self) -> str:
        values = zip(self.sigma, ("type 1", "type 2"), strict=True)
        listed = ", ".join(f"{value:.2g} of {name}" for value, name in values if value < np.inf) or "none"
        name = f"near {self.near.value}" if not self and self.near is not SingularityType.NONE else self.kind.value
        return f"{name} (smallest singular values: {listed})"

    @property
    def message(self) -> str:
        """The result as a text."""
        parts, both, node = [self._status], SingularityType.BOTH, self.node
        if self.near in (SingularityType.TYPE_1, both) and self.lost.order:
            lost, supported = self.lost.text(), self.supported.text()
            if self.lost.order > 1:
                lost = f"{self.lost.order} DoF: {self.supported.complement_text()}"
            parts.append(f"{node} loses, or nearly, {lost}")
            if self.keeps_rotations:
                parts.append("its rotations, which follow from its position elsewhere, are left out: they remain")
            parts.append(f"the structure supports {supported} without its actuated joints")
        if self.near in (SingularityType.TYPE_2, both) and self.uncontrolled.order:
            moves, unsupported = self.uncontrolled.text(), self.unsupported.text()
            if self.uncontrolled.order > 1:
                moves += f" ({self.uncontrolled.order} uncontrolled DoF)"
                only = self.uncontrolled.reciprocal.text()
                unsupported = f"{self.uncontrolled.complement_text()}: they support {only}, and no other wrench"
            can = "can" if self.kind in (SingularityType.TYPE_2, both) else "can nearly"
            parts.append(f"with all actuated joints locked {node} {can} make {moves}")
            parts.append(f"the actuated joints can't support {unsupported}")
        if self.dependence is not None:
            reason = self.dependence
            parts.append(f"{reason.grassmann_class.title}: {reason.text(unit='m')}")
            parts.append(f"the lines of all legs have rank {reason.rank}: {reason.class_of_all.title}")
        return "; ".join(parts)

    def as_dict(self) -> dict[str, Any]:
        """Return what JSON shows: m and rad."""
        systems = {name: getattr(self, name) for name in ("lost", "supported", "uncontrolled", "unsupported")}
        names = {"lost": "dof", "supported": "wrench", "uncontrolled": "dof", "unsupported": "wrench"}
        reason = self.dependence
        return {
            "kind": self.kind.value,
            "near": self.near.value,
            "node": self.node,
            "singular_values": {"type 1": self.first.tolist(), "type 2": self.second.tolist()},
            **{
                f"{name}_{names[name]}": system.coordinates[0].tolist() if system.order else None
                for name, system in systems.items()
            },
            **{name: system.as_dict() for name, system in systems.items()},
            "grassmann_class": self.grassmann_class and self.grassmann_class.title,
            "class": None if reason is None else reason.grassmann_class.title,
            "legs": None if reason is None else [[i + 1 for i in group.lines] for group in reason.sets],
            "dependence": None if reason is None else reason.as_dict(),
            "message": self.message,
        }


def _first_of(system: ScrewSystem) -> Screw | None:
    return system.screws[0] if system.order else None


def singularity(
    mechanism: Mechanism,
    q: ArrayLike,
    node: str | None = None,
    tolerance: float = SINGULAR,
    within: float = NEAR_SINGULAR,
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
    checked, name = mechanism.structure.checked(q), mechanism.end if node is None else node
    gap = mechanism.closure(checked)
    if gap > _OPEN:
        raise ClosureError(f"{mechanism.name}: loops are open by {gap:.2g} (rad or lengths): close(q) first")
    frame = LineFrame(mechanism.placement(checked, name).translation, mechanism.length)
    jacobians = counted(mechanism, checked, name)
    first, lost, keeps_rotations, known = _first(mechanism, jacobians, name, tolerance, within)
    lost_twists, supported = _systems(frame, lost, known)
    second, motions, known = _second(mechanism, jacobians, name, tolerance, within)
    images = motions @ jacobians.node.T
    moves = np.linalg.svd(images, full_matrices=False)
    accuracy = max(known, _EVER)
    uncontrolled, unsupported = _systems(frame, moves[2][moves[1] > accuracy], known)
    if uncontrolled.order:
        motions = np.roll(uncontrolled.vectors, 3, axis=1) @ np.linalg.pinv(images, rcond=accuracy) @ motions
        motions /= np.linalg.norm(motions, axis=1, keepdims=True)
    motions = motions @ jacobians.joints.T * mechanism.scale
    legs, dependence = leg_lines(mechanism, checked), None
    if legs:
        exact = classify(legs, mechanism.length, tolerance)
        dependence = exact or near(legs, mechanism.length, within, tolerance)
    return Singularity(
        _kind(first, second, tolerance), _kind(first, second, within), name, first, second, lost_twists,
        keeps_rotations, supported, uncontrolled, unsupported, motions, legs, dependence,
    )  # fmt: skip


def _kind(first: Array, second: Array, threshold: float) -> SingularityType:
    return SingularityType.of(*(bool(len(values)) and float(values[-1]) <= threshold for values in (first, second)))


def _images(jacobians: CountedJacobians, loop_rank: int) -> Array:
    """Return the node's motions (6, k) in the motions that loops of this rank leave, in the world, dimensionless."""
    motions = free_motions(jacobians.loops, loop_rank)[0]
    return np.asarray(jacobians.node @ orthonormal(motions, jacobians.cut_rates))


def _first(
    mechanism: Mechanism, jacobians: CountedJacobians, node: str, tolerance: float, within: float
) -> tuple[Array, Array, bool, float]:
    """Return the singular values of type 1, the directions (n, 6) that are lost, dimensionless, whether rotations that
    don't count remain (`Singularity.keeps_rotations`), and the accuracy of the directions.

    Rotations count if they don't follow from the translations. A direction that the node never has is not lost. Where
    the loops lose a rank, and the mechanism has more motions than elsewhere, all of them count.
    """
    everywhere = [_images(counted(mechanism, q, node), mechanism.loop_rank) for q in mechanism.structure.samples]
    current = _images(jacobians, min(mechanism.loop_rank, rank(jacobians.loops, tolerance)))
    ranks = [max(rank(images[:count]) for images in everywhere) for count in (3, 6)]
    count = 6 if ranks[1] > ranks[0] else 3
    if max(ranks) == 0:
        return np.zeros(0), np.zeros((0, 6)), False, _EVER
    u, sigma, _ = np.linalg.svd(np.hstack([*everywhere, current])[:count], full_matrices=False)
    ever = u[:, sigma > _EVER * sigma[0]]
    directions, values, _ = np.linalg.svd(ever.T @ current[:count], full_matrices=False)
    values = values[: max(ranks)]
    weakest, known = _weakest(values, tolerance, within)
    lost = np.zeros((len(values) - weakest, 6))
    lost[:, :count] = (ever @ directions[:, weakest : len(values)]).T
    twists = np.linalg.svd(current, compute_uv=False)[len(values) - 1]
    return values, lost, bool(values[-1] <= within < twists), known


def _second(
    mechanism: Mechanism, jacobians: CountedJacobians, node: str, tolerance: float, within: float
) -> tuple[Array, Array, float]:
    """Return the singular values of type 2, the motions (n, nv) that the actuated joints control least, dimensionless,
    and their accuracy. Motions that are controlled nowhere count if they move the node."""
    columns, rank_of_passive = mechanism.structure.passive_columns, mechanism.structure.passive_rank
    nowhere = controlled_nowhere(mechanism, node)
    if not rank_of_passive + nowhere:
        return np.zeros(0), np.zeros((0, mechanism.model.nv)), _EVER
    count = rank_of_passive + mechanism.structure.screws.cut
    _, sigma, vt = np.linalg.svd(jacobians.passive)
    values = sigma[:count]
    weakest, known = _weakest(np.append(values, np.zeros(nowhere)), tolerance, within)
    singular = bool(nowhere) or values[-1] <= tolerance  # not distinguishable from DoF that are controlled nowhere
    chosen = vt[weakest:] if singular else vt[weakest:count]
    motions = np.zeros((len(chosen), mechanism.model.nv))
    motions[:, columns] = chosen[:, : len(columns)]
    return np.append(values, np.zeros(nowhere)), motions * [[sense(motion)] for motion in motions], known


def controlled_nowhere(mechanism: Mechanism, node: str) -> int:
    """Return the number of motions of a node in every configuration while all actuated joints are locked: by
    passive joints outside loops, or of a platform that is singular everywhere."""
    columns, count = mechanism.structure.passive_columns, mechanism.structure.passive_rank
    if len(columns) == count:
        return 0
    ranks = []
    for q in mechanism.structure.samples:
        jacobians = counted(mechanism, q, node)
        motions = np.linalg.svd(jacobians.loops[:, columns])[2][count:].T
        ranks.append(rank(jacobians.node[:, columns] @ motions))
    return max(ranks)


def _weakest(values: Array, tolerance: float, within: float) -> tuple[int, float]:
    """Return from which singular value on, largest first, all are 0; if none is, are near 0; else are the last; and the
    accuracy of the space that belongs to these, rad."""
    for threshold in (tolerance, within):
        count = int((values <= threshold).sum())
        if count:
            break
    weakest = len(values) - max(count, 1)
    if count < 2 or not weakest:
        return weakest, _EVER
    noise = max(tolerance, _MARGIN * float(values[weakest]))
    return weakest, float(min(noise / values[weakest - 1], _UNKNOWN))


def _systems(frame: LineFrame, vectors: Array, known: float) -> tuple[ScrewSystem, ScrewSystem]:
    """Return the system of twists (n, 6), linear above angular, dimensionless, at the frame's origin; and that of the
    wrenches that do work on them and have the same numbers: force and couple change places."""
    return ScrewSystem(np.roll(vectors, 3, axis=1), frame, known), ScrewSystem(vectors, frame, known, wrenches=True)
