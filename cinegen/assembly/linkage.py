"""`Linkage`: the loops of a mechanism with its actuated joints locked, in complex numbers."""

from __future__ import annotations

import os
from collections.abc import Collection
from concurrent.futures import ThreadPoolExecutor
from functools import cached_property
from types import SimpleNamespace

import numpy as np
import pinocchio as pin
from numba import complex128, float64, int64, typeof

from cinegen.arrays import Array, Integers
from cinegen.assembly._kernels.equations import evaluate, write_features
from cinegen.assembly._kernels.tables import LOST, Complex, LinkageTables, ParameterPath
from cinegen.assembly._kernels.tracking import solve_from, track
from cinegen.assembly.bodies import CutJoint, LinkageBodies
from cinegen.assembly.certify import BodyFeature
from cinegen.assembly.dependent_joints import followers, list_of, redundant_joints, remedy
from cinegen.assembly.errors import FreeMotionError, ModesError
from cinegen.assembly.linkage_tables import Tracked, attached, scratch_of
from cinegen.assembly.results import NearestConfiguration
from cinegen.errors import ClosureError
from cinegen.jit.compiled import prepare, together
from cinegen.jit.interpreted import interpreted
from cinegen.joints import axis
from cinegen.model import Mechanism
from raff2urdf import closure
from raff2urdf.coupling import followed

ACCURACY = 3e-4
"""Target error of a prediction along a path, radians and characteristic lengths."""


_STILL = 1e-9  # a joint that loops move less is in none
_SINGULAR = 1e-3  # part of the largest singular value: a direction in which a solution near a singular one may move
_STEP = 0.05  # rad, characteristic lengths
_NEWTON_WORK = 3.0  # steps along a path that Newton's method from a random start costs
_MANY, _SHARE = 24, 6  # paths that are shared among threads, and how many each takes
_CORES = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
_IDLE = 1e-6  # a motion that moves features by less moves none of them


