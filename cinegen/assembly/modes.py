"""`assembly_modes`: all ways in which a closed mechanism can be assembled with its motors where they are."""

from __future__ import annotations

import threading
import weakref
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, overload

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from cinegen.assembly.families import recognise
from cinegen.assembly.found import Approach, Found, Paths
from cinegen.assembly.homotopy import Homotopy
from cinegen.assembly.linkage import Linkage, ModesError
from cinegen.assembly.six_rods import SixRods
from cinegen.model import Mechanism

__all__ = ["Approach", "AssemblyModes", "Paths", "assembly_modes"]

Array = NDArray[np.float64]

_THERE = 1e-6  # rad, characteristic lengths: a surplus motor is where it was asked to be


@dataclass(frozen=True, eq=False)
class AssemblyModes(Sequence[Array]):
    """All real closed configurations q (nq,) for some values of the motors; a sequence, nearest to home first.

    Attributes:
        mechanism: whose.
        actuated: (motors,) the values, in `mechanism.actuated` order, rad and m.
        configurations: the modes, each closed to 1e-12.
        coincident: of each mode how many solutions meet in it: 1, unless the motors' values are singular.
        complete: whether it is proved that these are all: by elimination, or by as many solutions as a theorem allows.
        method: how they were found, and why they are all, or what is missing or not excluded: a sentence.
        paths: what became of all solutions.
        closest: where there is no mode, what comes nearest.
        trace_test: whether nothing is missing on the curves of configurations that were met from home and from random
            starts: the trace test closed, and no path was lost. That excludes neither other curves nor branches on
            which the mechanism moves freely. None where no trace test was needed.
    """

    mechanism: Mechanism
    actuated: Array
    configurations: tuple[Array, ...]
    coincident: tuple[int, ...]
    complete: bool
    method: str
    paths: Paths
    closest: Approach | None = None
    trace_test: bool | None = None

    @overload
    def __getitem__(self, index: int) -> Array: ...
    @overload
    def __getitem__(self, index: slice) -> tuple[Array, ...]: ...
    def __getitem__(self, index: int | slice) -> Array | tuple[Array, ...]:
        return self.configurations[index]

    def __len__(self) -> int:
        return len(self.configurations)

    def __iter__(self) -> Iterator[Array]:
        return iter(self.configurations)

    def __repr__(self) -> str:
        return f"<{len(self)} assembly mode{'s' * (len(self) != 1)} of {self.mechanism.name}: {self.method}>"

    def placements(self, node: str | None = None) -> list[pin.SE3]:
        """Where a node, the mechanism's end unless said, is in the world, mode by mode.

        Raises:
            UnknownNameError: no such node.
        """
        name = self.mechanism.end if node is None else node
        return [self.mechanism.placement(q, name) for q in self]

    def as_dict(self) -> dict[str, Any]:
        """As JSON has it: rad and m, and where the end is."""
        return {
            "robot": self.mechanism.name,
            "actuated": dict(zip(self.mechanism.actuated, map(float, self.actuated), strict=True)),
            "complete": self.complete,
            "trace_test": self.trace_test,
            "method": self.method,
            "paths": {name: getattr(self.paths, name) for name in Paths.__dataclass_fields__},
            "end": self.mechanism.end,
            "modes": [
                {
                    "joints": {name: float(q[self.mechanism.q_index(name)]) for name in self.mechanism.joints},
                    "position": placement.translation.tolist(),
                    "rotation": placement.rotation.tolist(),
                    "coincident": count,
                }
                for q, placement, count in zip(self, self.placements(), self.coincident, strict=True)
            ],
            "closest": None
            if self.closest is None
            else {"gap": self.closest.gap, "words": self.closest.words, "q": self.closest.q.tolist()},
        }


def assembly_modes(
    mechanism: Mechanism,
    actuated: ArrayLike | None = None,
    method: str = "auto",
    say: Callable[[str], None] | None = None,
    effort: float = 1.0,
) -> AssemblyModes:
    """All configurations in which a closed mechanism can be assembled with its motors at given values.

    Six rods between base and platform are solved by the polynomial of J.-P. Merlet, "Symbolic computation for the
    determination of the minimal direct kinematics polynomial and the singular configurations of parallel manipulators",
    where their ends meet in pairs, and else by homotopy from a platform whose 40 modes are known. All others are solved
    by monodromy: once for each mechanism, which may take seconds, then by homotopy from there to the motors' values.

    Configurations that differ only in how a universal or a ball joint is counted are one mode.

    Args:
        mechanism: with loops, which its motors determine.
        actuated: (motors,) values in `mechanism.actuated` order, rad and m; those of home unless given.
        method: `auto`, or `monodromy` for what knows of no family: for comparison, and for modes of operation that a
            family leaves out (the turned platforms of a delta).
        say: is told how far it is, where that takes long.
        effort: how much may be done the first time for a mechanism of no known family; 1 is about half a minute. What
            could not be done is said, and done if more is allowed.

    Raises:
        ModesError: there are no loops; the motors don't determine the mechanism; or the values are not such.
    """
    if method not in ("auto", "monodromy"):
        raise ModesError(f"method '{method}': there are 'auto' and 'monodromy'")
    solver = _solver(mechanism, method)
    with solver.lock:
        return solver.modes(mechanism, _values(mechanism, actuated), say, effort)


