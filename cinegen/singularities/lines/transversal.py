"""The lines that meet four given lines: two, one, none that is real, or infinitely many."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cinegen.singularities.lines import klein
from cinegen.singularities.lines.frame import Frame
from cinegen.singularities.lines.line import INCIDENT, Line, LineAtInfinity, LineError


@dataclass(frozen=True, eq=False)
class Transversals:
    """The real lines that meet four lines.

    Attributes:
        lines: two, one (counted twice) or none; none where there are infinitely many.
        infinitely_many: whether there are.
    """

    lines: tuple[Line | LineAtInfinity, ...]
    infinitely_many: bool


def transversals(lines: Sequence[Line], length: float, tolerance: float = INCIDENT) -> Transversals:
    """The lines that meet four lines.

    What is reciprocal to four independent lines is spanned by two screws; the transversals are the lines among their
    combinations (O. Veblen and J. W. Young, "Projective geometry", 1910). Four lines that are dependent leave three
    screws or more, and infinitely many transversals.

    Args:
        lines: four.
        length: the characteristic length.
        tolerance: how accurate the lines are, in characteristic lengths and rad.

    Raises:
        LineError: there are not four lines.
    """
    if len(lines) != 4:
        raise LineError(f"transversals of {len(lines)} lines were asked for; give four")
    frame = Frame.of(lines, length)
    spanned = klein.span(frame.coordinates(lines), 4)
    if spanned.values[-1] <= tolerance:
        return Transversals((), infinitely_many=True)
    found = klein.directors(spanned, tolerance)
    known = spanned.known(tolerance)
    return Transversals(tuple(frame.line(np.asarray(vector), known) for vector in found.lines), found.all)
