"""`calibrate`: the true dimensions of a robot, from measurements of any kind.

    found = calibrate("gough", "measurements.csv")
    print(found.text())
    Path("calibrated.raff").write_text(found.raff())

With residuals f(theta) of all readings (module `observation`), whitened by their covariance, scipy's
`least_squares` minimises |f|^2 over the combinations that are determined at nominal geometry (`identifiability`):
theta = theta_0 + D V z, with the expected errors D. All other combinations W keep their nominal values. They act on
readings by effects of second order: errors w along W, which nothing measures, change the readings by J_W w, as J_W is
not 0 at the estimate, and by w^T H w / 2. Both bias z, by B = (J^T J)^-1 J^T times them. The covariance of the estimate
is the Cramer-Rao bound and the second moment of that bias: of its linear part as it is, of its quadratic one by random
w. Errors w are taken to be as large as those that are determined: s expected ones, the median of |z|, and 1 at least.

Outliers: the estimate begins from readings that the expected errors can explain, with a convex loss (soft L1),
continues with a redescending one (Cauchy), and ends with plain least squares of the readings whose studentised
residuals are below `REJECTED`; the others are listed.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import least_squares
from scipy.special import gammainc

from cinegen.arrays import Array, Bools
from cinegen.design.amounts import Amounts, amount_in, pairs
from cinegen.design.calibration.checks import ContradictionError, check, check_fit, doubt
from cinegen.design.calibration.comparison import ColumnComparison
from cinegen.design.calibration.identifiability import LISTED, Dependency, Subspace, dependencies, subspace
from cinegen.design.calibration.left_out import is_poor, left_out
from cinegen.design.calibration.measurements import Measurements
from cinegen.design.calibration.observation import Observation, Prediction
from cinegen.design.errors import DesignError
from cinegen.design.parameters import Parameters
from cinegen.design.ties import fits
from cinegen.errors import warn
from cinegen.typed_json import as_json
from raff2urdf import closure
from raff2urdf.quantities import ANGLE, LENGTH, Dimension
from raff2urdf.raff.document import Document

LENGTH_ERROR, ANGLE_ERROR = 3e-4, math.radians(0.05)
"""Expected errors of manufacture and assembly, m and rad, of parameters for which none is given."""

REJECTED = 4.0
"""Studentised residuals beyond this many standard deviations are outliers."""

_STARTS = 8.0  # expected standard deviations beyond which a reading is left out at first
_CAUCHY = 2.0  # standard deviations from which the redescending loss weakens
_ROUNDS = 12  # of rejection
_SAMPLES = 64  # of errors that nothing measures
_SMALL = 0.04  # chi-square per degree of freedom below which sigmas are too large
_UNLIKELY = 1e-6  # probability of a chi-square that is smaller
_COMPUTED = 1e-8  # the same below which readings were computed, not measured
_SEEN = 4  # poses that are compared for motions of the whole robot
_OWN = 1.0 - 1e-9  # a parameter of this determined length is determined by itself
_WITHOUT = 1e-7  # one below has no effect


@dataclass(frozen=True)
class Outlier:
    """A reading that was left out.

    Attributes:
        pose: index.
        column: of the measurements.
        where: pose and column by name.
        residual: expected minus measured, m or rad.
        sigmas: the same in standard deviations.
    """

    pose: int
    column: int
    where: str
    residual: float
    sigmas: float


@dataclass(frozen=True)
class HeldOut:
    """Errors of readings that an estimate has not used, per kind: root mean squares, m or rad; NaN without any.

    Attributes:
        dimension: length or angle.
        count: number of readings.
        before: at nominal values.
        after: calibrated.
        kept: likewise, without outliers.
        noise: of the readings themselves.
    """

    dimension: Dimension
    count: int
    before: float
    after: float
    kept: float
    noise: float


@dataclass(frozen=True, eq=False)
class Calibration:
    """Estimates of the parameters of a robot. All values in m and rad, gains dimensionless.

    Attributes:
        observation: of the measurements.
        names: (parameters,) of the description, then gains of encoders, then of frames that were not known.
        nominal: (parameters,) values as written; 0 of gains, and of frames where the readings put them.
        values: (parameters,) estimates; what is not determined is nominal.
        covariance: (parameters, parameters) of the determined part of the estimates: the Cramer-Rao bound, and
            what expected errors of the other part add.
        subspace: the combinations that are determined.
        combinations: (combinations,) their estimates, in expected errors.
        combination_covariance: (combinations, combinations).
        dependencies: parameters that can't be told apart.
        without_effect: names of parameters that change no reading.
        opening: names of parameters that are not estimated: their errors would open loops of an over-constrained
            mechanism.
        before: (poses, outputs) expected minus measured readings at nominal values; NaN where nothing was measured.
        after: likewise, calibrated.
        standard: (poses, outputs) standard deviations of the readings, with what errors of the inputs add.
        kept: (poses, outputs) which readings the estimate is made of.
        outliers: the others.
        chi2: sum of squares of whitened residuals of the readings kept.
        degrees_of_freedom: readings minus combinations.
        folds: of the cross-validation; 0 without.
        held_out: its errors.
    """

    observation: Observation
    names: tuple[str, ...]
    nominal: Array
    values: Array
    covariance: Array
    subspace: Subspace
    combinations: Array
    combination_covariance: Array
    dependencies: tuple[Dependency, ...]
    without_effect: tuple[str, ...]
    opening: tuple[str, ...]
    before: Array
    after: Array
    standard: Array
    kept: Bools
    outliers: tuple[Outlier, ...]
    chi2: float
    degrees_of_freedom: int
    folds: int = 0
    held_out: tuple[HeldOut, ...] = field(default=())

    def __repr__(self) -> str:
        count = self.subspace.basis.shape[1]
        return f"<Calibration of {self.parameters.robot.name}: {count} combinations of {len(self.names)} parameters>"

    @property
    def parameters(self) -> Parameters:
        """The free parameters of the description."""
        return self.observation.design.parameters

    @property
    def sigmas(self) -> Array:
        """(parameters,) standard deviations of the determined part of the estimates."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def separate(self) -> Bools:
        """(parameters,) which are determined by themselves."""
        return np.asarray(self.subspace.lengths > _OWN)

    @property
    def frames(self) -> dict[str, Array]:
        """Poses (4, 4) of devices in the world, and of targets on their nodes, m: those that were not known."""
        own, known = self.observation.frames, len(self.names) - len(self.observation.frames)
        return {name: own.pose(name, self.values[known:]) for name in own.start}

    @property
    def fit(self) -> float:
        """Chi-square per degree of freedom; about 1 if the sigmas are right. NaN without degrees of freedom."""
        return self.chi2 / self.degrees_of_freedom if self.degrees_of_freedom > 0 else math.nan

    def raff(self) -> str:
        """Return the RAFF file with the estimates; comments stay. Offsets of encoders change the home that is written;
        RAFF has no statement for gains."""
        return self.parameters.with_values(self.values[: len(self.parameters)])

    def unit(self, name: str) -> str:
        """Return the unit of a parameter: m, rad, or "" of a gain."""
        return self.observation.units[self.names.index(name)]

    def dimension(self, name: str) -> Dimension:
        """Return whether a parameter is a length or an angle."""
        return LENGTH if self.unit(name) == "m" else ANGLE

    def as_dict(self) -> dict[str, Any]:
        """Return what JSON shows: m and rad."""
        kinds = {LENGTH: "length", ANGLE: "angle"}
        columns = zip(self.names, self.nominal, self.values, self.sigmas, self.separate, strict=True)
        left_out = (*self.without_effect, *self.opening, *self.observation.frames.names)
        return as_json(
            self, "names", "covariance", "without_effect", "opening", "chi2", "degrees_of_freedom", "folds",
            poses=len(self.observation.measurements),
            readings=int(np.isfinite(self.before).sum()),
            parameters=[
                {"name": name, "unit": self.unit(name), "nominal": a, "value": b, "sigma": s, "separate": own}
                for name, a, b, s, own in columns
                if name not in left_out
            ],
            frames=[{"name": name, "pose": pose} for name, pose in self.frames.items()],
            identifiable=self.subspace.rank,
            estimated=self.subspace.basis.shape[1],
            dependencies=[as_json(one, "names", "changes", "text") for one in self.dependencies],
            outliers=[
                as_json(one, "residual", "sigmas", pose=self.observation.measurements.labels[one.pose], text=one.where)
                for one in self.outliers
            ],
            held_out=[
                as_json(one, "before", "after", "kept", "noise", kind=kinds[one.dimension], readings=one.count)
                for one in self.held_out
            ],
        )  # fmt: skip


