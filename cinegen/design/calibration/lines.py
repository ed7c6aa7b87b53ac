"""`lines`: what was read is in other lines than the readings of the joints where it was read."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from scipy.optimize import linear_sum_assignment

from cinegen.design.calibration.comparison import FEWEST, ColumnComparison
from cinegen.design.calibration.mistakes import Mistake, names_of
from raff2urdf.errors import first_of

_SHOWN = 4  # lines whose other place is named


def lines(comparison: ColumnComparison) -> Iterator[Mistake]:
    """Yield readings that are shifted by one line, then the order in which they are nearest to what the robot does."""
    observation = comparison.observation
    given, outputs = observation.measurements, observation.outputs
    count, names = len(given), names_of(given, outputs)
    if count <= 2 * FEWEST or comparison.given is None:
        return

    def moved(here: list[int], there: list[int], text: str, edit: str) -> Mistake:
        values, sigmas = given.values[here].copy(), given.sigmas[here].copy()
        values[:, outputs], sigmas[:, outputs] = given.values[there][:, outputs], given.sigmas[there][:, outputs]
        labels = tuple(given.labels[i] for i in here)
        return Mistake(text, edit, replace(given, values=values, sigmas=sigmas, labels=labels), 1)

    first, last, edit = list(range(count - 1)), list(range(1, count)), f"move {names} by one line, joints stay"
    yield moved(first, last, f"with {names} of the line below", edit)
    yield moved(last, first, f"with {names} of the line above", edit)
    values = observation.predict(observation.values, derivatives=False).values
    apart = (values[:, None] - observation.measured) / comparison.given.expected
    order = linear_sum_assignment(np.nan_to_num(np.abs(apart)).sum(axis=2))[1].tolist()
    others = [f"{given.labels[j]} at {given.labels[i]}" for i, j in enumerate(order) if i != j]
    text = f"with {names} in another order of lines ({first_of(others, _SHOWN)})"
    yield moved(list(range(count)), order, text, f"move {names} to the lines of the joints where they were read")
