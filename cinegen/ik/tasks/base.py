"""The base of all kinds of tasks: their attributes are checked as they are set."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import numpy as np

from cinegen.arrays import Array
from cinegen.errors import CinegenError
from cinegen.ik.state import State
from cinegen.ik.tasks.fields import FIELDS


@dataclass(eq=False, repr=False)
class Kind:
    """Base of the kinds: attributes that are checked when they are set."""

    priority: int = field(default=0, kw_only=True)
    weight: float = field(default=1.0, kw_only=True)

    def __setattr__(self, name: str, value: Any) -> None:
        if name not in self.__dataclass_fields__:
            known = ", ".join((*self._names(), "priority", "weight"))
            raise AttributeError(f"{type(self).__name__} has no attribute '{name}' that can be set; it has {known}")
        checked = FIELDS[name]
        try:
            object.__setattr__(self, name, checked.checked(value))
        except (AttributeError, TypeError, ValueError):
            raise CinegenError(f"{type(self).__name__}.{name} must be {checked.what}, not {value!r:.80}") from None

    def __repr__(self) -> str:
        return f"<{type(self).__name__} {', '.join(str(getattr(self, name)) for name in self._names()[:2])}>"

    def _names(self) -> list[str]:
        return [name for name in self.__dataclass_fields__ if name not in ("priority", "weight")]


def placed(state: State, on: str | None, point: Array) -> tuple[Array, Array]:
    """Return a point (3,) in the world, and its Jacobian (3, nv): on a node, or of the world."""
    if on is None:
        return point, np.zeros((3, state.model.nv))
    return state.frame(on).act(point), state.point_jacobian(on, point)[:3]


def turned(state: State, on: str | None, direction: Array) -> tuple[Array, Array]:
    """Return a direction (3,) in the world, and the angular velocity's Jacobian (3, nv) of what carries it."""
    if on is None:
        return direction, np.zeros((3, state.model.nv))
    return state.frame(on).rotation @ direction, state.jacobian(on)[3:]


def across(axis: Array) -> Array:
    """Return a right-handed basis (3, 3) as rows, whose last is the axis."""
    return _basis(axis.tobytes())


@lru_cache(maxsize=256)  # of attributes, which ticks ask for again and again: `numpy.cross` takes longer than all else
def _basis(numbers: bytes) -> Array:
    axis = np.frombuffer(numbers)
    x = np.cross(axis, np.eye(3)[int(np.abs(axis).argmin())])
    x /= np.linalg.norm(x)
    basis = np.array([x, np.cross(axis, x), axis])
    basis.flags.writeable = False
    return basis