def calibrate(
    source: str | Path | Document | Parameters,
    measurements: str | Path | Measurements,
    *,
    names: Iterable[str] = ("*",),
    ties: Iterable[str] = (),
    sigma: Amounts | None = None,
    gains: Sequence[str] = (),
    robust: bool = True,
    folds: int = 5,
    robot: str | None = None,
) -> Calibration:
    """Estimate the parameters of a robot.

    Args:
        source: as `Parameters` takes it; or parameters, whose names and ties are used then.
        measurements: or a CSV file, see `Measurements`.
        names: patterns of the parameters that are estimated; offsets of all encoders come with `*`.
        ties: of parameters.
        sigma: expected errors of manufacture, by name or pattern: m or rad, or a text such as "0.1mm"; 0.3 mm and 0.05
            degrees where none is given. They scale the parameters; they are no measurements.
        gains: joints whose encoders have an unknown gain.
        robust: whether outliers are found and left out.
        folds: parts of the poses for the cross-validation; 0 for none.
        robot: name of one robot of a file that holds several.

    Raises:
        DesignError: measurements that don't fit the robot, are in another unit or frame, or determine nothing; most
            readings of a column contradict the others.
        raff2urdf.RaffError: a file is wrong.
    """
    whole = source if isinstance(source, Parameters) else Parameters(source, robot=robot)
    read = measurements if isinstance(measurements, Measurements) else Measurements.load(measurements, whole.mechanism)
    parameters = whole if isinstance(source, Parameters) else _with_offsets(whole, names, ties, read)

    observation = Observation(parameters, read, gains)
    known = observation.expected_errors(expected_errors(parameters, sigma))
    comparison = ColumnComparison(observation, known[: len(known) - len(observation.frames)])
    check(comparison)
    found = _estimate(parameters, read, sigma, gains, robust, folds)
    check_fit(comparison, found)
    why = doubt(found)
    if why is not None and not why.remedy:
        raise ContradictionError(why.text)
    if why is not None:
        warn(f"{why.text}. If that is real, give what you expect: --sigma {why.remedy}")

    def again(others: Parameters, given: Measurements, larger: dict[str, float]) -> Calibration:
        return _estimate(others, given, [*pairs(sigma), *larger.items()], gains, False, 0)

    _warn(found, left_out(found, again))
    return found


