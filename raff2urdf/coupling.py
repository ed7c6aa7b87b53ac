"""Couplings: equations between joints, as gears, belts, racks, screws and differentials impose them.

A coupling of the joints q_1, q_2, ... is

    sum_i p_i(q_i) = c_0,    p_i(q) = c_i1 q + c_i2 q^2 + ...

in rad and m: linear for gears and screws, q_1 = p(q_2) for a joint that follows a curve. The joint of the first term is
the one that follows. The residual is dimensionless as that of a loop: it is divided by the size of the equation,

    s^2 = sum_i max_q (p_i'(q) l_i)^2 ,

where l_i is the characteristic length for a prismatic joint, and 1 rad for a revolute one, and q within the joint's
limits; where it has none, within l_i of 0 and of the other limit. Of a linear coupling it is the distance, in rad or
characteristic lengths, to the nearest joint values that fulfil it; of a curve it is at most that, where it is steepest.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.polynomial import Polynomial

from raff2urdf.bounds import UNLIMITED

_EXACT = 1e-14  # rad or m: a follower that is off by less stays as written


@dataclass(frozen=True, slots=True)
class Coupling:
    """An equation between joints.

    Attributes:
        name: such as `joint5-joint3`.
        terms: coefficients c_1, c_2, ... of a joint's variable (rad or m) and its powers, by the joint's name; first
            the joint that follows.
        constant: c_0.
    """

    name: str
    terms: Mapping[str, tuple[float, ...]]
    constant: float = 0.0

    @property
    def follower(self) -> str:
        """The joint of the first term."""
        return next(iter(self.terms))

    @property
    def is_linear(self) -> bool:
        """True if no power of a joint variable occurs but the first."""
        return all(len(coefficients) == 1 for coefficients in self.terms.values())

    def __str__(self) -> str:
        """Return the equation, in rad and m."""
        text = ""
        for joint, coefficients in self.terms.items():
            for power, c in enumerate(coefficients, 1):
                if c != 0.0:
                    sign = "-" if c < 0.0 else "+" if text else ""
                    factor = "" if abs(c) == 1.0 else f"{abs(c):.6g} "
                    term = f"{factor}{joint}{f'^{power}' if power > 1 else ''}"
                    text += f" {sign} {term}" if text else f"{sign}{term}"
        return f"{text or '0'} = {self.constant:.6g}"

    def size(self, scales: Mapping[str, float], limits: Mapping[str, tuple[float, float]]) -> float:
        """Return s; arguments as of `slopes`."""
        return math.sqrt(sum(slope**2 for slope in self.slopes(scales, limits).values()))

    def slopes(self, scales: Mapping[str, float], limits: Mapping[str, tuple[float, float]]) -> dict[str, float]:
        """Return the steepest derivative p_i'(q) l_i by each joint, of its scale and limits: the characteristic length
        (m) or 1 rad; rad or m, or infinite."""
        return {
            joint: _steepest(Polynomial([0.0, *coefficients]).deriv(), scales[joint], *limits[joint]) * scales[joint]
            for joint, coefficients in self.terms.items()
        }

    def evaluate(self, values: Mapping[str, float]) -> tuple[float, dict[str, float]]:
        """Return the residual at joint values (rad, m), not divided by the size, and its derivative by each joint."""
        residual, derivative = -self.constant, {}
        for joint, coefficients in self.terms.items():
            value, slope = 0.0, 0.0
            for c in reversed(coefficients):  # Horner's scheme
                slope = slope * values[joint] + value + c
                value = (value + c) * values[joint]
            residual += value
            derivative[joint] = slope
        return residual, derivative

    def roots(self, joint: str, values: Mapping[str, float]) -> list[complex]:
        """Return all complex values of a joint (rad, m) that fulfil the coupling with the values of the others: the
        roots x of p(x) + sum of the others' p_i(q_i) - c_0."""
        lack, _ = self.evaluate({**values, joint: 0.0})
        return [complex(root) for root in np.roots([*reversed(self.terms[joint]), lack])]


