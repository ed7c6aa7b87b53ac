"""`Linkage`: a mechanism whose motors are held, as tables of numbers, and what tells its assembly modes apart."""

from __future__ import annotations

import os
import weakref
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numba import complex128, float64, int64, typeof
from numpy.typing import NDArray
from scipy.linalg import qr

from cinegen.assembly._kernels import (
    ARRIVED,
    BALL,
    KIND,
    LOST,
    PRISMATIC,
    REVOLUTE,
    RIGID,
    SINGULAR,
    Complex,
    Path,
    Scratch,
    Tables,
    measure,
    residuals,
    settle,
    track,
)
from cinegen.assembly.bodies import Bodies
from cinegen.errors import CinegenError
from cinegen.jit.compiled import prepare, together
from cinegen.joints import axis
from cinegen.model import Mechanism
from raff2urdf.document import LoopKind

Array = NDArray[np.float64]

KINDS = {
    LoopKind.RIGID: RIGID,
    LoopKind.PRISMATIC: PRISMATIC,
    LoopKind.REVOLUTE: REVOLUTE,
    LoopKind.BALL: BALL,
}
ACCURACY = 3e-4
"""Error of a prediction along a path that is aimed at, radians and characteristic lengths."""

_STILL = 1e-9  # a joint that loops move less is in none
_SINGULAR = 1e-3  # part of the largest singular value: a direction in which a solution near a singular one may move
_STEP = 0.05  # rad, characteristic lengths
_SETTLING = 3.0  # steps along a path that Newton's method from a random start is worth
_MANY, _SHARE = 24, 6  # paths that are shared among threads, and how many each takes
_CORES = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
_IDLE = 1e-6  # a motion that moves points that matter by less moves none of them


class ModesError(CinegenError):
    """Assembly modes that can't be asked for: says of which joints, and what to do."""


class Led(NamedTuple):
    """Solutions that were led along a path.

    Attributes:
        solutions: (count, k + 1) the unknowns at the end.
        ends: (count,) how each ended: ARRIVED, SINGULAR, INFINITE or LOST.
        pivots: (count,) smallest pivot over the largest at the end: 0 where solutions meet.
    """

    solutions: Complex
    ends: NDArray[np.int64]
    pivots: Array

    @property
    def arrived(self) -> Complex:
        """Those that came to the end."""
        return np.asarray(self.solutions[self.ends == ARRIVED])


