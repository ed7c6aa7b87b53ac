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
from pathlib import Path

import numpy as np
from scipy.special import gammainc

from cinegen.arrays import Array, Bools
from cinegen.design.amounts import Amounts, amount_in, known_pairs
from cinegen.design.calibration.checks import ContradictionError, check, check_fit, doubt
from cinegen.design.calibration.comparison import ColumnComparison
from cinegen.design.calibration.identifiability import LISTED, Dependency, Subspace, dependencies, subspace
from cinegen.design.calibration.measurements import Measurements
from cinegen.design.calibration.missing_parameters import is_poor, left_out
from cinegen.design.calibration.observation import Observation, Prediction
from cinegen.design.calibration.result import Calibration, HeldOut, Outlier
from cinegen.design.calibration.solver import CalibrationSolver
from cinegen.design.errors import DesignError
from cinegen.design.parameters import Parameters
from cinegen.design.ties import fits
from cinegen.errors import warn
from raff2urdf.errors import counted
from raff2urdf.quantities import ANGLE, LENGTH
from raff2urdf.raff.document import Document

LENGTH_ERROR, ANGLE_ERROR = 3e-4, math.radians(0.05)
"""Expected errors of manufacture and assembly, m and rad, of parameters for which none is given."""


_SMALL = 0.04  # chi-square per degree of freedom below which sigmas are too large
_UNLIKELY = 1e-6  # probability of a chi-square that is smaller
_COMPUTED = 1e-8  # the same below which readings were computed, not measured
_SEEN = 4  # poses that are compared for motions of the whole robot
_WITHOUT = 1e-7  # one below has no effect


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
    calibration = _estimate(parameters, read, sigma, gains, robust, folds)
    check_fit(comparison, calibration)
    why = doubt(calibration)
    if why is not None and not why.remedy:
        raise ContradictionError(why.text)
    if why is not None:
        warn(f"{why.text}. If that is real, give what you expect: --sigma {why.remedy}")

    _warn(calibration, left_out(calibration))
    return calibration


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


def _solver(observation: Observation, nominal: Prediction, sigma: Amounts | None) -> CalibrationSolver:
    errors = observation.expected_errors(expected_errors(observation.design.parameters, sigma))
    errors[[name in nominal.opening for name in observation.names]] = 0.0
    return CalibrationSolver(observation, observation.covariances(nominal), errors)


def expected_errors(parameters: Parameters, sigma: Amounts | None) -> Array:
    """Return the expected errors (count,) of free parameters, m and rad; later patterns replace earlier ones.

    Raises:
        DesignError: unknown names (all of them), a wrong unit, an error that is not above 0, or of what is not
            estimated.
    """
    indices = [parameters.find(name) for name in parameters.names]
    errors = np.array([LENGTH_ERROR if parameters.all[i].unit == "m" else ANGLE_ERROR for i in indices])
    for pattern, amount in known_pairs(parameters, sigma):
        matching = parameters.matching([pattern])
        fitting = [i for i in matching if fits(str(amount), parameters.all[i].dimension)] or matching
        if set(indices).isdisjoint(fitting):
            raise DesignError(f"expected error of {pattern}: it is not estimated: add it to --vary, or leave this out")
        for i in set(fitting) & set(indices):
            value = amount_in(f"expected error of {pattern}", amount, parameters.all[i].dimension)
            if not value > 0.0:
                raise DesignError(f"expected error of {pattern}: {amount} is not above 0")
            errors[indices.index(i)] = value
    return errors


# --- what is checked and told -----------------------------------------------------------------------------------------


def _with_offsets(
    whole: Parameters, names: Iterable[str], ties: Iterable[str], measurements: Measurements
) -> Parameters:
    """Return the parameters with those names, and with the offsets of measured joints' encoders where `*` is one."""
    wanted = [names] if isinstance(names, str) else list(names)
    if "*" in wanted:
        wanted += [
            whole.own_variable(quantity.of).name for quantity in measurements.quantities if quantity.kind == "joint"
        ]
    return Parameters(whole.document, wanted, ties, robot=whole.robot.name)


