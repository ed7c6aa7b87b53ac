"""The result of a calibration."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from cinegen.arrays import Array, Bools
from cinegen.design.calibration.identifiability import Dependency, Subspace
from cinegen.design.calibration.observation import Observation
from cinegen.design.parameters import Parameters
from cinegen.typed_json import as_json
from raff2urdf.errors import counted
from raff2urdf.quantities import ANGLE, LENGTH, Dimension

_OWN = 1.0 - 1e-9  # a parameter of this determined length is determined by itself


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
        of = f"{counted(count, 'combination')} of {counted(len(self.names), 'parameter')}"
        return f"<Calibration of {self.parameters.robot.name}: {of}>"

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
        frames, known = self.observation.frames, len(self.names) - len(self.observation.frames)
        return {name: frames.pose(name, self.values[known:]) for name in frames.start}

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
        kinds, labels = {LENGTH: "length", ANGLE: "angle"}, self.observation.measurements.labels
        columns = zip(self.names, self.nominal, self.values, self.sigmas, self.separate, strict=True)
        left_out = (*self.without_effect, *self.opening, *self.observation.frames.names)
        return as_json(
            self, "names", "covariance", "without_effect", "opening", "chi2", "degrees_of_freedom", "folds",
            poses=len(self.observation.measurements),
            readings=int(np.isfinite(self.before).sum()),
            parameters=[
                {"name": name, "unit": self.unit(name), "nominal": a, "value": b, "sigma": s, "separate": separate}
                for name, a, b, s, separate in columns
                if name not in left_out
            ],
            frames=[{"name": name, "pose": pose} for name, pose in self.frames.items()],
            identifiable=self.subspace.rank,
            estimated=self.subspace.basis.shape[1],
            dependencies=[as_json(dependency, "names", "changes", "text") for dependency in self.dependencies],
            outliers=[
                as_json(outlier, "residual", "sigmas", pose=labels[outlier.pose], text=outlier.where)
                for outlier in self.outliers
            ],
            held_out=[
                as_json(group, "before", "after", "kept", "noise", kind=kinds[group.dimension], readings=group.count)
                for group in self.held_out
            ],
        )  # fmt: skip
