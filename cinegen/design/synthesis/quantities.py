"""Quantities that a synthesis optimises and bounds: names, which direction is better, and units."""

from __future__ import annotations

from typing import NamedTuple

from raff2urdf.quantities import LENGTH, MASS, NUMBER, Dimension


class DesignQuantity(NamedTuple):
    """A number that judges a design.

    Attributes:
        better: "maximise" or "minimise".
        dimension: of its values; None where the mechanism's joints decide it.
        pointwise: whether each target has one, of which the worst or the mean counts.
        meaning: in one line, for help and reports.
    """

    better: str
    dimension: Dimension | None
    pointwise: bool
    meaning: str


QUANTITIES = {
    "sigma_1": DesignQuantity("maximise", NUMBER, True, "smallest singular value"),
    "sigma_max": DesignQuantity("minimise", NUMBER, True, "largest singular value"),
    "condition": DesignQuantity("minimise", NUMBER, True, "ratio of the largest singular value to the smallest"),
    "torque": DesignQuantity("minimise", None, True, "largest torque or force of an actuated joint at rest"),
    "accuracy": DesignQuantity("minimise", LENGTH, True, "root mean square position error by the tolerances"),
    "size": DesignQuantity("minimise", LENGTH, False, "sum of lengths"),
    "mass": DesignQuantity("minimise", MASS, False, "mass of all links but the base"),
    "region": DesignQuantity("maximise", NUMBER, False, "factor by which the region grows about its centre"),
}
"""All quantities, by name."""
