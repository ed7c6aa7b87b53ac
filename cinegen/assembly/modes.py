"""`assembly_modes`: all configurations in which a closed mechanism can be assembled with given actuated joints."""

from __future__ import annotations

import threading
from collections.abc import Callable, Collection
from dataclasses import replace
from functools import partial

import numpy as np

from cinegen.arrays import Array, ArrayLike, Complex
from cinegen.assembly.certify import BodyFeature, Unknowns
from cinegen.assembly.errors import ModesError
from cinegen.assembly.families import Family, recognise
from cinegen.assembly.homotopy import Homotopy
from cinegen.assembly.linkage import Linkage, linkage_of
from cinegen.assembly.results import AssemblyModes, NearestConfiguration
from cinegen.assembly.six_revolutes import SixRevolutes
from cinegen.assembly.six_rods import SixRods
from cinegen.model import Mechanism
from raff2urdf.errors import counted

_MOST_EQUATIONS = 100
_AS_ASKED = 1e-6  # rad, characteristic lengths: a redundant joint is at the value asked for


def assembly_modes(
    mechanism: Mechanism, actuated: ArrayLike | None = None, method: str = "auto",
    report: Callable[[str], None] | None = None, effort: float = 1.0,
) -> AssemblyModes:  # fmt: skip
    """Compute all configurations in which a closed mechanism can be assembled with its actuated joints at given values.

    Six rods between base and platform are solved by homotopy from a platform whose 40 modes are known. All others are
    solved by monodromy: once for each mechanism, which may take seconds, then by homotopy from there to the values.

    Configurations that differ only in how a universal or a ball joint is written as joints are one mode.

    Args:
        mechanism: with loops, which its actuated joints determine.
        actuated: (actuated,) values in `mechanism.actuated` order, rad and m; home's unless given.
        method: `auto`, or `monodromy` to use no knowledge of families: for comparison, and for modes of operation that
            a family leaves out (the rotated platforms of a delta).
        report: called with a sentence on the progress, if it takes long.
        effort: how much may be done the first time for a mechanism of no known family; 1 is about half a minute. What
            was not done is stated in the result, and done if more is allowed.

    Raises:
        ModesError: there are no loops; actuated joints don't determine the mechanism; wrong values or method.
    """
    if method not in _METHODS:
        raise ModesError(f"method '{method}': there are 'auto' and 'monodromy'")
    if mechanism.spherical is not None:
        to = mechanism.spherical.from_successive
        solved = assembly_modes(mechanism.successive, _values(mechanism, actuated), method, report, effort)
        nearest = solved.closest and replace(solved.closest, q=to(solved.closest.q))
        modes = tuple(map(to, solved.configurations))
        self_motions = tuple(motion.with_ball_joints(mechanism.spherical) for motion in solved.self_motions)
        return replace(solved, mechanism=mechanism, configurations=modes, closest=nearest, self_motions=self_motions)
    solver = mechanism.structure.derived(_METHODS[method])
    with solver.lock:
        return solver.modes(mechanism, _values(mechanism, actuated), report, effort)


def _values(mechanism: Mechanism, actuated: ArrayLike | None) -> Array:
    names = mechanism.actuated
    if actuated is None:
        return np.array([mechanism.q_home[mechanism.q_index(name)] for name in names])
    try:
        values = np.asarray(actuated, dtype=float)
    except (TypeError, ValueError):
        raise ModesError(f"values of {mechanism.name}'s actuated joints: {actuated!r} are no numbers") from None
    if values.shape != (len(names),):
        listed = ", ".join(names)
        count = counted(values.size, "value")
        raise ModesError(f"{mechanism.name} has {counted(len(names), 'actuated joint')} ({listed}): {count} were given")
    if not np.isfinite(values).all():
        raise ModesError(f"values of {mechanism.name}'s actuated joints: some are not finite")
    return values


