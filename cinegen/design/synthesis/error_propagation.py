"""The accuracy of designs at configurations, and how it changes with the design.

With the derivative J of the node's position by all sources of errors (`cinegen.design.tolerance`), the root mean square
deviation is sqrt(trace(J diag(sigma^2) J^T)). J is exact; its derivative by the variables is that of central
differences along the motion of the configuration.
"""

from __future__ import annotations

import numpy as np

from cinegen.arrays import Array
from cinegen.design.errors import DesignError
from cinegen.design.parameters import Parameters
from cinegen.design.synthesis.reaching import Reaching
from cinegen.design.synthesis.task import DesignErrors
from cinegen.design.tolerance import Tolerances

_STEP = 1e-5  # characteristic lengths or rad


class ErrorPropagation:
    """The accuracy of a mechanism's node at any values of its parameters.

    Args:
        errors: of parameters, joints and encoders.
        reaching: of the node.

    Raises:
        DesignError: nothing that has an error moves the node.
    """

    def __init__(self, errors: DesignErrors, reaching: Reaching) -> None:
        self.reaching = reaching
        parameters = reaching.parameters
        mechanism = reaching.mechanism
        first = Tolerances(parameters.document, errors.sigma, errors.play, errors.encoder, robot=parameters.robot.name)
        varied = [entry.name for entry, row in zip(parameters.all, parameters.ties.matrix, strict=True) if row.any()]
        names = sorted({*first.design.parameters.names, *varied})
        every = Parameters(parameters.document, names, robot=parameters.robot.name)
        self._tolerances = Tolerances(every, errors.sigma, errors.play, errors.encoder)
        self.design = self._tolerances.design
        self._indices = [parameters.find(name) for name in every.names]
        self._deviations = np.zeros(len(self.design.names))
        for source in self._tolerances.closing:
            self._deviations[list(source.columns)] = source.sigma
        self._steps = _STEP * parameters.sizes
        if not self._at(parameters.values, np.array([mechanism.q_home]))[0] > 0.0:
            raise DesignError(f"tolerances: none of them moves {reaching.node}: accuracy means nothing")

    def at(self, p: Array, q: Array, moved: Array) -> tuple[Array, Array]:
        """Return the root mean square deviation (count,) of the node's position, m, and its derivative
        (count, variables).

        Args:
            p: (parameters,) m and rad.
            q: (count, nq) closed configurations.
            moved: (count, nv, variables) derivative of the configurations; the first variables are the parameters.
        """
        mechanism, n = self.reaching.mechanism, len(p)
        slopes = np.zeros((len(q), moved.shape[2]))
        for k in range(moved.shape[2]):
            step = self._steps[k] if k < n else _STEP
            change = step * np.eye(n)[k] if k < n else np.zeros(n)
            ends = []
            for sign in (1.0, -1.0):
                shifted = [mechanism.integrate(a, sign * step * b) for a, b in zip(q, moved[..., k], strict=True)]
                ends.append(self._at(p + sign * change, np.array(shifted)))
            slopes[:, k] = (ends[0] - ends[1]) / (2.0 * step)
        return self._at(p, q), slopes

    def _at(self, p: Array, q: Array) -> Array:
        values = self.reaching.parameters.full(p)[self._indices]
        evaluation = self.design.evaluate(values, q)
        moved = evaluation.pose_derivative(self.reaching.node, "world")[:, :3] * self._deviations
        return np.asarray(np.sqrt((moved**2).sum(axis=(1, 2))))
