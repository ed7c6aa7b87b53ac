"""`IKSolutions`: all configurations that bring a node to a pose, and what is proved of their number."""

from __future__ import annotations

import itertools
import math
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from threading import Lock

import numpy as np

from cinegen.arrays import Array
from cinegen.assembly import AssemblyModes, ModesError, SelfMotion
from cinegen.errors import ClosureError
from cinegen.hexapod import SolutionCounts
from cinegen.ik.solutions import IKError, IKSolutions
from cinegen.ik.task import FrameTask
from cinegen.inverse.parts import NodeTask
from cinegen.inverse.task_parts import TaskParts
from cinegen.model import Mechanism
from cinegen.recent import Recent
from cinegen.tolerances import AT_LIMIT
from raff2urdf.coupling import followed
from raff2urdf.errors import raised_as

_OFF = 1e-6  # rad, characteristic lengths: a pose this near to those that can be reached is one of them
_POLISHED = 1e-13  # rad, characteristic lengths
_WRONG = 1e-6  # rad, characteristic lengths: what is off by more after polishing is no solution
_SINGULAR = 1e-4  # part of the largest singular value: a direction in which a singular solution may move
_STEP = 0.05  # rad, characteristic lengths: to see whether it does
_PATIENCE, _WEAK = 60, 0.01  # steps of Newton's method, which is slow there; directions that it does not go back along
_ON_CURVE = 1e-9  # rad, characteristic lengths
_CURVE = "a curve of configurations"
_MOST = 10_000  # solutions
_KEPT = 8  # tasks of a mechanism whose parts are kept


def all_solutions(
    mechanism: Mechanism, task: FrameTask, q: Array, locked: Mapping[str, float],
    report: Callable[[str], None] | None, effort: float,
) -> IKSolutions:  # fmt: skip
    """Compute all isolated configurations that bring a node to a pose; see `inverse_kinematics`."""
    if mechanism.spherical is not None:
        joints = mechanism.spherical
        solutions = all_solutions(mechanism.successive, task, joints.to_successive(q), locked, report, effort)
        closest = None if solutions.closest is None else joints.from_successive(solutions.closest)
        return replace(
            solutions, mechanism=mechanism, start=joints.from_successive(solutions.start), closest=closest,
            configurations=tuple(map(joints.from_successive, solutions.configurations)),
            self_motions=tuple(motion.with_ball_joints(joints) for motion in solutions.self_motions),
        )  # fmt: skip
    with raised_as(IKError, ClosureError, "no closed configuration near the start: "):
        start = mechanism.close(mechanism.configuration(locked, q), tuple(locked))
    with raised_as(IKError, ModesError):
        parts, lock = mechanism.structure.derived(_Kept).parts(mechanism, _node_task(mechanism, task), locked)
        with lock:
            return _Assembly(mechanism, task, start, locked, parts).solutions(report, effort)


def _node_task(mechanism: Mechanism, task: FrameTask) -> NodeTask:
    """Return what is constrained.

    Raises:
        IKError: all solutions of such a task are not computed.
    """
    linear, angular = task.weights[:3] > 0.0, task.weights[3:] > 0.0
    plane = task.translation == 2 or task.rotation == 1  # the motion must be one in that plane
    normal = ~linear if task.translation == 2 else angular
    if (task.axes != "target" and task.translation + task.rotation not in (3, 6)) or task.translation < 2:
        raise IKError(f"'{task.node}': all solutions are computed for tasks in the target's axes with a position")
    if plane and (task.rotation not in (0, 1) or normal.sum() != 1 or (task.rotation and (normal != angular).any())):
        raise IKError(f"'{task.node}': all solutions are not computed for a task that constrains these axes")
    if task.rotation == 2:
        return NodeTask(task.node, task.offset, 2, tuple((~angular).astype(float)))
    return NodeTask(task.node, task.offset, 3 if task.rotation else 0)


