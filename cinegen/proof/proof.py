"""`prove`: a workspace that is guaranteed, not sampled."""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cinegen.arrays import Array, ArrayLike
from cinegen.cluster import check_workers
from cinegen.model import Mechanism
from cinegen.proof.checker import BoxResult, CertificateError
from cinegen.proof.document import Exporter, ProofError
from cinegen.proof.equations import Equations
from cinegen.proof.prover import BOXES, ROUND, Prover
from cinegen.proof.reach import ReachTest
from cinegen.proof.singular import SingularValues
from cinegen.proof.spread import Checker, Report
from cinegen.proof.tolerances import Robots, with_tolerances
from cinegen.proof.velocities import VelocityExporter
from cinegen.singularities.slice import POSE, Coordinates
from raff2urdf.errors import RaffError
from raff2urdf.files import read_bytes

_FORMAT = "cinegen proof 1"

_CONSTANT = 1e-9  # rad or characteristic lengths: a coordinate that changes by less never does
_EXACT = 1e-12  # m or rad: a fixed coordinate that is off by less is 0
_STEPS = 40  # from a configuration to the middle of the region
_RATIO, _SMALLEST = 1.01, 2.0**-10  # of regions that grow: accuracy, and smallest part of what is given
_PARTS = 1000  # of a region, in reports
_SHRINKS = 5  # by that ratio, until the checker confirms a region


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
        leaves = _leaves(np.array(list(self.region.values()), dtype=float), self.certificate["tree"])
        for (box, _), status in zip(leaves, self.statuses, strict=True):
            yield box, status

    def as_dict(self) -> dict[str, Any]:
        """Return what JSON shows: m and rad."""
        return {
            "proved": self.proved, "refuted": self.refuted, "undecided": self.undecided, "boxes": self.boxes,
            "region": {name: list(ends) for name, ends in self.region.items()},
            "witnesses": list(self.witnesses), "reasons": dict(self.reasons),
        }  # fmt: skip


