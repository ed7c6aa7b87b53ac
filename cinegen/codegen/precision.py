"""Thresholds in single precision.

A threshold of the kernels is a power of the rounding unit of doubles: 1e-12 is its 0.77th. In single precision it
becomes the same power of the unit of floats. Thresholds that stand for something else than rounding are listed.
"""

from __future__ import annotations

import math

_UNIT, _SINGLE_UNIT = 2.0**-52, 2.0**-23
_ROUNDING = 1e-8  # thresholds up to this are about rounding
_LEAST, _LARGEST = 1e-37, 1e18  # numbers whose inverse, or whose square, no float overflows

_NAMED = {
    "ARRIVED": 2e-5,  # rad or lengths
    "REST": 2e-6,  # of a joint in a tick
    "FULL": 1.0 - 6e-5,  # joints of a few rad are rounded to 1e-7, in a tick of a few 1e-3
    "_LAST": 1e-4,  # rotation in the last sweep
    "_ALIKE": 1e-5,
}
_LITERALS = {  # below these a power series is used; the formula would lose too many digits
    ("sinc", 1e-4): 3e-2,
    ("swing", 1e-4): 3e-2,
    ("log_derivative", 1e-2): 1e-1,
    ("_float", 1e-8): 1e-2,
}

POSITION_ERROR = 2e-5
"""Stated error of frames, in characteristic lengths and rad, at configurations that are not near a singularity."""

CLOSURE_ERROR = 1e-5
"""Stated largest residual of loops, rad or characteristic lengths."""


def threshold(value: float, name: str = "", function: str = "") -> float:
    """Return a number of the kernels in single precision.

    Args:
        value: as it is in doubles.
        name: of a constant.
        function: in which a literal is written.
    """
    if name in _NAMED:
        return _NAMED[name]
    if (function, value) in _LITERALS:
        return _LITERALS[function, value]
    if 0.0 < abs(value) <= _ROUNDING:
        power = math.log(abs(value)) / math.log(_UNIT)
        return math.copysign(max(_SINGLE_UNIT**power, _LEAST), value)
    if _LARGEST < abs(value) < math.inf and abs(value) > 1e30:
        return math.copysign(_LARGEST, value)
    return value
