"""What a field is made of is checked once, when it is made."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cinegen.collision.errors import AvoidError

Array = NDArray[np.float64]


class FieldError(AvoidError):
    """A field that can't be: says which number is wrong, and what it has to be."""


def positive(what: str, value: float) -> None:
    """Nothing, if it is a finite number above 0.

    Raises:
        FieldError: it is not.
    """
    if not (math.isfinite(value) and value > 0.0):
        raise FieldError(f"{what} is {value!r}; give a finite number above 0")


def vector(what: str, value: ArrayLike) -> Array:
    """(3,) of its own, which nobody can change.

    Raises:
        FieldError: it is not three finite numbers.
    """
    given = np.array(value, dtype=float)
    if given.shape != (3,) or not np.isfinite(given).all():
        raise FieldError(f"{what} is {value!r}; give three finite numbers")
    given.setflags(write=False)
    return given
