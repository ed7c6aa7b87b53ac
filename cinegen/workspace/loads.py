"""Quantities of a map's cells that come from loads and elasticity: torques, payloads, reactions, stiffness, frequency.

The mechanism is at rest, with `MapSpecification.payloads`, `wrenches` and `gravity`.
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from contextlib import suppress
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from cinegen.arrays import Array
from cinegen.dynamics import InverseDynamics, Payload
from cinegen.dynamics.elasticity import Elasticity
from cinegen.dynamics.errors import MotionError
from cinegen.errors import CinegenError, UnknownNameError
from cinegen.workspace.errors import MapError

if TYPE_CHECKING:
    from cinegen.workspace.cells import Cells
    from cinegen.workspace.specification import MapSpecification


LIMITED = frozenset({"torque", "payload", "payload_any"})
"""Quantities that take limits of torque, and masses."""

REACTIONS = ("reaction_force", "reaction_moment")
"""Quantities of one joint or loop, which take masses."""

ELASTIC = frozenset({"stiffness", "rotational_stiffness", "frequency"})
"""Quantities that take the stiffness of joints; `frequency` takes masses, too."""

LOADED = (*sorted(LIMITED), *REACTIONS, *sorted(ELASTIC))

_HEAVIEST = 1e9  # kg: more is borne by the structure alone
_NO_GRAVITY = (0.0, 0.0, 0.0)
_ROUNDING = 1e-11  # of the largest component of a reaction, dimensionless
_COMPONENTS = {"reaction_force": "force", "reaction_moment": "moment"}


# --- torques and reactions --------------------------------------------------------------------------------------------


def torque(cells: Cells) -> Array:
    """Return (n,) the largest torque or force at rest under gravity, relative to its limit; infinite where none holds
    the mechanism."""
    return np.asarray(np.abs(_used(cells, _dynamics_of(cells.spec))).max(axis=1))


def payload(cells: Cells) -> Array:
    """Return (n,) the largest mass at the node's origin, kg, that torques within their limits hold at rest: at most
    1e9. NaN where they do not hold the mechanism itself."""
    weight, loaded = _used(cells, _dynamics_of(cells.spec)), _used(cells, _dynamics_of(cells.spec, more=1.0))
    with np.errstate(divide="ignore", invalid="ignore"):
        by_mass = loaded - weight
        masses = np.where(by_mass != 0.0, (1.0 - np.sign(by_mass) * weight) / np.abs(by_mass), np.inf).min(axis=1)
        return np.where(np.abs(weight).max(axis=1) <= 1.0, np.minimum(masses, _HEAVIEST), np.nan)


def payload_any(cells: Cells) -> Array:
    """Return (n,) the largest mass at the node's origin, kg, that torques within their limits hold at rest in whatever
    direction gravity acts: at most 1e9. NaN where they do not hold the mechanism itself in all directions.

    With torques w of weight and p of 1 kg by gravity along x, y and z, and c of wrenches, all relative to the limits, a
    joint holds m if |w + m p| <= 1 - |c|: the largest of d . (w + m p) + c over all directions d.
    """
    spec = cells.spec
    pushed = np.abs(_used(cells, _dynamics_of(spec, _NO_GRAVITY, is_carried=False)))
    weight, by_mass = np.zeros((2, 3, *pushed.shape))
    for axis, gravity in enumerate(np.diag([np.linalg.norm(spec.gravity)] * 3).tolist()):
        first, second = (_used(cells, _dynamics_of(spec, tuple(gravity), mass, is_pushed=False)) for mass in (0.0, 1.0))
        with np.errstate(invalid="ignore"):
            weight[axis], by_mass[axis] = first, second - first
    with np.errstate(divide="ignore", invalid="ignore"):
        along, by_weight, room = (weight * by_mass).sum(axis=0), (weight**2).sum(axis=0), 1.0 - pushed
        square = (by_mass**2).sum(axis=0)
        masses = np.where(
            square > 0.0, (np.sqrt(along**2 + square * (room**2 - by_weight)) - along) / square, np.inf
        ).min(axis=1)  # fmt: skip
        is_held = (room >= 0.0) & (by_weight <= room**2)
        return np.where(is_held.all(axis=1), np.minimum(masses, _HEAVIEST), np.nan)


def _used(cells: Cells, dynamics: InverseDynamics) -> Array:
    """Return the torques (n, limited) of the actuated joints at rest, relative to their limits; infinite where none
    hold the mechanism, NaN where there is no configuration."""
    q, limits = cells.evaluations.q, _limits_of(cells.spec)
    known, limited = np.isfinite(q).all(axis=1), np.isfinite(limits)
    used = np.full((len(q), int(limited.sum())), np.nan)
    torques = dynamics.torques_of(q[known])[:, limited] / limits[limited]
    used[known] = np.where(np.isfinite(torques), torques, np.inf)
    return used


def reaction_force(cells: Cells) -> Array:
    """Return (n,) the force in the joint, N, without the components that statics does not determine; infinite where no
    torques hold the mechanism."""
    return _reaction(cells, slice(0, 3))


def reaction_moment(cells: Cells) -> Array:
    """Return (n,) the moment in the joint, N m; as `reaction_force`."""
    return _reaction(cells, slice(3, 6))


def _reaction(cells: Cells, part: slice) -> Array:
    """Return (n,) the length of a part of the reaction."""
    spec, q = cells.spec, cells.evaluations.q
    known, lengths = np.isfinite(q).all(axis=1), np.full(len(q), np.nan)
    dynamics = _dynamics_of(spec)
    wrenches, units = dynamics.reactions_of(spec.reaction, q[known]), np.repeat([spec.mechanism.length, 1.0], 3)
    is_in = ~dynamics.undetermined_of(spec.reaction)
    largest = np.abs((wrenches * units)[:, is_in]).max(axis=1, initial=0.0)[:, None]
    wrenches[np.abs(wrenches * units) <= _ROUNDING * largest] = 0.0
    is_in[: part.start], is_in[part.stop :] = False, False
    lengths[known] = np.linalg.norm(wrenches[:, is_in], axis=1)
    lost = np.flatnonzero(known & np.isnan(lengths))
    if len(lost):  # else statics determines less there than elsewhere
        lengths[lost[np.isnan(dynamics.torques_of(q[lost])).any(axis=1)]] = np.inf
    return lengths


def described(spec: MapSpecification, quantity: str, text: str) -> str:
    """Return the description of a quantity in a map: of reactions with the joint's name, and what is left out."""
    if quantity not in REACTIONS:
        return text
    left = ", ".join(left_out(spec, quantity))
    what = text.replace("the joint", spec.reaction)
    return f"{what}, without {left}, which statics does not determine" if left else what