def _dependencies(observation: Observation, space: Subspace, errors: Array, q: Array) -> tuple[Dependency, ...]:
    """Return what can't be told apart. A dependency that moves what is measured by one twist of the world in all poses
    (poses, nq), with the devices, moves the robot as one body: it is named so."""
    estimated = np.flatnonzero(errors > 0.0).tolist()
    inner = Subspace(space.basis[estimated], space.singular_values, errors[estimated], space.rank)
    parameters = observation.design.parameters
    nodes_of = parameters.robot.nodes.values()
    parents = {
        _keyword(parameters, each.number): _keyword(parameters, getattr(each, "pred", None)) for each in nodes_of
    }
    frames, bodies = observation.frames, list[Array]()
    q = q[np.sort(np.unique(q, axis=0, return_index=True)[1])]  # one pose alone moves as one body
    some = np.linspace(0, len(q) - 1, min(len(q), _SEEN)).astype(int)
    evaluation = observation.design.evaluate(q=q[some])
    measured = dict.fromkeys(each.of for each in observation.quantities if each.kind != "joint")
    for node in measured or (observation.design.mechanism.end,):
        origins = evaluation.placements(node)[:, None, :3, 3]
        for origin, twist in zip(origins, evaluation.pose_derivative(node, "world"), strict=True):
            at_world = np.vstack([twist[:3] + np.cross(origin, twist[3:].T).T, twist[3:]])
            bodies.append(np.hstack([at_world, np.zeros((6, len(observation) - len(parameters)))]))
    for name in frames.devices:
        bodies.append(np.zeros((6, len(observation))))
        bodies[-1][:, len(observation) - len(frames) :] = frames.twists(name)
    names, motions = [observation.names[k] for k in estimated], np.array(bodies)[:, :, estimated]
    unresolved = dependencies(inner, names, [observation.units[k] for k in estimated], parents, motions)
    moving = f"robot and {' and '.join(frames.devices)}" if frames.devices else "base and platform"
    described = list[Dependency]()
    for each in unresolved:
        at = [names.index(name) for name in each.names]
        text = each.text
        if len(each.changes) == 1 and len(bodies) > 1:
            moved = motions[:, :, at] @ each.changes[0]
            size = float(np.abs(moved).max())
            if size > 1e-9 and np.abs(moved - moved[-1]).max() < 1e-7 * size:
                if len(each.names) > LISTED:
                    of = ", ".join(dict.fromkeys(name.rpartition(".")[0] for name in each.names))
                    text = f"no reading changes ({counted(len(each.names), 'parameter')} of {of})"
                text = f"{moving} move together as one body: {text}"
        described.append(Dependency(each.names, each.changes, text))
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
    solver: CalibrationSolver, space: Subspace, folds: int, kept: Bools, before: Array, nominal: Prediction
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
        predicted = observation.predict(observation.values + inner.changes @ z, derivatives=False)
        after[held] = observation.residuals(predicted)[held]
    errors = []
    for dimension in (LENGTH, ANGLE):
        columns = [each.dimension is dimension for each in observation.quantities]
        mask = np.isfinite(before) & np.array(columns)
        if mask.any():
            within = (after, mask & kept) if (mask & kept).any() else (after, mask)
            rms = [_rms(*each) for each in ((before, mask), (after, mask), within, (solver.standard, mask))]
            errors.append(HeldOut(dimension, int(mask.sum()), *rms))
    return folds, tuple(errors)


def _rms(values: Array, mask: Bools) -> float:
    return float(np.sqrt(np.mean(values[mask] ** 2)))


def _warn(calibration: Calibration, instead: str) -> None:
    source, count = calibration.observation.measurements.source, len(calibration.combinations)
    off = math.sqrt(calibration.fit)
    if calibration.degrees_of_freedom <= 0:
        warn(
            f"{source}: {counted(int(calibration.kept.sum()), 'reading')} for {counted(count, 'combination')} of "
            "parameters: any errors fit, and the residuals show nothing; measure more poses"
        )
    elif is_poor(calibration):
        warn(
            f"{source}: the residuals are {off:.2g} times what the sigmas of the readings allow: "
            "these are too small, or something else than the parameters is wrong (backlash, bending, thermal growth)"
            f"{instead and f'. {instead}'}"
        )
    elif instead:
        warn(f"{source}: {instead}")
    elif (
        _COMPUTED < calibration.fit < _SMALL
        and gammainc(calibration.degrees_of_freedom / 2, calibration.chi2 / 2) < _UNLIKELY
    ):
        warn(
            f"{source}: the residuals are only {off:.2g} times what the sigmas of the readings allow: "
            "these are too large, or in another unit"
        )
