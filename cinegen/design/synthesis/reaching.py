"""A design's node at wanted poses: closed configurations for values of the parameters, and how they change with these.

With the actuated joints' own variables as further columns, the derivative of a quantity f at a wanted pose is

    df / dp = f_p + f_a dq_a / dp ,    dq_a / dp = -X_a^+ X_p ,

where X_p and X_a are the node's twists by the parameters and by the actuated joints, with closed loops.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from cinegen.design.design import Design, DesignEvaluation
from cinegen.design.errors import DesignError
from cinegen.design.parameters import Parameters
from cinegen.design.synthesis.task import Reach
from cinegen.errors import UnknownNameError
from raff2urdf import closure

Array = NDArray[np.float64]

REACHED = 1e-9
"""Distance from a wanted pose within which it is reached, characteristic lengths and rad."""

_LARGEST_STEP = 0.3  # rad or characteristic lengths, of all joints in one step
_MOST_STEPS = 40
_DAMPING, _LEAST_DAMPING = 1e-9, 1e-13
_FURTHER = 0.6  # rad or characteristic lengths: a joint that moves further may have changed its assembly mode
_SUBDIVISIONS = (1, 4, 16)
_RANK = 1e-6
_STATIONARY = 1e-7  # gradient of a distance, in which no step comes nearer


@dataclass(frozen=True, eq=False)
class Reached:
    """A design's node at `count` wanted poses.

    Attributes:
        p: (parameters,) values, m and rad.
        targets: (count, axes) wanted coordinates, m.
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
    def is_reached(self) -> NDArray[np.bool_]:
        """(count,) whether each pose is reached."""
        return np.asarray(self.distance <= REACHED)