def left_out(spec: MapSpecification, quantity: str) -> str:
    """Return the components of a reaction that a quantity leaves out, because statics does not determine them: "xy"."""
    first = 3 * REACTIONS.index(quantity)
    unknown = _dynamics_of(spec).undetermined_of(spec.reaction)[first : first + 3]
    return "".join(axis for axis, is_unknown in zip("xyz", unknown, strict=True) if is_unknown)


# --- elasticity -------------------------------------------------------------------------------------------------------


def stiffness(cells: Cells) -> Array:
    """Return (n,) the smallest force on the node by its displacement, N/m: the inverse of the largest eigenvalue of the
    compliance of its translations, its rotations free; 0 where the mechanism moves and deforms no spring."""
    return _stiffness(cells, slice(0, 3))


def rotational_stiffness(cells: Cells) -> Array:
    """Return (n,) the smallest moment on the node by its rotation, N m/rad; as `stiffness`, its translations free."""
    return _stiffness(cells, slice(3, 6))


def _stiffness(cells: Cells, part: slice) -> Array:
    """Return (n,) the smallest eigenvalue of the inverse of a part of the node's compliance."""
    spec, done = cells.spec, cells.evaluations
    known, stiffness = np.isfinite(done.q).all(axis=1), np.full(len(done.q), np.nan)
    if _is_square(spec):
        soft = _springs(spec)
        columns = done.jacobians[known][:, part][:, :, list(soft)] / np.sqrt(list(soft.values()))
        moves = cells.is_controlled[known]
        largest = np.full(len(columns), np.inf)
        largest[moves] = np.linalg.svd(columns[moves], compute_uv=False)[:, 0] ** 2
    else:
        largest = _one_by_one(
            spec, done.q[known], lambda system: np.linalg.eigvalsh(system.compliance(spec.node)[part, part])[-1], np.inf
        )
    with np.errstate(divide="ignore"):
        stiffness[known] = 1.0 / largest
    return stiffness


