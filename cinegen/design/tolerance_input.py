"""Tolerances as they are given: which columns of a design err, and the components of play."""

from __future__ import annotations

from collections.abc import Container, Mapping

import numpy as np

from cinegen.design.amounts import amount_in
from cinegen.design.chains import COMPONENTS
from cinegen.design.errors import DesignError
from cinegen.design.parameters import Parameters
from cinegen.design.ties import fits
from raff2urdf.errors import did_you_mean
from raff2urdf.quantities import ANGLE, LENGTH, has_unit, shown
from raff2urdf.raff.document import LoopKind

_ACROSS = {LoopKind.REVOLUTE: 2, LoopKind.PRISMATIC: 2, LoopKind.BALL: 3, LoopKind.RIGID: 0}


def columns_of(parameters: Parameters, sigmas: Mapping[int, float], named: Container[int]) -> dict[int, list[int]]:
    """Return the columns that have tolerances, and the indices in `Parameters.all` of what these belong to: parameters
    that are tied err alike.

    Args:
        parameters: the free ones, with ties.
        sigmas: standard deviations, by index.
        named: indices that were named, not matched by a pattern.

    Raises:
        DesignError: parameters that are tied have different tolerances; one that follows from others was named, or
            those have none.
    """
    matrix, members, following = parameters.ties.matrix, dict[int, list[int]](), list[int]()
    for i in sorted(sigmas):
        columns = np.flatnonzero(matrix[i])
        if len(columns) == 1 and abs(matrix[i, columns[0]]) == 1.0:
            members.setdefault(int(columns[0]), []).append(i)
        else:
            following.append(i)
    for tied in members.values():
        for i in tied[1:]:
            if sigmas[i] != sigmas[tied[0]]:
                first, second = (parameters.all[k] for k in (tied[0], i))
                texts = [shown(sigmas[k], first.dimension) for k in (tied[0], i)]
                raise DesignError(
                    f"{first.name} and {second.name} are tied, but have different tolerances: {' and '.join(texts)}"
                )
    for i in following:
        masters = np.flatnonzero(matrix[i]).tolist()
        lacking = [parameters.names[k] for k in masters if k not in members]
        if i in named or lacking:
            follows = " and ".join(parameters.names[k] for k in masters) or "a constant"
            raise DesignError(
                f"{parameters.all[i].name} follows from {follows} by a tie: give the tolerance to "
                f"{' and '.join(lacking or [parameters.names[k] for k in masters]) or 'a parameter that is not tied'}"
            )
    return members


def play_of(whole: Parameters, name: str, amount: float | str) -> list[tuple[str, str, list[str], float]]:
    """Return the joint or loop, the name of the source, the components and the amount of a play."""
    mechanism = whole.mechanism
    kinds = {loop.name: _ACROSS[loop.kind] for loop in mechanism.loops}
    kinds |= dict.fromkeys(mechanism.joints, 2) | dict.fromkeys(mechanism.balls, 3)
    joint, dot, component = name.rpartition(".")
    if name not in kinds and dot and joint in kinds and component in COMPONENTS:
        value = amount_in(f"play of {name}", amount, ANGLE if component.startswith("r") else LENGTH)
        return [(joint, f"{name} (play)", [component], value)]
    if name not in kinds:
        raise DesignError(
            f"{mechanism.name} has no joint or loop '{name}' to have play{did_you_mean(name, list(kinds))}"
        )
    if not kinds[name]:
        raise DesignError(f"loop '{name}' is rigid: it has no play; give that of a joint next to it")
    tilts = isinstance(amount, str) and fits(amount, ANGLE) and has_unit(amount)
    value = amount_in(f"play of {name}", amount, ANGLE if tilts else LENGTH)
    if tilts and kinds[name] == 3:
        raise DesignError(f"'{name}' is a ball joint: its play is a length, not {amount}")
    components = COMPONENTS[3:5] if tilts else COMPONENTS[: kinds[name]]
    return [(name, f"{name} ({'tilt' if tilts else 'play'})", list(components), value)]
