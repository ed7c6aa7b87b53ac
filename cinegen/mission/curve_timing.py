"""Time laws of curves of all joints."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import CubicHermiteSpline, PchipInterpolator, PPoly

from cinegen.arrays import Array, Indices
from cinegen.errors import CinegenError
from cinegen.mission.branch import Branch
from cinegen.mission.file_format import MissionError
from cinegen.model import Mechanism
from cinegen.planning.singular_crossing import guided
from cinegen.planning.timing import TimeLaw, TimingError, derivatives, time_law
from cinegen.planning.torque_limits import TorqueLimits, TorqueTerms

_BETWEEN = 4  # points in each interval of the time law at which torques are tested


_NUDGE = 1e-4  # part of an interval by which friction counts inside of its ends, where joints may be at rest


class CurveTiming:
    """Time laws of a curve of all joints (nq,), at most as fast as its parameter.

    The passive joints of loops are not on the curve, but on a branch: where they have limits, a curve through their
    positions on the grid stands for them.

    Args:
        branch, curve, knots, recorded, velocity, acceleration, name, torques: as in `_timed`.
        grid: (n,) parameters between which the acceleration of the parameter is constant.

    Attributes:
        has_pace: whether the motion can't be slowed down at will, see `TorqueTerms.has_pace`.
        fastest: limit of the parameter's rate, 1/s.
    """

    fastest = 1.0

    def __init__(
        self, branch: Branch, curve: PPoly, knots: Array, grid: Array, recorded: Array, velocity: Array,
        acceleration: Array, name: str, torques: TorqueLimits | None,
    ) -> None:  # fmt: skip
        mechanism = branch.mechanism
        self._branch, self._curve, self._knots, self._recorded, self._name = branch, curve, knots, recorded, name
        self._torques, self._terms, self._tighter, self.has_pace = torques, None, np.ones(2), False
        if torques is not None:
            if torques.crosses and mechanism.is_constrained:
                grid = np.union1d(grid, torques.crossings(mechanism, self._configuration, grid))
            points = np.insert(grid, np.arange(1, len(grid)), 0.5 * (grid[1:] + grid[:-1]))
            tangents, bends = derivatives(curve, grid)
            terms = self._terms = self._terms_at(points, tangents, bends)
            self.has_pace = terms.has_pace
            if self.has_pace and mechanism.is_constrained and not torques.crosses:
                self._check_crossings(mechanism, torques, terms, grid)
            if self.has_pace:
                with np.errstate(divide="ignore", invalid="ignore"):
                    torques.check_static(terms.static[0, 0] / terms.weight[0, 0], "where the path begins")
                    torques.check_static(terms.static[2, -1] / terms.weight[2, -1], "where the path ends")
        self._grid = grid
        at_q, at_v = mechanism.structure.scalar_joints
        passive = at_q[np.isin(at_v, mechanism.structure.passive_columns)] if mechanism.is_constrained else at_q[:0]
        passive = passive[np.isfinite(velocity[passive]) | np.isfinite(acceleration[passive])]
        limited = np.setdiff1d(np.flatnonzero(np.isfinite(velocity) | np.isfinite(acceleration)), passive)
        values, slopes = curve(grid), curve(grid, 1)
        if len(passive):
            closed = self._closed(grid)
            values[:, passive] = closed[:, passive]
            slopes[:, passive] = PchipInterpolator(grid, closed[:, passive])(grid, 1)
        joints = np.concatenate([limited, passive])
        self._whole = CubicHermiteSpline(grid, values[:, joints], slopes[:, joints])
        self._limits = velocity[joints], acceleration[joints]

    def law(self, slower: float = 1.0, torque: float = 1.0) -> TimeLaw:
        """Return the fastest law, within limits that become tighter with each call: of velocity by a factor, of
        acceleration by its square, of torque by another factor.

        Raises:
            TimingError: there is none.
        """
        self._tighter *= slower, torque
        terms, (velocity, acceleration) = self._terms, self._limits
        if terms is not None:
            terms = terms.scaled(self._tighter[1])
        tighter = self._tighter[0]
        try:
            return time_law(self._whole, velocity / tighter, acceleration / tighter**2, self._grid, self.fastest, terms)
        except TimingError as error:
            if not self.has_pace:
                raise
            raise TimingError(
                f"{error}. It passes a singularity of type 2, or points at which torques do not hold the mechanism at "
                "rest: some speed must keep torques within limits there, and all before and after"
            ) from None

    def used(self, law: TimeLaw) -> Array:
        """Return the largest torques (joints,) of a law relative to their limits, between its knots, too."""
        parts = np.linspace(0.0, 1.0, _BETWEEN + 2)[1:-1]
        squares, steps = law.rates**2, np.diff(law.s)
        growth = np.diff(squares) / (2.0 * steps)
        points = (law.s[:-1, None] + parts * steps[:, None]).ravel()
        tangents, bends = self._curve(points, 1), self._curve(points, 2)
        square = (squares[:-1, None] + parts * np.diff(squares)[:, None]).ravel()
        terms = self._terms_at(points, tangents, bends, inner=False)
        largest = terms.used(np.repeat(growth, _BETWEEN), square)
        return np.asarray(np.nanmax(np.abs(largest), axis=0))

    def _check_crossings(self, mechanism: Mechanism, torques: TorqueLimits, terms: TorqueTerms, grid: Array) -> None:
        """Raise a `CinegenError` if the path passes a singularity of type 2."""
        if len(mechanism.actuated) != mechanism.mobility:
            torques.check_static(terms.static)
            return
        if len(torques.crossings(guided(mechanism, self._knots), self._configuration, grid)):
            raise CinegenError(
                f"{mechanism.name}: the path passes a type 2 singularity, where torques stay within limits at certain "
                "speeds only: --cross-singularities (crosses=True) finds one"
            )

    def _terms_at(self, points: Array, tangents: Array, bends: Array, inner: bool = True) -> TorqueTerms:
        """Return the torques at points (2 n - 1,): at the beginning, in the middle and at the end of each interval; or,
        unless `inner`, at each."""
        torques, mechanism, q = self._torques, self._branch.mechanism, self._closed(points)
        assert torques is not None
        q = np.array([q[:-2:2], q[1::2], q[2::2]]) if inner else q
        at = [mechanism.q_index(joint) for joint in mechanism.actuated]
        if torques.crosses and mechanism.is_constrained:
            return torques.crossing_terms(mechanism, q, tangents[..., at], bends[..., at])
        nudge = _NUDGE * np.diff(points[::2]) * np.array([[1.0], [0.0], [-1.0]]) if inner else np.zeros(len(points))
        return torques.terms(q, tangents[..., at], bends[..., at], nudge[..., None])

    def _configuration(self, s: float) -> Array:
        """Return the configuration (nq,) on the branch at a parameter."""
        ends = self._curve.x
        k = int(np.clip(np.searchsorted(ends, s, side="right") - 1, 0, len(ends) - 2))
        return np.asarray(self._branch.interpolate(self._knots[k], self._knots[k + 1], self._curve(np.array([s])))[0])

    def _closed(self, points: Array) -> Array:
        """Return the configurations (n, nq) on the branch at parameters (n,)."""
        ends = np.searchsorted(points, self._curve.x)
        along = self._curve(points)
        if points[-1] < self._curve.x[-1]:
            along = np.vstack([along, self._knots[-1:]])
        return closed_along(self._branch, self._knots, along, ends, self._recorded, self._name)[: len(points)]


def closed_along(branch: Branch, knots: Array, along: Array, ends: Indices, recorded: Array, name: str) -> Array:
    """Return configurations (n, nq) on the branch, with the actuated joints of others.

    Args:
        branch: interpolation on the branch.
        knots: (k, nq) recorded samples.
        along: (n, nq) configurations near them.
        ends: (k,) number of configurations before each recorded sample.
        recorded: (k,) times of the recorded samples in the recording, s.
        name: name of the robot.
    """
    if branch.mechanism.balls:
        along = np.array([branch.mechanism.structure.normalized(q) for q in along]).reshape(along.shape)
    if not branch.mechanism.is_constrained:
        return along
    closed = along.copy()
    for i, part in enumerate(map(slice, [0, *ends[1:-1]], [*ends[1:-1], len(along)])):
        if (along[part] == knots[i]).all():
            continue
        try:
            closed[part] = branch.interpolate(knots[i], knots[i + 1], along[part])
        except MissionError as error:
            when = f"between {recorded[i]:.3f} and {recorded[i + 1]:.3f} s of the recording"
            raise MissionError(f"{name} can't be exported: {when} it {error}") from None
    closed[-1] = knots[-1]
    return closed