class ModesSolver:
    """Solves a mechanism for any values; what does not depend on them is computed once.

    Args:
        mechanism: to solve.
        recognise: returns the family that its linkage belongs to, if it is known.
        distinct: joints whose values distinguish modes, see `Linkage`.
        virtual: whether actuated joints are virtual: they are not named in results.
    """

    def __init__(
        self, mechanism: Mechanism, recognise: Callable[[Linkage], Family | None], distinct: Collection[str] = (),
        virtual: bool = False,
    ) -> None:  # fmt: skip
        self._virtual = virtual
        if mechanism.loop_rank > _MOST_EQUATIONS:
            raise ModesError(
                f"the loops of {mechanism.name} are {mechanism.loop_rank} independent equations in "
                f"{len(mechanism.cluster_ranks)} clusters: assembly modes are computed for up to {_MOST_EQUATIONS}, as "
                "their number grows exponentially; take a part of the mechanism"
            )
        self.lock = threading.Lock()
        try:
            self._linkage = linkage_of(mechanism, distinct)
        except ModesError:
            if mechanism.loops:
                _check_rods(mechanism)
            raise
        family = recognise(self._linkage)
        self._rods = SixRods(self._linkage, family) if family is not None and family.name == "hexapod" else None
        series = family.series if family is not None else ()
        self._revolutes = SixRevolutes(self._linkage, series) if series else None
        self._homotopy = Homotopy(self._linkage, family)

    def modes(
        self, mechanism: Mechanism, values: Array, report: Callable[[str], None] | None, effort: float
    ) -> AssemblyModes:
        """Return all modes for values (actuated,) in the mechanism's order."""
        asked = mechanism.configuration(dict(zip(mechanism.actuated, map(float, values), strict=True)))
        modes = self._revolutes.modes(asked) if self._revolutes is not None else None
        if modes is None:
            modes = self._rods.modes(asked) if self._rods is not None else self._homotopy.modes(asked, report, effort)
        if self._linkage.redundant:
            modes = _matching(self._linkage, modes, asked, self._virtual)
        if self._linkage.bodies.ignores_end and not self._virtual:
            line = "the line between the joints at the ends of its rod"
            turns = f"rotations of '{mechanism.end}' about {line} are not counted"
            modes = replace(modes, method=f"{modes.method}; {turns}")
        home = self.features(mechanism.q_home)
        far = [round(float(np.abs(self.features(q) - home).sum()), 9) for q in modes]
        passive = tuple(name for name in mechanism.joints if name not in mechanism.actuated)
        unknowns = Unknowns(passive, mechanism.structure.passive_rank, self.body_features)
        return replace(_selected(modes, np.argsort(far, kind="stable").tolist()), unknowns=unknowns)

    @property
    def body_features(self) -> tuple[BodyFeature, ...]:
        """The points and directions that distinguish modes."""
        return self._linkage.body_features

    def features(self, q: Array) -> Complex:
        """Return the points and directions (3 f,) that distinguish modes, in the configuration q (nq,)."""
        linkage = self._linkage
        return np.asarray(linkage.features(linkage.unknowns(q)[None], linkage.locked_values(q))[0])


_METHODS = {
    "auto": partial(ModesSolver, recognise=recognise),
    "monodromy": partial(ModesSolver, recognise=lambda _: None),
}


def _check_rods(mechanism: Mechanism) -> None:
    """Name what is special about six rods whose actuated joints don't determine them.

    Raises:
        ModesError: that.
    """
    linkage = Linkage(mechanism, as_built=True)
    family = recognise(linkage)
    if family is not None and family.name == "hexapod":
        SixRods(linkage, family).check(linkage.locked_values(mechanism.q_home))


def _selected(modes: AssemblyModes, which: list[int]) -> AssemblyModes:
    """Return some of the modes, in this order."""
    coincident, isolated = tuple(modes.coincident[k] for k in which), tuple(modes.isolated[k] for k in which)
    return replace(modes, configurations=tuple(modes[k] for k in which), coincident=coincident, isolated=isolated)


def _matching(linkage: Linkage, modes: AssemblyModes, asked: Array, virtual: bool) -> AssemblyModes:
    """Return those modes in which the redundant joints have the values asked for."""
    errors = [linkage.redundancy_error(q, asked) for q in modes]
    worst = [float(np.abs(error).max()) for error in errors]
    kept, closest = [k for k, error in enumerate(worst) if error < _AS_ASKED], modes.closest
    names = ", ".join(f"'{name}'" for name in linkage.redundant)
    number = f"{counted(len(worst), 'mode')}, {len(kept)} as asked"
    remark = f"; with {names} following the other actuated joints: {number}"
    if virtual:
        remark = f"; {len(kept)} of {len(worst)} meet all of the pose" if len(kept) < len(worst) else ""
    method = modes.method + remark
    if worst and not kept:
        best = int(np.argmin(worst))
        listed = ", ".join(f"'{n}' by {error:.3g}" for n, error in zip(linkage.redundant, errors[best], strict=True))
        unit = f"(rad, or lengths of {linkage.mechanism.length:.4g} m)"
        message = f"actuated joints that contradict the others are off: {listed} {unit}"
        closest = NearestConfiguration(modes[best], worst[best], message)
    return replace(_selected(modes, kept), method=method, closest=closest)