class _Kept:
    """The parts of the tasks that were solved last for a mechanism."""

    def __init__(self, _: Mechanism) -> None:
        self._lock = Lock()
        self._recent = Recent[tuple[TaskParts, Lock]](_KEPT)

    def parts(self, mechanism: Mechanism, task: NodeTask, locked: Mapping[str, float]) -> tuple[TaskParts, Lock]:
        """Return the parts of a task, and a lock for those who use them."""
        numbers = task.offset.homogeneous.ravel().tolist()
        key = (task.node, task.rotation, task.free_axis, *numbers, *sorted(locked.items()))
        with self._lock:
            return self._recent.get(key, lambda: (TaskParts(mechanism, task, locked), Lock()))


class _Assembly:
    """Solves the parts of a task for one pose, and combines their solutions."""

    def __init__(
        self, mechanism: Mechanism, task: FrameTask, start: Array, locked: Mapping[str, float], parts: TaskParts
    ) -> None:
        self._mechanism, self._task, self._start, self._locked, self._parts = mechanism, task, start, locked, parts
        moving = {name for part in parts.parts for name in part.joints}
        self._moving = tuple(name for name in mechanism.joints if name in moving)
        self._columns = np.array([mechanism.v_index(name) for name in self._moving])
        revolute = [mechanism.q_index(name) for name in self._moving if not mechanism.is_prismatic(name)]
        self._revolute = np.array(revolute, dtype=np.intp)
        self._rows = parts.rows(parts.couplings)  # couplings with other joints are fulfilled afterwards

    def solutions(self, report: Callable[[str], None] | None, effort: float) -> IKSolutions:
        """Return all solutions."""
        parts, task = self._parts, self._task
        pose = parts.virtual_pose(task.target, self._start)
        partial = self._is_planar()  # what is not constrained may be off
        if not partial and max(pose.distance / self._mechanism.length, pose.angle) > _OFF:
            off = f"the pose is {1e3 * pose.distance:.6g} mm and {math.degrees(pose.angle):.6g} degrees off"
            method = f"'{task.node}' moves {parts.motions.description}: {off}"
            method += "" if parts.every else "; other modes of operation are not examined"
            return self._result([], [], parts.every, None, method, SolutionCounts(0, 0, 0, 0, 0))
        groups = []
        for number, part in enumerate(parts.parts, 1):
            said = f"part {number} of {len(parts.parts)}: " if len(parts.parts) > 1 else ""
            progress = None if report is None else (lambda text, said=said: report(said + text))
            groups.append(part.solver.modes(part.mechanism, pose.values, progress, effort))
        counts = _product(groups)
        if counts.real > _MOST and min(map(len, groups)):
            raise IKError(f"{self._mechanism.name}: {counts.real} solutions; lock some joints")
        configurations, times, wrong, unexamined = list[Array](), list[int](), 0, {*parts.driven.unexamined}
        chosen = [[part.values(part.near(q)) for q in modes] for part, modes in zip(parts.parts, groups, strict=True)]
        coincident = itertools.product(*(modes.coincident for modes in groups))
        for values, together in zip(itertools.product(*chosen), coincident, strict=True):
            q = self._mechanism.configuration({k: v for some in values for k, v in some.items()}, self._start)
            if self._error(polished := self._unwound(self._polished(q))) >= _WRONG:
                wrong += 1
                continue
            closed, lost, double = parts.driven.configurations(polished)
            configurations += closed
            times += [math.prod(together)] * len(closed)
            wrong += lost
            unexamined |= double
        complete = all(modes.complete for modes in groups) or any(modes.complete and not modes for modes in groups)
        proved = all(modes.proved for modes in groups) or any(modes.proved and not modes for modes in groups)
        remarks = [f"; {wrong} were lost in polishing"] if wrong else []
        if task.rotation < 3 and not partial and parts.motions.rotations < 3 and not parts.every:
            remarks.append("; modes of operation in which it rotates otherwise are not among them")
            complete = False
        if not any(_CURVE in modes.method for modes in groups) and any(map(self._can_move, configurations)):
            remarks.append(f"; solutions are singular: {_CURVE} is not excluded")
            complete = False
        remarks += parts.driven.remarks(self._moving if configurations else ())
        if unexamined:
            remarks.append(f"; other solutions of couplings are not excluded: {', '.join(sorted(unexamined))}")
            complete = False
        if self._mechanism.floating:
            remarks.append("; the base stays where it is")
        tests = [modes.trace_test for modes in groups if modes.trace_test is not None]
        trace_test = all(tests) and not wrong if tests else None
        method = _method(groups) + "".join(remarks)
        result = self._result(configurations, times, complete and not wrong, trace_test, method, counts)
        return replace(
            result, self_motions=tuple(self._self_motions(groups, chosen)), almost_surely=result.complete and not proved
        )

    def _self_motions(
        self, groups: Sequence[AssemblyModes], chosen: Sequence[Sequence[Mapping[str, float]]]
    ) -> Iterator[SelfMotion]:
        """Yield the self-motions of each part, with a solution of each other part, if all have one."""
        for k, (part, modes) in enumerate(zip(self._parts.parts, groups, strict=True)):
            others = [some for j, some in enumerate(chosen) if j != k]
            for motion in modes.self_motions if all(others) else ():
                values = [*(some[0] for some in others), part.values(motion.configuration)]
                q = self._mechanism.configuration({k: v for some in values for k, v in some.items()}, self._start)
                polished = self._unwound(self._polished(q))
                closed = self._parts.driven.configurations(polished)[0] if self._error(polished) < _WRONG else []
                if closed:
                    yield replace(
                        motion, configuration=closed[0], moving=tuple(n for n in motion.moving if n in part.joints)
                    )

    def _result(
        self, configurations: list[Array], times: list[int], complete: bool, trace_test: bool | None, method: str,
        counts: SolutionCounts,
    ) -> IKSolutions:  # fmt: skip
        far = [self._mechanism.distance(self._start, q) for q in configurations]
        order = np.argsort(np.round(far, 9), kind="stable").tolist()
        limits = self._mechanism.limits
        return IKSolutions(
            self._mechanism, self._task.copy(), self._start, dict(self._locked),
            tuple(configurations[k] for k in order),
            tuple(limits.exceeded(configurations[k], AT_LIMIT) for k in order),
            tuple(times[k] for k in order), complete, method, counts, trace_test,
            unknowns=self._parts.unknowns if configurations else None,
        )  # fmt: skip

    def _is_planar(self) -> bool:
        """Return whether the task constrains two translations or one rotation of a node that moves in that plane.

        Raises:
            IKError: it does, and the node does not.
        """
        task, motions = self._task, self._parts.motions
        if task.translation == 3 and task.rotation != 1:
            return False
        free = ~(task.weights[:3] > 0.0) if task.translation == 2 else task.weights[3:] > 0.0
        normal = task.target.rotation @ free
        if (
            task.axes != "target"
            or motions.rotations > 1
            or np.abs(motions.directions @ normal).max(initial=0.0) > _OFF
        ):
            raise IKError(
                f"'{task.node}': all solutions are computed for tasks that constrain 3 translations and 0, 2 or 3 "
                "rotations; or 2 and 1 of a motion in their plane"
            )
        return True

    def _can_move(self, q: Array) -> bool:
        """Return whether a singular solution (nq,) may lie on a curve of solutions, along which joints move that
        distinguish solutions: whether Newton's method ends away from it when it starts a step aside. With two singular
        directions or more it may."""
        jacobian = self._equations(q)[1]
        _, values, rows = np.linalg.svd(jacobian)
        free = rows[int((values > _SINGULAR * values.max(initial=0.0)).sum()) :]
        distinct = [name for part in self._parts.parts for name in part.distinct]
        at = [self._moving.index(name) for name in distinct]
        free = free[np.abs(free[:, at]).max(axis=1, initial=0.0) > _SINGULAR]
        if len(free) != 1:
            return len(free) > 1
        step, scale = np.zeros(self._mechanism.model.nv), self._mechanism.scale
        step[self._columns] = _STEP * free[0] / np.abs(free[0, at]).max()
        polished = self._polished(self._mechanism.integrate(q, step * scale), _PATIENCE, _WEAK)
        moved = (self._mechanism.difference(q, polished) / scale)[self._columns][at]
        return self._error(polished) < _ON_CURVE and bool(np.abs(moved).max() > 0.5 * _STEP)

    # --- one solution ---------------------------------------------------------------------------------------------

    def _equations(self, q: Array) -> tuple[Array, Array]:
        """Return what is missing of the pose and the loops at q (nq,), dimensionless, and its derivative by the joints
        that move; by Pinocchio's kinematics alone."""
        mechanism, task, length = self._mechanism, self._task, self._mechanism.length
        jacobian = task.offset.toActionMatrixInverse() @ mechanism.jacobian(q, task.node)
        error, by = task.equations(mechanism.placement(q, task.node) * task.offset, jacobian)
        units = np.repeat([length, 1.0], [task.translation, task.rotation])
        c, loops = (part[self._rows] for part in mechanism.structure.system.evaluate(q))
        rows = np.vstack([by * mechanism.scale / units[:, None], loops])
        return np.concatenate([error / units, -c]), rows[:, self._columns]

    def _error(self, q: Array) -> float:
        return float(np.abs(self._equations(q)[0]).max(initial=0.0))

    def _polished(self, q: Array, steps: int = 8, weakest: float = 1e-9) -> Array:
        """Return the configuration (nq,) that Newton's method reaches from q, without moving along directions whose
        singular values are below a part of the largest."""
        for _ in range(steps):
            missing, jacobian = self._equations(q)
            if np.abs(missing).max(initial=0.0) < _POLISHED:
                break
            step = np.zeros(self._mechanism.model.nv)
            step[self._columns] = np.linalg.lstsq(jacobian, missing, rcond=weakest)[0]
            better = self._mechanism.integrate(q, step * self._mechanism.scale)
            if not self._error(better) < np.abs(missing).max():
                break
            q = better
        return q

    def _unwound(self, q: Array) -> Array:
        """Return q (nq,) with whole revolutions added, so that joints are within limits, and then near the start."""
        limits, revolute = self._mechanism.limits, self._revolute
        near = q.copy()
        near[revolute] -= 2.0 * np.pi * np.rint((q[revolute] - self._start[revolute]) / (2.0 * np.pi))
        beyond = [self._mechanism.q_index(name) for name in limits.exceeded(near, AT_LIMIT)]
        near[beyond] = limits.unwound(near)[beyond]
        for coupling in self._parts.couplings:  # the follower has made as many revolutions
            values = {name: float(near[self._mechanism.q_index(name)]) for name in coupling.terms}
            near[self._mechanism.q_index(coupling.follower)] = followed([coupling], values)[coupling.follower]
        return near


def _product(groups: Sequence[AssemblyModes]) -> SolutionCounts:
    """Return the counts of all combinations of solutions."""
    counts = [modes.counts for modes in groups]
    real = math.prod(sum(modes.coincident) for modes in groups)
    finite = math.prod(c.real + c.complex for c in counts)
    followed = math.prod(c.real + c.complex + c.infinite for c in counts)
    every = math.prod(c.real + c.complex + c.infinite + c.lost for c in counts)
    multiple = every - math.prod(c.real + c.complex + c.infinite + c.lost - c.multiple for c in counts)
    return SolutionCounts(real, finite - real, followed - finite, multiple, every - followed)


def _method(groups: Sequence[AssemblyModes]) -> str:
    methods = Counter(modes.method for modes in groups)
    if len(groups) == 1:
        return groups[0].method
    listed = [f"{number} times {text}" if number > 1 else text for text, number in methods.items()]
    return f"{len(groups)} parts, independent at a given pose: {'; '.join(listed)}"
