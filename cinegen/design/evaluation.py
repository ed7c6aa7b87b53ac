"""A design evaluated at configurations: poses, screws, and their derivatives by all parameters."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from cinegen.arrays import Array
from cinegen.design.errors import DesignError
from cinegen.errors import UnknownNameError
from raff2urdf import closure
from raff2urdf.errors import counted

if TYPE_CHECKING:
    from cinegen.design.design import Design

DEPENDENT = 1e-9
"""A column of the loops below this fraction of the largest opens nothing."""


@dataclass(frozen=True, eq=False)
class DesignEvaluation:
    """A design at `count` pairs of parameters and configurations.

    Twists are linear above angular, m and rad; columns of the design are its free parameters, then play.

    Attributes:
        design: the design.
        p: (count, columns) values, m and rad.
        q: (count, nq) closed configurations, as encoders read them.
        gap: (count,) largest residual of the loops, rad or characteristic lengths.
        poses: (count, nodes, 4, 3) three axes and the origin of each node; see `placements`.
        all_screws: (count, nv, 6) joints' columns: velocity of the point at the world's origin, angular velocity.
        all_frames: (count, joints, 4, 3) of the model.
        motion_screws: (count, motions, 6) columns of all elementary motions.
        jacobians: (count, rows, nv) of the loops, dimensionless.
        maps: (count, rows, 6) rows of the loops by the twist of the loop's second end relative to the first.
    """

    design: Design
    p: Array
    q: Array
    gap: Array
    poses: Array
    all_screws: Array
    all_frames: Array
    motion_screws: Array
    jacobians: Array
    maps: Array

    def __len__(self) -> int:
        return len(self.p)

    def __repr__(self) -> str:
        closed = int((self.gap <= closure.CLOSED).sum())
        return f"<DesignEvaluation of {self.design.mechanism.name}: {counted(len(self), 'pair')}, {closed} closed>"

    def placements(self, node: str) -> Array:
        """Return the poses (count, 4, 4) of a node in the world, m."""
        frames = self.poses[:, self._node(node)]
        placements = np.zeros((len(self), 4, 4))
        placements[:, :3], placements[:, 3, 3] = np.swapaxes(frames, 1, 2), 1.0
        return placements

    # --- loops ---------------------------------------------------------------------------------------------------

    @cached_property
    def loop_joints(self) -> Array:
        """(count, rows, nv) derivative of the loops' residual, dimensionless, by joints, rad and m."""
        return np.asarray(self.jacobians / self.design.mechanism.scale)

    @cached_property
    def loop_parameters(self) -> Array:
        """(count, rows, columns) derivative of the loops' residual, dimensionless, by the parameters, m and rad."""
        design = self.design
        derivative = np.zeros((len(self), design.mechanism.structure.system.rows, len(design.names)))
        for i in range(len(design._before_ends)):
            first, second = design._before_ends[i]
            rows = np.flatnonzero(design._loop_of_row == i)
            used = np.flatnonzero(second - first)
            twists = self.motion_screws[:, used] * (second - first)[used, None]
            by_motion = self.maps[:, rows] @ np.swapaxes(twists, 1, 2)
            derivative[:, rows] = by_motion @ design._matrix[used]
        return np.asarray(derivative + self.loop_joints @ design._by_offsets)

    @cached_property
    def _decomposed(self) -> tuple[Array, Array, Array]:
        """U (count, rows, r), 1 / S (count, r) and V^T (count, r, moving) of the joints that move, dimensionless."""
        design = self.design
        u, s, vt = np.linalg.svd(self.jacobians[:, :, design.moving], full_matrices=False)
        r = design.rank
        with np.errstate(divide="ignore"):
            return u[:, :, :r], 1.0 / s[:, :r], vt[:, :r]

    def compensate(self, rows: Array) -> Array:
        """Return the motion (count, nv, .) of the joints that move, rad and m, which removes changes (count, rows, .)
        of the loops' residual, as far as they can be removed."""
        design = self.design
        motion = np.zeros((len(self), design.mechanism.model.nv, rows.shape[2]))
        if design.rank:
            u, inverse, vt = self._decomposed
            motions = np.swapaxes(vt, 1, 2) @ (inverse[:, :, None] * (np.swapaxes(u, 1, 2) @ rows))
            motion[:, design.moving] = -motions * design.mechanism.scale[design.moving, None]
        return motion

    @cached_property
    def joint_derivative(self) -> Array:
        """(count, nv, columns) derivative of the closed configuration by the parameters, the fixed joints at rest; rad
        and m by m and rad."""
        return self.compensate(self.loop_parameters)

    @cached_property
    def opens(self) -> Array:
        """(count, rows, columns) what remains open of the loops, dimensionless, by the parameters, m and rad: nonzero
        where a mechanism with such an error can't be assembled without force."""
        u = self._decomposed[0]
        return self.loop_parameters - u @ (np.swapaxes(u, 1, 2) @ self.loop_parameters)

    @cached_property
    def opening(self) -> tuple[str, ...]:
        """Names of the columns whose change opens loops, in any of the pairs."""
        sizes = np.abs(self.opens).max(axis=(0, 1), initial=0.0) * self.design._sizes
        names = zip(self.design.names, sizes, strict=True)
        return tuple(name for name, size in names if size > DEPENDENT)

    # --- nodes ---------------------------------------------------------------------------------------------------

    def node_joints(self, node: str, axes: str = "node") -> Array:
        """Return the Jacobian (count, 6, nv) of a node by the joints.

        Args:
            node: its name.
            axes: "node" for its own axes, "world" for the world's; at its origin.
        """
        return self._seen(node, self.all_screws * self.supports(node)[:, None], axes)

    def supports(self, node: str) -> Array:
        """Return (nv,) 1 for the joints that move a node with all others at rest, else 0."""
        return np.asarray(self.design._joints_before[self.design._chains.nodes[self._name(node)].joint])

    def node_parameters(self, node: str, axes: str = "node") -> Array:
        """Return the derivative (count, 6, columns) of a node's pose by the parameters, all readings at rest."""
        before = self.design._before_node[self._name(node)]
        by_motions = self._seen(node, self.motion_screws * before[:, None], axes) @ self.design._matrix
        return np.asarray(by_motions + self.node_joints(node, axes) @ self.design._by_offsets)

    def pose_derivative(self, node: str, axes: str = "node") -> Array:
        """Return the derivative (count, 6, columns) of a node's pose by the parameters, with closed loops and the fixed
        joints at rest: a twist in the node's own axes, or the world's, at its origin; m and rad by m and rad.

        Raises:
            UnknownNameError: no such node.
        """
        return self.node_parameters(node, axes) + self.node_joints(node, axes) @ self.joint_derivative

    def _seen(self, node: str, screws: Array, axes: str) -> Array:
        """Return screws (count, n, 6) as columns (count, 6, n) at a node's origin."""
        frame = self.poses[:, self._node(node)]
        linear = screws[..., :3] + np.cross(screws[..., 3:], frame[:, None, 3])
        if axes == "world":
            return np.swapaxes(np.concatenate([linear, screws[..., 3:]], axis=2), 1, 2)
        if axes != "node":
            raise DesignError(f"axes are 'node' or 'world', not {axes!r}")
        turn = frame[:, :3]  # rows are the node's axes
        return np.concatenate([turn @ np.swapaxes(linear, 1, 2), turn @ np.swapaxes(screws[..., 3:], 1, 2)], axis=1)

    def _name(self, node: str) -> str:
        if node not in self.design.mechanism.nodes:
            raise UnknownNameError("node", node, self.design.mechanism.nodes)
        return node

    def _node(self, node: str) -> int:
        return self.design.mechanism.nodes.index(self._name(node))

    # --- second order --------------------------------------------------------------------------------------------

    def amplification(self, node: str) -> Array:
        """Return the Jacobian (count, 6, fixed) of a node in its own axes by the fixed joints, those of `Design.fixed`
        in their order, with closed loops."""
        fixed = self._fixed_columns
        jacobian = self.node_joints(node)
        return np.asarray(jacobian[:, :, fixed] + jacobian @ self.follow)

    @cached_property
    def _fixed_columns(self) -> list[int]:
        return [self.design.mechanism.v_index(name) for name in self.design.fixed]

    @cached_property
    def follow(self) -> Array:
        """(count, nv, fixed) motions of the joints that move by those of the fixed ones, which are 0 here."""
        return self.compensate(self.loop_joints[:, :, self._fixed_columns])

    def amplification_derivative(self, node: str) -> Array:
        """Return the derivative (count, 6, fixed, columns) of `amplification` by the parameters, along closed loops.

        A column s of a joint changes by the Lie bracket [V, s] with the twist V of the body that carries it.
        """
        count, columns = len(self), len(self.design.names)
        moved = self.screw_derivative - bracket(self.node_twists(node)[:, :, None], self.all_screws[:, None])
        moved *= self.supports(node)[:, None]
        changed = self._seen(node, moved.reshape(count, -1, 6), "node").reshape(count, 6, columns, moved.shape[2])
        changed = np.swapaxes(changed, 1, 2)  # (count, columns, 6, nv)
        total = changed[..., self._fixed_columns] + changed @ self.follow[:, None]
        return np.moveaxis(total + self.node_joints(node)[:, None] @ self.follow_derivative, 1, 3)

    def node_twists(self, node: str) -> Array:
        """Return the twists (count, columns, 6) with which a node moves by the parameters, loops closed: velocity of
        the point at the world's origin, angular velocity."""
        chain = self.design._chains.nodes[self._name(node)]
        joints, before = self.design._joints_before[chain.joint], self.design._before_node[node]
        return self._twists(joints[None], before[None])[:, :, 0]

    def _twists(self, joints: Array, before: Array) -> Array:
        """Return the twists (count, columns, ., 6) of bodies behind joints (., nv) and motions (., motions)."""
        by_joints = self._joint_motion[:, :, None] * joints  # (count, columns, ., nv)
        by_motions = self.design._matrix.T[:, None] * before  # (columns, ., motions)
        moved = by_joints @ self.all_screws[:, None] + by_motions @ self.motion_screws[:, None]
        return np.asarray(moved)

    @cached_property
    def _joint_motion(self) -> Array:
        """(count, columns, nv) motion of the joints, readings and offsets, by the parameters, loops closed."""
        return np.swapaxes(self.joint_derivative + self.design._by_offsets, 1, 2)

    @cached_property
    def _bodies(self) -> Array:
        """(count, columns, nv, 6) twists of the bodies that carry the joints' columns."""
        design = self.design
        return self._twists(design._joints_before, design._before)[:, :, design._joint_of]

    @cached_property
    def screw_derivative(self) -> Array:
        """(count, columns, nv, 6) derivative of `all_screws` by the parameters, loops closed."""
        return bracket(self._bodies, self.all_screws[:, None])

    @cached_property
    def follow_derivative(self) -> Array:
        """(count, columns, nv, fixed) derivative of `follow` by the parameters, loops closed."""
        count, columns, fixed = len(self), len(self.design.names), len(self.design.fixed)
        rows = self._loop_derivative()
        lack = rows[..., self._fixed_columns] + rows @ self.follow[:, None]  # (count, columns, rows, fixed)
        flat = np.swapaxes(lack, 1, 2).reshape(count, lack.shape[2], columns * fixed)
        return np.swapaxes(self.compensate(flat).reshape(count, self.all_screws.shape[1], columns, fixed), 1, 2)

    def _loop_derivative(self) -> Array:
        """Return the derivative (count, columns, rows, nv) of `loop_joints` along closed loops."""
        design, system, motion = self.design, self.design.mechanism.structure.system, self._joint_motion
        screws, at = self.all_screws[:, None], self.q + design.offsets(self.p)
        derivative = np.zeros((len(self), len(design.names), system.rows, screws.shape[2]))
        if len(system.loops):
            first = self._twists(design._joints_before_ends[:, 0], design._before_ends[:, 0])
        for i in range(len(system.loops)):
            rows = np.flatnonzero(design._loop_of_row == i)
            moved = bracket(self._bodies - first[:, :, i, None], screws) * system.signs[i][:, None]
            derivative[:, :, rows] = self.maps[:, None, rows] @ np.swapaxes(moved, 2, 3)
        row = system.rows - len(system.couplings)
        for coupling, size in zip(system.couplings, system.coupling_sizes, strict=True):
            for name, coefficients in coupling.terms.items():
                v, x = design.mechanism.v_index(name), at[:, design.mechanism.q_index(name)]
                second = sum(k * (k - 1) * c * x ** (k - 2) for k, c in enumerate(coefficients, 1) if k > 1)
                derivative[:, :, row, v] = np.broadcast_to(second, len(self))[:, None] / size * motion[:, :, v]
            row += 1
        return derivative

    def singular_values(
        self, node: str, rows: slice | Sequence[int] = slice(None), length: float | None = None
    ) -> tuple[Array, Array]:
        """Return the singular values of a node's `amplification`, largest first, and their derivatives.

        Args:
            node: its name.
            rows: components of its twist that count: `slice(0, 3)` for translations.
            length: by which lengths are divided; the characteristic length of the mechanism as written unless given.

        Returns:
            (count, k), and their derivatives (count, k, columns) by the parameters, m and rad. That of equal singular
            values is the one of the vectors that the decomposition has chosen.
        """
        design = self.design
        length = design.mechanism.length if length is None else length
        prismatic = [design.mechanism.is_prismatic(name) for name in design.fixed]
        left = np.repeat([1.0 / length, 1.0], 3)[rows]
        right = np.where(prismatic, length, 1.0)
        scaled = self.amplification(node)[:, rows] * left[:, None] * right
        u, s, vt = np.linalg.svd(scaled, full_matrices=False)
        changed = self.amplification_derivative(node)[:, rows] * left[:, None, None] * right[:, None]
        return s, np.asarray(np.einsum("crk,crfp,ckf->ckp", u, changed, vt, optimize=True))


def bracket(a: Array, b: Array) -> Array:
    """Return the Lie brackets (..., 6) of twists (..., 6): the change of b that moves with the motion a."""
    linear = np.cross(a[..., 3:], b[..., :3]) + np.cross(a[..., :3], b[..., 3:])
    return np.concatenate([linear, np.cross(a[..., 3:], b[..., 3:])], axis=-1)
