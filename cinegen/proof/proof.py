"""`prove`: a workspace that is guaranteed, not sampled."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cinegen.arrays import ArrayLike
from cinegen.model import Mechanism
from cinegen.proof.checker import CertificateError, check
from cinegen.proof.document import Exporter, ProofError
from cinegen.proof.equations import Equations
from cinegen.proof.prover import BOXES, Prover
from cinegen.proof.singular import SingularValues
from cinegen.proof.velocities import VelocityExporter
from cinegen.singularities.slice import POSE, Coordinates

_FORMAT = "cinegen proof 1"

_CONSTANT = 1e-9  # rad or characteristic lengths: a coordinate that changes by less never does
_EXACT = 1e-12  # m or rad: a fixed coordinate that is off by less is 0
_STEPS = 40  # from a configuration to the middle of the region


@dataclass(frozen=True, eq=False, repr=False)
class Proof:
    """Result of a proof, as the checker of its certificate computed it.

    Attributes:
        proved: share of the region's volume in which each pose has exactly one configuration on the branch, within the
            joints' limits if they are asked for, and none is singular, or as near as a bound of singular values.
        refuted: share in which a joint is beyond a limit at each pose, or a singular value below its bound.
        undecided: the rest.
        witnesses: what refutes the region: for a limit a pose, its configuration and the joint; for a singular value a
            pose, its configuration, and `sigma_1` or `sigma_2`; for a singularity of type 2, two poses on the branch
            where the determinants of the locked joints' matrix have opposite signs.
        reasons: number of undecided boxes by reason.
        boxes: number of boxes.
        certificate: JSON values; `cinegen.proof.check` reads them.
    """

    proved: float
    refuted: float
    undecided: float
    witnesses: tuple[Mapping[str, Any], ...]
    reasons: Mapping[str, int]
    boxes: int
    certificate: Mapping[str, Any]

    def __bool__(self) -> bool:
        """Return whether all of the region is proved."""
        return not (self.refuted or self.undecided or self.witnesses)

    def __repr__(self) -> str:
        return f"<Proof: {self.message}>"

    @property
    def message(self) -> str:
        """The result as a text."""
        parts = [f"proved {100.0 if self else min(100.0 * self.proved, 99.99):.4g} %"]
        for name, share in (("refuted", self.refuted), ("undecided", self.undecided)):
            parts += [f"{name} {100.0 * share:.4g} %"] if share else []
        return f"{', '.join(parts)} of the region, in {self.boxes} boxes"

    def as_dict(self) -> dict[str, Any]:
        """Return what JSON shows: m and rad."""
        return {
            "proved": self.proved, "refuted": self.refuted, "undecided": self.undecided, "boxes": self.boxes,
            "witnesses": list(self.witnesses), "reasons": dict(self.reasons),
        }  # fmt: skip


def prove(
    mechanism: Mechanism, over: Mapping[str, tuple[float, float]], at: Mapping[str, float] | None = None,
    node: str | None = None, q: ArrayLike | None = None, limits: bool = False, sigma: float | None = None,
    boxes: int = BOXES,
    report: Callable[[float], None] | None = None,
) -> Proof:  # fmt: skip
    """Prove that each pose of a region has exactly one configuration on a branch, and that none is singular.

    Args:
        mechanism: any whose pose determines its configuration.
        over: ranges of coordinates of the pose, of `POSE`, m and rad.
        at: values of others; those that are needed besides are as in the configuration q.
        node: whose pose; the mechanism's end by default.
        q: (nq,) a configuration of the branch; home by default.
        limits: whether all joints must stay within their limits.
        sigma: what the smallest singular values of type 1 and 2 must be above, dimensionless as in maps.
        boxes: number of boxes that are tested.
        report: is called with the share of the region that is decided.

    Raises:
        ProofError: there is no range, or an empty one; or sigma is negative.
        SliceError: coordinates that don't exist, or that can't be given independently.
        UnknownNameError: no such node.
    """
    whole = mechanism.successive
    coordinates = Coordinates(whole, [*over, *(at or {})], node)
    if coordinates.over_joints or not over:
        raise ProofError(f"{mechanism.name}: a proof is over coordinates of a pose: give ranges of {', '.join(POSE)}")
    if any(not low < high for low, high in over.values()):
        raise ProofError("a range is empty: give the lower end first")
    start = whole.q_home if q is None else whole.structure.checked(q)
    if sigma is not None and not sigma >= 0.0:
        raise ProofError(f"sigma is {sigma:g}: give a bound that is not negative")
    known = coordinates.coordinates(start)
    pose = np.array([(at or {}).get(name, known[name]) for name in POSE])
    constant = [name for name in POSE if name not in coordinates.independent and not _moves(coordinates, name)]
    pose[np.abs(pose) < _EXACT] = 0.0
    kind = Exporter if sigma is None else VelocityExporter
    exporter = kind(whole, coordinates.node, pose, over, coordinates.independent, constant, limits)
    document = {"format": _FORMAT, **exporter.document(start), "bounds": {"limits": limits, "sigma": sigma}}
    with np.errstate(all="ignore"):
        equations = Equations(document)
        low, high = np.array(list(over.values()), dtype=float).T
        first, middle = np.array([known[name] for name in over]), 0.5 * (low + high)
        x = equations.start
        equations.select(x, first)
        reason = _not_square(len(equations.rows), len(x)) or document.get("unbounded", "")
        values = None if sigma is None or reason else SingularValues(equations, document)
        prover = Prover(equations, limits, sigma, values)
        for part in np.linspace(0.0, 1.0, _STEPS + 1)[1:] if not reason else ():
            equations.pose = (1.0 - part) * np.array([known[name] for name in POSE]) + part * pose
            found, _, done = prover.solve((first + part * (middle - first))[None], x[None])
            x = found[0]
            if not done[0]:
                reason = "the branch ends before the middle of the region"
                break
        if not reason:
            prover.run(low, high, x, boxes, report)
        tree = [{"claim": "open", "reason": reason}] if reason else prover.tree()
    document |= {
        "rows": equations.rows.tolist(),
        "start": {"pose": middle.tolist(), "x": (x * equations.units).tolist()},
        "tree": tree,
    }
    dropped = set[int]()
    result = check(document, dropped=dropped)
    leaves = [node for node in tree if isinstance(node, dict)]
    for box in dropped:
        leaves[box] |= {"claim": "open", "reason": "the checker does not confirm it"}
    return _proof(document, check(document) if dropped else result)


def read_proof(certificate: Mapping[str, Any], report: Callable[[int, int], None] | None = None) -> Proof:
    """Return what a certificate proves.

    Args:
        certificate: its JSON values.
        report: is called with the number of nodes of its tree that are read, and of all.

    Raises:
        ProofError: a claim is not confirmed.
    """
    try:
        result = check(certificate) if report is None else check(certificate, report)
    except CertificateError as error:
        raise ProofError(f"the certificate is rejected: {error}") from error
    return _proof(certificate, result)


def _proof(certificate: Mapping[str, Any], result: Mapping[str, Any]) -> Proof:
    leaves = [node for node in certificate["tree"] if isinstance(node, dict)]
    reasons = Counter(leaf["reason"] for leaf in leaves if leaf["claim"] in ("open", "regular"))
    return Proof(
        result["proved"], result["refuted"], result["undecided"], tuple(result["witnesses"]), dict(reasons),
        result["boxes"], certificate,
    )  # fmt: skip


def load_proof(path: Path | str, report: Callable[[int, int], None] | None = None) -> Proof:
    """Return what the certificate in a file proves.

    Raises:
        ProofError: the file can't be read, or is no certificate; or a claim is not confirmed.
    """
    try:
        certificate = json.loads(Path(path).read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise ProofError(f"{path}: can't be read ({error})") from None
    if not isinstance(certificate, dict) or certificate.get("format") != _FORMAT:
        raise ProofError(f"{path}: is no certificate of cinegen prove ({_FORMAT})")
    try:
        return read_proof(certificate, report)
    except ProofError as error:
        raise ProofError(f"{path}: {error}") from None


def _not_square(equations: int, unknowns: int) -> str:
    if equations < unknowns:
        return "the pose does not determine the configuration"
    return "" if equations == unknowns else f"{equations - unknowns} dependent equations are not proved to follow"


def _moves(coordinates: Coordinates, name: str) -> bool:
    """Return whether a coordinate of the node's pose ever changes."""
    samples = coordinates.mechanism.structure.samples
    return any(np.abs(coordinates.rates(q, [name])).max(initial=0.0) > _CONSTANT for q in samples)
