"""`AssemblyModes`: all configurations in which a mechanism can be assembled, and what is known of their number.

`SolutionSet` is what they share with inverse solutions: a sequence of configurations with certificates.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, overload

import numpy as np
import pinocchio as pin

from cinegen.arrays import Array
from cinegen.assembly.certify import LoopEquations, Unknowns
from cinegen.hexapod import SolutionCounts
from cinegen.html import table
from cinegen.krawczyk import Certificate
from cinegen.model import Mechanism
from cinegen.model.spherical import SphericalJoints
from cinegen.typed_json import as_json
from raff2urdf.errors import counted

_WITHOUT = "singular or nearly so, not exact, or not distinct"  # solutions without a certificate


@dataclass(frozen=True, eq=False)
class NearestConfiguration:
    """The configuration nearest to a closed one, where the mechanism can't be assembled.

    Attributes:
        q: (nq,) with the actuated joints at the values asked for.
        gap: the largest loop residual there, rad and characteristic lengths.
        message: what is missing where.
    """

    q: Array
    gap: float
    message: str

    def __repr__(self) -> str:
        return f"<NearestConfiguration: {self.message}>"


@dataclass(frozen=True, eq=False)
class SelfMotion:
    """Configurations among which a mechanism moves with its actuated joints locked: a component of positive dimension.

    Attributes:
        dimension: its number of DoF.
        degree: number of points, real or complex, in which a general plane meets a curve; known if the trace test shows
            that none is missing, so that the curve is irreducible and known as a whole. None otherwise, and of more
            than one DoF.
        configuration: (nq,) one of its real configurations.
        moving: names of the joints that move.
    """

    dimension: int
    degree: int | None
    configuration: Array
    moving: tuple[str, ...]

    def __repr__(self) -> str:
        return f"<SelfMotion: {self.description}>"

    @property
    def description(self) -> str:
        """A part of a sentence: the joints that move, the DoF and the degree."""
        degree = f" of degree {self.degree}" if self.degree is not None else ""
        kind = f"1 DoF, a curve{degree}" if self.dimension == 1 else f"{self.dimension} DoF"
        return f"{', '.join(self.moving)} move{'s' * (len(self.moving) == 1)} ({kind})"

    def with_ball_joints(self, joints: SphericalJoints) -> SelfMotion:
        """Return it for the model with ball joints in place of successive revolute ones."""
        return SelfMotion(
            self.dimension, self.degree, joints.from_successive(self.configuration), joints.merged(self.moving)
        )

    def as_dict(self, mechanism: Mechanism) -> dict[str, Any]:
        """Return what JSON shows: rad and m."""
        return as_json(self, "dimension", "degree", "moving", joints=mechanism.values(self.configuration))


class SolutionSet(Sequence[Array]):
    """Solutions q (nq,) in an order, each with a certificate where that is possible.

    Attributes:
        mechanism: the mechanism.
        configurations: the solutions.
        coincident: of each solution how many coincide in it.
        complete: whether these are all: proved, or with probability one.
        almost_surely: whether that holds with probability one only.
        method: how they were computed, and why they are all, or what is not excluded.
        unknowns: of the certified equations; None for solutions that are too inaccurate.
    """

    mechanism: Mechanism
    configurations: tuple[Array, ...]
    coincident: tuple[int, ...]
    complete: bool
    almost_surely: bool
    method: str
    unknowns: Unknowns | None

    @overload
    def __getitem__(self, index: int) -> Array: ...
    @overload
    def __getitem__(self, index: slice) -> tuple[Array, ...]: ...
    def __getitem__(self, index: int | slice) -> Array | tuple[Array, ...]:
        return self.configurations[index]

    def __len__(self) -> int:
        return len(self.configurations)

    @property
    def proved(self) -> bool:
        """True if it is proved that these are all; False where that holds with probability one only."""
        return self.complete and not self.almost_surely

    @property
    def completeness(self) -> str:
        """A part of a sentence: whether these are all."""
        if not self.complete:
            return "not proved to be all"
        return "proved to be all" if self.proved else "all with probability one"

    @cached_property
    def certificates(self) -> tuple[Certificate | None, ...]:
        """Proofs, of each solution, that it exists, is real, is the only one near it, and differs from the others;
        None where there is none. Computed when it is first asked for: some milliseconds for each solution."""
        joints = self.mechanism.spherical
        if self.unknowns is None:
            return (None,) * len(self)
        equations = self._equations(self.unknowns)
        configurations = self if joints is None else map(joints.to_successive, self)
        return equations.certificates(configurations, self.coincident)

    @property
    def certified(self) -> int:
        """Number of solutions with a certificate."""
        return sum(certificate is not None for certificate in self.certificates)

    @property
    def certification(self) -> str:
        """A sentence on the certificates; empty without solutions."""
        if not len(self):
            return ""
        if self.unknowns is None:
            return "Not certified: found by a local search."
        proofs = [certificate for certificate in self.certificates if certificate is not None]
        if not proofs:
            return f"{'None of them is' if len(self) > 1 else 'It is not'} certified: {_WITHOUT}."
        text = f"{len(proofs)} of {len(self)} are certified" if len(self) > 1 else "It is certified"
        text += f": real, and unique within {min(proof.radius for proof in proofs):.0e} (rad, characteristic lengths)"
        most = max(proofs, key=lambda proof: (proof.others, proof.gap))
        if most.others:
            more = f"{most.others} more hold{'s' * (most.others == 1)} within {max(proof.gap for proof in proofs):.0e}"
            text += f", by {most.equations} independent equations; {more}"
        return text + (f"; the others are {_WITHOUT}." if len(proofs) < len(self) else ".")

    @property
    def _triples(self) -> list[list[str]]:
        return [] if self.mechanism.spherical is None else self.mechanism.spherical.triples

    @abstractmethod
    def _equations(self, unknowns: Unknowns) -> LoopEquations:
        """Return the equations that are certified."""


@dataclass(frozen=True, eq=False, repr=False)
class AssemblyModes(SolutionSet):
    """All real closed configurations q (nq,) for values of the actuated joints; a sequence, nearest to home first.

    Attributes:
        mechanism: that is assembled.
        actuated: (actuated,) the values, in `mechanism.actuated` order, rad and m.
        configurations: the modes, each closed to 1e-12.
        coincident: of each mode how many solutions coincide in it: 1, unless the values are singular (type 2).
        complete: whether these are all, and there is no self-motion: proved, by elimination or by as many solutions as
            a theorem allows, or with probability one, see `proved`.
        method: how they were computed, and why they are all, or what is missing or not excluded: a sentence.
        counts: what became of all complex solutions.
        closest: if there is no mode, the nearest configuration.
        trace_test: whether nothing is missing on the curves of configurations that were met from home and from random
            starts: the trace test closed, and no path was lost. That excludes neither other curves nor self-motions.
            None if no trace test was needed.
        self_motions: components of positive dimension that were found: there the mechanism moves with its actuated
            joints locked.
        isolated: of each mode whether it is isolated; the others are points of self-motions.
        unknowns: of the certified equations.
        almost_surely: whether `complete` holds with probability one only, see `PlatformModes`.
    """

    mechanism: Mechanism
    actuated: Array
    configurations: tuple[Array, ...]
    coincident: tuple[int, ...]
    complete: bool
    method: str
    counts: SolutionCounts
    closest: NearestConfiguration | None
    trace_test: bool | None
    self_motions: tuple[SelfMotion, ...]
    isolated: tuple[bool, ...]
    unknowns: Unknowns | None = None
    almost_surely: bool = False

    def __repr__(self) -> str:
        number = f"{counted(len(self), 'assembly mode')} of {self.mechanism.name[:80]}"
        return f"<{number}, {self.completeness}>"

    def _repr_html_(self) -> str:
        rows = []
        for number, (placement, count) in enumerate(zip(self.placements(), self.coincident, strict=True), 1):
            angles = np.degrees(pin.rpy.matrixToRpy(placement.rotation))
            values = *(f"{1e3 * value:.3f}" for value in placement.translation), *(f"{angle:.2f}" for angle in angles)
            rows.append((number, *values, count))
        header = "mode", "x (mm)", "y (mm)", "z (mm)", "roll (°)", "pitch (°)", "yaw (°)", "solutions"
        return table(f"{self!r}: {self.mechanism.end}. {self.method}. {self.certification}", header, rows)

    def placements(self, node: str | None = None) -> list[pin.SE3]:
        """Return the placement of a node, by default the mechanism's end, in the world, mode by mode.

        Raises:
            UnknownNameError: no such node.
        """
        name = self.mechanism.end if node is None else node
        return [self.mechanism.placement(q, name) for q in self]

    def _equations(self, unknowns: Unknowns) -> LoopEquations:
        mechanism = self.mechanism.successive
        asked = mechanism.configuration(dict(zip(mechanism.actuated, map(float, self.actuated), strict=True)))
        return LoopEquations(mechanism, unknowns, asked, self._triples)

    def as_dict(self) -> dict[str, Any]:
        """Return what JSON shows: rad and m, and the end's placements."""
        columns = zip(self, self.placements(), self.coincident, self.isolated, self.certificates, strict=True)
        return as_json(
            self, "complete", "proved", "trace_test", "method", "counts", "certified",
            robot=self.mechanism.name,
            actuated=dict(zip(self.mechanism.actuated, self.actuated, strict=True)),
            end=self.mechanism.end,
            modes=[
                {"joints": self.mechanism.values(q), "position": placement.translation, "rotation": placement.rotation,
                 "coincident": count, "isolated": isolated, "certificate": certificate}
                for q, placement, count, isolated, certificate in columns
            ],
            self_motions=[motion.as_dict(self.mechanism) for motion in self.self_motions],
            closest=self.closest,
        )  # fmt: skip
