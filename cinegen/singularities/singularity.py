"""`singularity`: whether a mechanism is singular at a configuration, of which kind, and why.

C. Gosselin and J. Angeles, "Singularity analysis of closed-loop kinematic chains", IEEE Trans. Robotics and Automation
6, 1990. Type 1: the end can no longer move some way, whatever the motors do; the structure carries a wrench by itself.
Type 2: the end moves though all motors are held; they can't bear some wrench. For a platform on six legs the second is
a dependence of the legs' lines, and Grassmann's geometry says which (J-P. Merlet, "Symbolic computation for the
determination of the minimal direct kinematics polynomial and the singular configurations of parallel manipulators").
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cinegen.errors import ClosureError
from cinegen.ik.resolve import free_motions
from cinegen.model import Mechanism
from cinegen.singularities.counted import Counted, counted
from cinegen.singularities.legs import leg_lines
from cinegen.singularities.lines import Dependence, Frame, Line, Screw, Variety, classify, near
from cinegen.tolerances import CLOSURE
from raff2urdf.closure import rank

Array = NDArray[np.float64]

SINGULAR = 1e-6
"""A singular value (without unit) up to this is 0."""

NEAR = 0.02
"""... and up to this it is near."""

_EVER = 1e-6  # a direction in which the end moves less than this part of the best is none


class Kind(Enum):
    """Which singularity."""

    NONE = "regular"
    TYPE_1 = "type 1"
    TYPE_2 = "type 2"
    BOTH = "type 1 and type 2"


@dataclass(frozen=True, eq=False)
class Singularity:
    """What is singular at a configuration, and what is near to it.

    Screws are in the world, m and rad; which wrench belongs to which motion depends on what a metre is worth: the
    characteristic length, at the node's origin.

    Attributes:
        kind: which, up to the tolerance.
        near: which is near, or reached.
        node: whose motion is meant.
        first: singular values of how the free motions move the node, without unit, largest first (type 1).
        second: singular values of the passive joints in the loops, likewise (type 2).
        lost: the motion that the node loses, or is nearest to lose; None where it can't move at all.
        carried: the wrench that the structure bears there without the motors.
        gained: the motion that the motors don't hold, or hold least, as the node makes it; None where there are no
            passive joints, or the node stands still in it.
        unheld: the wrench on the node that the motors can't bear, or bear worst.
        motion: (nv,) the gained motion of all joints, rad and m; None as `gained`.
        legs: the lines of the legs, if the mechanism is a platform on legs that are lines.
        dependence: why they are dependent, or nearly so; None where they are not.
    """

    kind: Kind
    near: Kind
    node: str
    first: Array
    second: Array
    lost: Screw | None
    carried: Screw | None
    gained: Screw | None
    unheld: Screw | None
    motion: Array | None
    legs: tuple[Line, ...]
    dependence: Dependence | None

    def __bool__(self) -> bool:
        """Whether it is singular."""
        return self.kind is not Kind.NONE

    @property
    def sigma(self) -> tuple[float, float]:
        """The smallest singular values of both kinds; infinite where there are none."""
        smallest = [float(values[-1]) if len(values) else np.inf for values in (self.first, self.second)]
        return smallest[0], smallest[1]

    @property
    def words(self) -> str:
        """What there is to say, in sentences."""
        parts = [f"{self.kind.value} (smallest singular values: {_values(self.sigma)})"]
        if self.kind is Kind.NONE and self.near is not Kind.NONE:
            parts = [f"near {self.near.value} (smallest singular values: {_values(self.sigma)})"]
        if self.near in (Kind.TYPE_1, Kind.BOTH) and self.lost is not None and self.carried is not None:
            parts.append(f"{self.node} can hardly, or not, make {described(self.lost)}")
            parts.append(f"the structure bears {described(self.carried, wrench=True)} without its motors")
        if self.near in (Kind.TYPE_2, Kind.BOTH) and self.gained is not None and self.unheld is not None:
            parts.append(f"with all motors held {self.node} still makes {described(self.gained)}")
            parts.append(f"the motors can't bear {described(self.unheld, wrench=True)}")
        if self.dependence is not None:
            parts.append(f"{_named(self.dependence.variety)}: {self.dependence.words(unit='m')}")
        return "; ".join(parts)

    def as_dict(self) -> dict[str, Any]:
        """As JSON has it."""
        screws = {name: getattr(self, name) for name in ("lost", "carried", "gained", "unheld")}
        return {
            "kind": self.kind.value,
            "near": self.near.value,
            "node": self.node,
            "singular_values": {"type 1": self.first.tolist(), "type 2": self.second.tolist()},
            **{name: None if screw is None else screw.coordinates.tolist() for name, screw in screws.items()},
            "class": None if self.dependence is None else _named(self.dependence.variety),
            "legs": None if self.dependence is None else [[i + 1 for i in one.lines] for one in self.dependence.sets],
            "words": self.words,
        }


def singularity(
    mechanism: Mechanism, q: ArrayLike, node: str | None = None, tolerance: float = SINGULAR, within: float = NEAR
) -> Singularity:
    """Whether a mechanism is singular at a configuration, of which kind, and why.

    Args:
        mechanism: any.
        q: (nq,) loops closed.
        node: whose motion is meant; the mechanism's end unless said.
        tolerance: up to which a singular value, without unit (lengths divided by the characteristic length), is 0.
        within: up to which it is near.

    Raises:
        ClosureError: loops are open at q.
        ConfigurationError: q is no configuration.
        UnknownNameError: no such node.
    """
    here, name = mechanism.checked(q), mechanism.end if node is None else node
    gap = mechanism.closure(here)
    if gap > CLOSURE:
        raise ClosureError(f"{mechanism.name}: loops stand open by {gap:.2g} (rad or lengths): close(q) first")
    frame = Frame(mechanism.placement(here, name).translation, mechanism.length)
    matrices = counted(mechanism, here, name)
    first, direction = _first(mechanism, matrices, name)
    second, weakest = _second(mechanism, matrices)
    lost = carried = released = unheld = motion = None
    if direction is not None:
        lost, carried = _screw(frame, direction), _screw(frame, direction, wrench=True)
    if weakest is not None:
        motion = matrices.joints @ weakest * mechanism.scale
        twist = matrices.node @ weakest
        size = float(np.linalg.norm(twist))
        if size > _EVER:
            released, unheld = _screw(frame, twist / size), _screw(frame, twist / size, wrench=True)
    legs = leg_lines(mechanism, here)
    return Singularity(
        _kind(first, second, tolerance), _kind(first, second, within), name, first, second, lost, carried, released,
        unheld, motion, legs, _dependence(mechanism, legs, tolerance, within),
    )  # fmt: skip


def _kind(first: Array, second: Array, threshold: float) -> Kind:
    one, two = (bool(len(values)) and float(values[-1]) <= threshold for values in (first, second))
    return {(False, False): Kind.NONE, (True, False): Kind.TYPE_1, (False, True): Kind.TYPE_2}.get(
        (one, two), Kind.BOTH
    )


def _images(mechanism: Mechanism, matrices: Counted) -> Array:
    """(6, k) how the free motions move the node in the world, without unit."""
    return np.asarray(matrices.node @ free_motions(matrices.loops, mechanism.loop_rank)[0])


def _first(mechanism: Mechanism, matrices: Counted, node: str) -> tuple[Array, Array | None]:
    """Singular values of type 1, and the direction (6,) of the smallest, without unit.

    Rotations count where they don't follow from the translations. A direction that the node never has is not lost.
    """
    everywhere = [_images(mechanism, counted(mechanism, q, node)) for q in mechanism.samples]
    here = _images(mechanism, matrices)
    ranks = [max(rank(images[:count]) for images in everywhere) for count in (3, 6)]
    count = 6 if ranks[1] > ranks[0] else 3
    generic = max(ranks)
    if generic == 0:
        return np.zeros(0), None
    together = np.hstack([*everywhere, here])[:count]
    u, sigma, _ = np.linalg.svd(together, full_matrices=False)
    ever = u[:, sigma > _EVER * sigma[0]]
    directions, values, _ = np.linalg.svd(ever.T @ here[:count], full_matrices=False)
    generic = min(generic, len(values))
    lost = np.zeros(6)
    lost[:count] = ever @ directions[:, generic - 1]
    return values[:generic], lost


def _second(mechanism: Mechanism, matrices: Counted) -> tuple[Array, Array | None]:
    """Singular values of type 2, and the motion (nv,) that motors hold least, without unit."""
    if mechanism.passive_rank == 0:
        return np.zeros(0), None
    columns = mechanism.passive_columns
    _, sigma, vt = np.linalg.svd(matrices.loops[:, columns], full_matrices=False)
    weakest = np.zeros(mechanism.model.nv)
    weakest[columns] = vt[mechanism.passive_rank - 1]
    sign = -1.0 if weakest[np.argmax(np.abs(weakest))] < 0.0 else 1.0
    return sigma[: mechanism.passive_rank], sign * weakest


def _screw(frame: Frame, twist: Array, wrench: bool = False) -> Screw:
    """The screw of a twist (6,), linear above angular, without unit, at the frame's origin; or of the wrench that does
    work on it and, without unit, has the same numbers: force and couple change places."""
    linear, angular = twist[:3], twist[3:]
    return frame.screw(np.concatenate([linear, angular] if wrench else [angular, linear]), _EVER)


def _dependence(mechanism: Mechanism, legs: tuple[Line, ...], tolerance: float, within: float) -> Dependence | None:
    if not legs:
        return None
    exact = classify(legs, mechanism.length, tolerance=tolerance)
    return exact or near(legs, mechanism.length, within, tolerance=tolerance)


def described(screw: Screw, wrench: bool = False) -> str:
    """A motion or a wrench in words, m."""
    line = screw.axis
    if screw.translates:
        what = "a couple about" if wrench else "a translation along"
        return f"{what} {_vector(line.coordinates[3:])}"
    where = f"through {_vector(line.nearest(np.zeros(3)))} m along {_vector(line.direction)}"  # type: ignore[union-attr]
    if abs(screw.pitch) < 1e-9:
        return f"a force {where}" if wrench else f"a rotation about the axis {where}"
    pitch = f"{screw.pitch:.4g} {'m' if wrench else 'm/rad'}"
    return f"{'a wrench' if wrench else 'a screw'} of pitch {pitch} about the axis {where}"


def _named(variety: Variety) -> str:
    """Its name, and its number in Merlet's list of 1989."""
    return f"{variety.name.lower().replace('_', ' ')} ({variety.value})"


def _vector(vector: Array) -> str:
    return "(" + ", ".join(f"{value:.4g}" for value in np.where(np.abs(vector) < 1e-9, 0.0, vector)) + ")"


def _values(sigma: tuple[float, float]) -> str:
    named = [
        f"{value:.2g} of {what}" for value, what in zip(sigma, ("type 1", "type 2"), strict=True) if value < np.inf
    ]
    return ", ".join(named) or "none"