class Linkage:
    """The loops of a mechanism in complex numbers, for given values of its motors.

    Unknown are the passive joints that loops move, and of motors that are more than the mechanism has freedoms those
    that the others determine; all other joints are motors here. Without unit: lengths are divided by the characteristic
    length. Not for two threads at once.

    Args:
        mechanism: with loops; its joints turn or slide. It is not kept alive.
        as_built: whether motors are taken as they are, even if some are too many or don't determine the rest: to see
            what it is; nothing can be solved so.

    Attributes:
        motors: names of the joints that are held, in q's order.
        passive: names of those that the loops determine, in q's order.
        surplus: names of those among them that have a motor.
        leading: (motors,) those that move loops, as a wrist does not.
        end: the body that the mechanism's end belongs to.
        idle: how many motions are left that move no point that matters, as a rod that turns about itself.
        work: what has been done along paths, in multiplications, about: what may be done is told by it, and not by a
            clock, so that it is always the same.

    Raises:
        ModesError: no loops, joints of other kinds, or motors that don't determine the rest.
    """

    def __init__(self, mechanism: Mechanism, as_built: bool = False) -> None:
        self._mechanism = weakref.ref(mechanism)
        self.work = 0.0
        if not mechanism.loops:
            raise ModesError(
                f"{mechanism.name} has no loops: it can be assembled in one way for each configuration of its joints"
            )
        model = mechanism.model
        for name, joint in zip(model.names, model.joints, strict=True):
            if joint.nv > 1 and joint.idx_v >= 0 and not (mechanism.floating and joint.nv == 6):
                raise ModesError(
                    f"{mechanism.name}: joint '{name}' has {joint.nv} freedoms; assembly modes are found for joints "
                    "that turn or slide: write a ball joint as three joints that turn"
                )
        self.root = 1 if mechanism.floating else 0  # a base that could move stands still
        self._joints = range(1 + self.root, model.njoints)
        names = [model.names[j] for j in self._joints]
        columns = {name: mechanism.v_index(name) for name in names}
        moved = [mechanism.system.evaluate(q)[1] for q in mechanism.samples]
        inside = {name for name in names if max(np.abs(rows[:, columns[name]]).max() for rows in moved) > _STILL}
        loose = [name for name in names if name not in inside and name not in mechanism.actuated]
        if loose:
            raise ModesError(
                f"{mechanism.name}: {_listed(loose)} {'is' if len(loose) == 1 else 'are'} held by no motor and no "
                "loop: there is a curve of configurations, not a number of them"
            )
        driven = [name for name in names if name in inside and name in mechanism.actuated]
        self.surplus = () if as_built else _surplus(mechanism, moved, [columns[name] for name in driven], driven)
        self.passive = tuple(
            name for name in names if name in inside and (name not in mechanism.actuated or name in self.surplus)
        )
        self.motors = tuple(name for name in names if name not in self.passive)
        self.leading = np.array([name in inside for name in self.motors], dtype=bool)
        self._rank = mechanism.loop_rank if self.surplus else mechanism.passive_rank
        self.joint_names = names
        self._slides = np.array([mechanism.is_prismatic(name) for name in names])
        self._at = np.array([mechanism.q_index(name) for name in names])
        self._unit = np.where(self._slides, mechanism.length, 1.0)
        self.tables = self._tables()
        self.scratch = scratch_of(self.tables, len(self.passive), len(self.motors))
        self._compile()
        self.idle = len(self.passive) - self._rank
        if not as_built:
            self.check()

    @property
    def mechanism(self) -> Mechanism:
        """Whose loops these are."""
        found = self._mechanism()
        if found is None:
            raise ReferenceError("the mechanism is gone")
        return found

    # --- tables --------------------------------------------------------------------------------------------------

    def _tables(self) -> Tables:
        mechanism, model = self.mechanism, self.mechanism.model
        length, count = mechanism.length, len(self.joint_names)
        joints, constants = np.zeros((count, 4), dtype=np.int64), np.zeros((count, 15))
        above = np.zeros((count + 1, count), dtype=np.int64)
        for k, j in enumerate(self._joints):
            name = self.joint_names[k]
            parent = model.parents[j] - self.root
            joints[k] = (
                parent,
                self._slides[k],
                self.motors.index(name) if name in self.motors else -1,
                self.passive.index(name) if name in self.passive else -1,
            )
            placement = model.jointPlacements[j]
            constants[k, :9], constants[k, 9:12] = placement.rotation.ravel(), placement.translation / length
            constants[k, 12:] = axis(model.joints[j])
            above[k + 1] = above[parent]
            above[k + 1, k] = 1
        loops, anchors = np.zeros((len(mechanism.loops), 3), dtype=np.int64), np.zeros((len(mechanism.loops), 2, 12))
        for at, (loop, anchor) in enumerate(zip(mechanism.loops, mechanism.system.anchors, strict=True)):
            first, first_placement, second, second_placement = anchor
            loops[at] = max(first - self.root, 0), max(second - self.root, 0), KINDS[loop.kind]
            for end, placement in enumerate((first_placement, second_placement)):
                anchors[at, end, :9] = placement.rotation.T.ravel()
                anchors[at, end, 9:] = placement.translation / length
        partial = Tables(joints, constants, above, loops, anchors, np.zeros((0, 2), np.int64), np.zeros((0, 3)), 0)
        self.end = self._body_of_end()
        self._partial = partial
        self.bodies = self.bodies_at(mechanism.q_home)
        found = self.bodies.features
        return partial._replace(
            wanted=np.array([(feature.body, feature.direction) for feature in found], dtype=np.int64).reshape(-1, 2),
            local=np.array([feature.local for feature in found]).reshape(-1, 3),
            rank=self._rank + 1,
        )

    def bodies_at(self, q: Array) -> Bodies:
        """The bodies, with points and axes where they are at q (nq,)."""
        mechanism = self.mechanism
        mechanism.system.evaluate(q)
        found = [mechanism.system.data.oMi[j] for j in (self.root, *self._joints)]
        placements = np.array([np.c_[at.rotation, at.translation / mechanism.length] for at in found])
        return Bodies(self._partial, placements, self.end)

    def _body_of_end(self) -> int:
        frame = self.mechanism.model.frames[self.mechanism.frame_id(self.mechanism.end)]
        return max(int(frame.parentJoint) - self.root, 0)

    def _compile(self) -> None:
        """Compiles what is not yet compiled, and says so."""
        tables, path, scratch = typeof(self.tables), typeof(self.at(self._home)), typeof(self.scratch)
        given, numbers = complex128[:, ::1], int64[::1]
        with together():
            prepare(track, tables, path, given, numbers, float64[:, ::1], scratch)
            prepare(settle, tables, path, given, numbers, scratch)
            prepare(measure, tables, path, given, complex128[:, :, ::1], scratch)
            prepare(residuals, tables, path, complex128[::1], scratch)

    @property
    def _home(self) -> Array:
        return self.motor_values(self.mechanism.q_home)

    def check(self) -> None:
        """Whether the motors determine all that matters.

        Raises:
            ModesError: they don't.
        """
        free = self.idle
        if free == 0:
            return
        for q in self.mechanism.samples:
            matrix, moved = self._derivatives(q)
            motions = np.linalg.svd(matrix)[2][self._rank :].T
            if np.abs(moved @ motions).max(initial=0.0) > _IDLE:
                raise ModesError(
                    f"{self.mechanism.name}: with its motors held it still moves, by {free} "
                    f"motion{'s' * (free != 1)} more than its loops take away: there is a curve of configurations, not "
                    "a number of them. Say 'actuated 1' for more of its joints"
                )

    def _derivatives(self, q: Array) -> tuple[Array, Array]:
        """Of loops and of features by the passive joints, at q (nq,), by central differences for the features."""
        solution, motors = self.unknowns(q), self.motor_values(q)
        residuals(self.tables, self.at(motors), solution, self.scratch)
        matrix = self.scratch.matrix[:-1, :-1].real.copy()
        step, columns = 1e-6, []
        for k in range(len(self.passive)):
            away = np.zeros(len(solution))
            away[k] = step
            there = self.features(np.array([solution + away, solution - away]), motors).real
            columns.append((there[0] - there[1]).ravel() / (2.0 * step))
        return matrix, np.array(columns).T

    # --- values --------------------------------------------------------------------------------------------------

    @cached_property
    def _passive_at(self) -> NDArray[np.intp]:
        return np.array([self.joint_names.index(name) for name in self.passive], dtype=np.intp)

    @cached_property
    def _motors_at(self) -> NDArray[np.intp]:
        return np.array([self.joint_names.index(name) for name in self.motors], dtype=np.intp)

    @cached_property
    def _surplus_at(self) -> list[int]:
        return [self.joint_names.index(name) for name in self.surplus]

    def off(self, q: Array, asked: Array) -> Array:
        """(surplus,) how far surplus motors are from where q (nq,) `asked` has them, rad and characteristic lengths."""
        at = self._surplus_at
        gaps = (q[self._at[at]] - asked[self._at[at]]) / self._unit[at]
        return np.asarray(np.where(self._slides[at], gaps, (gaps + np.pi) % (2.0 * np.pi) - np.pi))

    @cached_property
    def turning(self) -> NDArray[np.bool_]:
        """(motors,) those that turn."""
        return np.asarray(~self._slides[self._motors_at])

    def motor_values(self, q: Array) -> Array:
        """(motors,) without unit, of q (nq,)."""
        at = self._motors_at
        return np.asarray(q[self._at[at]] / self._unit[at])

    def unknowns(self, q: Array) -> Complex:
        """(k + 1,) the passive joints' values without unit, and t = 0, of q (nq,)."""
        at = self._passive_at
        return np.append(q[self._at[at]] / self._unit[at], 0.0).astype(complex)

    def configuration(self, solution: Complex, motors: Array) -> Array:
        """q (nq,) of a solution's real part; angles within half a turn of home's."""
        q = self.mechanism.q_home.copy()
        q[self._at[self._motors_at]] = motors * self._unit[self._motors_at]
        for k, at in enumerate(self._passive_at):
            value, where = solution[k].real, self._at[at]
            if not self._slides[at]:
                home = self.mechanism.q_home[where]
                value = home + (value - home + np.pi) % (2.0 * np.pi) - np.pi
            q[where] = value * self._unit[at]
        return q

    # --- paths ---------------------------------------------------------------------------------------------------

    def at(self, motors: Complex | Array) -> Path:
        """Motors (motors,) that stay where they are."""
        return self.way(motors, motors)

    def way(self, start: Complex | Array, goal: Complex | Array) -> Path:
        """Motors (motors,) that are led from some values to others, straight."""
        lines = np.zeros((2, len(self.motors), 2), dtype=complex)
        lines[0, :, 0], lines[1, :, 0] = start, goal
        return Path(lines, np.array([self.fibre, self.fibre]), False, ACCURACY)

    @cached_property
    def fibre(self) -> Complex:
        """(3 f + 2,) the slice t = 0."""
        plain = np.zeros(3 * len(self.tables.wanted) + 2, dtype=complex)
        plain[-2] = 1.0
        return plain

    @cached_property
    def _step_work(self) -> float:
        """What a step along a path costs: least squares, derivatives, and places."""
        rows, columns = self.scratch.matrix.shape
        return float(rows * columns * (columns + 20) + 3000)

    def lead(self, solutions: Complex, path: Path) -> Led:
        """Leads solutions (count, k + 1) along a path."""
        led = np.array(solutions, dtype=complex, order="C").reshape(-1, len(self.passive) + 1)
        ends, records = np.zeros(len(led), dtype=np.int64), np.zeros((len(led), 2))
        if len(led) < _MANY or _CORES == 1:
            track(self.tables, path, led, ends, records, self.scratch)
        else:
            shares = [slice(k, k + _SHARE) for k in range(0, len(led), _SHARE)]

            def follow(share: slice) -> None:
                scratch = scratch_of(self.tables, len(self.passive), len(self.motors))
                track(self.tables, path, led[share], ends[share], records[share], scratch)

            with ThreadPoolExecutor(_CORES) as threads:  # the kernel does without Python's lock
                list(threads.map(follow, shares))
        self.work += float(records[:, 1].sum()) * self._step_work
        return Led(led, ends, records[:, 0])

    def random(self, rng: np.random.Generator, count: int) -> Complex:
        """(count, k + 1) unknowns to start from; t = 0."""
        shape = count, len(self.passive) + 1
        drawn = np.pi * rng.uniform(-1.0, 1.0, size=shape) + 0.5j * rng.normal(size=shape)
        drawn[:, -1] = 0.0
        return np.asarray(drawn)

    def settled(self, guesses: Complex, path: Path) -> tuple[Complex, int]:
        """Regular solutions (n, k + 1) at a path's beginning that Newton's method reaches from guesses (count, k + 1);
        and how many guesses led to others, of which there is a curve."""
        there = np.array(guesses, dtype=complex, order="C")
        ends = np.zeros(len(there), dtype=np.int64)
        settle(self.tables, path, there, ends, self.scratch)
        self.work += _SETTLING * len(there) * self._step_work
        return there[ends == ARRIVED], int((ends == SINGULAR).sum())

    def can_move(self, solution: Complex, motors: Array) -> bool:
        """Whether a singular solution (k + 1,) lies on a curve of solutions, on which features move: motors held, it
        can move farther than infinitesimally."""
        path = self.at(motors)
        residuals(self.tables, path, solution, self.scratch)
        _, sigma, vh = np.linalg.svd(self.scratch.matrix[:-1, :-1])
        own = int((sigma > _SINGULAR * sigma[0]).sum())
        fewer = self.tables._replace(rank=own + 1)
        for direction in vh[own:].conj():
            ahead = solution.copy()
            ahead[:-1] += _STEP * direction / np.abs(direction).max()
            there, ends = ahead[None].copy(), np.zeros(1, dtype=np.int64)
            settle(fewer, path, there, ends, self.scratch)
            here, meant, moved = self.features(np.array([solution, ahead, there[0]]), motors)
            far = float(np.abs(meant - here).max(initial=0.0))
            if ends[0] != LOST and far > _IDLE and np.abs(moved - here).max(initial=0.0) > 0.5 * far:
                return True
        return False

    def features(self, solutions: Complex, where: Complex | Array | Path) -> Complex:
        """(count, 3 f) points and directions that tell solutions apart, at motors (motors,) or a path's beginning."""
        path = where if isinstance(where, Path) else self.at(where)
        given = np.array(solutions, dtype=complex, order="C").reshape(-1, len(self.passive) + 1)
        out = np.zeros((len(given), len(self.tables.wanted), 3), dtype=complex)
        measure(self.tables, path, given, out, self.scratch)
        return out.reshape(len(given), 3 * len(self.tables.wanted))


