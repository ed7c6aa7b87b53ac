"""`LoadedTree`: the tree of a mechanism with its payloads, and what gravity and wrenches do to it."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np
import pinocchio as pin

from cinegen.arrays import Array, ArrayLike, Bools
from cinegen.dynamics._kernels.torques import RESTING
from cinegen.dynamics.errors import MassError, PayloadError
from cinegen.dynamics.payload import Payload
from cinegen.joints import step_scale
from cinegen.model import Mechanism


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
        given = np.asarray(mechanism.gravity if gravity is None else gravity, dtype=float)
        if given.shape != (3,) or not np.isfinite(given).all():
            raise PayloadError(f"gravity is an acceleration (3,) in m/s^2, such as (0, 0, -9.81), not {gravity!r:.60}")
        self.model.gravity = pin.Motion(given, np.zeros(3))
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
        found = [pin.Force.Zero() for _ in range(self.model.njoints)]
        for payload, joint, placement in self.loads:
            wrench = pin.Force(np.array(payload.wrench, dtype=float))
            if payload.axes == "world":
                rotation = (self.data.oMi[joint].rotation @ placement.rotation).T
                wrench = pin.Force(rotation @ wrench.linear, rotation @ wrench.angular)
            found[joint] += placement.act(wrench)
        vector = pin.StdVec_Force()
        vector.extend(found)
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
