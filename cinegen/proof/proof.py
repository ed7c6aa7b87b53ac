"""`prove`: a workspace that is guaranteed, not sampled."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from cinegen.arrays import Array, ArrayLike
from cinegen.cluster import check_workers
from cinegen.model import Mechanism
from cinegen.proof.clearance import Clearances, bodies_of, shapes_of
from cinegen.proof.distributed_checks import Checker, Report, examined
from cinegen.proof.equations import Equations
from cinegen.proof.exported_equations import Exporter, ProofError
from cinegen.proof.prover import BOXES, ROUND, Prover
from cinegen.proof.reach import ReachTest
from cinegen.proof.result import FORMAT, Proof, leaves, proof_of
from cinegen.proof.singular import SingularValues
from cinegen.proof.tolerances import Robots, with_tolerances
from cinegen.proof.velocities import VelocityExporter
from cinegen.singularities.slice import POSE, Coordinates

_CONSTANT = 1e-9  # rad or characteristic lengths: a coordinate that changes by less never does
_EXACT = 1e-12  # m or rad: a fixed coordinate that is off by less is 0
_STEPS = 40  # from a configuration to the middle of the region
_RATIO, _SMALLEST = 1.01, 2.0**-10  # of regions that grow: accuracy, and smallest part of what is given
_PARTS = 1000  # of a region, in reports
_SHRINKS = 5  # by that ratio, until the checker confirms a region


def prove(
    mechanism: Mechanism, over: Mapping[str, tuple[float, float]], at: Mapping[str, float] | None = None,
    node: str | None = None, q: ArrayLike | None = None, limits: bool = False, sigma: float | None = None,
    boxes: int = BOXES, shape: str = "box", grow: bool = False, tolerances: Robots | None = None,
    clearance: float | None = None, workers: int | None = 1, scheduler: str | None = None, report: Report | None = None,
    unfinished: Path | None = None,
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
        clearance: what distances between bodies must be above, m; the pairs are those of `Clearance`.
        workers: processes on this machine that check the certificate; None for one for each core, for many boxes.
        scheduler: address of a Dask scheduler whose workers check it instead.
        report: is called with what is done, and how much of how much.
        unfinished: a file that keeps the boxes that were examined, if they are many, until all are: the same proof goes
            on there after it was interrupted.

    Raises:
        ProofError: there is no range, or an empty one; no such shape; tolerances of another robot, or that loops can't
            follow; sigma or the clearance is negative.
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
    if clearance is not None and not 0.0 <= clearance < np.inf:
        raise ProofError(f"the clearance is {clearance:g} m: give one that is not negative")
    known = coordinates.coordinates(start)
    pose = np.array([(at or {}).get(name, known[name]) for name in POSE])
    constant = [name for name in POSE if name not in coordinates.independent and not _moves(coordinates, name)]
    pose[np.abs(pose) < _EXACT] = 0.0
    bodies = [] if clearance is None else bodies_of(mechanism)
    shapes = {} if clearance is None else shapes_of(mechanism)

    def export(robot: Mechanism) -> dict[str, Any]:
        kind = Exporter if sigma is None else VelocityExporter
        exporter = kind(
            robot.successive, coordinates.node, pose, over, coordinates.independent, constant,
            limits or clearance is not None, bodies,
        )  # fmt: skip
        bounds = {"limits": limits, "sigma": sigma, "clearance": clearance}
        return {"format": FORMAT, **exporter.document(start), "bounds": bounds, "shape": shape, **shapes}

    document = export(mechanism)
    if tolerances is not None:
        if tolerances.mechanism.joints != mechanism.joints:
            raise ProofError(f"{mechanism.name}: the tolerances are of {tolerances.mechanism.name}: give this robot's")
        document = with_tolerances(document, tolerances, export)
    with np.errstate(all="ignore"):
        ends, known_pose = np.array(list(over.values()), dtype=float), np.array([known[name] for name in POSE])
        checker = Checker(workers, scheduler, report)
        question = _Question(whole, document, known_pose, pose, boxes, checker, report, unfinished)
        return question.largest(ends) if grow else question.answer(ends)


class _Question:
    """A question: what is to be proved, over any region about a centre.

    Args:
        mechanism: without ball joints of one piece.
        document: the equations.
        known: (6,) the pose of the configuration that they were written in.
        pose: (6,) that of what does not vary.
        boxes: number of boxes that are tested.
        checker: of certificates.
        report: see `prove`.
        unfinished: likewise.
    """

    def __init__(
        self, mechanism: Mechanism, document: Mapping[str, Any], known: Array, pose: Array, boxes: int,
        checker: Checker, report: Report | None, unfinished: Path | None,
    ) -> None:  # fmt: skip
        self._document, self._known, self._pose, self._boxes = document, known, pose, boxes
        self._checker, self._report, self._unfinished = checker, report, unfinished
        self._equations = Equations(document)
        self._over = [POSE.index(document["variables"][k]["name"]) for k in self._equations.over]
        self._equations.select(self._equations.start, known[self._over])
        self._reason = _not_square(len(self._equations.rows), len(self._equations.start))
        self._reason = self._reason or document.get("unbounded", "")
        limits, sigma, clearance = (document["bounds"][name] for name in ("limits", "sigma", "clearance"))
        values = None if sigma is None or self._reason else SingularValues(self._equations, document)
        clearances = None if clearance is None else Clearances(mechanism, self._equations, document, clearance)
        reach = ReachTest(self._equations, document)
        self._prover = Prover(self._equations, reach, limits, sigma, values, clearances)

    def answer(self, ends: Array) -> Proof:
        """Return what is proved of a region, whose coordinates have these ends (parameters, 2)."""
        pose, x, _ = self._start(ends)
        tree = [{"claim": "open", "reason": self._reason}]
        if not self._reason:
            self._prover.run(ends[:, 0], ends[:, 1], x, self._boxes, self._document["shape"], report=self._decided)
            tree = self._prover.tree()
        return self._checked(ends, pose, x, tree)

    def _decided(self, share: float) -> None:
        if self._report is not None:
            self._report("proving", round(_PARTS * share), _PARTS)

    def largest(self, ends: Array) -> Proof:
        """Return the proof of the largest region of the same proportions and centre that is proved as a whole."""
        pose, x, is_middle = self._start(ends)
        if self._reason or not is_middle:
            reason = self._reason or "the branch ends before the middle of the region"
            return self._checked(ends, pose, x, [{"claim": "open", "reason": reason}])
        centre, half = pose, 0.5 * (ends[:, 1] - ends[:, 0])

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

    def _start(self, ends: Array) -> tuple[Array, Array, bool]:
        """Return a pose of the region, the configuration there on the branch, and whether it is that of the middle.

        Where the branch ends before the middle, it is the first pose of the region on the path there; without any, the
        configuration is NaN."""
        middle, first, x = ends.mean(axis=1), self._known[self._over], self._equations.start
        inside = list[tuple[Array, Array]]()
        for part in np.linspace(0.0, 1.0, _STEPS + 1) if not self._reason else ():
            self._equations.pose = (1.0 - part) * self._known + part * self._pose
            pose = (1.0 - part) * first + part * middle
            (x, *_), _, (is_reached, *_) = self._prover.solve(pose[None], x[None])
            if not is_reached:
                break
            if (
                (ends[:, 0] <= pose).all()
                and (pose <= ends[:, 1]).all()
                and np.allclose(self._equations.pose, self._pose)
            ):
                inside.append((pose, x))
        else:
            return middle, x, True
        self._equations.pose = self._pose
        return *(inside[0] if inside else (middle, np.full(len(x), np.nan))), False

    def _checked(self, ends: Array, pose: Array, x: Array, tree: list[Any]) -> Proof:
        names = list(self._document["over"])
        document = {
            **self._document,
            "over": dict(zip(names, ends.tolist(), strict=True)),
            "rows": self._equations.rows.tolist(),
            "tree": tree,
        }
        claims, dropped = [node for node in tree if isinstance(node, dict)], set[int]()
        with examined(self._unfinished, document) as findings:
            while True:
                document["start"] = _start(ends, pose, np.nan_to_num(x) * self._equations.units, tree)
                result = self._checker.result(document, dropped, findings)
                if not dropped:
                    break
                for box in dropped:
                    findings.pop(box, None)
                    claims[box].clear()
                    claims[box] |= {"claim": "open", "reason": "the checker does not confirm it"}
                dropped.clear()
        return proof_of(document, result)


def _start(ends: Array, pose: Array, x: Array, tree: Sequence[Any]) -> dict[str, list[float]]:
    """Return a pose and a configuration in a box that something is claimed of: those that are wanted, or in the box
    nearest to them."""
    nearest, start = np.inf, {"pose": pose.tolist(), "x": x.tolist()}
    for box, node in leaves(ends, tree):
        away = float(np.abs((np.clip(pose, box[:, 0], box[:, 1]) - pose) / np.ptp(ends, axis=1)).max())
        if "x" in node and away < nearest:
            nearest = away
            start = {"pose": box.mean(axis=1).tolist(), "x": node["x"]} if away else start
    return start


def _not_square(equations: int, unknowns: int) -> str:
    if equations < unknowns:
        return "the pose does not determine the configuration"
    return "" if equations == unknowns else f"{equations - unknowns} dependent equations are not proved to follow"


def _moves(coordinates: Coordinates, name: str) -> bool:
    """Return whether a coordinate of the node's pose ever changes."""
    samples = coordinates.mechanism.structure.samples
    return any(np.abs(coordinates.rates(q, [name])).max(initial=0.0) > _CONSTANT for q in samples)