def frequency(cells: Cells) -> Array:
    """Return (n,) the lowest natural frequency, Hz; 0 where the mechanism moves and deforms no spring."""
    spec, q = cells.spec, cells.evaluations.q
    known, lowest = np.isfinite(q).all(axis=1), np.full(len(q), np.nan)
    try:
        lowest[known] = _frequencies(spec, q[known])
    except MotionError:  # the actuated joints do not determine the motion of a cell
        lowest[known] = _one_by_one(spec, q[known], lambda system: system.frequencies()[0], 0.0)
    return lowest


def _frequencies(spec: MapSpecification, q: Array) -> Array:
    """Return (n,) the lowest natural frequency at configurations (n, nq), Hz.

    Raises:
        MotionError: the actuated joints do not determine the motion at one of them, or they are not the only springs.
    """
    if not _is_square(spec):
        raise MotionError(f"{spec.mechanism.name} has other springs than its actuated joints")
    soft = _springs(spec)
    inverse_squares = _unloaded(spec).mass_matrices_of(q)[:, list(soft)][:, :, list(soft)]  # of angular frequencies
    if not np.isfinite(inverse_squares).all():
        raise MotionError(f"{spec.mechanism.name}: its actuated joints do not determine the motion")
    springs = np.array(list(soft.values()))
    largest = np.linalg.eigvalsh(inverse_squares / np.sqrt(np.outer(springs, springs)))[:, -1]
    with np.errstate(divide="ignore"):
        return np.asarray(1.0 / (2.0 * np.pi * np.sqrt(np.maximum(largest, 0.0))))


def _is_square(spec: MapSpecification) -> bool:
    """Return whether the actuated joints, as many as degrees of freedom, are the only springs: then what is elastic is
    computed for all cells at once."""
    mechanism = spec.mechanism
    return len(mechanism.actuated) == spec.dof and set(spec.stiffness) <= set(mechanism.actuated)


def _springs(spec: MapSpecification) -> dict[int, float]:
    """Return the stiffness, N m/rad or N/m, of each elastic joint by its number among the actuated joints."""
    names = spec.mechanism.actuated
    return {names.index(name): value for name, value in spec.stiffness.items()}


def _one_by_one(spec: MapSpecification, q: Array, value: Callable[[Elasticity], float], loose: float) -> Array:
    """Return (n,) a value of the elasticity at each configuration; `loose` where the mechanism moves and deforms no
    spring."""
    dynamics, values = _unloaded(spec), np.full(len(q), loose)
    for k, configuration in enumerate(q):
        with suppress(MotionError):
            values[k] = value(Elasticity(dynamics, configuration, spec.stiffness))
    return values


# --- what is kept from chunk to chunk ---------------------------------------------------------------------------------


