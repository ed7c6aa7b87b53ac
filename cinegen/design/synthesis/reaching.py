"""A design's node at wanted poses: closed configurations for values of the parameters, and how they change with these.

With the actuated joints' own variables as further columns, the derivative of a quantity f at a wanted pose is

    df / dp = f_p + f_a dq_a / dp ,    dq_a / dp = -X_a^+ X_p ,

where X_p and X_a are the node's twists by the parameters and by the actuated joints, with closed loops.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from cinegen.arrays import Array, Bools, Indices
from cinegen.design.design import Design
from cinegen.design.errors import DesignError
from cinegen.design.evaluation import DesignEvaluation
from cinegen.design.parameters import Parameters
from cinegen.design.synthesis.nearest import nearest
from cinegen.design.synthesis.region import Reach
from cinegen.model.plausible import FAR_TARGET, check_lengths
from raff2urdf import closure

REACHED = 1e-9
"""Distance from a wanted pose within which it is reached, characteristic lengths and rad."""

_FURTHER = 0.6  # rad or characteristic lengths: a joint that moves further may have changed its assembly mode
_SUBDIVISIONS = (1, 4, 16)
_RANK = 1e-6
_SAME = 1e-6  # of a distance


@dataclass(frozen=True, eq=False)
class Reached:
    """A design's node at `count` wanted poses.

    Attributes:
        p: (parameters,) values, m and rad.
        targets: (count, rows) wanted coordinates, m, and rotation vectors from the orientation at home, rad.
        q: (count, nq) closed configurations, the nearest ones where a pose is not reached.
        error: (count, rows) what is missing: m and rad, in the world.
        distance: (count,) its norm, characteristic lengths and rad.
    """

    p: Array
    targets: Array
    q: Array
    error: Array
    distance: Array

    @property
    def is_reached(self) -> Bools:
        """(count,) whether each pose is reached."""
        return np.asarray(self.distance <= REACHED)


class Reaching:
    """Closed configurations of a design with its node at wanted poses.

    Args:
        parameters: free ones, without the variables of joints.
        reach: where the node must get to.
        node: that reaches; the end unless given.
        further: the same parameters, with the actuated joints' own variables.

    Attributes:
        reach: as given, with orientations from that at home.
        node: as given.
        every: the design with all joints free to move.
        design: with the actuated joints' own variables.
        length: characteristic length of the mechanism as written, m, by which lengths are divided.
        weights: (rows,) that make a twist's components dimensionless.

    Raises:
        DesignError: the task wants more or fewer coordinates than the actuated joints move.
    """

    def __init__(self, parameters: Parameters, further: Parameters, reach: Reach, node: str = "") -> None:
        self.parameters = parameters
        self.mechanism = mechanism = parameters.mechanism
        self.node = node or mechanism.end
        check_lengths(mechanism, "reach", [*reach.low.tolist(), *reach.high.tolist()], FAR_TARGET)
        self.every, self.design = Design(parameters, fixed=()), Design(further)
        self.home = self.every.evaluate().placements(self.node)[0]
        self.reach = reach.relative_to(self.home[:3, :3])
        self.length, self.rows = mechanism.length, reach.rows
        names = [further.own_variable(name).name for name in self.design.fixed]
        self.actuated = [further.index(name) for name in names]
        self.free = [further.index(name) for name in parameters.names]
        self._written = further.values.copy()
        self.weights = np.repeat([1.0 / self.length, 1.0], 3)[self.rows]
        evaluation = self.evaluate(parameters.values, np.array([mechanism.q_home]))
        nominal = self.motions(evaluation)[0] * self.weights[:, None]
        u, s, _ = np.linalg.svd(nominal)
        self.rank = int((s > _RANK * s[0]).sum()) if s.size and s[0] > 0.0 else 0
        self._check_coordinates()
        self._basis = u[:, : self.rank]
        self._side = np.sign(np.linalg.det(self._basis.T @ nominal))

    def _check_coordinates(self) -> None:
        joints, axes = len(self.design.fixed), ", ".join(self.reach.axes)
        name, keeps = self.mechanism.name, self.reach.is_oriented
        if self.rank < joints:
            remedy = "another node" if keeps else 'more coordinates, or orientation = "home"'
            raise DesignError(
                f"{name}: the task fixes {axes}{' and the orientation' * keeps} of {self.node}, "
                f"which is {self.rank} coordinates, but {joints} actuated joints move it: give {remedy}"
            )
        if not keeps and self.rank < len(self.rows):
            raise DesignError(
                f"{name}: {self.node} can't be moved along all of {axes} at home: leave out the coordinate that can't "
                "change"
            )

    # --- configurations ------------------------------------------------------------------------------------------

    def from_home(self, p: Array, targets: Array) -> Reached:
        """Return the design at targets (count, rows), continued from the file's values at home: first the node moves
        along straight lines, then the parameters change."""
        written = self.parameters.values
        at_home = np.zeros(len(self.rows))
        at_home[: len(self.reach.axes)] = self.home[self.rows[: len(self.reach.axes)], 3]
        begin = Reached(
            written, at_home[None], np.array([self.mechanism.q_home]), np.zeros((1, len(self.rows))), np.zeros(1)
        )
        starts = Reached(
            written, *(np.repeat(a, len(targets), 0) for a in (begin.targets, begin.q, begin.error, begin.distance))
        )
        across = np.abs((targets - at_home) * self.weights).max(initial=0.0)
        steps = max(2, int(np.ceil(8 * across)))
        for part in np.linspace(0.0, 1.0, steps + 1)[1:]:
            starts = self.continued(starts, written, at_home + part * (targets - at_home))
        if np.array_equal(p, written):
            return starts
        change = np.abs((p - written) / np.where(written == 0.0, self.length, written)).max()
        for part in np.linspace(0.0, 1.0, max(2, int(np.ceil(6 * change))) + 1)[1:]:
            starts = self.continued(starts, written + part * (p - written), targets)
        return starts

    def continued(self, known: Reached, p: Array, targets: Array) -> Reached:
        """Return the design at other values of the parameters and targets, each continued from a known one; steps are
        subdivided where a joint moves far."""
        best: Reached | None = None
        todo = np.arange(len(targets))
        for parts in _SUBDIVISIONS:
            q, now = known.q[todo], None
            for part in np.linspace(0.0, 1.0, parts + 1)[1:]:
                wanted = known.targets[todo] + part * (targets[todo] - known.targets[todo])
                now = self._solve(known.p + part * (p - known.p), wanted, q)
                q = now.q
            assert now is not None
            out_of_reach = np.zeros(len(todo), dtype=bool)
            if best is None:
                best = now
            else:  # as far as before, by another way: nothing comes nearer
                out_of_reach = ~now.is_reached & (np.abs(now.distance - best.distance[todo]) < _SAME * now.distance)
                best.q[todo], best.error[todo], best.distance[todo] = now.q, now.error, now.distance
            moved = np.array([self.mechanism.distance(a, b) for a, b in zip(known.q[todo], q, strict=True)])
            todo = todo[((moved > _FURTHER) | (known.is_reached[todo] & ~now.is_reached)) & ~out_of_reach]
            if not len(todo):
                break
        assert best is not None
        return best

    def _solve(self, p: Array, targets: Array, q: Array) -> Reached:
        def residual(evaluation: DesignEvaluation, at: Indices) -> tuple[Array, Array]:
            columns = evaluation.node_joints(self.node, "world")[:, self.rows] * self.mechanism.scale
            return self._missing(evaluation, targets[at]) * self.weights, columns * self.weights[:, None]

        q, missing, distance = nearest(self.every, p, q, residual)
        return Reached(p, targets, q, missing / self.weights, distance)

    def _missing(self, evaluation: DesignEvaluation, targets: Array) -> Array:
        placements = evaluation.placements(self.node)
        lengths = len(self.reach.axes)
        lack = targets[:, :lengths] - placements[:, self.rows[:lengths], 3]
        if self.reach.is_oriented:
            turns = [
                pin.log3(pin.exp3(target[lengths:]) @ self.home[:3, :3] @ placement[:3, :3].T)
                for target, placement in zip(targets, placements, strict=True)
            ]
            lack = np.hstack([lack, turns])
        return np.asarray(lack)

    def home_with(self, p: Array) -> Array:
        """Return a home (nq,) at other values of the parameters: the file's, continued with the actuated joints at
        rest; where that passes a singularity, or the loops can't be closed so, the configuration at the target in the
        middle."""
        written, q = self.parameters.values, np.array([self.mechanism.q_home])
        change = np.abs((p - written) / np.where(written == 0.0, self.length, written)).max(initial=0.0)
        for part in np.linspace(0.0, 1.0, max(2, int(np.ceil(12 * change))) + 1)[1:]:
            evaluation = self.evaluate(written + part * (p - written), q)
            if evaluation.gap[0] > closure.CLOSED or self.side(evaluation)[0] < 0.0:
                return np.asarray(self.from_home(p, self.reach.middle[None]).q[0])
            q = evaluation.q
        return np.asarray(q[0])

    # --- derivatives ---------------------------------------------------------------------------------------------

    def evaluate(self, p: Array, q: Array, derivatives: bool = True) -> DesignEvaluation:
        """Return the design with the actuated joints at their values in q (count, nq), closed near it."""
        values = self._written.copy()
        values[self.free] = p
        return self.design.evaluate(values, q, derivatives)

    def motions(self, evaluation: DesignEvaluation) -> Array:
        """Return the wanted components (count, rows, actuated) of the node's twist in the world by the actuated
        joints."""
        return evaluation.pose_derivative(self.node, "world")[:, self.rows][:, :, self.actuated]

    def follow(self, evaluation: DesignEvaluation, growth: Array | None = None) -> Array:
        """Return the derivative (count, actuated, parameters) of the actuated joints at wanted poses; with the motion
        `growth` (count, rows) of these, m and rad, a further column by it."""
        twist = evaluation.pose_derivative(self.node, "world")[:, self.rows] * self.weights[:, None]
        wanted = -twist[:, :, self.free]
        if growth is not None:
            wanted = np.concatenate([wanted, (growth * self.weights)[:, :, None]], axis=2)
        return np.asarray(np.linalg.pinv(twist[:, :, self.actuated], rcond=1e-10) @ wanted)

    def side(self, evaluation: DesignEvaluation) -> Array:
        """Return 1 (count,) where no singularity lies between home and a configuration by the sign of the determinant
        of the node's motions, or -1."""
        by_joint = self._basis.T @ (self.motions(evaluation) * self.weights[:, None])
        return np.asarray(np.where(np.sign(np.linalg.det(by_joint)) == self._side, 1.0, -1.0))