class Linkage:
    """The loops of a mechanism in complex numbers, for given values of its actuated joints.

    Unknown are the passive joints in loops, and of redundant actuated joints those that the others determine; all other
    joints are locked. Dimensionless: lengths are divided by the characteristic length. Not for two threads at once.

    Args:
        mechanism: with loops; its joints are revolute or prismatic.
        as_built: whether actuated joints are taken as they are, even if some are redundant or don't determine the
            others: to examine its structure; nothing can be solved so.
        distinct: passive joints whose values distinguish modes: they are no part of a universal or a ball joint.
        held: passive joints that are locked, too; see `linkage_of`.

    Attributes:
        locked: names of the locked joints, in q's order.
        passive: names of those that the loops determine, in q's order.
        redundant: names of those among them that are actuated.
        driving: (locked,) whether a locked joint moves loops, as those of a wrist do not.
        end: the body that the mechanism's end belongs to.
        idle: number of motions that move no feature, as of a rod about itself.
        work: multiplications done along paths, about: what `effort` limits is counted by it, not by a clock, so that
            results are reproducible.

    Raises:
        ModesError: no loops, or actuated joints that don't determine the others.
    """

    def __init__(
        self, mechanism: Mechanism, as_built: bool = False, distinct: Collection[str] = (), held: Collection[str] = ()
    ) -> None:
        self.mechanism = mechanism
        self.work = 0.0
        self._following, self._mimics = ([], {}) if as_built else followers(mechanism)
        if not mechanism.loops:
            raise ModesError(f"{mechanism.name} has no loops: each value of its joints has one configuration")
        model = mechanism.model
        self.root = 1 if mechanism.floating else 0  # a base that could move is fixed
        self._joints = range(1 + self.root, model.njoints)
        names = self.joint_names = [model.names[j] for j in self._joints]
        columns = {name: mechanism.v_index(name) for name in names}
        following = {coupling.follower for coupling in self._following}
        self._distinct = {*distinct, *self._mimics, *(mimic.leader for mimic in self._mimics.values())}
        system = mechanism.structure.system
        equations = system.rows - len(mechanism.couplings)  # of loops: couplings only declare where joints are
        rows = [system.evaluate(q)[1][:equations] for q in mechanism.structure.samples]
        for row in rows:
            for name, mimic in self._mimics.items():
                row[:, columns[mimic.leader]] += mimic.ratio * row[:, columns[name]]
                row[:, columns[name]] = 0.0
        inside = {name for name in names if max(np.abs(row[:, columns[name]]).max() for row in rows) > _STILL}
        determined = {*mechanism.actuated, *following, *self._mimics, *held}
        loose = [name for name in names if name not in inside and name not in determined]
        if loose:
            raise ModesError(
                f"{mechanism.name}: {list_of(loose)} {'is' if len(loose) == 1 else 'are'} neither actuated nor in a "
                "loop: there is a curve of configurations, not a number of them"
            )
        driven = [name for name in names if name in inside and name in mechanism.actuated]
        at = [columns[name] for name in driven]
        follow, mimics = bool(following), len(self._mimics)
        self.redundant = () if as_built else redundant_joints(mechanism, rows, at, driven, follow, mimics)
        passive = {name for name in inside if name not in determined or name in self.redundant}
        self.passive = tuple(name for name in names if name in passive)
        self.locked = tuple(name for name in names if name not in passive and name not in self._mimics)
        self.driving = np.array([name in inside for name in self.locked], dtype=bool)
        unknown = [columns[name] for name in self.passive]
        self._rank = max(closure.rank(row[:, unknown]) for row in rows)
        self.idle = len(self.passive) - self._rank
        self._prismatic = np.array([mechanism.is_prismatic(name) for name in names])
        self._index = np.array([mechanism.q_index(name) for name in names])
        self._unit = np.where(self._prismatic, mechanism.length, 1.0)
        self._passive, self._locked, self._redundant = (
            np.array([names.index(name) for name in some], dtype=np.intp)
            for some in (self.passive, self.locked, self.redundant)
        )
        self.revolute = np.asarray(~self._prismatic[self._locked])  # (locked,)
        frame = model.frames[mechanism.frame_id(mechanism.end)]
        self.end = max(int(frame.parentJoint) - self.root, 0)
        self.cuts = self._cuts()
        self.tables = self._tables()
        self.scratch = scratch_of(self.tables, len(self.passive))
        if not as_built:
            self._check_idle()

    @property
    def has_mimics(self) -> bool:
        """True if passive joints follow others in couplings, which no known family of linkages has."""
        return bool(self._mimics)

    # --- tables -------------------------------------------------------------------------------------------------------

    def _cuts(self) -> list[CutJoint]:
        mechanism, cuts = self.mechanism, []
        for loop, (first, first_end, second, second_end) in zip(
            mechanism.loops, mechanism.structure.system.anchors, strict=True
        ):
            anchors = [
                np.vstack([end.rotation.T, end.translation / mechanism.length]) for end in (first_end, second_end)
            ]
            bodies = max(first - self.root, 0), max(second - self.root, 0)
            cuts.append(CutJoint(loop.kind, bodies, np.array(anchors)))
        return cuts

    def _tables(self) -> LinkageTables:
        mechanism, model, count = self.mechanism, self.mechanism.model, len(self.joint_names)
        joints, self._axes = np.zeros((count, 3), dtype=np.int64), np.zeros((count, 3))
        constants, above = np.zeros((count, 15)), np.zeros((count + 1, count), dtype=np.int64)
        column = {int(k): i for i, k in enumerate([*self._passive, -1, *self._locked])}
        column |= {
            self.joint_names.index(name): column[self.joint_names.index(mimic.leader)]
            for name, mimic in self._mimics.items()
        }
        for k, j in enumerate(self._joints):
            parent, placement = model.parents[j] - self.root, model.jointPlacements[j]
            joints[k] = parent, self._prismatic[k], column[k]
            self._axes[k] = axis(model.joints[j])
            along, mimic = self._axes[k], self._mimics.get(self.joint_names[k])
            if mimic is not None:  # an unknown for both, along another axis
                along, shift = mimic.ratio * along, mimic.offset * along
                prismatic = bool(self._prismatic[k])
                placement = placement * pin.SE3(
                    np.eye(3) if prismatic else pin.exp3(shift), shift if prismatic else np.zeros(3)
                )
            constants[k] = *placement.rotation.ravel(), *(placement.translation / mechanism.length), *along
            above[k + 1] = above[parent]
            above[k + 1, k] = 1
        self._joint_table = joints
        self.bodies = self.bodies_at(mechanism.q_home)
        features = self.bodies.features
        return LinkageTables(
            joints, constants, above, *attached(self.cuts, features), features=len(features), rank=self._rank + 1
        )

    def bodies_at(self, q: Array) -> LinkageBodies:
        """Return the bodies with points and axes as they are at q (nq,)."""
        mechanism = self.mechanism
        mechanism.structure.system.evaluate(q)
        poses = [mechanism.structure.system.data.oMi[j] for j in (self.root, *self._joints)]
        placements = [pin.SE3(at.rotation, at.translation / mechanism.length) for at in poses]
        distinct = frozenset(k for k, name in enumerate(self.joint_names) if name in self._distinct)
        return LinkageBodies(
            self._joint_table, self._axes, len(self.passive), self.cuts, placements, self.end, distinct
        )

    @cached_property
    def kernel(self) -> SimpleNamespace:
        """The kernels, compiled at the first access: a linkage of which only the structure is asked needs none."""
        path = typeof(self.fixed(self.locked_values(self.mechanism.q_home)))
        tables, scratch, unknowns = typeof(self.tables), typeof(self.scratch), complex128[:, ::1]
        with together():
            prepare(track, tables, path, unknowns, int64[::1], float64[:, ::1], scratch)
            prepare(solve_from, tables, path, unknowns, int64[::1], scratch)
            prepare(write_features, tables, path, unknowns, complex128[:, :, ::1], scratch)
            prepare(evaluate, tables, path, complex128[::1], scratch)
        return SimpleNamespace(track=track, solve_from=solve_from, write_features=write_features, evaluate=evaluate)

    def _check_idle(self) -> None:
        """Refuse a mechanism whose locked joints don't determine its features: a general combination of them, which the
        slice selects, moves where any of them does."""
        cut = np.append(np.random.default_rng(0).normal(size=3 * self.tables.features), [0.0, 0.0]).astype(complex)
        plainly = interpreted(evaluate)  # a few times: not worth a compilation
        for q in self.mechanism.structure.samples if self.idle else ():
            plainly(
                self.tables, self.fixed(self.locked_values(q))._replace(slices=np.array([cut, cut])), self.unknowns(q),
                self.scratch,
            )  # fmt: skip
            matrix = self.scratch.matrix[: len(self.passive)].real.T
            if closure.rank(matrix[:-1]) < self._rank:
                continue  # a special configuration: there it may move, without doing so elsewhere
            motions = np.linalg.svd(matrix[:-1])[2][self._rank :].T
            if np.abs(matrix[-1] @ motions).max(initial=0.0) > _IDLE:
                raise FreeMotionError(
                    f"{self.mechanism.name}: with its actuated joints locked it still moves, with {self.idle} DoF that "
                    "its loops don't remove: there is a curve of configurations, not a number of them"
                    + remedy(self.mechanism, self.mechanism.uncontrolled, "actuated, too"),
                    self.idle,
                )

    def jacobian(self, solution: Complex, locked: Complex | Array) -> Complex:
        """Return the derivatives (rows, k) of all loops by the passive joints, at a solution (k + 1,)."""
        self.kernel.evaluate(self.tables, self.fixed(locked), solution, self.scratch)
        return np.asarray(self.scratch.matrix[: len(self.passive), :-1].T.copy())

    # --- values -------------------------------------------------------------------------------------------------------

    def redundancy_error(self, q: Array, asked: Array) -> Array:
        """Return how far redundant joints (redundant,) are from their values in q (nq,) `asked`, rad and characteristic
        lengths."""
        at = self._redundant
        gaps = (q[self._index[at]] - asked[self._index[at]]) / self._unit[at]
        return np.asarray(np.where(self._prismatic[at], gaps, (gaps + np.pi) % (2.0 * np.pi) - np.pi))

    def locked_values(self, q: Array) -> Array:
        """Return the values (locked,) of the locked joints in q (nq,), dimensionless; joints that follow others in
        couplings are where these drive them."""
        values = dict(zip(self.joint_names, q[self._index].tolist(), strict=True))
        all_values = followed(self._following, values)
        return np.array([all_values[name] for name in self.locked]) / self._unit[self._locked]

    def actuated_values(self, q: Array) -> Array:
        """Return the values (actuated,) of all actuated joints in q (nq,), rad and m, in the mechanism's order."""
        return np.asarray(q[[self.mechanism.q_index(name) for name in self.mechanism.actuated]])

    def unknowns(self, q: Array) -> Complex:
        """Return (k + 1,) the passive joints' values in q (nq,), dimensionless, and t = 0."""
        return np.append(q[self._index[self._passive]] / self._unit[self._passive], 0.0).astype(complex)

    def configuration(self, solution: Complex, locked: Array) -> Array:
        """Return q (nq,) of a solution's real part; angles within half a revolution of home's."""
        mechanism, home = self.mechanism, self.mechanism.q_home
        q, at, index = home.copy(), self._passive, self._index[self._passive]
        q[self._index[self._locked]] = locked * self._unit[self._locked]
        values = solution[:-1].real * self._unit[at]
        about_home = home[index] + (values - home[index] + np.pi) % (2.0 * np.pi) - np.pi
        q[index] = np.where(self._prismatic[at], values, about_home)
        for name, mimic in self._mimics.items():
            q[mechanism.q_index(name)] = mimic.ratio * q[mechanism.q_index(mimic.leader)] + mimic.offset
        return q

    def closed(self, q: Array) -> Array | None:
        """Return the closed configuration (nq,) that Newton's method reaches from q with locked joints fixed; None if
        it doesn't converge."""
        try:
            return self.mechanism.close(q, self.locked)
        except ClosureError:
            return None

    def nearest(self, starts: list[Array], message: str = "") -> NearestConfiguration:
        """Return the configuration with the smallest gap that least squares reaches from starts (nq,), at which locked
        joints have the values asked for; with a message of the open loops unless one is given."""
        mechanism = self.mechanism
        free = np.ones(mechanism.model.nv, dtype=bool)
        free[[mechanism.v_index(name) for name in self.locked]] = False
        closings = (closure.close(mechanism.structure.system, start, free) for start in starts)
        best = min(closings, key=lambda closing: closing.gap)
        gaps = zip(mechanism.constraint_names, closure.gaps(mechanism.structure.system, best.q), strict=True)
        listed = ", ".join(f"'{name}' by {gap:.3g}" for name, gap in gaps if gap > closure.CLOSED)
        unit = f"(rad, or lengths of {mechanism.length:.4g} m)"
        return NearestConfiguration(best.q, best.gap, message or f"open stay {listed} {unit}")

    @property
    def body_features(self) -> tuple[BodyFeature, ...]:
        """The features with the joints that move their bodies, m."""
        units = {True: 1.0, False: self.mechanism.length}
        return tuple(
            BodyFeature(self.joint_names[f.body - 1], f.is_direction, tuple((f.local * units[f.is_direction]).tolist()))
            for f in self.bodies.features
            if f.body > 0
        )

    # --- paths --------------------------------------------------------------------------------------------------------

    def fixed(self, locked: Complex | Array) -> ParameterPath:
        """Return the path on which locked joints stay at values (locked,)."""
        return self.straight(locked, locked)

    def straight(self, start: Complex | Array, goal: Complex | Array) -> ParameterPath:
        """Return the straight path of locked joints from values (locked,) to others."""
        lines = np.zeros((2, len(self.locked), 2), dtype=complex)
        lines[0, :, 0], lines[1, :, 0] = start, goal
        return ParameterPath(lines, np.array([self.zero_slice, self.zero_slice]), False, ACCURACY)

    @cached_property
    def zero_slice(self) -> Complex:
        """(3 f + 2,) the slice t = 0."""
        plain = np.zeros(3 * self.tables.features + 2, dtype=complex)
        plain[-2] = 1.0
        return plain

    @cached_property
    def _step_work(self) -> float:
        """Cost of a step along a path: least squares, derivatives, and placements."""
        rows, columns = len(self.scratch.residual), len(self.passive) + 1
        return float(rows * columns * (columns + 20) + 3000)

    def track(self, solutions: Complex, path: ParameterPath, rank: int | None = None) -> Tracked:
        """Continue solutions (count, k + 1) along a path, with a rank of the loops unless it is the general one."""
        tables = self._of_rank(rank)
        tracked = np.array(solutions, dtype=complex, order="C").reshape(-1, len(self.passive) + 1)
        ends, records = np.zeros(len(tracked), dtype=np.int64), np.zeros((len(tracked), 2))
        track = self.kernel.track
        if len(tracked) < _MANY or _CORES == 1:
            track(tables, path, tracked, ends, records, self.scratch)
        else:
            shares = [slice(k, k + _SHARE) for k in range(0, len(tracked), _SHARE)]

            def follow(share: slice) -> None:
                scratch = scratch_of(self.tables, len(self.passive))
                track(tables, path, tracked[share], ends[share], records[share], scratch)

            with ThreadPoolExecutor(_CORES) as threads:  # the kernel does without Python's lock
                list(threads.map(follow, shares))
        self.work += float(records[:, 1].sum()) * self._step_work
        return Tracked(tracked, ends, records[:, 0])

    def random_unknowns(self, rng: np.random.Generator, count: int, imaginary: float) -> Complex:
        """Return random unknowns (count, k + 1), and t = 0; with imaginary parts of a standard deviation."""
        shape = count, len(self.passive) + 1
        guesses = np.pi * rng.uniform(-1.0, 1.0, size=shape) + 1j * imaginary * rng.normal(size=shape)
        guesses[:, -1] = 0.0
        return np.asarray(guesses)

    def newton(
        self, guesses: Complex, where: Complex | Array | ParameterPath, rank: int | None = None
    ) -> tuple[Complex, Integers]:
        """Apply Newton's method to guesses (count, k + 1) at values (locked,) or at a path's beginning, with a rank of
        the loops unless it is the general one. Return where it ends, and how: ARRIVED, SINGULAR or LOST."""
        path = where if isinstance(where, ParameterPath) else self.fixed(where)
        solutions, ends = np.array(guesses, dtype=complex, order="C"), np.zeros(len(guesses), dtype=np.int64)
        self.kernel.solve_from(self._of_rank(rank), path, solutions, ends, self.scratch)
        self.work += _NEWTON_WORK * len(solutions) * self._step_work
        return solutions, ends

    def _of_rank(self, rank: int | None) -> LinkageTables:
        return self.tables if rank is None else self.tables._replace(rank=rank + 1)

    def can_move(self, solution: Complex, locked: Array) -> bool:
        """Return whether a singular solution (k + 1,) lies on a curve of solutions on which features move: whether it
        can move farther than infinitesimally."""
        _, sigma, vh = np.linalg.svd(self.jacobian(solution, locked))
        rank = int((sigma > _SINGULAR * sigma[0]).sum())
        for direction in vh[rank:].conj():
            ahead = solution.copy()
            ahead[:-1] += _STEP * direction / np.abs(direction).max()
            reached, ends = self.newton(ahead[None], locked, rank)
            start, meant, moved = self.features(np.array([solution, ahead, reached[0]]), locked)
            far = float(np.abs(meant - start).max(initial=0.0))
            if ends[0] != LOST and far > _IDLE and np.abs(moved - start).max(initial=0.0) > 0.5 * far:
                return True
        return False

    def features(self, solutions: Complex, where: Complex | Array | ParameterPath) -> Complex:
        """Return the points and directions (count, 3 f) that distinguish solutions (count, k + 1), at values (locked,)
        or at a path's beginning."""
        path = where if isinstance(where, ParameterPath) else self.fixed(where)
        unknowns = np.array(solutions, dtype=complex, order="C").reshape(-1, len(self.passive) + 1)
        out = np.zeros((len(unknowns), self.tables.features, 3), dtype=complex)
        self.kernel.write_features(self.tables, path, unknowns, out, self.scratch)
        return out.reshape(len(unknowns), 3 * self.tables.features)


def linkage_of(mechanism: Mechanism, distinct: Collection[str] = ()) -> Linkage:
    """Return the linkage of a mechanism; idle motions that would move its features are locked, one joint each.

    Raises:
        ModesError: see `Linkage`.
    """
    try:
        return Linkage(mechanism, distinct=distinct)
    except ModesError:
        held = mechanism.structure.idle_joints
        if not held:
            raise
        return Linkage(mechanism, distinct=distinct, held=held)
