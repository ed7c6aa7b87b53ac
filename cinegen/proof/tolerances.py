"""Radii of a document's placements: what tolerances of dimensions change in the equations of a proof.

A translation is linear in the lengths d_i of the description, each entry of a rotation analytic in its angles a_i, with
second derivatives along any direction e of at most (sum |e_i|)^2. So with both ends of each tolerance tried alone, all
robots within all tolerances have entries within

    sum_i |change by i| + A^2 (rotations),    ... + A (A l + D) (translations),    A = sum_i |e_i|, angles only,

where D is the sum of the lengths' tolerances, and l that of all lengths of the robot (Taylor's theorem). Links keep
their shapes.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple, Protocol

import numpy as np

from cinegen.arrays import Array
from cinegen.errors import CinegenError
from cinegen.model import Mechanism
from cinegen.proof.exported_equations import RADIUS, ProofError


class DimensionError(NamedTuple):
    """Largest error of one dimension, m or rad."""

    number: int
    name: str
    size: float
    is_length: bool

    @property
    def text(self) -> str:
        """The error as people read it."""
        return f"{1e3 * self.size:.4g} mm" if self.is_length else f"{math.degrees(self.size):.4g} degrees"


class Robots(Protocol):
    """All robots within tolerances: `cinegen.design.WithinTolerances`."""

    mechanism: Mechanism
    errors: Sequence[DimensionError]
    length: float

    def extremes(self, error: DimensionError) -> Iterator[Mechanism]:
        """Yield the robots with one dimension at the ends of its tolerance."""


_TURN = [2, 5, 6, 7, 8, 11]
"""Entries of a placement that a rotation about z and a translation across it leave as they are."""


def with_tolerances(
    document: Mapping[str, Any], robots: Robots, export: Callable[[Mechanism], Mapping[str, Any]]
) -> dict[str, Any]:
    """Return a document with the radii of its placements, and the tolerances by name.

    Args:
        document: of the robot as described.
        robots: all that the proof is about.
        export: returns the document of another robot.

    Raises:
        ProofError: loops can't be closed with an error, or the robot has another structure then.
    """
    usual, nominal = _numbers(document)
    changes, angles, lengths = np.zeros(nominal.shape), np.zeros(len(nominal)), np.zeros(len(nominal))
    for error in robots.errors:
        step = np.zeros(nominal.shape)
        try:
            others = [export(other) for other in robots.extremes(error)]
        except CinegenError:
            raise ProofError(
                f"no joint can compensate an error of {error.text} of {error.name}: the loops would be open; give "
                "tolerances to other dimensions"
            ) from None
        for chains, numbers in map(_numbers, others):
            if [k for _, k in chains] != [k for _, k in usual]:
                raise ProofError(
                    f"with an error of {error.text} of {error.name} the robot has other loops or ball joints: give "
                    "tolerances to other dimensions"
                )
            step = np.maximum(step, np.abs(numbers - nominal))
        changes += step
        touched = step.max(axis=1, initial=0.0) > 2.0 * RADIUS
        (lengths if error.is_length else angles)[touched] += error.size
    second = np.repeat(angles[:, None] ** 2, 12, axis=1)
    second[:, 9:] = (angles * (angles * robots.length + lengths))[:, None]
    turns = (nominal[:, 8] == 1.0) & ~changes[:, _TURN[:-1]].any(axis=1)
    second[np.ix_(turns, _TURN)] = 0.0
    radii = np.zeros((len(document["placements"]), 12))
    for (index, _), radius in zip(usual, changes + second, strict=True):
        radii[index] = np.maximum(radii[index], radius)
    named = {error.name: error.size for error in robots.errors}
    return {**document, "radii": radii.tolist(), "bounds": {**document["bounds"], "tolerances": named}}


def _numbers(document: Mapping[str, Any]) -> tuple[list[tuple[int, int]], Array]:
    """Return the placements of all chains, in order: index and variable (-1 at an end), and numbers (., 12)."""
    used = list[tuple[int, int]]()
    for closure in [*document["closures"], *document.get("bodies", [])]:
        for side in ("first", "second"):
            used += [(index, k) for index, k in closure[side]] + [(closure[f"{side}_end"], -1)]
    for cluster in (document.get("second") or {"clusters": []})["clusters"]:
        used += [(index, k) for chain, *_ in cluster["about"] for index, k in chain]
    return used, np.array([document["placements"][index] for index, _ in used])