def _estimate(
    parameters: Parameters, read: Measurements, sigma: Amounts | None, gains: Sequence[str], robust: bool, folds: int
) -> Calibration:
    """Estimate parameters, whatever the estimate is; see `calibrate`."""
    observation = Observation(parameters, read, gains)
    nominal = observation.predict(observation.values)
    before = observation.residuals(nominal)
    present = np.isfinite(before)
    solver = _solver(observation, nominal, sigma)
    errors, standard = solver.errors, solver.standard
    space = subspace(solver.whiten(nominal.jacobian, present), errors)
    if not space.basis.shape[1]:
        raise DesignError(f"{read.source}: no parameter changes any of the readings: nothing can be estimated")
    kept = present.copy()
    z = np.zeros(space.basis.shape[1])
    if robust:
        z, kept = solver.robust(space, nominal, before)
    z = solver.least_squares(space, z, kept)
    theta = observation.values + space.changes @ z
    final = observation.predict(theta)
    after = observation.residuals(final)
    rows = solver.whiten(final.jacobian, kept) * errors
    jacobian = rows @ space.basis
    covariance: Array = np.asarray(np.linalg.pinv(jacobian.T @ jacobian, hermitian=True), dtype=float)
    typical = max(1.0, float(np.median(np.abs(z))) / 0.6745)  # error, in expected ones
    curved = solver.curvature(space, theta, typical, kept)
    bias = covariance @ jacobian.T @ np.hstack([typical * (rows - jacobian @ space.basis.T), curved])
    covariance = covariance + bias @ bias.T
    whitened = solver.whiten(after[..., None], kept)
    return Calibration(
        observation, observation.names, observation.values, theta, space.changes @ covariance @ space.changes.T, space,
        z, covariance, _dependencies(observation, space, errors, nominal.q),
        tuple(n for n, s, e in zip(observation.names, space.lengths, errors, strict=True) if s < _WITHOUT and e > 0.0),
        nominal.opening, before, after, standard, kept, tuple(_outliers(observation, after, standard, present & ~kept)),
        float((whitened**2).sum()), int(kept.sum()) - len(z), *_held_out(solver, space, folds, kept, before, nominal),
    )  # fmt: skip


