"""`Payload`: what a node carries, and what acts on it; `LoadedTree`: the tree of a mechanism with its payloads, and
what gravity and wrenches do to it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
import pinocchio as pin

from cinegen.arrays import Array, ArrayLike, Bools
from cinegen.dynamics._kernels.torques import RESTING
from cinegen.dynamics.errors import MassError, PayloadError
from cinegen.joints import step_scale
from cinegen.model import Mechanism

_PHYSICAL = 1e-9  # relative: a principal moment of inertia exceeds the sum of the others by no more


@dataclass(frozen=True, eq=False)
class Payload:
    """A rigid body on a node, and a wrench that its surroundings exert on it.

    Attributes:
        node: that carries it.
        mass: kg.
        centre: (3,) of mass, in the node's frame, m.
        inertia: (3, 3) about the centre of mass, in the node's axes, kg m^2; 0 for a point mass.
        wrench: (6,) force (N), then moment (N m), on the node at its origin.
        axes: of the wrench: the world's, or the node's, which rotate with it.

    Raises:
        PayloadError: a number is not finite or of the wrong shape, the mass is negative, or no body has that inertia.
    """

    node: str
    mass: float = 0.0
    centre: Sequence[float] | Array = (0.0, 0.0, 0.0)
    inertia: ArrayLike | None = None
    wrench: Sequence[float] | Array = (0.0,) * 6
    axes: Literal["world", "node"] = "world"

    def __post_init__(self) -> None:
        self._number("mass", self.mass, ())
        self._number("centre", self.centre, (3,))
        self._number("wrench", self.wrench, (6,))
        if self.mass < 0.0:
            raise PayloadError(f"the payload on '{self.node}' has a negative mass, {self.mass:g} kg")
        if self.axes not in ("world", "node"):
            raise PayloadError(f"the axes of a wrench on '{self.node}' are 'world' or 'node', not {self.axes!r}")
        if self.inertia is None:
            return
        inertia = self._number("inertia", self.inertia, (3, 3))
        if np.abs(inertia - inertia.T).max() > _PHYSICAL * np.abs(inertia).max():
            raise PayloadError(f"the inertia of the payload on '{self.node}' is not symmetric")
        first, second, third = np.linalg.eigvalsh(inertia)
        slack = _PHYSICAL * third
        if first < -slack or third > first + second + slack or (not self.mass and third > 0.0):
            raise PayloadError(
                f"no body has the inertia of the payload on '{self.node}': principal moments {first:.3g}, "
                f"{second:.3g}, {third:.3g} kg m^2, {self.mass:g} kg (none is negative, none exceeds the sum of the "
                "others, and none is there without mass)"
            )

    def _number(self, what: str, value: object, shape: tuple[int, ...]) -> Array:
        try:
            numbers = np.asarray(value, dtype=float)
        except (TypeError, ValueError):
            numbers = np.full(1, np.nan)
        if numbers.shape != shape or not np.isfinite(numbers).all():
            size = "a finite number" if not shape else f"{' x '.join(map(str, shape))} finite numbers"
            raise PayloadError(f"the {what} of the payload on '{self.node}' must be {size}, not {value!r:.60}")
        return numbers

    @property
    def body(self) -> pin.Inertia:
        """Mass, centre and inertia, in the node's frame."""
        inertia = np.zeros((3, 3)) if self.inertia is None else np.asarray(self.inertia, dtype=float)
        return pin.Inertia(float(self.mass), np.array(self.centre, dtype=float), inertia)