def _values(mechanism: Mechanism, actuated: ArrayLike | None) -> Array:
    names = mechanism.actuated
    home = np.array([mechanism.q_home[mechanism.q_index(name)] for name in names])
    if actuated is None:
        return home
    try:
        values = np.asarray(actuated, dtype=float)
    except (TypeError, ValueError):
        raise ModesError(f"values of {mechanism.name}'s motors: {actuated!r} are no numbers") from None
    if values.shape != (len(names),):
        listed = ", ".join(names)
        raise ModesError(f"{mechanism.name} has {len(names)} motors ({listed}): {values.size} values were given")
    if not np.isfinite(values).all():
        raise ModesError(f"values of {mechanism.name}'s motors: some are not finite")
    return values


_SOLVERS: weakref.WeakKeyDictionary[Mechanism, dict[str, _Solver]] = weakref.WeakKeyDictionary()
_SOLVERS_LOCK = threading.Lock()


def _solver(mechanism: Mechanism, method: str) -> _Solver:
    with _SOLVERS_LOCK:
        known = _SOLVERS.setdefault(mechanism, {})
        if method not in known:
            known[method] = _Solver(mechanism, method)
        return known[method]


class _Solver:
    """What is known of a mechanism once and for all, and how it is solved. The mechanism itself is not kept alive."""

    def __init__(self, mechanism: Mechanism, method: str) -> None:
        self.lock = threading.Lock()
        try:
            self._linkage = Linkage(mechanism)
        except ModesError:
            _check_rods(mechanism)
            raise
        family = recognise(self._linkage) if method == "auto" else None
        self._rods = SixRods(self._linkage, family) if family is not None and family.name == "hexapod" else None
        self._homotopy = Homotopy(self._linkage, family)

    def modes(
        self, mechanism: Mechanism, values: Array, say: Callable[[str], None] | None, effort: float
    ) -> AssemblyModes:
        """All modes for values (motors,) in the mechanism's order."""
        linkage = self._linkage
        asked = mechanism.configuration(dict(zip(mechanism.actuated, map(float, values), strict=True)))
        motors = linkage.motor_values(asked)
        found = self._rods.modes(motors) if self._rods is not None else self._homotopy.modes(motors, say, effort)
        if linkage.surplus:
            found = _matching(linkage, found, asked)
        home = self._features(mechanism.q_home)
        far = [round(float(np.abs(self._features(q) - home).sum()), 9) for q in found.configurations]
        order = np.argsort(far, kind="stable")
        return AssemblyModes(
            mechanism, values, tuple(found.configurations[k] for k in order), tuple(found.coincident[k] for k in order),
            found.complete, found.words, found.paths, found.closest, found.trace_test,
        )  # fmt: skip

    def _features(self, q: Array) -> NDArray[np.complex128]:
        linkage = self._linkage
        return np.asarray(linkage.features(linkage.unknowns(q)[None], linkage.motor_values(q))[0])


def _check_rods(mechanism: Mechanism) -> None:
    """Says what is special about six rods whose motors don't determine them.

    Raises:
        ModesError: that, or that there are no loops.
    """
    linkage = Linkage(mechanism, as_built=True)
    family = recognise(linkage)
    if family is not None and family.name == "hexapod":
        SixRods(linkage, family).check(linkage.motor_values(mechanism.q_home))


def _matching(linkage: Linkage, found: Found, asked: Array) -> Found:
    """Those modes in which the motors that others determine are where they were asked to be."""
    off = [linkage.off(q, asked) for q in found.configurations]
    kept = [k for k, gaps in enumerate(off) if np.abs(gaps).max() < _THERE]
    names = ", ".join(f"'{name}'" for name in linkage.surplus)
    words = f"{found.words}; with {names} left to the other motors: {len(off)} modes, {len(kept)} as asked"
    closest = found.closest
    if off and not kept:
        best = min(range(len(off)), key=lambda k: float(np.abs(off[k]).max()))
        listed = ", ".join(f"'{n}' by {gap:.3g}" for n, gap in zip(linkage.surplus, off[best], strict=True))
        said = (
            f"motors that contradict the others are off: {listed} (rad, or lengths of {linkage.mechanism.length:.4g} m)"
        )
        closest = Approach(found.configurations[best], float(np.abs(off[best]).max()), said)
    return Found(
        tuple(found.configurations[k] for k in kept), tuple(found.coincident[k] for k in kept),
        found.complete, words, found.paths, closest, found.trace_test,
    )  # fmt: skip
