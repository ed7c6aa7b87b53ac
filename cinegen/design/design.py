"""`Design`: a mechanism whose parameters change in place, evaluated at many of their values, with all derivatives.

Notation: C(q, p) = 0 are the loops, X the twist of a node. Columns of parameters are Jacobian columns of frozen joints.
With the singular value decomposition U S V^T of the columns C_m of the joints that move, at the mechanism's rank r,

    dq / dp = -V_r S_r^-1 U_r^T C_p ,    dX / dp = X_p + X_m dq / dp ,    opens = C_p - U_r U_r^T C_p .

`opens` is what the loops can't take up: a mechanism with such an error can't be assembled without force.

q are the readings of encoders. The joints are at x = q + D p, with the offsets D p of their own variables, and loops
and couplings hold there: C(q, p) = c(q + D p, p). So the column of an own variable is that of its joint, c_x D and
X_x D, and a follower follows where its leaders are, not what their encoders read.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import cached_property, partial

import numpy as np
import pinocchio as pin

from cinegen.arrays import Array, ArrayLike, Indices
from cinegen.design._kernels.evaluate import CONSTANT, PX, evaluate_designs
from cinegen.design._kernels.memory import DesignMemory
from cinegen.design.chains import Chain, Chains, chains_of
from cinegen.design.errors import DesignError
from cinegen.design.evaluation import DEPENDENT, DesignEvaluation
from cinegen.design.parameters import Parameters
from cinegen.errors import ClosureError
from cinegen.jit.foreign import frame_of
from cinegen.jit.one_thread import OneThread, in_one_thread
from cinegen.jit.starting import start
from cinegen.joints import supporting_columns
from cinegen.loops.setup import set_up
from raff2urdf import closure

# what the kernel returns, in the order of `DesignEvaluation`
_RESULTS = ("result_q", "gaps", "poses", "all_screws", "all_frames", "motion_screws", "jacobians", "maps")
_BATCH = 2048  # evaluations of one call of the kernel


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
        motions = len(chains.values)
        self._matrix = np.zeros((motions, len(self.names)))  # of all motions by the columns
        self._matrix[: len(parameters.all), : len(parameters)] = parameters.ties.matrix
        self._matrix[len(parameters.all) :, len(parameters) :] = np.eye(len(self.play))
        self._constant = np.append(parameters.ties.constant, np.zeros(len(self.play)))
        own = {i: parameter for i, parameter in enumerate(parameters.all) if parameter.joint}
        self._own_q = [mechanism.q_index(parameter.joint) for parameter in own.values()]
        self._own_constant = self._constant[[*own]] - [parameter.value for parameter in own.values()]
        self._own_matrix = self._matrix[[*own]]
        self._matrix[[*own]] = 0.0
        self._constant[[*own]] = 0.0
        self._by_offsets = np.zeros((mechanism.model.nv, len(self.names)))  # D
        self._by_offsets[[mechanism.v_index(parameter.joint) for parameter in own.values()]] = self._own_matrix
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
        parts, memory, offsets = list[list[Array]](), self._memory, self.offsets(values)
        memory.is_exact, memory.most = int(not near), 12 if near else 100
        motions = values @ self._matrix.T + self._constant
        for first in range(0, count, _BATCH):
            rows = slice(first, min(first + _BATCH, count))
            size = rows.stop - rows.start
            memory.resize(count=size, detailed=size if derivatives else 0)
            memory.point_at("values", np.ascontiguousarray(motions[rows]))
            memory.point_at("starts", np.ascontiguousarray(starts[rows] + offsets[rows]))
            for name in _RESULTS:
                memory.point_at(name, np.zeros(memory.shape(name)))
            self._run(memory.handle)
            parts.append([getattr(memory, name) for name in _RESULTS])
        at, *results = map(np.concatenate, zip(*parts, strict=True))
        return DesignEvaluation(self, values, at - offsets, *results)

    def offsets(self, values: Array) -> Array:
        """Return how far the joints (count, nq) are beyond their encoders' readings, rad and m, at values (count,
        columns)."""
        offsets = np.zeros((len(values), self.mechanism.model.nq))
        offsets[:, self._own_q] = values @ self._own_matrix.T + self._own_constant
        return offsets

    def close(self, p: ArrayLike, q: ArrayLike | None = None) -> Array:
        """Return the closed configuration (nq,) at values of the parameters (columns,), near q (nq,), home by default,
        with the fixed joints at their values there.

        Raises:
            ClosureError: the loops can't be closed there.
        """
        evaluation = self.evaluate(p, q, derivatives=False)
        if not evaluation.gap[0] <= closure.CLOSED:
            raise ClosureError(
                f"{self.mechanism.name} can't be closed at these values of its parameters: its loops remain open by "
                f"{evaluation.gap[0]:.2g} (rad or lengths)"
            )
        return np.array(evaluation.q[0])

    def without_effect(self, nodes: Iterable[str] | None = None, count: int = 5) -> tuple[str, ...]:
        """Return the names of the columns that change neither the pose of a node nor the closed configuration, at
        home and on random closed configurations.

        Args:
            nodes: whose poses count; the end by default.
            count: number of random configurations.
        """
        mechanism = self.mechanism
        wanted = [mechanism.end] if nodes is None else list(nodes)
        evaluation = self.evaluate(q=np.array([mechanism.q_home, *mechanism.random_closed(count)]))
        largest = np.zeros(len(self.names))
        for node in wanted:
            moved = evaluation.pose_derivative(node) / np.repeat([mechanism.length, 1.0], 3)[:, None]
            largest = np.maximum(largest, np.abs(moved).max(axis=(0, 1)))
        largest = np.maximum(largest, np.abs(evaluation.opens).max(axis=(0, 1), initial=0.0)) * self._sizes
        return tuple(name for name, size in zip(self.names, largest, strict=True) if size <= DEPENDENT)

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
        on_path = self._before[chain.joint].copy()
        on_path[_motions(chain)] = 1.0
        return np.asarray(on_path)

    def _rank_of(self, columns: Indices) -> int:
        mechanism = self.mechanism
        if not mechanism.is_constrained:
            return 0
        return max(
            closure.rank(mechanism.structure.system.evaluate(q)[1][:, columns]) for q in mechanism.structure.samples
        )


def _motions(chain: Chain) -> list[int]:
    return [step[1] for step in chain.steps if not isinstance(step, pin.SE3)]