class LoadedTree:
    """A mechanism's tree, loops open, with its payloads: what the recursive Newton-Euler algorithm computes.

    For one thread at a time.

    Args:
        mechanism: any.
        payloads: bodies on nodes, and wrenches.
        gravity: (3,) acceleration, m/s^2, in the world; the mechanism's if None.
        friction: whether the friction of joints counts.

    Attributes:
        mechanism, payloads: as given.
        model: a copy of the mechanism's model with the payloads' masses, and this gravity; without friction if it does
            not count.
        loads: for each payload with a wrench the joint that carries its node, and the node's placement on that joint.
        lacking: names of moving links whose mass is unknown.
        step: (nv,) size of one dimensionless step, m or rad, by which forces and torques are compared.

    Raises:
        UnknownNameError: no such node.
        PayloadError: gravity is no acceleration.
    """

    def __init__(
        self,
        mechanism: Mechanism,
        payloads: Sequence[Payload] = (),
        gravity: ArrayLike | None = None,
        friction: bool = True,
    ) -> None:
        self.mechanism, self.payloads = mechanism, tuple(payloads)
        self.model = pin.Model(mechanism.model)
        acceleration = np.asarray(mechanism.gravity if gravity is None else gravity, dtype=float)
        if acceleration.shape != (3,) or not np.isfinite(acceleration).all():
            raise PayloadError(f"gravity is an acceleration (3,) in m/s^2, such as (0, 0, -9.81), not {gravity!r:.60}")
        self.model.gravity = pin.Motion(acceleration, np.zeros(3))
        if not friction:
            rest = np.zeros(self.model.nv)
            self.model.damping, self.model.upperDryFrictionLimit, self.model.lowerDryFrictionLimit = rest, rest, rest
        self.lacking = mechanism.massless
        self.loads: list[tuple[Payload, int, pin.SE3]] = []
        for payload in self.payloads:
            frame = mechanism.model.frames[mechanism.frame_id(payload.node)]
            joint, placement = frame.parentJoint, frame.placement
            self.model.inertias[joint] = self.model.inertias[joint] + placement.act(payload.body)
            if np.any(payload.wrench):
                self.loads.append((payload, joint, placement))
        self.step = step_scale(self.model, mechanism.length)

    @cached_property
    def data(self) -> pin.Data:
        """Pinocchio's, of the last configuration; for n degrees of freedom it takes 54 n^3 bytes."""
        return self.model.createData()

    @property
    def gravity(self) -> Array:
        """(3,) acceleration, m/s^2, in the world."""
        return np.array(self.model.gravity.linear)

    def check_masses(self, massless: bool = False) -> None:
        """Raise a `MassError` if moving links have no mass, or an inertia that no body can have.

        Args:
            massless: whether links without mass count as having none.
        """
        name = self.mechanism.name
        for link, why in self.mechanism.unphysical.items():
            raise MassError(f"{name}: link '{link}' has an inertia that no body can have: {why}")
        if self.lacking and not massless:
            named = ", ".join(f"'{link}'" for link in self.lacking[:6])
            more = f" and {len(self.lacking) - 6} more" if len(self.lacking) > 6 else ""
            raise MassError(
                f"{name}: these links have no mass: {named}{more}. Gravity and accelerations act on "
                "masses: give them in the file, or state that they count as 0 (massless=True, --massless)"
            )

    def wrenches(self) -> pin.StdVec_Force:
        """Return the wrenches on each joint's body, in its joint's frame, at the placements in `data`."""
        wrenches = [pin.Force.Zero() for _ in range(self.model.njoints)]
        for payload, joint, placement in self.loads:
            wrench = pin.Force(np.array(payload.wrench, dtype=float))
            if payload.axes == "world":
                rotation = (self.data.oMi[joint].rotation @ placement.rotation).T
                wrench = pin.Force(rotation @ wrench.linear, rotation @ wrench.angular)
            wrenches[joint] += placement.act(wrench)
        vector = pin.StdVec_Force()
        vector.extend(wrenches)
        return vector

    def torques(self, q: Array, v: Array, a: Array) -> Array:
        """Return the torques and forces (nv,) that all joints of the tree need, loops open: what the loops would
        transmit is left out. `data.f` are the wrenches that the joints transmit then."""
        if self.model.nv == 0:
            return np.zeros(0)
        pin.forwardKinematics(self.model, self.data, q)
        return np.array(pin.rnea(self.model, self.data, q, v, a, self.wrenches())) + self.resistance(v)

    def resistance(self, v: Array) -> Array:
        """Return the torques and forces (nv,) that the friction of the joints needs at v (nv,): viscous, and Coulomb's
        of the joints that move."""
        return np.asarray(self.model.damping * v + self.model.upperDryFrictionLimit * np.sign(v) * self.moves(v))

    def moves(self, v: Array) -> Bools:
        """Return which joints (nv,) move at v (nv,): others are slower by `RESTING` than the fastest."""
        speeds = np.abs(v) / self.mechanism.scale
        return np.asarray(speeds > RESTING * speeds[6 if self.mechanism.floating else 0 :].max(initial=0.0))
