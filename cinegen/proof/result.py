"""`Proof`: what a certificate proves."""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cinegen.arrays import Array
from cinegen.cluster import check_workers
from cinegen.proof.checker import CertificateError
from cinegen.proof.distributed_checks import Checker, Report
from cinegen.proof.exported_equations import ProofError
from raff2urdf.errors import RaffError
from raff2urdf.files import read_bytes

FORMAT = "cinegen proof 2"
_APART = "it is not connected to the start"  # by boxes with configurations


@dataclass(frozen=True, eq=False, repr=False)
class Proof:
    """Result of a proof, as the checker of its certificate computed it.

    Attributes:
        proved: share of the region's volume in which each pose has exactly one configuration on the branch, within the
            joints' limits if they are asked for, and none is singular, or as near as a bound of singular values.
        refuted: share in which no pose is within reach, or at each a joint is beyond a limit, or a singular value below
            its bound.
        undecided: the rest.
        witnesses: what refutes the region: for the reach a pose, whose configuration is empty; for a limit a pose, its
            configuration and the joint; for a singular value a pose, its configuration, and `sigma_1` or `sigma_2`; for
            a singularity of type 2, two poses on the branch where the determinants of the locked joints' matrix have
            opposite signs.
        reasons: number of undecided boxes by reason.
        boxes: number of boxes.
        region: ranges of its coordinates, m and rad.
        statuses: of all boxes: `proved`, `refuted` (reach, limit, singular value), `undecided`, or `outside` of a round
            region.
        certificate: JSON values; `cinegen.proof.check` reads them.
    """

    proved: float
    refuted: float
    undecided: float
    witnesses: tuple[Mapping[str, Any], ...]
    reasons: Mapping[str, int]
    boxes: int
    region: Mapping[str, tuple[float, float]]
    statuses: Sequence[str]
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
        return f"{', '.join(parts)} of the region, in {self.boxes} box{'' if self.boxes == 1 else 'es'}"

    @property
    def region_text(self) -> str:
        """The region as a text: m and degrees."""
        scales = {True: (math.degrees(1.0), "deg"), False: (1.0, "m")}
        parts = [(name, *ends, *scales[name.startswith("r")]) for name, ends in self.region.items()]
        return ", ".join(f"{name} = {low * k:.4g}..{high * k:.4g} {unit}" for name, low, high, k, unit in parts)

    def cells(self) -> Iterator[tuple[Array, str]]:
        """Yield all boxes (coordinates, 2), m and rad, and their statuses."""
        boxes = leaves(np.array(list(self.region.values()), dtype=float), self.certificate["tree"])
        for (box, _), status in zip(boxes, self.statuses, strict=True):
            yield box, status

    def as_dict(self) -> dict[str, Any]:
        """Return what JSON shows: m and rad."""
        return {
            "proved": self.proved, "refuted": self.refuted, "undecided": self.undecided, "boxes": self.boxes,
            "region": {name: list(ends) for name, ends in self.region.items()},
            "witnesses": list(self.witnesses), "reasons": dict(self.reasons),
        }  # fmt: skip


def read_proof(
    certificate: Mapping[str, Any], workers: int | None = 1, scheduler: str | None = None, report: Report | None = None
) -> Proof:
    """Return what a certificate proves.

    Args:
        certificate: its JSON values.
        workers: see `prove`.
        scheduler: likewise.
        report: likewise.

    Raises:
        ProofError: a claim is not confirmed.
        ClusterError: workers can't be started.
    """
    check_workers(workers, scheduler)
    try:
        result = Checker(workers, scheduler, report).result(certificate)
    except CertificateError as error:
        raise ProofError(f"the certificate is rejected: {error}") from error
    return proof_of(certificate, result)


def proof_of(certificate: Mapping[str, Any], result: Mapping[str, Any]) -> Proof:
    """Return the proof of a certificate and of what its check returned."""
    claims = [node for node in certificate["tree"] if isinstance(node, dict)]
    undecided = [leaf for leaf, status in zip(claims, result["statuses"], strict=True) if status == "undecided"]
    reasons = Counter(leaf["reason"] if leaf["claim"] in ("open", "regular") else _APART for leaf in undecided)
    return Proof(
        result["proved"], result["refuted"], result["undecided"], tuple(result["witnesses"]), dict(reasons),
        result["boxes"],
        {certificate["variables"][int(k)]["name"]: tuple(ends) for k, ends in certificate["over"].items()},
        tuple(result["statuses"]),
        certificate,
    )  # fmt: skip


def load_proof(
    path: Path | str, workers: int | None = 1, scheduler: str | None = None, report: Report | None = None
) -> Proof:
    """Return what the certificate in a file proves; for arguments see `read_proof`.

    Raises:
        ProofError: the file can't be read, or is no certificate; or a claim is not confirmed.
    """
    try:
        certificate = json.loads(read_bytes(path))
    except RaffError as error:
        raise ProofError(str(error)) from None
    except (ValueError, RecursionError) as error:
        raise ProofError(f"{path}: can't be read ({error})") from None
    if not isinstance(certificate, dict) or certificate.get("format") != FORMAT:
        raise ProofError(f"{path}: is no certificate of cinegen prove ({FORMAT})")
    try:
        return read_proof(certificate, workers, scheduler, report)
    except ProofError as error:
        raise ProofError(f"{path}: {error}") from None


def leaves(ends: Array, tree: Iterable[Any]) -> Iterator[tuple[Array, Mapping[str, Any]]]:
    """Yield the boxes (parameters, 2) of a tree that are not halved, and their claims."""
    nodes, waiting = iter(tree), [ends]
    while waiting:
        box, node = waiting.pop(), next(nodes)
        if isinstance(node, dict):
            yield box, node
            continue
        low, high = box.copy(), box.copy()
        low[node, 1] = high[node, 0] = box[node].mean()
        waiting += [high, low]
