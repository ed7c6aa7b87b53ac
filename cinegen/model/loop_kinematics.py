"""Kinematics of a mechanism: poses, Jacobians, and its loops."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pinocchio as pin

from cinegen.arrays import Array, ArrayLike
from cinegen.errors import ClosureError
from cinegen.loops.closed_loops import ClosedLoops
from cinegen.loops.clusters import subsystems
from cinegen.model.jacobian import COMPONENTS, ExtendedJacobian
from cinegen.model.mechanism_model import MechanismModel
from raff2urdf import closure
from raff2urdf.errors import counted
from raff2urdf.loops.open_loops import shown_gaps


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class LoopKinematics(MechanismModel):
    """Poses and Jacobians of a `Mechanism`, residuals and Jacobians of its loops, and closing them."""

    def placement(self, q: ArrayLike, node: str) -> pin.SE3:
        """Return the pose of a node in the world, m.

        Args:
            q: (nq,).
            node: its name.

        Raises:
            UnknownNameError: no such node.
            ConfigurationError: q is no configuration.
        """
        data = self.structure.system.data
        frame = self.model.frames[self.frame_id(node)]
        pin.forwardKinematics(self.model, data, self.structure.checked(q))
        return data.oMi[frame.parentJoint] * frame.placement

    def jacobian(self, q: ArrayLike, node: str) -> Array:
        """Return the (6, nv) Jacobian of a node in its own frame: linear above angular velocity, m and rad.

        Raises:
            UnknownNameError: no such node.
            ConfigurationError: q is no configuration.
        """
        frame = self.frame_id(node)
        if self.model.nv == 0:  # Pinocchio would crash
            return np.zeros((6, 0))
        local = pin.ReferenceFrame.LOCAL
        jacobian = pin.computeFrameJacobian(
            self.model, self.structure.system.data, self.structure.checked(q), frame, local
        )
        return np.asarray(jacobian).reshape(6, self.model.nv)  # a single column comes without its second dimension

    def loop_residual(self, q: ArrayLike) -> Array:
        """Return the residual (rows,) of all loops, m and rad, in the first ends' axes (see `raff2urdf.residual`), and
        then of all couplings, in the unit of their equations (see `raff2urdf.coupling`)."""
        return self.structure.system.evaluate(self.structure.checked(q))[0] * self._loop_units

    def loop_jacobian(self, q: ArrayLike) -> Array:
        """Return the exact derivative (rows, nv) of `loop_residual` by the velocity, m and rad; loops may be open."""
        jacobian = self.structure.system.evaluate(self.structure.checked(q))[1]
        return jacobian * self._loop_units[:, None] / self.scale

    @cached_property
    def _loop_units(self) -> Array:
        components = [component for loop in self.loops for component in loop.components]
        of_loops = [1.0 if "r" in component else self.length for component in components]
        return np.array([*of_loops, *self.structure.system.coupling_sizes])

    def extended_jacobian(self, q: ArrayLike, nodes: Iterable[str] | str = ()) -> ExtendedJacobian:
        """Return the extended Jacobian (seed paper, figure 9): six rows for each node above the rows of all loops and
        couplings.

        Args:
            q: (nq,).
            nodes: whose Jacobians come first, each in its node's own frame.

        Returns:
            rows in m and rad, columns by m and rad. The entry of a joint that does not move what a row describes is
            exactly 0.

        Raises:
            UnknownNameError: no such node.
            ConfigurationError: q is no configuration.
        """
        nodes = [nodes] if isinstance(nodes, str) else list(nodes)
        blocks = [self.jacobian(q, node) for node in nodes]
        rows = [(node, component) for node in nodes for component in COMPONENTS]
        if self.is_constrained:
            blocks.append(self.loop_jacobian(q))
            rows += [(loop.name, component) for loop in self.loops for component in loop.components]
            rows += [(coupling.name, "q") for coupling in self.couplings]
        matrix = np.vstack(blocks) if blocks else np.zeros((0, self.model.nv))
        return ExtendedJacobian(matrix, tuple(rows), self.columns)

    def screw_matrix(self, q: Array, system: ClosedLoops | None = None) -> Array:
        """Return the screw matrix of all loops and couplings, (rows, nv + cut joints' velocities), dimensionless: its
        singular values do not depend on which joints were cut, see `cinegen.loops.screws`.

        Args:
            q: (nq,) with closed loops.
            system: the loops, if not the mechanism's own: their data is that at q afterwards.
        """
        system = self.structure.system if system is None else system
        return self.structure.screws.matrix(system, system.evaluate(q)[1])

    def loop_singular_values(self, q: ArrayLike) -> Array:
        """Return the singular values of `screw_matrix` at q (nq,), dimensionless, largest first, as many as its generic
        rank: `loop_rank`, and one for each degree of freedom of the joints that were cut."""
        if self.loop_rank == 0:
            return np.zeros(0)
        sigma = np.linalg.svd(self.screw_matrix(self.structure.checked(q)), compute_uv=False)
        return np.asarray(sigma[: self.loop_rank + self.structure.screws.cut])

    def closure(self, q: ArrayLike) -> float:
        """Return the largest residual of all loops and couplings at q (nq,), in rad or characteristic lengths; 0
        without any."""
        return max(closure.gaps(self.structure.system, self.structure.checked(q)), default=0.0)

    def close(self, q: ArrayLike, locked: Iterable[str] = ()) -> Array:
        """Return the closed configuration that Gauss-Newton steps reach from q (`raff2urdf.closure.close`), a nearby
        one; joint limits are not considered.

        Args:
            q: (nq,) such as rounded or guessed values.
            locked: joints that keep their value. With all actuated joints this is forward kinematics, on the branch
                near q.

        Returns:
            (nq,), closed to 1e-12.

        Raises:
            ClosureError: not closed there; names the loops and couplings, and their gaps.
            UnknownNameError: no such joint.
            ConfigurationError: q is no configuration.
        """
        names = (locked,) if isinstance(locked, str) else tuple(locked)
        mask = self.structure.mask(names)
        start = np.asarray(q, dtype=float)
        if not self.is_constrained or start.shape != self.q_home.shape:
            return self.structure.checked(start).copy()
        closing = self.structure.closer.close(start, mask)
        if closing.closed:
            return closing.q
        self.structure.checked(start)
        gaps = (closure.gaps(self.structure.system, closing.q), shown_gaps(self.structure.system, closing.q))
        rows = zip(self.constraint_names, *gaps, strict=True)
        listed = ", ".join(f"'{name}' by {shown}" for name, gap, shown in rows if gap > closure.CLOSED)
        what = "loops and couplings" if self.couplings else "loops"
        condition = f" with {counted(len(set(names)), 'joint')} locked" if names else ""
        raise ClosureError(f"{self.name} can't be closed from there{condition}: these {what} remain open: {listed}")

    def random_closed(self, count: int, seed: int = 0) -> list[Array]:
        """Return random closed configurations (nq,) along a walk from home: at most `count`, fewer where little can
        move. Joint limits are not considered."""
        rng, system, start = np.random.default_rng(seed), self.structure.system, self.structure.held_at
        if not self.is_constrained:
            return [system.integrate(start, rng.normal(size=self.model.nv)) for _ in range(count)]
        parts = subsystems(system)
        walks = [list(closure.closed_walk(part, start[at], count, seed + i)) for i, (part, at) in enumerate(parts)]
        idle = np.ones(self.model.nv)  # joints in no cluster; a single cluster has all joints
        idle[np.concatenate(system.columns)] = 0.0
        many = len(parts) > 1 or bool(self.held)
        configurations, steps = list[Array](), count if many and idle.any() else max(map(len, walks))
        for i in range(steps):
            q = system.integrate(start, idle * rng.normal(size=len(idle)))
            for (_, at), walk in zip(parts, walks, strict=True):
                if walk:
                    q[at] = walk[min(i, len(walk) - 1)]
            configurations.append(q)
        return configurations