def _solver(observation: Observation, nominal: Prediction, sigma: Amounts | None) -> _Solver:
    errors = observation.expected_errors(expected_errors(observation.design.parameters, sigma))
    errors[[name in nominal.opening for name in observation.names]] = 0.0
    return _Solver(observation, observation.covariances(nominal), errors)


def expected_errors(parameters: Parameters, sigma: Amounts | None) -> Array:
    """Return the expected errors (count,) of free parameters, m and rad; later patterns replace earlier ones.

    Raises:
        DesignError: an unknown name, a wrong unit, or an error that is not above 0.
    """
    indices = [parameters.find(name) for name in parameters.names]
    found = np.array([LENGTH_ERROR if parameters.all[i].unit == "m" else ANGLE_ERROR for i in indices])
    for pattern, amount in pairs(sigma):
        matching = parameters.matching([pattern])
        fitting = [i for i in matching if fits(str(amount), parameters.all[i].dimension)] or matching
        for i in set(fitting) & set(indices):
            value = amount_in(f"expected error of {pattern}", amount, parameters.all[i].dimension)
            if not value > 0.0:
                raise DesignError(f"expected error of {pattern}: {amount} is not above 0")
            found[indices.index(i)] = value
    return found


class _Solver:
    """Residuals of an observation in the combinations of a subspace, whitened."""

    def __init__(self, observation: Observation, covariances: Array, errors: Array) -> None:
        self.observation, self.covariances, self.errors = observation, covariances, errors
        self.standard = np.sqrt(np.einsum("nkk->nk", covariances))

    def expected(self, nominal: Prediction) -> Array:
        """Return the standard deviations (poses, outputs) that residuals at nominal values have by the expected errors
        of parameters and readings; frames are where their readings put them."""
        known = len(self.errors) - len(self.observation.frames)
        return np.asarray(np.sqrt(self.standard**2 + ((nominal.jacobian * self.errors)[..., :known] ** 2).sum(axis=2)))

    def whiten(self, rows: Array, kept: Bools) -> Array:
        """Return rows (poses, outputs, .) of the readings kept (poses, outputs), whitened: (rows, .)."""
        is_diagonal = not self.observation.input_sigmas.any()
        if is_diagonal:
            return np.asarray((rows / self.standard[..., None])[kept])
        found = []
        for one, covariance, mask in zip(rows, self.covariances, kept, strict=True):
            if mask.any():
                factor = np.linalg.cholesky(covariance[np.ix_(mask, mask)])
                found.append(np.linalg.solve(factor, one[mask]))
        return np.concatenate(found)

    def least_squares(self, space: Subspace, z: Array, kept: Bools, loss: str = "linear", scale: float = 1.0) -> Array:
        """Return the combinations (combinations,) that minimise the loss of the readings kept, from z. Losses that are
        not linear take readings as independent."""
        observation = self.observation
        last: dict[bytes, Prediction] = {}
        independent = loss != "linear"

        def predicted(z: Array) -> Prediction:
            key = z.tobytes()
            if key not in last:
                last.clear()
                last[key] = observation.predict(observation.values + space.changes @ z)
            return last[key]

        def whitened(rows: Array) -> Array:
            return (rows / self.standard[..., None])[kept] if independent else self.whiten(rows, kept)

        def residuals(z: Array) -> Array:
            found = predicted(z)
            if not (found.gap <= closure.CLOSED).all():
                return np.full(int(kept.sum()), 1e9)  # refused: the step is shortened
            return whitened(observation.residuals(found)[..., None])[:, 0]

        def jacobian(z: Array) -> Array:
            return np.asarray(whitened(predicted(z).jacobian) @ space.changes)

        tolerance = 1e-10 if loss == "linear" else 1e-5
        done = least_squares(
            residuals, z, jacobian, method="trf", loss=loss, f_scale=scale, xtol=tolerance, ftol=tolerance,
            gtol=1e-8, max_nfev=60,
        )  # fmt: skip
        if not done.success and loss == "linear":
            warn(f"{observation.measurements.source}: the estimate has not converged in {done.nfev} evaluations")
        return np.asarray(done.x)

    def curvature(self, space: Subspace, theta: Array, size: float, kept: Bools) -> Array:
        """Return what random errors along combinations that are not determined, of a size in expected ones, change the
        readings by in second order, whitened (rows, samples): their second moment is the product with its transpose."""
        random = np.random.default_rng(0).normal(size=(len(theta), _SAMPLES)) * (self.errors > 0.0)[:, None]
        changes = size * self.errors[:, None] * (random - space.basis @ (space.basis.T @ random))
        here, sums = self.observation.predict(theta, derivatives=False), list[Array]()
        for change in changes.T:
            both = [self.observation.predict(theta + sign * change, derivatives=False) for sign in (1.0, -1.0)]
            if all((one.gap <= closure.CLOSED).all() for one in both):
                sums.append(sum(map(self.observation.residuals, both)) / 2.0 - self.observation.residuals(here))
        return (
            self.whiten(np.stack(sums, axis=-1), kept) / math.sqrt(len(sums))
            if sums
            else np.zeros((int(kept.sum()), 0))
        )

    def robust(self, space: Subspace, nominal: Prediction, before: Array) -> tuple[Array, Bools]:
        """Return combinations, and which readings (poses, outputs) are no outliers."""
        present = np.isfinite(before)
        sizes = np.abs(before) / self.expected(nominal)
        start = present & (sizes <= _STARTS * max(1.0, float(np.median(sizes[present])) / 0.6745))
        z = self.least_squares(space, np.zeros(space.basis.shape[1]), start, "soft_l1")
        z = self.least_squares(space, z, present, "cauchy", _CAUCHY)
        kept = np.zeros_like(present)
        for _ in range(_ROUNDS):
            found = self.observation.predict(self.observation.values + space.changes @ z)
            sizes = self._studentised(space, found, kept if kept.any() else present)
            scale = max(1.0, float(np.median(sizes[present])) / 0.6745)
            wanted = present & (sizes <= REJECTED * scale)
            if (wanted == kept).all():
                break
            kept = wanted
            if kept.sum() < len(z):
                contrary, count = int(present.sum() - kept.sum()), int(present.sum())
                raise ContradictionError(
                    f"{self.observation.measurements.source}: {contrary} of {count} readings contradict the others"
                )
            z = self.least_squares(space, z, kept)
        return z, kept

    def _studentised(self, space: Subspace, found: Prediction, kept: Bools) -> Array:
        """Return residuals (poses, outputs) in their standard deviations, were they estimated without themselves."""
        residuals = self.observation.residuals(found) / self.standard
        rows = found.jacobian @ space.changes / self.standard[..., None]
        inside = rows[kept]
        inverse = np.linalg.pinv(inside.T @ inside, hermitian=True)
        leverage = np.einsum("nkz,zy,nky->nk", rows, inverse, rows)
        spread = np.where(kept, np.maximum(1.0 - leverage, 1e-6), 1.0 + leverage)
        return np.asarray(np.nan_to_num(np.abs(residuals) / np.sqrt(spread), nan=0.0))


