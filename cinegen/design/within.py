"""`WithinTolerances`: all robots whose dimensions differ from a description's by no more than tolerances."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from cinegen.design.amounts import Amounts, sizes_by_index
from cinegen.design.parameters import Parameters
from cinegen.model import Mechanism
from cinegen.proof.tolerances import DimensionError
from raff2urdf.quantities import LENGTH


class WithinTolerances:
    """All robots whose dimensions differ by no more than tolerances.

    Args:
        parameters: the dimensions.
        tolerances: largest errors by name or pattern: m, rad, or texts with a unit.

    Attributes:
        mechanism: the robot as described.
        errors: of its dimensions.
        length: sum of all lengths, m.

    Raises:
        DesignError: an unknown name, or a wrong unit.
    """

    def __init__(self, parameters: Parameters, tolerances: Amounts) -> None:
        self._parameters, self.mechanism, dimensions = parameters, parameters.mechanism, parameters.all
        sizes = sizes_by_index(parameters, tolerances)
        self.errors: Sequence[DimensionError] = [
            DimensionError(i, dimensions[i].name, size, dimensions[i].dimension is LENGTH) for i, size in sizes.items()
        ]
        self.length = sum(abs(parameter.value) for parameter in dimensions if parameter.dimension is LENGTH)

    def extremes(self, error: DimensionError) -> Iterator[Mechanism]:
        """Yield the robots with one dimension at the ends of its tolerance, of a length at the upper end: it is linear.

        Raises:
            CinegenError: its loops can't be closed.
        """
        at, parameters = self._parameters.all[error.number].value, self._parameters
        for end in (error.size,) if error.is_length else (error.size, -error.size):
            yield parameters.mechanism_with(parameters.with_changed({error.name: at + end}))
