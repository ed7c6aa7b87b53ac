"""Tasks and values of a synthesis as people read them."""

from __future__ import annotations

import math
from collections.abc import Mapping

from cinegen.design.synthesis import QUANTITIES, DesignObjective, Reach, SynthesisTask
from raff2urdf.quantities import LENGTH, shown, shown_scale

_UNITS = {"size": "m", "region": "", "mass": "kg", "accuracy": "mm", "clearance": "mm"}
_NAMES = {
    "sigma_1": "smallest singular value",
    "sigma_max": "largest singular value",
    "condition": "condition number",
    "size": "sum of lengths",
    "region": "scale of the region",
}


def unit_of(quantity: str, torque: str = "N m") -> tuple[float, str]:
    """Return the factor to what is shown from the value of a quantity in m, kg or the unit of torques, and the unit; ""
    for those that are dimensionless."""
    unit = torque if quantity == "torque" else _UNITS.get(quantity, "")
    if unit == "m":
        return shown_scale(LENGTH)
    return (1e3, unit) if unit == "mm" else (1.0, unit)


def name_of(quantity: str) -> str:
    """Return a quantity's name as text."""
    return _NAMES.get(quantity, quantity.replace("_", " "))


def heading_of(quantity: str, torque: str = "N m") -> str:
    """Return a quantity's name as text, with its unit."""
    unit = unit_of(quantity, torque)[1]
    return f"{name_of(quantity)}{f' ({unit})' * bool(unit)}"


def value_text(quantity: str, value: float, digits: int = 5, torque: str = "N m") -> str:
    """Return a value of a quantity with its unit."""
    if math.isnan(value):
        return "the task is not done"
    if math.isinf(value):
        return "infinite"
    scale, unit = unit_of(quantity, torque)
    return f"{scale * value:.{digits}g}\u00a0{unit}".strip()


def change_text(objective: DesignObjective, before: float, after: float) -> str:
    """Return by how much an objective has improved."""
    if not (math.isfinite(before) and math.isfinite(after)) or before == 0.0:
        return ""
    percent = 100.0 * (after - before) / abs(before)
    better = (percent > 0.0) == objective.is_maximised
    text = f"{percent:+.1f}\u00a0%".replace("-", "−")
    return text if better or abs(percent) < 0.05 else f"{text} (worse)"


def objective_text(objective: DesignObjective) -> str:
    """Return an objective as a clause."""
    verb = "maximise" if objective.is_maximised else "minimise"
    if objective.of:
        return f"{verb} the {name_of(objective.quantity)} {', '.join(objective.of)}"
    over = f", {objective.over} over the region" * QUANTITIES[objective.quantity].pointwise
    return f"{verb} the {name_of(objective.quantity)}{over}"


def reach_text(reach: Reach) -> str:
    """Return the points to reach as a clause."""
    orientation = ", with the orientation that it has at home" if reach.is_oriented else ""
    if len(reach.given):
        count = len(reach.given)
        return f"{count} point{'s' * (count != 1)} ({', '.join(reach.axes)}){orientation}"
    if reach.radius:
        axes, middle = ", ".join(reach.axes), ", ".join(shown(float(x), LENGTH) for x in (reach.low + reach.high) / 2.0)
        return f"every point within {shown(reach.radius, LENGTH)} of ({axes}) = ({middle}){orientation}"
    ends = []
    for axis, low, high in zip(reach.axes, reach.low, reach.high, strict=True):
        least = shown(float(low), LENGTH)
        ends.append(f"{axis} = {least}" if low == high else f"{axis} from {least} to {shown(float(high), LENGTH)}")
    return f"every point with {', '.join(ends)}{orientation}"


def constraint_texts(task: SynthesisTask, most_of: Mapping[str, float], torque: str = "N m") -> list[str]:
    """Return the constraints, one text each.

    Args:
        task: that has them.
        most_of: largest values of quantities, SI.
        torque: unit of torques.
    """
    low, high = task.singular_values
    texts = [f"singular values from {low:g} to {high:g}"]
    texts.append("joints within their limits" if task.joint_limits else "limits of joints are ignored")
    if task.size is not None:
        of, most = task.size
        texts.append(f"{', '.join(of)} are at most {shown(most, LENGTH)} together")
    for name, value in most_of.items():
        texts.append(f"{name_of(name)} at most {value_text(name, value, torque=torque)}")
    if task.clearance is not None:
        texts.append(
            f"clearance of bars of radius {shown(task.clearance.radius, LENGTH)} at least "
            f"{shown(task.clearance.least, LENGTH)}"
            + f", also from {len(task.clearance.obstacles)} obstacles"
            * bool(task.clearance.obstacles)
        )
    return texts
