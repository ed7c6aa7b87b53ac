"""Objectives and constraints of a task at targets, with their derivatives by the variables.

Variables are the free parameters, and the logarithm of the region's scale where a task lets the region grow. All scores
are written so that larger is better, dimensionless, and continuous where a target is lost: there the singular values
count as minus its distance, and beyond a singularity they are negative.
"""

from __future__ import annotations

import math

import numpy as np

from cinegen.arrays import Array
from cinegen.design.dimensions import DimensionedMasses, LinkMass
from cinegen.design.errors import DesignError
from cinegen.design.synthesis.clearance import BarClearance
from cinegen.design.synthesis.error_propagation import ErrorPropagation
from cinegen.design.synthesis.quantities import QUANTITIES
from cinegen.design.synthesis.reaching import Reached, Reaching
from cinegen.design.synthesis.scores import ScoreRows, Scores
from cinegen.design.synthesis.task import DesignObjective, SynthesisTask
from raff2urdf.quantities import FORCE, NUMBER, TORQUE, Dimension, QuantityError, parse

_INDEX = {"sigma_1": 0, "sigma_max": 1, "condition": 2}
_SMALL = 1e-9  # reference values below are replaced by 1


class Scoring:
    """Scores of the designs of a task.

    Args:
        task: as read.
        reaching: of its node.

    Raises:
        DesignError: `size` names what is no length; a quantity does not fit the mechanism.
        MassError: links have no mass, and torques are wanted.
    """

    def __init__(self, task: SynthesisTask, reaching: Reaching) -> None:
        self.task, self.reaching, self.load = task, reaching, task.load
        mechanism, limits = reaching.mechanism, reaching.mechanism.limits
        named = [(mechanism.q_index(j), mechanism.v_index(j)) for j in mechanism.joints if j in limits]
        kept = [(q, v) for q, v in named if np.isfinite(limits.lower[q]) or np.isfinite(limits.upper[q])]
        self.limited = np.array(kept if task.joint_limits else [], dtype=int).reshape(-1, 2)
        self.lower, self.upper = (bounds[self.limited[:, 0]] for bounds in (limits.lower, limits.upper))
        self.units = np.array(
            [reaching.length if mechanism.is_prismatic(mechanism.columns[v]) else 1.0 for v in self.limited[:, 1]]
        )
        wanted = [*(objective.of for objective in task.objectives), task.size[0] if task.size else ()]
        self._lengths = {of: self._of(of) for of in wanted if of}
        self.gravity = task.load.gravity or tuple(mechanism.gravity)
        self.wrenches = {reaching.node: self._wrench()} if any(self._wrench()) else {}
        self._masses = DimensionedMasses(reaching.parameters) if task.uses("mass") or task.uses("torque") else None
        self.torque_units, self.torque_dimension = self._torque_units() if task.uses("torque") else (np.ones(0), NUMBER)
        self.errors = ErrorPropagation(task.errors, reaching) if task.uses("accuracy") else None
        self.clearance = None if task.clearance is None else BarClearance(task.clearance, reaching)
        self.most = {name: self._limit(name, value) for name, value in task.most.items()}
        self._references: dict[str, float] = {}
        self._check_mass()

    # --- setting up ----------------------------------------------------------------------------------------------

    def _of(self, patterns: tuple[str, ...]) -> list[int]:
        parameters = self.reaching.parameters
        indices = parameters.matching(patterns)
        for i in indices:
            if parameters.all[i].unit != "m":
                raise DesignError(f"size: {parameters.all[i].name} is an angle: name lengths, such as link2.d")
        return indices

    def _wrench(self) -> list[float]:
        weight = [self.load.payload * x for x in self.gravity] + [0.0] * 3
        return [a + b for a, b in zip(self.load.wrench, weight, strict=True)]

    def _torque_units(self) -> tuple[Array, Dimension]:
        """Return the units of the actuated joints' torques: their limits, if all have one."""
        mechanism = self.reaching.mechanism
        names = self.reaching.design.fixed
        limits = np.array([mechanism.limits.effort[mechanism.v_index(name)] for name in names])
        if np.isfinite(limits).all():
            return limits, NUMBER
        prismatic = {mechanism.is_prismatic(name) for name in names}
        if len(prismatic) > 1:
            raise DesignError(
                f"{mechanism.name}: torques and forces can't be compared: give each actuated joint its 'effort', and "
                "the largest part of it counts"
            )
        return np.ones(len(names)), FORCE if prismatic == {True} else TORQUE

    def _limit(self, name: str, value: float | str) -> float:
        if isinstance(value, str):
            try:
                value = parse(value, self.dimension(name))
            except QuantityError as error:
                of = "; every actuated joint has an effort: torques are parts of it" if name == "torque" else ""
                raise DesignError(f"constraints: {name} is wrong: {error}{of}") from None
        if not 0.0 < value < math.inf:
            raise DesignError(f"constraints: {name} must be above 0, not {value:g}")
        return value

    def _check_mass(self) -> None:
        if self.task.uses("mass") and self._masses is not None and not self._masses.vary:
            raise DesignError(
                f"{self.reaching.mechanism.name}: its mass does not depend on its dimensions: give links a density and "
                "a radius in place of a mass, inertial { density 2700 radius 10 }"
            )

    def dimension(self, name: str) -> Dimension:
        """Return the dimension of a quantity's values."""
        return QUANTITIES[name].dimension or self.torque_dimension

    def masses_at(self, p: Array) -> dict[str, LinkMass]:
        """Return the links' masses with derivatives by the columns of the design with the actuated joints' own
        variables."""
        assert self._masses is not None
        free, n = self.reaching.free, len(self.reaching.design.names)

        def padded(slopes: Array) -> Array:
            by_columns = np.zeros((*slopes.shape[:-1], n))
            by_columns[..., free] = slopes
            return by_columns

        return {
            name: link._replace(mass_by=padded(link.mass_by), centre_by=padded(link.centre_by))
            for name, link in self._masses.at(p).items()
        }

    # --- at targets ----------------------------------------------------------------------------------------------

    def at(self, reached: Reached, scale: float = 1.0, growth: Array | None = None) -> Scores:
        """Return the scores at configurations of a design.

        Args:
            reached: the configurations.
            scale: of the region.
            growth: (count, rows) motion of the targets by the logarithm of the scale, m and rad; None where it is no
                variable.
        """
        return Scores(self, reached, scale, growth)

    def constraints(self, scores: Scores) -> dict[str, ScoreRows]:
        """Return what must not be negative: rows (count, k) of targets or (1, k), by the name of the constraint."""
        low, high = self.task.singular_values
        sigma = scores.sigma
        least, slopes = self._squared(scores)
        rows = {
            "singular_values": ScoreRows(
                np.stack([least - low**2, sigma.values[:, 1] - 1.0 / high], axis=1),
                np.stack([slopes, sigma.slopes[:, 1]], axis=1),
            ),
            "joint_limits": scores.margins,
        }
        if self.task.size is not None:
            of, most = self.task.size
            rows["size"] = self._below(self._size(scores, of), most, self.reaching.length)
        for name, most in self.most.items():
            if name == "condition":
                rows[name] = ScoreRows(sigma.values[:, 2:] - 1.0 / most, sigma.slopes[:, 2:])
            elif name == "torque":
                rows[name] = self._below(_both(scores.torques), most, most)
            else:
                rows[name] = self._below(self._value(name, scores), most, most)
        if self.clearance is not None:
            rows["clearance"] = scores.gaps
        return rows

    @staticmethod
    def _squared(scores: Scores) -> tuple[Array, Array]:
        """Return the square (count,) of the smallest singular value with its sign, and its derivative. Towards the
        boundary of the workspace a singular value falls like the root of the distance, its square like the distance."""
        values, slopes = scores.sigma.values[:, 0], scores.sigma.slopes[:, 0]
        reached = scores.reached.is_reached
        squares = np.where(reached, values * np.abs(values), values)
        return squares, np.where(reached, 2.0 * np.abs(values), 1.0)[:, None] * slopes

    def objective(self, objective: DesignObjective, scores: Scores) -> ScoreRows:
        """Return the scores (n, k) of an objective, of which the least (or the mean) counts."""
        name = objective.quantity
        if name in _INDEX:
            k = _INDEX[name]
            return ScoreRows(scores.sigma.values[:, k : k + 1], scores.sigma.slopes[:, k : k + 1])
        reference = self._reference(objective, scores)
        if name == "torque" and objective.over == "mean":
            values, slopes = scores.torques
            return ScoreRows(-((values / reference) ** 2), -2.0 * values[..., None] * slopes / reference**2)
        if name == "torque":
            rows = _both(scores.torques)
        elif name == "size":
            rows = self._size(scores, objective.of)
        else:
            rows = self._value(name, scores)
        sign = 1.0 if objective.is_maximised else -1.0
        return ScoreRows(sign * rows.values / reference, sign * rows.slopes / reference)

    def value(self, objective: DesignObjective, scores: Scores) -> float:
        """Return the score of an objective; larger is better."""
        values = self.objective(objective, scores).values
        return float(values.mean() if objective.over == "mean" else values.min())

    def shown(self, objective: DesignObjective, score: float) -> float:
        """Return the value of an objective by its score, in SI units."""
        name = objective.quantity
        if name in ("sigma_max", "condition"):
            return 1.0 / score if score > 0.0 else math.inf
        if name == "sigma_1":
            return score
        if name == "region":
            return math.exp(score)
        reference = self._references[self._key(objective)]
        if name == "torque" and objective.over == "mean":
            return reference * math.sqrt(max(-score, 0.0))
        return (1.0 if objective.is_maximised else -1.0) * reference * score

    def pointwise(self, scores: Scores) -> dict[str, Array]:
        """Return the values (count,) of all pointwise quantities that the task uses, as people read them; NaN where a
        target is not reached or lies beyond a singularity."""
        sigma = scores.sigma.values
        good = scores.reached.is_reached & (sigma[:, 0] > 0.0)
        with np.errstate(divide="ignore", invalid="ignore"):
            quantities = {"sigma_1": sigma[:, 0], "sigma_max": 1.0 / sigma[:, 1], "condition": 1.0 / sigma[:, 2]}
        if self.task.uses("torque"):
            quantities["torque"] = np.abs(scores.torques.values).max(axis=1)
        if self.errors is not None:
            quantities["accuracy"] = scores.accuracy.values[:, 0]
        return {name: np.where(good, values, np.nan) for name, values in quantities.items()}

    def _value(self, name: str, scores: Scores) -> ScoreRows:
        """Return the values of accuracy (m), mass (kg) or the region's scale (its logarithm)."""
        if name == "accuracy":
            return scores.accuracy
        if name == "mass":
            base = self.reaching.mechanism.nodes[0]
            masses = [mass for node, mass in self.masses_at(scores.p).items() if node != base]
            slopes = np.zeros(scores.variables)
            slopes[: len(self.reaching.free)] = np.sum([mass.mass_by for mass in masses], axis=0)[self.reaching.free]
            return ScoreRows(np.array([[sum(mass.mass for mass in masses)]]), slopes[None, None])
        slopes = np.zeros(scores.variables)
        slopes[-1] = 1.0
        return ScoreRows(np.array([[math.log(scores.scale)]]), slopes[None, None])

    def _size(self, scores: Scores, of: tuple[str, ...]) -> ScoreRows:
        """Return the sum of the absolute values of lengths, m."""
        parameters, lengths = self.reaching.parameters, self._lengths[of]
        values = parameters.full(scores.p)[lengths]
        slopes = np.zeros(scores.variables)
        slopes[: len(parameters)] = np.sign(values) @ parameters.ties.matrix[lengths]
        return ScoreRows(np.array([[np.abs(values).sum()]]), slopes[None, None])

    @staticmethod
    def _below(rows: ScoreRows, most: float, unit: float) -> ScoreRows:
        return ScoreRows((most - rows.values) / unit, -rows.slopes / unit)

    # --- references ----------------------------------------------------------------------------------------------

    def take_references(self, other: Scoring) -> None:
        """Divide quantities by the values of another design."""
        self._references = other._references

    def _key(self, objective: DesignObjective) -> str:
        return f"{objective.quantity} {' '.join(objective.of)}"

    def _reference(self, objective: DesignObjective, scores: Scores) -> float:
        """Return the value by which a quantity is divided: that of the first design, for all designs."""
        if objective.quantity == "region":
            return 1.0
        key = self._key(objective)
        if key not in self._references:
            if objective.quantity == "torque":
                rows = scores.torques
            elif objective.quantity == "size":
                rows = self._size(scores, objective.of)
            else:
                rows = self._value(objective.quantity, scores)
            largest = float(np.abs(rows.values).max(initial=0.0))
            self._references[key] = largest if _SMALL < largest < math.inf else 1.0
        return self._references[key]


def _both(rows: ScoreRows) -> ScoreRows:
    """Return values and their negatives, of which the largest is the largest absolute value."""
    values = np.concatenate([rows.values, -rows.values], axis=1)
    return ScoreRows(values, np.concatenate([rows.slopes, -rows.slopes], axis=1))