class Reaching:
    """Closed configurations of a design with its node at wanted poses.

    Args:
        parameters: free ones, without the variables of joints.
        reach: which coordinates are wanted.
        node: that reaches; the end unless given.
        further: the same parameters, with the actuated joints' own variables.

    Attributes:
        node: as given.
        length: characteristic length of the mechanism as written, m, by which lengths are divided.

    Raises:
        DesignError: the task wants more or fewer coordinates than the actuated joints move.
    """

    def __init__(self, parameters: Parameters, further: Parameters, reach: Reach, node: str = "") -> None:
        self.parameters, self.reach = parameters, reach
        self.mechanism = mechanism = parameters.mechanism
        self.node = node or mechanism.end
        if self.node not in mechanism.nodes:
            raise UnknownNameError("node", self.node, mechanism.nodes)
        self.length, self.rows = mechanism.length, reach.rows
        self._every, self.design = Design(parameters, fixed=()), Design(further)
        names = [further.own_variable(name).name for name in self.design.fixed]
        self.own = [further.index(name) for name in names]
        self.free = [further.index(name) for name in parameters.names]
        self._written = further.values.copy()
        self._weights = np.repeat([1.0 / self.length, 1.0], 3)[self.rows]
        home = self._every.evaluate()
        self.home = home.placements(self.node)[0]
        here = self.evaluate(parameters.values, np.array([mechanism.q_home]))
        nominal = self.motions(here)[0] * self._weights[:, None]
        u, s, _ = np.linalg.svd(nominal)
        self.rank = int((s > _RANK * s[0]).sum()) if s.size and s[0] > 0.0 else 0
        self._check_coordinates()
        self._basis = u[:, : self.rank]
        self._side = np.sign(np.linalg.det(self._basis.T @ nominal))

    def _check_coordinates(self) -> None:
        joints, axes = len(self.design.fixed), ", ".join(self.reach.axes)
        name, keeps = self.mechanism.name, self.reach.keeps_orientation
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
        """Return the design at targets (count, axes), continued from the file's values at home: first the parameters
        change, then the node moves along straight lines."""
        written = self.parameters.values
        at_home = self.home[[self.rows[i] for i in range(len(self.reach.axes))], 3]
        begin = Reached(
            written, at_home[None], np.array([self.mechanism.q_home]), np.zeros((1, len(self.rows))), np.zeros(1)
        )
        starts = Reached(
            written, *(np.repeat(a, len(targets), 0) for a in (begin.targets, begin.q, begin.error, begin.distance))
        )
        across = np.abs(targets - at_home).max(initial=0.0) / self.length
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
        found: Reached | None = None
        todo = np.arange(len(targets))
        for parts in _SUBDIVISIONS:
            q, now = known.q[todo], None
            for part in np.linspace(0.0, 1.0, parts + 1)[1:]:
                here = known.targets[todo] + part * (targets[todo] - known.targets[todo])
                now = self._solve(known.p + part * (p - known.p), here, q)
                q = now.q
            assert now is not None
            if found is None:
                found = now
            else:
                found.q[todo], found.error[todo], found.distance[todo] = now.q, now.error, now.distance
            moved = np.array([self.mechanism.distance(a, b) for a, b in zip(known.q[todo], q, strict=True)])
            todo = todo[(moved > _FURTHER) | (known.is_reached[todo] & ~now.is_reached)]
            if not len(todo):
                break
        assert found is not None
        return found

    def _solve(self, p: Array, targets: Array, q: Array) -> Reached:
        """Return the nearest closed configurations by damped Newton steps among closed ones."""
        count, q = len(targets), q.copy()
        scale, integrate = self.mechanism.scale, self.mechanism.system.integrate
        error, distance = np.zeros((count, len(self.rows))), np.full(count, np.inf)
        active, damping = np.arange(count), np.full(count, _DAMPING)
        best = q.copy()
        for _ in range(_MOST_STEPS):
            here = self._every.evaluate(p, q[active])
            missing = self._missing(here, targets[active])
            size = np.linalg.norm(missing * self._weights, axis=1)
            size = np.where(here.gap <= closure.CLOSED, size, np.inf)
            better = size < distance[active]
            at = active[better]
            best[at], error[at], distance[at] = here.q[better], missing[better], size[better]
            damping[active] = np.where(
                better, np.maximum(damping[active] / 10.0, _LEAST_DAMPING), damping[active] * 30.0
            )
            going = (distance[active] > 1e-13) & (damping[active] < 1e2)
            active = active[going]
            if not len(active):
                break
            if better[going].all():
                now, wanted = here, going
                columns = now.node_joints(self.node, "world")[wanted][:, self.rows] * scale * self._weights[:, None]
                null = self._null(now.jacobians[wanted])
                stored = columns @ null
                lack = missing[going] * self._weights
            else:
                again = self._every.evaluate(p, best[active])
                columns = again.node_joints(self.node, "world")[:, self.rows] * scale * self._weights[:, None]
                null = self._null(again.jacobians)
                stored = columns @ null
                lack = error[active] * self._weights
            downhill = (np.swapaxes(stored, 1, 2) @ lack[..., None])[..., 0]
            moving = np.linalg.norm(downhill, axis=1) > _STATIONARY * np.linalg.norm(lack, axis=1)
            active, stored, null, downhill = active[moving], stored[moving], null[moving], downhill[moving]
            if not len(active):
                break
            square = np.swapaxes(stored, 1, 2) @ stored
            square += damping[active, None, None] * np.eye(square.shape[1])
            step = np.linalg.solve(square, downhill[..., None])
            motion = (null @ step)[..., 0]
            largest = np.abs(motion).max(axis=1, initial=0.0)
            motion *= (np.minimum(1.0, _LARGEST_STEP / np.maximum(largest, 1e-300)))[:, None] * scale
            q[active] = [integrate(a, b) for a, b in zip(best[active], motion, strict=True)]
        return Reached(p, targets, best, error, distance)

    def _null(self, jacobians: Array) -> Array:
        """Return a basis (count, nv, .) of the motions that keep the loops closed, dimensionless."""
        if not jacobians.shape[1]:
            return np.broadcast_to(np.eye(jacobians.shape[2]), (len(jacobians), *[jacobians.shape[2]] * 2))
        vt = np.linalg.svd(jacobians, full_matrices=True)[2]
        return np.swapaxes(vt[:, self._every.rank :], 1, 2)

    def _missing(self, here: DesignEvaluation, targets: Array) -> Array:
        placements = here.placements(self.node)
        axes = self.rows[: len(self.reach.axes)]
        found = targets - placements[:, axes, 3]
        if self.reach.keeps_orientation:
            turns = [pin.log3(self.home[:3, :3] @ one[:3, :3].T) for one in placements]
            found = np.hstack([found, turns])
        return np.asarray(found)

    # --- derivatives ---------------------------------------------------------------------------------------------

    def evaluate(self, p: Array, q: Array, derivatives: bool = True) -> DesignEvaluation:
        """Return the design with the actuated joints at their values in q (count, nq), closed near it."""
        values = self._written.copy()
        values[self.free] = p
        return self.design.evaluate(values, q, derivatives)

    def motions(self, here: DesignEvaluation) -> Array:
        """Return the wanted components (count, rows, actuated) of the node's twist in the world by the actuated
        joints."""
        return here.pose_derivative(self.node, "world")[:, self.rows][:, :, self.own]

    def follow(self, here: DesignEvaluation) -> Array:
        """Return the derivative (count, actuated, parameters) of the actuated joints at wanted poses."""
        twist = here.pose_derivative(self.node, "world")[:, self.rows] * self._weights[:, None]
        return np.asarray(-np.linalg.pinv(twist[:, :, self.own], rcond=1e-10) @ twist[:, :, self.free])

    def side(self, here: DesignEvaluation) -> Array:
        """Return 1 (count,) where no singularity lies between home and a configuration by the sign of the determinant
        of the node's motions, or -1."""
        found = self._basis.T @ (self.motions(here) * self._weights[:, None])
        return np.asarray(np.where(np.sign(np.linalg.det(found)) == self._side, 1.0, -1.0))