# --- what is checked and told -----------------------------------------------------------------------------------------


def _with_offsets(
    whole: Parameters, names: Iterable[str], ties: Iterable[str], measurements: Measurements
) -> Parameters:
    """Return the parameters with those names, and with the offsets of measured joints' encoders where `*` is one."""
    wanted = [names] if isinstance(names, str) else list(names)
    if "*" in wanted:
        wanted += [whole.own_variable(one.of).name for one in measurements.quantities if one.kind == "joint"]
    return Parameters(whole.document, wanted, ties, robot=whole.robot.name)


def _dependencies(observation: Observation, space: Subspace, errors: Array, q: Array) -> tuple[Dependency, ...]:
    """Return what can't be told apart. A dependency that moves what is measured by one twist of the world in all poses
    (poses, nq), with the devices, moves the robot as one body: it is named so."""
    estimated = np.flatnonzero(errors > 0.0).tolist()
    inner = Subspace(space.basis[estimated], space.singular_values, errors[estimated], space.rank)
    parameters = observation.design.parameters
    nodes_of = parameters.robot.nodes.values()
    parents = {_keyword(parameters, one.number): _keyword(parameters, getattr(one, "pred", None)) for one in nodes_of}
    frames, bodies = observation.frames, list[Array]()
    some = np.linspace(0, len(q) - 1, min(len(q), _SEEN)).astype(int)
    here = observation.design.evaluate(q=q[some])
    measured = dict.fromkeys(one.of for one in observation.quantities if one.kind != "joint")
    for node in measured or (observation.design.mechanism.end,):
        origins = here.placements(node)[:, None, :3, 3]
        for origin, twist in zip(origins, here.pose_derivative(node, "world"), strict=True):
            at_world = np.vstack([twist[:3] + np.cross(origin, twist[3:].T).T, twist[3:]])
            bodies.append(np.hstack([at_world, np.zeros((6, len(observation) - len(parameters)))]))
    for name in frames.devices:
        bodies.append(np.zeros((6, len(observation))))
        bodies[-1][:, len(observation) - len(frames) :] = frames.twists(name)
    names, motions = [observation.names[k] for k in estimated], np.array(bodies)[:, :, estimated]
    found = dependencies(inner, names, [observation.units[k] for k in estimated], parents, motions)
    moving = f"robot and {' and '.join(frames.devices)}" if frames.devices else "base and platform"
    described = list[Dependency]()
    for one in found:
        at = [names.index(name) for name in one.names]
        text = one.text
        if len(one.changes) == 1 and len(bodies) > 1:
            moved = motions[:, :, at] @ one.changes[0]
            size = float(np.abs(moved).max())
            if size > 1e-9 and np.abs(moved - moved[-1]).max() < 1e-7 * size:
                if len(one.names) > LISTED:
                    of = ", ".join(dict.fromkeys(name.rpartition(".")[0] for name in one.names))
                    text = f"no reading changes ({len(one.names)} parameters of {of})"
                text = f"{moving} move together as one body: {text}"
        described.append(Dependency(one.names, one.changes, text))
    return tuple(described)


