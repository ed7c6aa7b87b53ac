"""`Observation`: what a robot's measurements should read at values of its parameters, and all derivatives.

The readings of some joints, the *inputs*, define the configuration: with them all other joints follow from the loops.
What else was measured are the *outputs* y(theta). Redundant encoders are outputs. Parameters theta are the free ones of
the description, whose values of a measured joint's own variable are its encoder's offset, then the gains of encoders (a
joint is at (1 + gain) times its reading), then the frames of devices and targets (`frames`). With T = (R, t) the pose
of a node in the world, and its twist (v, w) at its origin in the world's axes, dX = (v, w) dtheta, loops closed
(`cinegen.design.design`), a point c on the node moves by v + w x R c, and roll, pitch and yaw by the inverse of their
Jacobian.

Errors of the inputs' readings act on all outputs of a pose: the covariance of these is diag(sigma^2) +
A diag(sigma_in^2) A^T, with A the derivative of the outputs by the inputs.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass

import numpy as np

from cinegen.arrays import Array
from cinegen.design.calibration.frames import MeasuringFrames
from cinegen.design.calibration.measurements import MeasuredQuantity, Measurements
from cinegen.design.calibration.reading import read
from cinegen.design.design import Design
from cinegen.design.errors import DesignError
from cinegen.design.evaluation import DesignEvaluation
from cinegen.design.parameters import Parameters
from raff2urdf import closure
from raff2urdf.errors import first_of
from raff2urdf.quantities import ANGLE, LENGTH

_STEPS = 24  # on the straight line of the inputs from home to each pose


@dataclass(frozen=True, eq=False)
class Prediction:
    """Readings that are expected, and their derivatives.

    Attributes:
        values: (poses, outputs) m and rad.
        jacobian: (poses, outputs, parameters), m and rad by m and rad, dimensionless gains.
        by_inputs: (poses, outputs, inputs) derivative by the inputs' readings.
        q: (poses, nq) closed configurations.
        gap: (poses,) largest residual of the loops; above 1e-10 where they can't be closed.
        opening: names of parameters that open loops.
    """

    values: Array
    jacobian: Array
    by_inputs: Array
    q: Array
    gap: Array
    opening: tuple[str, ...]


class Observation:
    """Measured quantities of a robot as functions of its parameters.

    Args:
        parameters: the free ones.
        measurements: whose columns are observed.
        gains: joints whose encoders have an unknown gain.
        frames: poses of devices and targets where they are known; else the readings place them.

    Attributes:
        design: evaluates the robot, the inputs fixed.
        measurements: as given.
        frames: of devices and targets whose poses are not known.
        names: (parameters,) of the description, then gains, such as `joint1.gain`, then of frames, such as `tracker.x`.
        units: (parameters,) m, rad, or "" of gains.
        values: (parameters,) as written; gains and frames 0.
        inputs: joints from whose readings the configuration follows.
        input_columns: of the measurements.
        outputs: columns of the measurements that are compared.
        readings: (poses, inputs) m and rad.
        input_sigmas: (poses, inputs).
        measured: (poses, outputs) NaN where nothing was measured.
        sigmas: (poses, outputs).

    Raises:
        DesignError: a joint that is not measured does not follow from those that are; a reading is missing.
    """

    def __init__(
        self,
        parameters: Parameters,
        measurements: Measurements,
        gains: Sequence[str] = (),
        frames: MeasuringFrames | None = None,
    ) -> None:
        mechanism = parameters.mechanism
        if mechanism.floating:
            raise DesignError(f"{mechanism.name} has a floating base: calibration needs one that is fixed")
        columns = {quantity.of: k for k, quantity in enumerate(measurements.quantities) if quantity.kind == "joint"}
        self.inputs = _inputs(parameters, measurements, columns)
        self.design = Design(parameters, fixed=self.inputs)
        for joint in gains:
            if joint not in columns:
                raise DesignError(f"{joint} has no column of readings: its encoder's gain can't be found")
        self.gains = tuple(dict.fromkeys(gains))
        self._at = [mechanism.q_index(joint) for joint in self.inputs]
        self._v = [mechanism.v_index(joint) for joint in self.inputs]
        self._rough = False
        self._observe(measurements, frames)

    def again(self, measurements: Measurements, rough: bool = False) -> Observation:
        """Return an observation of other measurements; if the same joints were measured, both share the design.

        Args:
            measurements: the others.
            rough: whether frames need not be placed exactly.
        """
        joints = [
            {quantity.of for quantity in read.quantities if quantity.kind == "joint"}
            for read in (measurements, self.measurements)
        ]
        if joints[0] != joints[1]:
            return Observation(self.design.parameters, measurements, self.gains)
        other = copy(self)
        other._rough = rough
        other._observe(measurements, None)
        return other

    def _observe(self, measurements: Measurements, frames: MeasuringFrames | None) -> None:
        self.measurements, parameters = measurements, self.design.parameters
        columns = {each.of: k for k, each in enumerate(measurements.quantities) if each.kind == "joint"}
        self.input_columns = [columns[joint] for joint in self.inputs]
        self.outputs = [k for k in range(len(measurements.quantities)) if k not in self.input_columns]
        self.frames, self._is_placed = frames or MeasuringFrames(self.quantities), frames is not None
        self.names = (*parameters.names, *(f"{joint}.gain" for joint in self.gains), *self.frames.names)
        self.units = (
            *(each.unit for each in parameters.free),
            *("" for _ in self.gains),
            *("m" if dimension is LENGTH else "rad" for dimension in self.frames.dimensions),
        )
        self.values = np.append(parameters.values, np.zeros(len(self.gains) + len(self.frames)))
        self.readings = measurements.values[:, self.input_columns]
        self.input_sigmas = measurements.sigmas[:, self.input_columns]
        self.measured = measurements.values[:, self.outputs]
        self.sigmas = measurements.sigmas[:, self.outputs]
        for pose in np.flatnonzero(~np.isfinite(self.measured).any(axis=1))[:1]:
            raise DesignError(
                f"{measurements.source}: pose {measurements.labels[pose]}: nothing is measured but the joints that the "
                f"configuration follows from ({', '.join(self.inputs)}): leave the line out"
            )
        self._q: Array | None = None

    def __len__(self) -> int:
        return len(self.names)

    @property
    def quantities(self) -> tuple[MeasuredQuantity, ...]:
        """Quantities of the outputs."""
        return tuple(self.measurements.quantities[k] for k in self.outputs)

    def start(self, hasty: bool = False) -> Array:
        """Return the closed configurations (poses, nq) of the robot as described: along the straight line of the
        inputs from home, from the nearest pose where that fails.

        Args:
            hasty: whether to take longer steps, and to give up at the first where the loops don't close.

        Raises:
            DesignError: the loops can't be closed at some readings; names the poses.
        """
        design = self.design
        home = design.mechanism.q_home
        q = np.tile(home, (len(self.readings), 1))
        steps = _STEPS // 2 if hasty else _STEPS
        for part in np.linspace(0.0, 1.0, steps + 1)[1:] if design.rank else (1.0,):
            q[:, self._at] = (1.0 - part) * home[self._at] + part * self.readings
            evaluation = design.evaluate(q=q, derivatives=False, near=hasty)
            closed = evaluation.gap <= closure.CLOSED
            q = np.where(closed[:, None], evaluation.q, q)
            if hasty and not closed.all():
                break
        while not hasty and not closed.all() and closed.any():
            open_, done = np.flatnonzero(~closed), np.flatnonzero(closed)
            scale = design.mechanism.scale[self._v]
            apart = np.linalg.norm((self.readings[open_][:, None] - self.readings[done]) / scale, axis=2)
            trial = q[done[apart.argmin(axis=1)]].copy()
            trial[:, self._at] = self.readings[open_]
            evaluation = design.evaluate(q=trial, derivatives=False)
            better = evaluation.gap <= closure.CLOSED
            if not better.any():
                break
            q[open_[better]], closed[open_[better]] = evaluation.q[better], True
        if not closed.all():
            labels = [self.measurements.labels[i] for i in np.flatnonzero(~closed)]
            raise DesignError(
                f"{self.measurements.source}: the loops of {design.mechanism.name} can't be closed at the readings of "
                f"{', '.join(self.inputs)} in pose {first_of(labels, 8)}, from home: check the units and signs "
                "of these columns, and the assembly mode of the robot's home"
            )
        return q

    def predict(self, theta: Array, derivatives: bool = True) -> Prediction:
        """Return what should be read at values (parameters,)."""
        design = self.design
        if self._q is None:
            self._q = self.start()
        if not self._is_placed:
            self._place_frames()
        count = len(design.parameters)
        own_frames = theta[count + len(self.gains) :]
        gains = dict(zip(self.gains, theta[count : count + len(self.gains)], strict=True))
        factors = 1.0 + np.array([gains.get(joint, 0.0) for joint in self.inputs])
        q = self._q.copy()
        q[:, self._at] = factors * self.readings
        state = design.evaluate(theta[:count], q, derivatives)
        by_joints = self._motions(state) if derivatives else None
        values = np.zeros((len(q), len(self.outputs)))
        jacobian = np.zeros((len(q), len(self.outputs), len(self)))
        by_inputs = np.zeros((len(q), len(self.outputs), len(self.inputs)))
        twists_of: dict[str, tuple[Array, Array]] = {}
        for k, quantity in enumerate(self.quantities):
            node = quantity.of
            if quantity.kind == "joint":
                j, factor = design.mechanism.v_index(node), 1.0 + gains.get(node, 0.0)
                values[:, k] = state.q[:, design.mechanism.q_index(node)] / factor
                if by_joints is not None:
                    jacobian[:, k, :count], by_inputs[:, k] = (
                        state.joint_derivative[:, j] / factor,
                        by_joints[:, j] / factor,
                    )
                    at = [count + i for i, joint in enumerate(self.gains) if joint == node]
                    jacobian[:, k, at] = -values[:, k, None] / factor
                continue
            placement = state.placements(node)
            if by_joints is None and not quantity.device and not quantity.target:
                values[:, k] = read(quantity, placement)[0]
                continue
            seen = self.frames.observe(quantity, placement, own_frames)
            values[:, k] = seen.value
            if by_joints is not None:
                if node not in twists_of:
                    twists_of[node] = (
                        state.pose_derivative(node, "world"),
                        state.node_joints(node, "world") @ by_joints,
                    )
                jacobian[:, k, :count], by_inputs[:, k] = (
                    np.einsum("ni,nic->nc", seen.by_node, twists) for twists in twists_of[node]
                )
                jacobian[:, k, count + len(self.gains) :] = self.frames.columns(quantity, seen)
        if derivatives:
            for i, joint in enumerate(self.inputs):
                if joint in self.gains:
                    g = count + self.gains.index(joint)
                    jacobian[:, :, g] += by_inputs[:, :, i] * self.readings[:, i, None]
        return Prediction(
            values, jacobian, by_inputs * factors, state.q, state.gap, state.opening if derivatives else ()
        )

    def _place_frames(self) -> None:
        self._is_placed = True
        if not len(self.frames):
            return
        evaluation = self.design.evaluate(q=self._q, derivatives=False)
        nodes = {
            quantity.of: evaluation.placements(quantity.of) for quantity in self.quantities if quantity.kind != "joint"
        }
        self.frames.locate(
            self.quantities, self.measured, nodes, self.design.mechanism.length, self.measurements.source, self._rough
        )

    @property
    def kept(self) -> Array | None:
        """Configurations (poses, nq) from which loops are closed; None before the first."""
        return self._q

    def keep(self, q: Array) -> None:
        """Begin to close loops from configurations (poses, nq) from now on."""
        self._q = q

    def residuals(self, prediction: Prediction) -> Array:
        """Return expected minus measured readings (poses, outputs), m and rad; NaN where nothing was measured. Angles
        are compared modulo revolutions."""
        residuals = prediction.values - self.measured
        for k, quantity in enumerate(self.quantities):
            if quantity.dimension is ANGLE:
                residuals[:, k] = (residuals[:, k] + math.pi) % (2.0 * math.pi) - math.pi
        return residuals

    def covariances(self, prediction: Prediction) -> Array:
        """Return the covariances (poses, outputs, outputs) of the readings; rows and columns of what was not measured
        are those of an independent error 1."""
        a, missing = prediction.by_inputs, ~np.isfinite(self.measured)
        covariances = np.einsum("nki,ni,nli->nkl", a, self.input_sigmas**2, a)
        covariances[missing] = 0.0
        np.swapaxes(covariances, 1, 2)[missing] = 0.0
        k = np.arange(covariances.shape[1])
        covariances[:, k, k] += np.where(missing, 1.0, self.sigmas**2)
        return np.asarray(covariances)

    def expected_errors(self, errors: Array) -> Array:
        """Return the expected errors (parameters,) with those of gains appended: what an error of the joint's offset
        does at its largest reading, m and rad; then those of frames."""
        expected = list(errors)
        for joint in self.gains:
            column = next(
                k
                for k, quantity in enumerate(self.measurements.quantities)
                if quantity.of == joint and quantity.kind == "joint"
            )
            largest = float(np.nanmax(np.abs(self.measurements.values[:, column])))
            is_long = self.measurements.quantities[column].dimension is LENGTH
            expected.append((3e-4 if is_long else math.radians(0.05)) / max(largest, 1e-3))
        expected += [3e-3 if dimension is LENGTH else math.radians(0.5) for dimension in self.frames.dimensions]
        return np.array(expected)

    def _motions(self, evaluation: DesignEvaluation) -> Array:
        """Return the motion (poses, nv, inputs) of all joints by the inputs."""
        rates = evaluation.compensate(evaluation.loop_joints[:, :, self._v])
        rates[:, self._v, np.arange(len(self._v))] = 1.0
        return rates


def _inputs(parameters: Parameters, measurements: Measurements, columns: dict[str, int]) -> tuple[str, ...]:
    """Return the measured joints from which all others follow: actuated ones where there is a choice, and such that are
    measured in all poses."""
    mechanism = parameters.mechanism
    matrices = (
        [mechanism.structure.system.evaluate(q)[1] for q in mechanism.structure.samples]
        if mechanism.is_constrained
        else []
    )
    measured = {mechanism.v_index(joint): joint for joint in columns}

    def rank(chosen: list[int]) -> int:
        return max((closure.rank(c[:, chosen]) for c in matrices), default=0) if chosen else 0

    moving = [v for v in range(mechanism.model.nv) if v not in measured]
    if rank(moving) < len(moving):
        owners = {mechanism.v_index(joint): joint for joint in mechanism.joints}
        loose = [owners.get(v, f"joint {v}") for v in moving if rank([w for w in moving if w != v]) == rank(moving)]
        known = [joint for joint in mechanism.actuated if joint in loose]
        raise DesignError(
            f"{measurements.source}: {', '.join(known or loose)} {'is' if len(known or loose) == 1 else 'are'} neither "
            f"measured nor given by the loops: add columns with the readings of "
            f"{'all actuated joints' if known else 'enough of them'}, such as {(known or loose)[0]} "
            f"[{'mm' if mechanism.is_prismatic((known or loose)[0]) else 'deg'}]"
        )
    whole = max((closure.rank(c) for c in matrices), default=0)
    complete = {joint: bool(np.isfinite(measurements.values[:, k]).all()) for joint, k in columns.items()}
    for joint in sorted(columns, key=lambda each: (complete[each], each in mechanism.actuated)):
        if len(moving) < whole and rank([*moving, mechanism.v_index(joint)]) > len(moving):
            moving.append(mechanism.v_index(joint))
    inputs = tuple(joint for joint in mechanism.joints if joint in columns and mechanism.v_index(joint) not in moving)
    for joint in inputs:
        if not complete[joint]:
            pose = int(np.flatnonzero(~np.isfinite(measurements.values[:, columns[joint]]))[0])
            raise DesignError(
                f"{measurements.source}: {measurements.cell(pose, columns[joint])}: the reading is missing, and the "
                "configuration does not follow without it: fill it in, or leave the line out"
            )
    return inputs