@lru_cache(maxsize=14)
def _dynamics_of(
    spec: MapSpecification, gravity: tuple[float, ...] | None = None, more: float = 0.0, *, is_carried: bool = True,
    is_pushed: bool = True,
) -> InverseDynamics:  # fmt: skip
    """Return the dynamics of the mechanism with its payloads and wrenches, and more mass (kg) at the node."""
    loads = [Payload(node, mass) for node, mass in spec.payloads.items()] if is_carried else []
    loads += [Payload(node, wrench=wrench) for node, wrench in spec.wrenches.items()] if is_pushed else []
    loads += [Payload(spec.node, more)] if more else []
    return InverseDynamics(spec.mechanism, loads, spec.gravity if gravity is None else gravity)


def _unloaded(spec: MapSpecification) -> InverseDynamics:
    """Return the dynamics without gravity and wrenches."""
    return _dynamics_of(spec, _NO_GRAVITY, is_pushed=False)


def _limits_of(spec: MapSpecification) -> Array:
    """Return the limits (actuated,) of torque of the actuated joints, N m and N; infinite for those without one."""
    return np.array([spec.mechanism.limits[name].effort for name in spec.mechanism.actuated])


# --- what they take ---------------------------------------------------------------------------------------------------


def notes(spec: MapSpecification, wanted: Collection[str]) -> tuple[str, ...]:
    """Return what the torques and reactions among quantities leave out."""
    return _dynamics_of(spec).notes_at_rest if {*LIMITED, *REACTIONS} & {*wanted} else ()


def check_loads(spec: MapSpecification, wanted: Collection[str]) -> None:
    """Check that a mechanism and a specification have what quantities take.

    Raises:
        MassError: links have no mass.
        UnknownNameError: no such joint, loop or node.
        CinegenError: no actuated joint has a limit of torque or force; a joint or a stiffness is missing or wrong.
    """
    mechanism = spec.mechanism
    weighed = (*sorted(LIMITED), *REACTIONS)
    if spec.gravity != tuple(spec.mechanism.gravity) and not set(weighed) & set(wanted):
        raise MapError(f"gravity: no quantity of this map takes it: add one of {', '.join(weighed)}")
    takers_of = (
        ("payloads", (*weighed, "frequency")), ("wrenches", weighed), ("reaction", REACTIONS),
        ("stiffness", tuple(sorted(ELASTIC))),
    )  # fmt: skip
    for setting, takers in takers_of:
        if getattr(spec, setting) and not set(takers) & set(wanted):
            raise MapError(f"{setting}: no quantity of this map takes it: add one of {', '.join(takers)}")
    if not set(LOADED) & set(wanted):
        return
    dynamics = _dynamics_of(spec) if {*weighed, "frequency"} & set(wanted) else _unloaded(spec)
    if "frequency" in wanted:
        dynamics.tree.check_masses()
    if LIMITED & set(wanted) and not np.isfinite(_limits_of(spec)).any():
        raise CinegenError(
            f"{mechanism.name}: no actuated joint has a limit of torque or force: give them in the file ('effort'), or "
            "leave torque and payloads out"
        )
    if ELASTIC & set(wanted):
        _check_springs(spec)
    for name in REACTIONS:
        if name not in wanted:
            continue
        if not spec.reaction:
            raise MapError(f"{name} is that of one joint or loop: name it (--reaction)")
        dynamics.undetermined_of(spec.reaction)
        if left_out(spec, name) == "xyz":
            raise MapError(
                f"{mechanism.name}: statics determines no component of the {_COMPONENTS[name]} in {spec.reaction}: it "
                f"depends on elasticity and on errors of manufacture. Leave {name} out"
            )


def _check_springs(spec: MapSpecification) -> None:
    if not spec.stiffness:
        raise MapError(
            "stiffness and frequency take the stiffness of joints: give it (--stiffness '*=1e5'), at least of one"
        )
    for name, value in spec.stiffness.items():
        if name not in spec.mechanism.joints:
            raise UnknownNameError("joint", name, spec.mechanism.joints)
        spec.mechanism.v_index(name)
        if not 0.0 < value < np.inf:
            raise MapError(f"the stiffness of joint '{name}' must be positive and finite, not {value!r:.40}")
