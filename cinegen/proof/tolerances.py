"""Radii of a document's placements: what tolerances of dimensions change in the equations of a proof.

A translation is linear in the lengths d_i of the description, each entry of a rotation analytic in its angles a_i, with
second derivatives along any direction e of at most (sum |e_i|)^2. So with both ends of each tolerance tried alone, all
robots within all tolerances have entries within

    sum_i |change by i| + A^2 (rotations),    ... + A (A l + D) (translations),    A = sum_i |e_i|, angles only,

where D is the sum of the lengths' tolerances, and l that of all lengths of the robot (Taylor's theorem).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from cinegen.arrays import Array
from cinegen.design.amounts import Amounts, amount_in, matching, pairs
from cinegen.design.parameters import Parameters
from cinegen.errors import CinegenError
from cinegen.model import Mechanism
from cinegen.proof.document import RADIUS, ProofError
from raff2urdf.quantities import LENGTH

_TURN = [2, 5, 6, 7, 8, 11]
"""Entries of a placement that a rotation about z and a translation across it leave as they are."""


def with_tolerances(
    document: Mapping[str, Any], parameters: Parameters, amounts: Amounts,
    export: Callable[[Mechanism], Mapping[str, Any]],
) -> dict[str, Any]:  # fmt: skip
    """Return a document with the radii of its placements, and the tolerances by name.

    Args:
        document: of the robot as described.
        parameters: of the same robot.
        amounts: largest errors of parameters, by name or pattern.
        export: returns the document of another robot.

    Raises:
        DesignError: an unknown name, or a wrong unit.
        ProofError: loops can't be closed with an error, or the robot has another structure then.
    """
    errors: dict[int, float] = {}
    for pattern, amount in pairs(amounts):
        errors |= {
            i: amount_in(pattern, amount, parameters.all[i].dimension) for i in matching(parameters, pattern, amount)
        }
    usual, nominal = _numbers(document)
    changes, angles, lengths = np.zeros(nominal.shape), np.zeros(len(nominal)), np.zeros(len(nominal))
    for i, error in errors.items():
        one = parameters.all[i]
        step = np.zeros(nominal.shape)
        text = f"{1e3 * error:.4g} mm" if one.dimension is LENGTH else f"{math.degrees(error):.4g} degrees"
        for end in (error,) if one.dimension is LENGTH else (error, -error):  # a length's change is linear
            try:
                other = export(parameters.mechanism_with(parameters.with_changed({one.name: one.value + end})))
            except CinegenError:
                raise ProofError(
                    f"no joint can compensate an error of {text} of {one.name}: the loops would be open; give "
                    "tolerances to other dimensions"
                ) from None
            chains, numbers = _numbers(other)
            if [k for _, k in chains] != [k for _, k in usual]:
                raise ProofError(
                    f"with an error of {text} of {one.name} the robot has other loops or ball joints: give "
                    "tolerances to other dimensions"
                )
            step = np.maximum(step, np.abs(numbers - nominal))
        changes += step
        touched = step.max(axis=1, initial=0.0) > 2.0 * RADIUS
        (lengths if one.dimension is LENGTH else angles)[touched] += error
    total = sum(abs(one.value) for one in parameters.all if one.dimension is LENGTH)
    second = np.repeat(angles[:, None] ** 2, 12, axis=1)
    second[:, 9:] = (angles * (angles * total + lengths))[:, None]
    turns = (nominal[:, 8] == 1.0) & ~changes[:, _TURN[:-1]].any(axis=1)
    second[np.ix_(turns, _TURN)] = 0.0
    radii = np.zeros((len(document["placements"]), 12))
    for (index, _), radius in zip(usual, changes + second, strict=True):
        radii[index] = np.maximum(radii[index], radius)
    named = {parameters.all[i].name: error for i, error in errors.items()}
    return {**document, "radii": radii.tolist(), "bounds": {**document["bounds"], "tolerances": named}}


def _numbers(document: Mapping[str, Any]) -> tuple[list[tuple[int, int]], Array]:
    """Return the placements of all chains, in order: index and variable (-1 at an end), and numbers (., 12)."""
    used = list[tuple[int, int]]()
    for closure in document["closures"]:
        for side in ("first", "second"):
            used += [(index, k) for index, k in closure[side]] + [(closure[f"{side}_end"], -1)]
    return used, np.array([document["placements"][index] for index, _ in used])