def scratch_of(tables: Tables, passive: int, motors: int) -> Scratch:
    """Memory for a linkage of so many unknowns and motors."""
    sizes = {BALL: 3, REVOLUTE: 6, PRISMATIC: 11, RIGID: 12}
    rows = sum(sizes[int(kind)] for kind in tables.loops[:, KIND]) + 1
    features, unknowns = len(tables.wanted), passive + 1

    def zeros(*shape: int) -> Complex:
        return np.zeros(shape, dtype=np.complex128)

    return Scratch(
        line=zeros(motors, 2), slice=zeros(3 * features + 2), bodies=zeros(len(tables.joints) + 1, 5, 3),
        found=zeros(features, 3), vectors=zeros(6, 3), matrix=zeros(rows, unknowns), motors=zeros(rows, motors),
        residual=zeros(rows), order=np.zeros(unknowns, dtype=np.int64), stages=zeros(6, unknowns),
    )  # fmt: skip


def _surplus(mechanism: Mechanism, rows: list[Array], columns: list[int], names: list[str]) -> tuple[str, ...]:
    """Motors that are one too many: what they do is determined by the others."""
    count = mechanism.loop_rank - mechanism.passive_rank
    if count == 0:
        return ()
    best: list[int] = []
    strongest = 0.0
    for matrix in rows:
        passive = np.linalg.svd(matrix[:, mechanism.passive_columns])[0][:, mechanism.passive_rank :]
        _, r, order = qr(passive.T @ matrix[:, columns], mode="economic", pivoting=True)
        weakest = abs(r[count - 1, count - 1])
        if weakest > strongest:
            best, strongest = order[:count].tolist(), weakest
    return tuple(names[k] for k in sorted(best))


def _listed(names: Iterable[str]) -> str:
    quoted = [f"'{name}'" for name in names]
    return quoted[0] if len(quoted) == 1 else f"{', '.join(quoted[:-1])} and {quoted[-1]}"
