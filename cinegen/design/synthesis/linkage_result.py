"""`LinkageSynthesis`: a linkage for precision points, its defects, and what people and programs read."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from cinegen.arrays import Array
from cinegen.design.parameters import Parameters
from cinegen.design.rewriting import rewritten
from cinegen.design.synthesis.home import HomedDocuments
from cinegen.design.synthesis.task import Precision
from cinegen.typed_json import as_json

EXACT = 1e-9
"""What may be missing at a precision point, characteristic lengths and rad."""


@dataclass(frozen=True, eq=False)
class LinkageSynthesis:
    """The result of a synthesis by precision points.

    Attributes:
        task: as given.
        parameters: free ones of the file.
        p: (parameters,) values, m and rad.
        q: (points, nq) closed configurations at the precision points.
        error: (points,) what is missing there, characteristic lengths and rad.
        one_circuit: all points are on one motion without taking the linkage apart.
        in_order: it passes them in their order.
        one_branch: the actuated joint never turns back between the first and the last.
        starts: least squares that were solved.
        evaluations: designs that these evaluated, without the random ones.
        exact: number of starts that met all points.
    """

    task: Precision
    parameters: Parameters
    p: Array
    q: Array
    error: Array
    one_circuit: bool
    in_order: bool
    one_branch: bool
    starts: int
    evaluations: int
    exact: int

    @property
    def holds(self) -> bool:
        """True where all points are met without a defect."""
        return bool(self.error.max() <= EXACT and self.one_circuit and self.in_order and self.one_branch)

    @property
    def raff(self) -> str:
        """The RAFF file with these values; its home is at the first precision point."""
        parameters = self.parameters
        document = HomedDocuments(parameters, self.task.ties).at(self.p, self.q[0])
        return rewritten(parameters.document, document, parameters.robot.name)

    @property
    def text(self) -> str:
        """The result as people read it."""
        met = int((self.error <= EXACT).sum())
        lines = [
            f"{self.parameters.robot.name}: {met} of {len(self.error)} precision points are met, at most "
            f"{self.error.max():.2g} is missing (characteristic lengths, rad)",
            f"  {self.exact} of {self.starts} starts met all",
        ]
        for name, old, new in zip(self.parameters.names, self.parameters.values, self.p, strict=True):
            lines.append(f"  {name:<12} {self.parameters.text(name, old)} -> {self.parameters.text(name, new, 9)}")
        return "\n".join([*lines, f"  {self.defects}"])

    @property
    def defects(self) -> str:
        """The defects that the linkage has or has not, as people read them."""
        return "; ".join(
            good if holds else bad
            for holds, good, bad in (
                (self.one_circuit, "all points are on one circuit", "circuit defect: points are on several circuits"),
                (self.in_order, "passed in their order", "order defect: passed in another order"),
                (
                    self.one_branch,
                    "the actuated joint never turns back",
                    "branch defect: the actuated joint turns back",
                ),
            )
        )

    def as_dict(self) -> dict[str, Any]:
        """Return the result for JSON: m and rad."""
        names = ("one_circuit", "in_order", "one_branch", "starts", "exact", "evaluations", "holds")
        return {
            "robot": self.parameters.robot.name,
            "parameters": dict(zip(self.parameters.names, self.p.tolist(), strict=True)),
            "before": dict(zip(self.parameters.names, self.parameters.values.tolist(), strict=True)),
            "errors": self.error.tolist(),
            **as_json(self, *names),
        }
