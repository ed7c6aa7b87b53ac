"""`Design`: a mechanism whose parameters change in place, evaluated at many of their values, with all derivatives.

Notation: C(q, p) = 0 are the loops, X the twist of a node. Columns of parameters are Jacobian columns of frozen joints.
With the singular value decomposition U S V^T of the columns C_m of the joints that move, at the mechanism's rank r,

    dq / dp = -V_r S_r^-1 U_r^T C_p ,    dX / dp = X_p + X_m dq / dp ,    opens = C_p - U_r U_r^T C_p .

`opens` is what the loops can't take up: a mechanism with such an error can't be assembled without force.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np
import pinocchio as pin

from cinegen.arrays import Array, ArrayLike, Indices
from cinegen.design._kernels.evaluate import CONSTANT, PX, evaluate_designs
from cinegen.design._kernels.memory import DesignMemory
from cinegen.design.chains import Chain, Chains, chains_of
from cinegen.design.errors import DesignError
from cinegen.design.parameters import Parameters
from cinegen.errors import ClosureError, UnknownNameError
from cinegen.jit.foreign import frame_of
from cinegen.jit.one_thread import OneThread, in_one_thread
from cinegen.jit.starting import start
from cinegen.joints import supporting_columns
from cinegen.loops.arrays import set_up
from raff2urdf import closure

# what the kernel returns, in the order of `DesignEvaluation`
_RESULTS = ("result_q", "gaps", "poses", "all_screws", "all_frames", "motion_screws", "jacobians", "maps")
_BATCH = 2048  # evaluations of one call of the kernel
_DEPENDENT = 1e-9  # a column of the loops below this fraction of the largest opens nothing


class Design(OneThread):
    """A mechanism whose parameters change in place: placements, closed loops and derivatives at any of their values.

    For one thread at a time. Lengths are divided by the characteristic length of the mechanism as written, at all
    values of the parameters.

    Args:
        parameters: the free ones, and the mechanism.
        play: joints or loops by name, each with a component (x, y, z, rx, ry, rz) of play that varies, too. Their
            columns come after those of the parameters.
        fixed: joints that keep their values when loops are closed; the actuated ones unless given.

    Attributes:
        parameters: as given.
        mechanism: as the file describes it.
        play: as given.
        names: of all columns: the free parameters, then of play, such as `joint3.x`.
        fixed: names of the fixed joints.

    Raises:
        UnknownNameError: no such joint.
        DesignError: no such joint or loop to have play.
    """

    def __init__(
        self, parameters: Parameters, play: Sequence[tuple[str, str]] = (), fixed: Iterable[str] | None = None
    ) -> None:
        self.parameters, self.mechanism, self.play = parameters, parameters.mechanism, tuple(play)
        mechanism = self.mechanism
        self.names = (*parameters.names, *(f"{name}.{component}" for name, component in self.play))
        self.fixed = mechanism.actuated if fixed is None else tuple(fixed)
        self.moving = np.setdiff1d(np.arange(mechanism.model.nv), [mechanism.v_index(name) for name in self.fixed])
        if mechanism.floating:
            self.moving = self.moving[self.moving >= 6]
        self._chains = chains = chains_of(parameters, self.play)
        motions, own = len(chains.values), np.array([bool(one.joint) for one in parameters.all])
        self._matrix = np.zeros((motions, len(self.names)))  # of all motions by the columns
        self._matrix[: len(parameters.all), : len(parameters)] = parameters.ties.matrix
        self._matrix[len(parameters.all) :, len(parameters) :] = np.eye(len(self.play))
        written = np.array([one.value for one in parameters.all])
        self._constant = np.append(parameters.ties.constant - np.where(own, written, 0.0), np.zeros(len(self.play)))
        self._memory = self._set_up(chains)
        self._run = start(evaluate_designs, DesignMemory, install=partial(setattr, self, "_run"))
        system = mechanism.structure.system
        self._count_motions(chains)
        self.rank = self._rank_of(self.moving)
        self._loop_of_row = np.repeat(np.arange(len(system.loops)), [loop.rows for loop in system.loops])

    def __reduce__(self) -> tuple[type[Design], tuple[object, ...]]:
        return type(self), (self.parameters, self.play, self.fixed)

    def __repr__(self) -> str:
        return f"<Design of {self.mechanism.name}: {len(self.names)} parameters>"

    @cached_property
    def values(self) -> Array:
        """(columns,) the values in the file, of parameters, and of play 0."""
        return np.append(self.parameters.values, np.zeros(len(self.play)))

    @in_one_thread
    def evaluate(
        self, p: ArrayLike | None = None, q: ArrayLike | None = None, derivatives: bool = True, *, near: bool = False
    ) -> DesignEvaluation:
        """Close the loops at values of the parameters, with the fixed joints at their values in q.

        Args:
            p: (columns,) or (count, columns) values, m and rad; play may be left out, and is 0 then. Those of the file
                unless given.
            q: (nq,) or (count, nq) where closing begins, in the fixed joints' values; home unless given.
            derivatives: whether the derivatives are computed.
            near: the loops are nearly closed at q: equations that depend on others in the nominal mechanism are counted
                as dependent, which is faster.

        Returns:
            of `count` pairs; those whose loops can't be closed have a `gap` above 1e-10.

        Raises:
            DesignError: wrong shapes, or numbers that are not finite.
        """
        values, starts = self._pairs(p, q)
        count = len(values)
        parts, memory = list[list[Array]](), self._memory
        memory.is_exact, memory.most = int(not near), 12 if near else 100
        motions = values @ self._matrix.T + self._constant
        for first in range(0, count, _BATCH):
            rows = slice(first, min(first + _BATCH, count))
            size = rows.stop - rows.start
            memory.resize(count=size, detailed=size if derivatives else 0)
            memory.point_at("values", np.ascontiguousarray(motions[rows]))
            memory.point_at("starts", np.ascontiguousarray(starts[rows]))
            for name in _RESULTS:
                memory.point_at(name, np.zeros(memory.shape(name)))
            self._run(memory.handle)
            parts.append([getattr(memory, name) for name in _RESULTS])
        return DesignEvaluation(self, values, *map(np.concatenate, zip(*parts, strict=True)))

    def close(self, p: ArrayLike, q: ArrayLike | None = None) -> Array:
        """Return the closed configuration (nq,) at values of the parameters (columns,), near q (nq,), home by default,
        with the fixed joints at their values there.

        Raises:
            ClosureError: the loops can't be closed there.
        """
        found = self.evaluate(p, q, derivatives=False)
        if not found.gap[0] <= closure.CLOSED:
            raise ClosureError(
                f"{self.mechanism.name} can't be closed at these values of its parameters: its loops remain open by "
                f"{found.gap[0]:.2g} (rad or lengths)"
            )
        return np.array(found.q[0])

    def without_effect(self, nodes: Iterable[str] | None = None, count: int = 5) -> tuple[str, ...]:
        """Return the names of the columns that change neither the pose of a node nor the closed configuration, at
        home and on random closed configurations.

        Args:
            nodes: whose poses count; the end by default.
            count: number of random configurations.
        """
        mechanism = self.mechanism
        wanted = [mechanism.end] if nodes is None else list(nodes)
        here = self.evaluate(q=np.array([mechanism.q_home, *mechanism.random_closed(count)]))
        largest = np.zeros(len(self.names))
        for node in wanted:
            moved = here.pose_derivative(node) / np.repeat([mechanism.length, 1.0], 3)[:, None]
            largest = np.maximum(largest, np.abs(moved).max(axis=(0, 1)))
        largest = np.maximum(largest, np.abs(here.opens).max(axis=(0, 1), initial=0.0)) * self._sizes
        return tuple(name for name, size in zip(self.names, largest, strict=True) if size <= _DEPENDENT)

    @cached_property
    def _sizes(self) -> Array:
        """(columns,) one dimensionless step of each: the characteristic length for lengths."""
        length = self.mechanism.length
        return np.append(self.parameters.sizes, [1.0 if word.startswith("r") else length for _, word in self.play])

    # --- setting up ----------------------------------------------------------------------------------------------

    def _pairs(self, p: ArrayLike | None, q: ArrayLike | None) -> tuple[Array, Array]:
        values = np.atleast_2d(np.asarray(self.values if p is None else p, dtype=float))
        starts = np.atleast_2d(np.asarray(self.mechanism.q_home if q is None else q, dtype=float))
        if values.ndim == 2 and values.shape[1] == len(self.parameters) < len(self.names):
            values = np.hstack([values, np.zeros((len(values), len(self.play)))])
        nq = self.mechanism.model.nq
        if values.ndim != 2 or values.shape[1] != len(self.names) or starts.ndim != 2 or starts.shape[1] != nq:
            raise DesignError(
                f"{self!r} takes values (count, {len(self.names)}) and configurations (count, {nq}), not "
                f"{values.shape} and {starts.shape}"
            )
        count = max(len(values), len(starts))
        if {len(values), len(starts)} - {1, count}:
            raise DesignError(f"{len(values)} values of the parameters, but {len(starts)} configurations")
        if not np.isfinite(values).all() or not np.isfinite(starts).all():
            raise DesignError("values of parameters and configurations must be finite numbers")
        return np.broadcast_to(values, (count, values.shape[1])), np.broadcast_to(starts, (count, nq))

    def _set_up(self, chains: Chains) -> DesignMemory:
        mechanism = self.mechanism
        memory = set_up(DesignMemory(), mechanism.structure.system, mechanism.cluster_ranks)
        targets = [chains.joints[j] for j in range(1, mechanism.model.njoints)]
        targets += [end for ends in chains.ends for end in ends]
        targets += [chains.nodes[node] for node in mechanism.nodes]
        rows, constants, first = list[tuple[int, int, int]](), list[Array](), [0]
        met: dict[int, int] = {}  # joints that carry the motions' axes
        for chain in targets:
            for step in chain.steps:
                if isinstance(step, pin.SE3):
                    rows.append((CONSTANT, len(constants), 0))
                    constants.append(frame_of(step))
                else:
                    rows.append((*step, int(step[1] not in met)))
                    met.setdefault(step[1], chain.joint)
            first.append(len(rows))
        memory.resize(
            motions=len(chains.values), steps_of_chains=len(rows), targets=len(targets), target_ends=len(first),
            constants=len(constants), outputs=len(mechanism.nodes),
        )  # fmt: skip
        memory.chain_first[:] = first
        if rows:
            memory.step_kind[:], memory.step_index[:], memory.step_records[:] = np.array(rows).T
        if constants:
            memory.constant[:] = constants
        memory.node_joint[:] = [chains.nodes[node].joint for node in mechanism.nodes]
        for k, joint in met.items():
            memory.motion_joint[k] = joint
        memory.motion_slides[:] = [int(kind >= PX) for kind in chains.kinds]
        memory.locked[:] = 1.0
        memory.locked[self.moving] = 0.0
        memory.tolerance = closure.ROUNDING
        return memory

    def _count_motions(self, chains: Chains) -> None:
        """Find which motions precede which joints, nodes and ends of loops."""
        model, motions = self.mechanism.model, len(chains.values)
        self._before = np.zeros((model.njoints, motions))  # motions before each joint
        for j in range(1, model.njoints):
            self._before[j] = self._before[chains.joints[j].joint]
            self._before[j, _motions(chains.joints[j])] = 1.0
        self._before_node = {node: self._on_path(chain) for node, chain in chains.nodes.items()}
        ends = [tuple(self._on_path(end) for end in pair) for pair in chains.ends]
        self._before_ends = np.array(ends).reshape(len(ends), 2, motions)
        system = self.mechanism.structure.system
        supports = [[supporting_columns(model, joint) for joint in anchor[::2]] for anchor in system.anchors]
        self._joints_before_ends = np.array(supports).reshape(len(system.anchors), 2, model.nv)
        self._joints_before = np.array([supporting_columns(model, j) for j in range(model.njoints)])
        self._joint_of = np.repeat(np.arange(model.njoints), list(model.nvs))

    def _on_path(self, chain: Chain) -> Array:
        found = self._before[chain.joint].copy()
        found[_motions(chain)] = 1.0
        return np.asarray(found)

    def _rank_of(self, columns: Indices) -> int:
        mechanism = self.mechanism
        if not mechanism.is_constrained:
            return 0
        return max(
            closure.rank(mechanism.structure.system.evaluate(q)[1][:, columns]) for q in mechanism.structure.samples
        )


def _motions(chain: Chain) -> list[int]:
    return [step[1] for step in chain.steps if not isinstance(step, pin.SE3)]


@dataclass(frozen=True, eq=False)
class DesignEvaluation:
    """A design at `count` pairs of parameters and configurations.

    Twists are linear above angular, m and rad; columns of the design are its free parameters, then play.

    Attributes:
        design: the design.
        p: (count, columns) values, m and rad.
        q: (count, nq) closed configurations.
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
        return f"<DesignEvaluation of {self.design.mechanism.name}: {len(self)} pairs, {closed} closed>"

    def placements(self, node: str) -> Array:
        """Return the poses (count, 4, 4) of a node in the world, m."""
        frames = self.poses[:, self._node(node)]
        found = np.zeros((len(self), 4, 4))
        found[:, :3], found[:, 3, 3] = np.swapaxes(frames, 1, 2), 1.0
        return found

    # --- loops ---------------------------------------------------------------------------------------------------

    @cached_property
    def loop_joints(self) -> Array:
        """(count, rows, nv) derivative of the loops' residual, dimensionless, by joints, rad and m."""
        return np.asarray(self.jacobians / self.design.mechanism.scale)

    @cached_property
    def loop_parameters(self) -> Array:
        """(count, rows, columns) derivative of the loops' residual, dimensionless, by the parameters, m and rad."""
        design = self.design
        found = np.zeros((len(self), design.mechanism.structure.system.rows, len(design.names)))
        for i in range(len(design._before_ends)):
            first, second = design._before_ends[i]
            rows = np.flatnonzero(design._loop_of_row == i)
            used = np.flatnonzero(second - first)
            twists = self.motion_screws[:, used] * (second - first)[used, None]
            by_motion = self.maps[:, rows] @ np.swapaxes(twists, 1, 2)
            found[:, rows] = by_motion @ design._matrix[used]
        return found

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
        found = np.zeros((len(self), design.mechanism.model.nv, rows.shape[2]))
        if design.rank:
            u, inverse, vt = self._decomposed
            motions = np.swapaxes(vt, 1, 2) @ (inverse[:, :, None] * (np.swapaxes(u, 1, 2) @ rows))
            found[:, design.moving] = -motions * design.mechanism.scale[design.moving, None]
        return found

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
        return tuple(name for name, size in names if size > _DEPENDENT)

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
        """Return the derivative (count, 6, columns) of a node's pose by the parameters, all joints at rest."""
        before = self.design._before_node[self._name(node)]
        return self._seen(node, self.motion_screws * before[:, None], axes) @ self.design._matrix

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
        own = frame[:, :3]  # rows are the node's axes
        return np.concatenate([own @ np.swapaxes(linear, 1, 2), own @ np.swapaxes(screws[..., 3:], 1, 2)], axis=1)

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
        own = self._fixed_columns
        jacobian = self.node_joints(node)
        return np.asarray(jacobian[:, :, own] + jacobian @ self.follow)

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
        by_joints = np.swapaxes(self.joint_derivative, 1, 2)[:, :, None] * joints  # (count, columns, ., nv)
        by_motions = self.design._matrix.T[:, None] * before  # (columns, ., motions)
        moved = by_joints @ self.all_screws[:, None] + by_motions @ self.motion_screws[:, None]
        return np.asarray(moved)

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
        design, system, motion = (
            self.design,
            self.design.mechanism.structure.system,
            np.swapaxes(self.joint_derivative, 1, 2),
        )
        screws = self.all_screws[:, None]
        found = np.zeros((len(self), len(design.names), system.rows, screws.shape[2]))
        if len(system.loops):
            first = self._twists(design._joints_before_ends[:, 0], design._before_ends[:, 0])
        for i in range(len(system.loops)):
            rows = np.flatnonzero(design._loop_of_row == i)
            moved = bracket(self._bodies - first[:, :, i, None], screws) * system.signs[i][:, None]
            found[:, :, rows] = self.maps[:, None, rows] @ np.swapaxes(moved, 2, 3)
        row = system.rows - len(system.couplings)
        for coupling, size in zip(system.couplings, system.coupling_sizes, strict=True):
            for name, coefficients in coupling.terms.items():
                v, x = design.mechanism.v_index(name), self.q[:, design.mechanism.q_index(name)]
                second = sum(k * (k - 1) * c * x ** (k - 2) for k, c in enumerate(coefficients, 1) if k > 1)
                found[:, :, row, v] = np.broadcast_to(second, len(self))[:, None] / size * motion[:, :, v]
            row += 1
        return found

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
