"""Precision points of linkages: dimensions with which a coupler point passes through points, a body through poses, or
an output follows an input.

Each precision point has a configuration of its own, which is eliminated: it is the closed one that comes nearest
(variable projection). With what is missing there, e, and the motions t of the wanted values with closed loops, the
Jacobian by the parameters is

    de / dp = -(1 - t t^+) X_p ,

which scipy's least squares takes. Starts are random designs whose motion, followed by continuation, passes the points
in their order best. The result is followed again to find defects: of the circuit (not all points on one closed motion),
of the order, and of the branch (the actuated joint turns back between two points).
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from cinegen.arrays import Array, Indices
from cinegen.design.design import Design
from cinegen.design.errors import DesignError
from cinegen.design.evaluation import DesignEvaluation
from cinegen.design.parameters import Parameters
from cinegen.design.synthesis.designs import WITHOUT_EFFECT
from cinegen.design.synthesis.linkage_result import EXACT, LinkageSynthesis
from cinegen.design.synthesis.nearest import closed_motions, nearest
from cinegen.design.synthesis.task import Precision, check_free
from cinegen.errors import UnknownNameError
from cinegen.model.plausible import FAR_TARGET, check_lengths
from raff2urdf import Document, closure

_ATLAS, _LARGEST_ATLAS = 64, 4096  # random designs, of which the best are starts: by the squared number of points
_FITTED = 32  # of them
_MOST_TRIED = 250  # designs of one start
_FOLLOWED = 96  # steps around a random design's motion
_LESS_LIKELY = 4.0  # cost of a start whose actuated joint turns back
_STEP = 0.12  # rad or characteristic lengths, of all joints
_FINE = 0.01  # the same, of the motion in which defects show
_BACK = 10  # fine steps after which it may be back at its beginning
_MET = 0.75 * _FINE  # distance from a configuration that it passes
_MOST_FINE = 20_000


class PrecisionProblem:
    """Precision points for a linkage of mobility 1.

    Args:
        source: as for `cinegen.design.Parameters`.
        task: parameters and precision points.
        robot: name of one robot of a file that holds several.

    Attributes:
        task: as given.
        parameters: the free ones.
        evaluations: designs that were evaluated.

    Raises:
        DesignError: the task does not fit the mechanism.
    """

    def __init__(self, source: str | Path | Document, task: Precision, robot: str | None = None) -> None:
        self.task = task
        self.parameters = Parameters(source, list(task.parameters), task.ties, task.parameters, robot)
        self.mechanism = mechanism = self.parameters.mechanism
        check_free(self.parameters)
        if mechanism.mobility != 1:
            raise DesignError(
                f"{mechanism.name} has mobility {mechanism.mobility}: precision points are of linkages with 1"
            )
        if mechanism.model.nq != mechanism.model.nv:
            raise DesignError(f"{mechanism.name}: precision points are of linkages with revolute and prismatic joints")
        self.node = task.node or mechanism.end
        if self.node not in mechanism.nodes:
            raise UnknownNameError("node", self.node, mechanism.nodes)
        if not task.joints:
            check_lengths(mechanism, "precision points", task.targets[:, :2].ravel().tolist(), FAR_TARGET)
        self.design = Design(self.parameters, fixed=())
        opening = [name for name in self.design.evaluate().opening if name in self.parameters.names]
        if opening:
            raise DesignError(f"{', '.join(opening)}: a change opens the loops of {mechanism.name}: leave it out")
        self.low, self.high = self.parameters.bounds.T
        self._targets, self.rows = task.targets, list(task.rows)
        slides = [name for name in task.joints if mechanism.is_prismatic(name)]
        if slides:
            raise DesignError(f"{', '.join(slides)}: is prismatic: a function is of angles of revolute joints")
        self._joints = [(mechanism.q_index(name), mechanism.v_index(name)) for name in task.joints]
        self._weights = np.repeat([1.0 / mechanism.length, 1.0], 3)[self.rows] if not task.joints else np.ones(2)
        self.evaluations = 0
        self._check_effects()

    def _check_effects(self) -> None:
        """Check that each parameter changes what is missing, in the file's design or some random one."""
        p = self._random(_ATLAS, np.random.default_rng(0))
        evaluation = self.design.evaluate(p, np.tile(self.mechanism.q_home, (len(p), 1)))
        slopes = self._slopes(evaluation)[evaluation.gap <= closure.CLOSED]
        effect = np.abs(slopes).max(axis=(0, 1)) * (self.high - self.low)
        idle = [name for name, size in zip(self.parameters.names, effect, strict=True) if size <= WITHOUT_EFFECT]
        if idle:
            raise DesignError(f"{', '.join(idle)}: without any effect on the precision points: leave it out")

    # --- what is missing -----------------------------------------------------------------------------------------

    def missing(self, evaluation: DesignEvaluation, at: Indices) -> Array:
        """Return what is missing (n, rows) at precision points by their indices, dimensionless."""
        targets = self._targets[at]
        if self._joints:
            return np.asarray((targets - evaluation.q[:, [q for q, _ in self._joints]]) * self._weights)
        placements = evaluation.placements(self.node)
        lengths = [row for row in self.rows if row < 3]
        lack = targets[:, : len(lengths)] - placements[:, lengths, 3]
        if len(lengths) < len(self.rows):  # the angle about the world's z
            angles = np.arctan2(placements[:, 1, 0], placements[:, 0, 0])
            turned = (targets[:, -1] - angles + np.pi) % (2.0 * np.pi) - np.pi
            lack = np.hstack([lack, turned[:, None]])
        return np.asarray(lack * self._weights)

    def _columns(self, evaluation: DesignEvaluation) -> Array:
        """Return the motions (n, rows, nv) of the wanted values by joints, dimensionless."""
        scale = self.mechanism.scale
        if self._joints:
            picked = np.eye(len(scale))[[v for _, v in self._joints]] * scale * self._weights[:, None]
            return np.broadcast_to(picked, (len(evaluation), *picked.shape))
        return np.asarray(evaluation.node_joints(self.node, "world")[:, self.rows] * scale * self._weights[:, None])

    def solved_at(self, p: Array, q: Array) -> tuple[Array, Array, Array]:
        """Return the nearest configurations (points, nq), what is missing (points, rows) and its derivative (points,
        rows, parameters)."""
        self.evaluations += 1
        best, missing, size = nearest(
            self.design, p, q, lambda trial, at: (self.missing(trial, at), self._columns(trial))
        )  # fmt: skip
        slopes = self._slopes(self.design.evaluate(p, best))
        return best, np.where(np.isfinite(size)[:, None], missing, 1.0), slopes

    def _slopes(self, evaluation: DesignEvaluation) -> Array:
        """Return the derivative (n, rows, parameters) of what is missing at the nearest configurations."""
        columns = self._columns(evaluation) @ closed_motions(self.design, evaluation.jacobians)
        if self._joints:
            by_p = evaluation.joint_derivative[:, [v for _, v in self._joints]] * self._weights[:, None]
        else:
            by_p = evaluation.pose_derivative(self.node, "world")[:, self.rows] * self._weights[:, None]
        outside = np.eye(columns.shape[1]) - columns @ np.linalg.pinv(columns, rcond=1e-8)
        return np.asarray(-(outside @ by_p))

    # --- starts --------------------------------------------------------------------------------------------------

    def followed(self, p: Array, q: Array, steps: int, length: float) -> tuple[Array, Array]:
        """Return the configurations (steps, count, nq) of motions in steps of a length (dimensionless), and which
        (steps, count) are closed, from configurations (count, nq) of designs (count, parameters)."""
        scale = self.mechanism.scale
        before = np.zeros((len(q), len(scale)))
        motions, closed = np.zeros((steps, *q.shape)), np.zeros((steps, len(q)), dtype=bool)
        for k in range(steps):
            evaluation = self.design.evaluate(p, q)
            motions[k], closed[k] = evaluation.q, evaluation.gap <= closure.CLOSED
            tangent = closed_motions(self.design, evaluation.jacobians)[:, :, 0]
            along = np.einsum("ci,ci->c", tangent, before)
            tangent = tangent * np.where(along < 0.0, -1.0, 1.0)[:, None]
            q, before = evaluation.q + length * tangent * scale, tangent
        return motions, closed

    def _random(self, count: int, generator: np.random.Generator) -> Array:
        """Return random values (count, parameters) within the bounds, the file's first."""
        p = self.low + generator.random((count, len(self.low))) * (self.high - self.low)
        p[0] = self.parameters.values
        return np.asarray(p)

    def atlas(self, count: int, generator: np.random.Generator) -> list[tuple[float, Array, Array]]:
        """Return random designs as (what is missing, values, configurations at the points), best first."""
        n, p = len(self._targets), self._random(count, generator)
        q = np.tile(self.mechanism.q_home, (count, 1))
        motions, closed = self.followed(p, q, _FOLLOWED, _STEP)
        keep = np.flatnonzero(closed.all(axis=0))
        designs, driver = [], self.mechanism.q_index(self.mechanism.actuated[0])
        flat = self.design.evaluate(
            np.repeat(p[keep], _FOLLOWED, 0), motions[:, keep].swapaxes(0, 1).reshape(-1, motions.shape[2]), False
        )
        each = [np.linalg.norm(self.missing(flat, np.full(len(flat), i)), axis=1) for i in range(n)]
        distances = np.stack(each, axis=1).reshape(len(keep), _FOLLOWED, n)
        for k, distance in zip(keep, distances, strict=True):
            cost, at, between = _in_order(distance**2)
            back = _turns_back(motions[between, k, driver])
            designs.append((_LESS_LIKELY * cost if back else cost, p[k], motions[at, k]))
        return sorted(designs, key=lambda design: design[0])

    def fitted(self, p: Array, q: Array) -> tuple[Array, Array, float]:
        """Return the least-squares design near another: its values, its configurations, and what is missing at most."""
        from scipy.optimize import least_squares

        size = self.high - self.low
        known = [q]
        cache: dict[bytes, tuple[Array, Array, Array]] = {}

        def at(u: Array) -> tuple[Array, Array, Array]:
            key = u.tobytes()
            if key not in cache:
                cache.clear()
                cache[key] = self.solved_at(self.low + u * size, known[0])
            return cache[key]

        def slopes(u: Array) -> Array:  # of a point that is accepted
            known[0], _, by_p = at(u)
            return np.asarray((by_p * size).reshape(-1, len(u)))

        unit = np.clip((p - self.low) / size, 1e-6, 1.0 - 1e-6)
        fit = least_squares(
            lambda u: at(u)[1].ravel(),
            unit,
            slopes,
            bounds=(0.0, 1.0),
            x_scale="jac",
            xtol=1e-15,
            ftol=1e-12,
            gtol=1e-15,
            max_nfev=_MOST_TRIED,
        )
        q, missing, _ = at(fit.x)
        return np.asarray(self.low + fit.x * size), q, float(np.linalg.norm(missing, axis=1).max())

    # --- the result ----------------------------------------------------------------------------------------------

    def solved(self, report: Callable[[str, int, int], object], seed: int = 0) -> LinkageSynthesis:
        """Return the first design without defects, or the best of all starts.

        Args:
            report: called with what is done, and how many starts of how many.
            seed: of the random designs.
        """
        generator, most = np.random.default_rng(seed), self.task.starts
        best: tuple[tuple[int, float], Array, Array, tuple[bool, bool, bool]] | None = None
        exact, done, queue = 0, 0, list[tuple[float, Array, Array]]()
        while done < most:
            if not queue:
                queue = self.atlas(min(_LARGEST_ATLAS, _ATLAS * len(self._targets) ** 2), generator)[:_FITTED]
                if not queue:
                    raise DesignError(f"{self.mechanism.name}: no random design within the bounds can be assembled")
            report("start", done, most)
            _, p, q = queue.pop(0)
            done += 1
            try:
                p, q, missing = self.fitted(p, q)
            except (np.linalg.LinAlgError, ValueError):  # a start among impossible designs
                continue
            met = missing <= EXACT
            exact += met
            defects = self.defects(p, q) if met or best is None else (False, False, False)
            rank = (sum(defects) if met else -1, -missing)
            if best is None or rank > best[0]:
                best = rank, p, q, defects
            if met and all(defects):
                break
        if best is None:
            raise DesignError(f"{self.mechanism.name}: no start could be computed: change the bounds")
        _, p, q, defects = best
        error = np.linalg.norm(self.solved_at(p, q)[1], axis=1)
        return LinkageSynthesis(self.task, self.parameters, p, q, error, *defects, done, self.evaluations, exact)

    def circuit(self, p: Array, q: Array) -> tuple[Array, Array]:
        """Return the motion (steps, nq) from a configuration (nq,) until it is back there, with dimensionless tangents
        (steps, nv); up to where the loops can't be closed, or a number of steps."""
        scale, before = self.mechanism.scale, np.zeros(len(self.mechanism.scale))
        motion, tangents, current = list[Array](), list[Array](), q[None]
        for k in range(_MOST_FINE):
            evaluation = self.design.evaluate(p, current)
            if evaluation.gap[0] > closure.CLOSED:
                break
            tangent = closed_motions(self.design, evaluation.jacobians)[0, :, 0]
            before = -tangent if tangent @ before < 0.0 else tangent
            motion.append(evaluation.q[0])
            tangents.append(before)
            if k > _BACK and self.apart(motion[-1], q) < _MET:
                break
            current = (motion[-1] + _FINE * before * scale)[None]
        return np.array(motion).reshape(-1, len(q)), np.array(tangents).reshape(-1, len(scale))

    def apart(self, motion: Array, q: Array) -> Array:
        """Return the distances (...,) of configurations (..., nq) from another, up to revolutions, dimensionless."""
        gaps = (motion - q) / self.mechanism.scale
        return np.asarray(np.abs((gaps + np.pi) % (2.0 * np.pi) - np.pi).max(axis=-1))

    def defects(self, p: Array, q: Array) -> tuple[bool, bool, bool]:
        """Return whether all configurations (points, nq) are on one circuit, in their order, and on one branch."""
        motion, tangents = self.circuit(p, q[0])
        met = np.array([self.apart(motion, point) < _MET for point in q])
        if not met.any(axis=1).all():
            return False, False, False
        where = met.argmax(axis=1)
        passed = np.argsort(where, kind="stable").tolist()
        order = passed in (list(range(len(q))), [0, *range(len(q) - 1, 0, -1)])
        driven = tangents[:, self.mechanism.v_index(self.mechanism.actuated[0])]
        used = driven[: where.max() + 1] if passed[1] == 1 else driven[where[passed[1]] :]  # or the other way around
        return True, order, bool(used.min() > 0.0 or used.max() < 0.0)


