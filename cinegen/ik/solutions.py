"""Solutions of inverse kinematics for one node: a list of configurations, and what is known about the others."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import pinocchio as pin

from cinegen.arrays import Array
from cinegen.assembly import SelfMotion
from cinegen.assembly.certify import EndEquations, LoopEquations, Unknowns
from cinegen.assembly.results import SolutionSet
from cinegen.errors import CinegenError
from cinegen.hexapod import SolutionCounts
from cinegen.html import table
from cinegen.ik.task import FrameTask
from cinegen.model import Mechanism
from cinegen.tolerances import AT_LIMIT
from cinegen.typed_json import as_json
from raff2urdf.errors import counted


class IKError(CinegenError):
    """Inverse solutions that can't be computed; the message names the reason, and what to do."""


@dataclass(frozen=True, eq=False, repr=False)
class IKSolutions(SolutionSet):
    """All isolated configurations q (nq,) that bring a node to a pose; a sequence, nearest to the start first.

    Configurations are the same if they place all links alike; angles of joints that move the node count modulo 2 pi,
    even where couplings drive others by them: `method` names revolutions that displace these. Where a whole number of
    revolutions brings a joint within its limits, it is within them.

    Attributes:
        mechanism: the mechanism.
        task: which frame is brought where.
        start: (nq,) the configuration from which distances are measured; joints that don't move the node stay there.
        locked: values of locked joints, rad and m.
        configurations: the solutions, loops closed and the pose reached to 1e-12.
        outside: of each solution the joints beyond their limits, each with that limit, rad and m.
        coincident: of each solution how many coincide in it: 1, unless it is singular.
        complete: whether these are all isolated solutions: proved, by as many as a theorem allows, or with probability
            one, see `proved`.
        method: how they were computed, and why they are all, or what is missing or not excluded: a sentence.
        counts: what became of all complex solutions.
        trace_test: whether nothing is missing on the curves of configurations that were met, see `AssemblyModes`; None
            if no trace test was needed.
        closest: if there is no solution, a configuration (nq,) near the pose, if one is known.
        self_motions: components of positive dimension that were found: the mechanism moves with the node at the pose.
        unknowns: of the certified equations; None for solutions of a local search.
        almost_surely: whether `complete` holds with probability one only, see `PlatformModes`.
    """

    mechanism: Mechanism
    task: FrameTask
    start: Array
    locked: Mapping[str, float]
    configurations: tuple[Array, ...]
    outside: tuple[dict[str, float], ...]
    coincident: tuple[int, ...]
    complete: bool
    method: str
    counts: SolutionCounts
    trace_test: bool | None = None
    closest: Array | None = None
    self_motions: tuple[SelfMotion, ...] = ()
    unknowns: Unknowns | None = None
    almost_surely: bool = False

    def __repr__(self) -> str:
        number = f"{counted(len(self), 'inverse solution')} of {self.mechanism.name[:80]}"
        return f"<{number}, {len(self.within_limits)} within the limits, {self.completeness}>"

    def _repr_html_(self) -> str:
        """Show the joints of each solution as a table in a notebook: the actuated ones, and what else distinguishes
        solutions."""
        at = {name: self.mechanism.q_index(name) for name in self.mechanism.joints}
        columns = {name: [f"{q[k]:.4f}" for q in self] for name, k in at.items()}
        names = distinguishing(columns, self.mechanism.actuated)
        rows = [[k + 1, *(columns[n][k] for n in names), ", ".join(beyond)] for k, beyond in enumerate(self.outside)]
        header = ["solution", *(f"{name} (rad, m)" for name in names), "outside limits"]
        return table(f"{self!r}: {self.task.node}. {self.method}. {self.certification}", header, rows)

    @cached_property
    def within_limits(self) -> tuple[Array, ...]:
        """The solutions in which no joint is beyond its limits."""
        return tuple(q for q, beyond in zip(self, self.outside, strict=True) if not beyond)

    @property
    def errors(self) -> tuple[tuple[float, float], ...]:
        """Remaining error of each solution: m and rad."""
        return tuple(self.task.distances(self.mechanism, q) for q in self)

    def placements(self, node: str | None = None) -> list[pin.SE3]:
        """Return the placement of a node, by default the task's, in the world, solution by solution.

        Raises:
            UnknownNameError: no such node.
        """
        return [self.mechanism.placement(q, node or self.task.node) for q in self]

    def _equations(self, unknowns: Unknowns) -> LoopEquations:
        mechanism, task = self.mechanism.successive, self.task
        joints = self.mechanism.spherical
        start = self.start if joints is None else joints.to_successive(self.start)
        linear, angular = (tuple(np.flatnonzero(part > 0.0).tolist()) for part in np.split(task.weights, 2))
        about = {1: angular[:1], 2: tuple({0, 1, 2}.difference(angular))}.get(len(angular), (2,))
        constrained = EndEquations(linear, len(angular), *about)
        return LoopEquations(
            mechanism, unknowns, start, self._triples, (task.node, task.offset, task.target, constrained)
        )

    def as_dict(self) -> dict[str, Any]:
        """Return what JSON shows: rad and m."""
        target = self.task.target
        columns = zip(self, self.outside, self.coincident, self.errors, self.certificates, strict=True)
        return as_json(
            self, "locked", "complete", "proved", "trace_test", "method", "counts", "certified",
            robot=self.mechanism.name,
            node=self.task.node,
            position=target.translation,
            rotation=target.rotation if self.task.rotation else None,
            solutions=[
                {**_values(self.mechanism, q), "within_limits": not beyond, "outside": beyond, "coincident": count,
                 "error": error, "closure": self.mechanism.closure(q), "certificate": certificate}
                for q, beyond, count, error, certificate in columns
            ],
            self_motions=[motion.as_dict(self.mechanism) for motion in self.self_motions],
            closest=None
            if self.closest is None
            else {
                **_values(self.mechanism, self.closest),
                "error": self.task.distances(self.mechanism, self.closest),
            },
        )  # fmt: skip


def distinguishing(columns: Mapping[str, Sequence[str]], first: Sequence[str]) -> list[str]:
    """Return names of columns of a table: the first ones, and of the others those by which rows differ that are alike
    in all columns before.

    Args:
        columns: the texts of all rows, by the column's name.
        first: names of some of them.
    """

    def kinds(names: Sequence[str]) -> int:
        return len({tuple(columns[name][k] for name in names) for k in range(len(next(iter(columns.values()))))})

    chosen = list(first)
    for name in columns:
        if name not in chosen and kinds([*chosen, name]) > kinds(chosen):
            chosen.append(name)
    return chosen


def _values(mechanism: Mechanism, q: Array) -> dict[str, Any]:
    """Return the values of all joints at q (nq,), and the pose of a floating base, as JSON shows them."""
    return {"joints": mechanism.values(q)} | ({"base": q[:7].tolist()} if mechanism.floating else {})


def with_closest(solutions: IKSolutions, q: Array, is_solution: bool) -> IKSolutions:
    """Return solutions, of which there are none, with the closest configuration q (nq,) that was found otherwise; with
    that as a solution if it is one."""
    if not is_solution:
        return replace(solutions, closest=q)
    outside = solutions.mechanism.limits.exceeded(q, AT_LIMIT)
    return replace(
        solutions, configurations=(q,), outside=(outside,), coincident=(1,), complete=False, almost_surely=False,
        trace_test=None if solutions.trace_test is None else False,
    )  # fmt: skip
