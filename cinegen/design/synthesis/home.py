"""`HomedDocuments`: other values of parameters, with a home in the assembly mode that is meant.

Closed from the file's numbers, the loops of other dimensions might end in another one.
"""

from __future__ import annotations

from collections.abc import Iterable

from cinegen.arrays import Array
from cinegen.design.parameters import Parameters
from raff2urdf import Document

_SAME = 1e-9  # m or rad: the home that is written stays


class HomedDocuments:
    """Documents with other values of parameters, and another home.

    Args:
        parameters: the free ones, without the variables of joints.
        ties: theirs.
    """

    def __init__(self, parameters: Parameters, ties: Iterable[str]) -> None:
        self._names, self._mechanism = parameters.names, parameters.mechanism
        variables = [parameter.name for parameter in parameters.all if parameter.joint]
        names, robot = [*parameters.names, *variables], parameters.robot.name
        self._every = Parameters(parameters.document, names, ties, robot=robot)

    def at(self, p: Array, home: Array) -> Document:
        """Return the document with values of the parameters (count,), and with the joints of a configuration (nq,)."""
        every, mechanism = self._every, self._mechanism
        values = every.values.copy()
        values[[every.index(name) for name in self._names]] = p
        for k, parameter in enumerate(every.free):
            if parameter.joint in mechanism.joints:
                value = home[mechanism.q_index(parameter.joint)]
                if abs(value - values[k]) > _SAME:
                    values[k] = value
        return every.document_with(values)