def _turns_back(values: Array) -> bool:
    """Return whether a joint turns back along values, which may jump where a motion ends and begins again."""
    steps = np.diff(values)
    steps = steps[np.abs(steps) < 2.0 * _STEP]
    return bool(len(steps) and steps.min() < 0.0 < steps.max())


def _in_order(costs: Array) -> tuple[float, Indices, Indices]:
    """Return the least sum of costs (steps, points) of points at increasing steps, these steps (points,), and all steps
    between the first and the last, in either direction and from the step that is best for the first point."""
    steps, n = costs.shape
    nothing = np.zeros(n, dtype=np.intp)
    best: tuple[float, Indices, Indices] = (np.inf, nothing, nothing)
    for direction in (1, -1):
        order = np.arange(steps)[::direction]
        first = int(np.argmin(costs[order, 0]))
        order = np.roll(order, -first)
        ordered = costs[order]
        total = ordered[:, 0].copy()
        total[1:] = np.inf
        back = np.zeros((steps, n), dtype=int)
        for i in range(1, n):
            least = np.minimum.accumulate(total)
            is_new = np.append(True, total[1:] < least[:-1])
            back[:, i] = np.maximum.accumulate(np.where(is_new, np.arange(steps), 0))
            total = least + ordered[:, i]
        k = int(np.argmin(total))
        if total[k] < best[0]:
            at = np.zeros(n, dtype=np.intp)
            value = float(total[k])
            for i in range(n - 1, -1, -1):
                at[i] = k
                k = back[k, i]
            best = value, order[at], order[at[0] : at[-1] + 1]
    return best
