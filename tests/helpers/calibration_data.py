"""Synthetic measurements of robots whose parameters differ from their description."""

import numpy as np

from cinegen.design import Calibration, Design, Measurements, Parameters
from cinegen.design.calibration.frames import MeasuringFrames
from cinegen.design.calibration.observation import Observation
from cinegen.design.poses import random_poses

POSE = ("x", "y", "z", "rx", "ry", "rz")
POSITION_NOISE, ANGLE_NOISE = 5e-5, float(np.radians(0.01))


def planar_arm() -> str:
    """Return readings of `planar_3r`, whose first bar is 405 mm long instead of 400, by plane geometry; that of y in
    pose 5 is off by 30 mm."""
    lines = ["pose,joint1 [deg],joint2 [deg],joint3 [deg],tool.x [mm],tool.y [mm]", "sigma,,,,1,1"]
    for i, (a, b, c) in enumerate(np.random.default_rng(0).uniform(-90.0, 90.0, (12, 3))):
        bars = zip((405.0, 300.0, 200.0), np.radians(np.cumsum([a, b, c])), strict=True)
        x, y = np.sum([(r * np.cos(t), r * np.sin(t)) for r, t in bars], axis=0)
        lines.append(f"{i},{a},{b},{c},{x},{y + 30.0 * (i == 5)}")
    return "\n".join(lines)


def everything(name: str) -> Parameters:
    """Return all parameters of a robot, variables of its joints too."""
    return Parameters(name, [parameter.name for parameter in Parameters(name).all])


def errors_of(parameters: Parameters) -> np.ndarray:
    return np.array([3e-4 if parameter.unit == "m" else np.radians(0.05) for parameter in parameters.all])


def exact(parameters, columns, truth, poses=40, seed=0, places=None):
    """Return what a robot with true values (parameters,) reads, without noise: the actuated joints, then columns; of
    devices and targets that stand at places."""
    mechanism = parameters.mechanism
    q = random_poses(Design(parameters), poses + 10, seed)
    q = q[Design(parameters).evaluate(truth, q).gap < 1e-10][:poses]
    assert len(q) == poses
    joints = [q[:, mechanism.q_index(joint)] for joint in mechanism.actuated]
    headers = [*mechanism.actuated, *columns]
    values = np.column_stack([*joints, np.zeros((poses, len(columns)))])
    sigmas = [0.0] * len(joints) + [1e-3] * len(columns)
    blank = Measurements.of(mechanism, headers, values, sigmas)
    frames = MeasuringFrames(blank.quantities)
    frames.start = {name: (places or {})[name].homogeneous for name in frames.start}
    observation = Observation(parameters, blank, frames=frames)
    theta = np.append(truth, np.zeros(len(frames)))
    values[:, observation.outputs] = observation.predict(theta, derivatives=False).values
    noise = [POSITION_NOISE if quantity.dimension.default == "m" else ANGLE_NOISE for quantity in blank.quantities]
    sigmas = [0.0] * len(joints) + noise[len(joints) :]
    return Measurements.of(mechanism, headers, values, sigmas)


def noisy(measurements: Measurements, seed: int, outliers: float = 0.0) -> Measurements:
    """Return measurements with normal noise of their sigmas; a part of the readings is 20 to 1000 sigma off."""
    rng, outlying = np.random.default_rng(seed), np.random.default_rng([seed, 1])
    values = measurements.values + measurements.sigmas * rng.normal(size=measurements.values.shape)
    if outliers:
        rows, columns = np.nonzero((measurements.sigmas > 0.0) & np.isfinite(values))
        chosen = outlying.choice(len(rows), round(outliers * len(rows)), replace=False)
        sizes = 10.0 ** outlying.uniform(np.log10(20.0), 3.0, len(chosen)) * outlying.choice([-1.0, 1.0], len(chosen))
        values[rows[chosen], columns[chosen]] += sizes * measurements.sigmas[rows[chosen], columns[chosen]]
    return Measurements(measurements.quantities, values, measurements.sigmas, measurements.labels, measurements.source)


def changes(estimate: Calibration, other: Calibration) -> np.ndarray:
    """Return the differences (combinations,) of two estimates in the combinations of the second, in its standard
    deviations."""
    apart = other.subspace.basis.T @ ((estimate.values - other.values) / other.subspace.errors)
    return np.abs(apart) / np.sqrt(np.diag(other.combination_covariance))


def changed_by_dependencies(calibration: Calibration) -> float:
    """Return the largest change of a reading by a dependency of a calibration, relative to the dependency's size."""
    observation, largest = calibration.observation, 0.0
    for dependency in calibration.dependencies:
        for change in dependency.changes:
            step = np.zeros(len(calibration.names))
            step[[calibration.names.index(name) for name in dependency.names]] = 0.01 * change
            ends = [observation.predict(observation.values + s * step, derivatives=False).values for s in (1, -1)]
            largest = max(largest, float(np.abs(ends[0] - ends[1]).max() / np.abs(step).max()))
    return largest