def _keyword(parameters: Parameters, number: int | None) -> str:
    if number is None or number not in parameters.robot.nodes:
        return ""
    return f"{parameters.robot.nodes[number].keyword}{number}" if number else "base"


def _outliers(observation: Observation, after: Array, standard: Array, left_out: Bools) -> Iterable[Outlier]:
    for pose, k in np.argwhere(left_out).tolist():
        column = observation.outputs[k]
        residual = float(after[pose, k])
        yield Outlier(
            pose,
            column,
            observation.measurements.cell(pose, column),
            residual,
            abs(residual) / float(standard[pose, k]),
        )


def _held_out(
    solver: _Solver, space: Subspace, folds: int, kept: Bools, before: Array, nominal: Prediction
) -> tuple[int, tuple[HeldOut, ...]]:
    """Return the number of folds, and the errors of poses that an estimate from the other poses has not used; readings
    that are outliers for all poses together are in none."""
    poses, observation = len(before), solver.observation
    folds = min(folds, poses)
    if folds < 2:
        return 0, ()
    order = np.random.default_rng(0).permutation(poses)
    after = np.full_like(before, np.nan)
    for part in range(folds):
        held = order[part::folds]
        training = kept.copy()
        training[held] = False
        if not training.any():
            return 0, ()
        inner = subspace(solver.whiten(nominal.jacobian, training) @ (space.basis @ space.basis.T), solver.errors)
        z = solver.least_squares(inner, np.zeros(inner.basis.shape[1]), training)
        here = observation.predict(observation.values + inner.changes @ z, derivatives=False)
        after[held] = observation.residuals(here)[held]
    found = []
    for dimension in (LENGTH, ANGLE):
        columns = [one.dimension is dimension for one in observation.quantities]
        mask = np.isfinite(before) & np.array(columns)
        if mask.any():
            within = (after, mask & kept) if (mask & kept).any() else (after, mask)
            rms = [_rms(*one) for one in ((before, mask), (after, mask), within, (solver.standard, mask))]
            found.append(HeldOut(dimension, int(mask.sum()), *rms))
    return folds, tuple(found)


def _rms(values: Array, mask: Bools) -> float:
    return float(np.sqrt(np.mean(values[mask] ** 2)))


def _warn(found: Calibration, instead: str) -> None:
    source = found.observation.measurements.source
    if found.degrees_of_freedom <= 0:
        warn(
            f"{source}: {int(found.kept.sum())} readings for {len(found.combinations)} combinations of parameters: any "
            "errors fit, and the residuals show nothing; measure more poses"
        )
    elif is_poor(found):
        warn(
            f"{source}: the residuals are {math.sqrt(found.fit):.2g} times what the sigmas of the readings allow: "
            "these are too small, or something else than the parameters is wrong (backlash, bending, thermal growth)"
            f"{instead and f'. {instead}'}"
        )
    elif instead:
        warn(f"{source}: {instead}")
    elif _COMPUTED < found.fit < _SMALL and gammainc(found.degrees_of_freedom / 2, found.chi2 / 2) < _UNLIKELY:
        warn(
            f"{source}: the residuals are only {math.sqrt(found.fit):.2g} times what the sigmas of the readings allow: "
            "these are too large, or in another unit"
        )