def prove(
    mechanism: Mechanism, over: Mapping[str, tuple[float, float]], at: Mapping[str, float] | None = None,
    node: str | None = None, q: ArrayLike | None = None, limits: bool = False, sigma: float | None = None,
    boxes: int = BOXES, shape: str = "box", grow: bool = False, tolerances: Robots | None = None,
    workers: int | None = 1, scheduler: str | None = None, report: Report | None = None,
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
        boxes: number of boxes that are tested; of each region, with `grow`.
        shape: `box`; `cylinder`, whose ellipse lies in the ranges of the first two coordinates; `ball`, an ellipsoid.
        grow: find the largest region of these proportions about the centre that is proved as a whole, up to 1 %.
        tolerances: all robots that it is to hold for, of `cinegen.design.WithinTolerances`.
        workers: processes on this machine that check the certificate; None for one for each core, for many boxes.
        scheduler: address of a Dask scheduler whose workers check it instead.
        report: is called with what is done, and how much of how much.

    Raises:
        ProofError: there is no range, or an empty one; no such shape; tolerances of another robot, or that loops can't
            follow; sigma is negative, or given with tolerances.
        SliceError: coordinates that don't exist, or that can't be given independently.
        UnknownNameError: no such node.
        ClusterError: workers can't be started.
    """
    check_workers(workers, scheduler)
    whole = mechanism.successive
    coordinates = Coordinates(whole, [*over, *(at or {})], node)
    if coordinates.over_joints or not over:
        raise ProofError(f"{mechanism.name}: a proof is over coordinates of a pose: give ranges of {', '.join(POSE)}")
    if any(not low < high for low, high in over.values()):
        raise ProofError("a range is empty: give the lower end first")
    if shape not in ROUND or ROUND[shape] == 2 > len(over):
        raise ProofError(
            f"no region '{shape}' over {len(over)} coordinates: {', '.join(ROUND)}, a cylinder over 2 or more"
        )
    start = whole.q_home if q is None else whole.structure.checked(q)
    if sigma is not None and not sigma >= 0.0:
        raise ProofError(f"sigma is {sigma:g}: give a bound that is not negative")
    if sigma is not None and tolerances is not None:
        raise ProofError("singular values are bounded without tolerances only: leave out sigma or the tolerances")
    known = coordinates.coordinates(start)
    pose = np.array([(at or {}).get(name, known[name]) for name in POSE])
    constant = [name for name in POSE if name not in coordinates.independent and not _moves(coordinates, name)]
    pose[np.abs(pose) < _EXACT] = 0.0

    def export(one: Mechanism) -> dict[str, Any]:
        kind = Exporter if sigma is None else VelocityExporter
        exporter = kind(one.successive, coordinates.node, pose, over, coordinates.independent, constant, limits)
        bounds = {"limits": limits, "sigma": sigma}
        return {"format": _FORMAT, **exporter.document(start), "bounds": bounds, "shape": shape}

    document = export(whole)
    if tolerances is not None:
        if tolerances.mechanism.joints != mechanism.joints:
            raise ProofError(f"{mechanism.name}: the tolerances are of {tolerances.mechanism.name}: give this robot's")
        document = with_tolerances(document, tolerances, export)
    with np.errstate(all="ignore"):
        ends, known_pose = np.array(list(over.values()), dtype=float), np.array([known[name] for name in POSE])
        question = _Question(document, known_pose, pose, boxes, Checker(workers, scheduler, report), report)
        return question.largest(ends) if grow else question.answer(ends)


class _Question:
    """A question: what is to be proved, over any region about a centre.

    Args:
        document: the equations.
        known: (6,) the pose of the configuration that they were written in.
        pose: (6,) that of what does not vary.
        boxes: number of boxes that are tested.
        checker: of certificates.
        report: see `prove`.
    """

    def __init__(
        self, document: Mapping[str, Any], known: Array, pose: Array, boxes: int, checker: Checker,
        report: Report | None,
    ) -> None:  # fmt: skip
        self._document, self._known, self._pose, self._boxes = document, known, pose, boxes
        self._checker, self._report = checker, report
        self._equations = Equations(document)
        self._over = [POSE.index(document["variables"][k]["name"]) for k in self._equations.over]
        self._equations.select(self._equations.start, known[self._over])
        self._reason = _not_square(len(self._equations.rows), len(self._equations.start))
        self._reason = self._reason or document.get("unbounded", "")
        limits, sigma = document["bounds"]["limits"], document["bounds"]["sigma"]
        values = None if sigma is None or self._reason else SingularValues(self._equations, document)
        self._prover = Prover(self._equations, ReachTest(self._equations, document), limits, sigma, values)

    def answer(self, ends: Array) -> Proof:
        """Return what is proved of a region, whose coordinates have these ends (parameters, 2)."""
        x, tree = self._at_centre(ends), [{"claim": "open", "reason": self._reason}]
        if not self._reason:
            self._prover.run(ends[:, 0], ends[:, 1], x, self._boxes, self._document["shape"], report=self._decided)
            tree = self._prover.tree()
        return self._checked(ends, x, tree)

    def _decided(self, share: float) -> None:
        if self._report is not None:
            self._report("proving", round(_PARTS * share), _PARTS)

    def largest(self, ends: Array) -> Proof:
        """Return the proof of the largest region of the same proportions and centre that is proved as a whole."""
        x, centre, half = self._at_centre(ends), ends.mean(axis=1), 0.5 * (ends[:, 1] - ends[:, 0])
        if self._reason:
            return self._checked(ends, x, [{"claim": "open", "reason": self._reason}])

        def at(scale: float) -> Array:
            return np.stack([centre - scale * half, centre + scale * half], axis=1)

        def holds(scale: float) -> bool:
            low, high = at(scale).T
            return self._prover.run(low, high, x, self._boxes, self._document["shape"], whole=True)

        low, high, factor = 1.0, 1.0, 2.0 if holds(1.0) else 0.5
        while _SMALLEST < low < 1.0 / _SMALLEST and holds(low * factor) is (factor > 1.0):
            low = high = low * factor
        low, high = (low, low * factor) if factor > 1.0 else (low * factor, low)
        while high > _RATIO * low:
            middle = math.sqrt(low * high)
            low, high = (middle, high) if holds(middle) else (low, middle)
        proof = self.answer(at(low))
        for _ in range(_SHRINKS):  # what the checker does not confirm
            if proof:
                break
            low /= _RATIO
            proof = self.answer(at(low))
        return proof

    def _at_centre(self, ends: Array) -> Array:
        """Return the configuration at a region's centre, on the branch; there may be a reason why there is none."""
        x, middle = self._equations.start, ends.mean(axis=1)
        for part in np.linspace(0.0, 1.0, _STEPS + 1)[1:] if not self._reason else ():
            self._equations.pose = (1.0 - part) * self._known + part * self._pose
            first = self._known[self._over]
            found, _, done = self._prover.solve((first + part * (middle - first))[None], x[None])
            x = found[0]
            if not done[0]:
                self._reason = "the branch ends before the middle of the region"
                break
        return x

    def _checked(self, ends: Array, x: Array, tree: list[Any]) -> Proof:
        names = list(self._document["over"])
        document = {
            **self._document,
            "over": dict(zip(names, ends.tolist(), strict=True)),
            "rows": self._equations.rows.tolist(),
            "tree": tree,
        }
        leaves, dropped = [node for node in tree if isinstance(node, dict)], set[int]()
        findings = dict[int, BoxResult]()
        while True:
            document["start"] = _start(ends, (x * self._equations.units).tolist(), tree)
            result = self._checker.result(document, dropped, findings)
            if not dropped:
                return _proof(document, result)
            for box in dropped:
                findings.pop(box, None)
                leaves[box].clear()
                leaves[box] |= {"claim": "open", "reason": "the checker does not confirm it"}
            dropped.clear()


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
    return _proof(certificate, result)


def _proof(certificate: Mapping[str, Any], result: Mapping[str, Any]) -> Proof:
    leaves = [node for node in certificate["tree"] if isinstance(node, dict)]
    reasons = Counter(leaf["reason"] for leaf in leaves if leaf["claim"] in ("open", "regular"))
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
    if not isinstance(certificate, dict) or certificate.get("format") != _FORMAT:
        raise ProofError(f"{path}: is no certificate of cinegen prove ({_FORMAT})")
    try:
        return read_proof(certificate, workers, scheduler, report)
    except ProofError as error:
        raise ProofError(f"{path}: {error}") from None


def _start(ends: Array, x: list[float], tree: Sequence[Any]) -> dict[str, list[float]]:
    """Return a pose and a configuration in a box that something is claimed of: the middle of the region, or the box
    nearest to it."""
    middle = ends.mean(axis=1)
    nearest, start = np.inf, {"pose": middle.tolist(), "x": x}
    for box, node in _leaves(ends, tree):
        away = float(np.abs((np.clip(middle, box[:, 0], box[:, 1]) - middle) / np.ptp(ends, axis=1)).max())
        if "x" in node and away < nearest:
            nearest = away
            start = {"pose": box.mean(axis=1).tolist(), "x": node["x"]} if away else start
    return start


def _leaves(ends: Array, tree: Iterable[Any]) -> Iterator[tuple[Array, Mapping[str, Any]]]:
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


def _not_square(equations: int, unknowns: int) -> str:
    if equations < unknowns:
        return "the pose does not determine the configuration"
    return "" if equations == unknowns else f"{equations - unknowns} dependent equations are not proved to follow"


def _moves(coordinates: Coordinates, name: str) -> bool:
    """Return whether a coordinate of the node's pose ever changes."""
    samples = coordinates.mechanism.structure.samples
    return any(np.abs(coordinates.rates(q, [name])).max(initial=0.0) > _CONSTANT for q in samples)