def _steepest(slope: Polynomial, scale: float, low: float, high: float) -> float:
    """Return the value of a slope that is largest by its amount, within limits; see above."""
    ends = (
        low if abs(low) < UNLIMITED else min(high, 0.0) - scale,
        high if abs(high) < UNLIMITED else max(low, 0.0) + scale,
    )
    inside = slope.deriv().trim().roots().real.clip(*ends)
    values = slope(np.array([*ends, *inside]))
    return float(values[np.abs(values).argmax()])


def coupled_scales(
    couplings: Sequence[Coupling], scales: Mapping[str, float], outermost: Collection[str],
    limits: Mapping[str, tuple[float, float]],
) -> dict[str, float]:  # fmt: skip
    """Return the size of a dimensionless step of each joint in couplings, rad or m.

    A joint that drives others by gears or a screw may make many revolutions while they move by little. Counted like any
    other joint it would dominate every motion that it takes part in, and the mechanism would seem nearly singular. So
    one step of a joint that moves nothing but its own body is as large as the step of the joint that it drives; of a
    curve where it is steepest, see `Coupling.slopes`.

    Args:
        couplings: all of them.
        scales: of the joints without couplings: the characteristic length (m), or 1 rad.
        outermost: joints behind which there are no other joints and no ends of loops.
        limits: of the joints in couplings, rad or m.
    """
    sizes = dict(scales)
    for coupling in couplings:
        slopes = coupling.slopes(scales, limits)
        for joint in coupling.terms.keys() & outermost:
            driven = max((abs(slope) for other, slope in slopes.items() if other != joint), default=0.0)
            if slopes[joint] != 0.0:
                sizes[joint] = max(sizes[joint], driven / abs(slopes[joint]) * scales[joint])
    return sizes


def followed(couplings: Iterable[Coupling], values: Mapping[str, float]) -> dict[str, float]:
    """Return joint values (rad, m) in which the follower of each coupling is where the other joints drive it.

    Leaders that follow others themselves move first. A follower of whose variable powers occur stays.
    """
    moved = dict(values)
    for coupling in leaders_first(couplings):
        (factor, *powers), follower = coupling.terms[coupling.follower], coupling.follower
        lack, _ = coupling.evaluate(moved)
        if not powers and abs(lack) > _EXACT * abs(factor):
            moved[follower] -= lack / factor
    return moved


def leaders_first(couplings: Iterable[Coupling]) -> Iterator[Coupling]:
    """Yield couplings, each behind those whose followers lead in it; in file order where they lead each other."""
    pending = list(couplings)
    while pending:
        following = Counter(coupling.follower for coupling in pending)
        ready = [c for c in pending if all(not following[joint] for joint in c.terms if joint != c.follower)]
        first = ready or pending[:1]
        yield from first
        pending = [c for c in pending if not any(c is other for other in first)]


def determining(couplings: Iterable[Coupling], known: Iterable[str]) -> list[Coupling]:
    """Return the couplings that determine a joint each, with this joint first, in whichever order they are written: all
    other joints are known, or a coupling before determines them. Where there is a choice, linear terms come first."""
    pending, ordered, determined = list(couplings), list[Coupling](), set(known)
    while True:
        pending = [coupling for coupling in pending if coupling.terms.keys() - determined]
        ready = [(c, joint) for c in pending for joint in c.terms if c.terms.keys() - determined == {joint}]
        if not ready:
            return ordered
        coupling, joint = min(ready, key=lambda pair: len(pair[0].terms[pair[1]]))
        terms = {joint: coupling.terms[joint], **coupling.terms}
        ordered.append(replace(coupling, terms=terms))
        determined.add(joint)


def coupling_entry(name: str, terms: Mapping[str, Sequence[float]], constant: float = 0.0) -> dict[str, Any]:
    """Return the entry of a coupling in a constraints file; see `Coupling`."""
    listed = [{"joint": joint, "coefficients": list(coefficients)} for joint, coefficients in terms.items()]
    return {"name": name, "terms": listed, "constant": constant}


def coupling_of(entry: Mapping[str, Any]) -> Coupling:
    """Return the coupling of an entry."""
    terms = {term["joint"]: tuple(map(float, term["coefficients"])) for term in entry["terms"]}
    return Coupling(entry["name"], terms, float(entry["constant"]))
