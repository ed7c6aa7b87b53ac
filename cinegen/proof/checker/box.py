"""Examination of single boxes; results are plain numbers, which processes can exchange."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from flint import arb, ctx

from cinegen.proof.checker.balls import CertificateError, added, added_sizes, column, identity, inverse, pick, radii
from cinegen.proof.checker.clearance import Bodies
from cinegen.proof.checker.equations import Robot
from cinegen.proof.checker.reach import excludes
from cinegen.proof.checker.singular import smallest
from cinegen.proof.checker.tube import Tube


class Box(NamedTuple):
    """A box that is not halved: its number, its ends, and its part of the certificate."""

    number: int
    low: list[float]
    high: list[float]
    leaf: Mapping[str, Any]


class BoxResult(NamedTuple):
    """Result of the examination of one box.

    Attributes:
        error: why its claim is not confirmed, else empty.
        status: `proved`, `regular`, `limit`, `sigma`, `clearance`, or `unreachable`.
        sign: of the locked joints' determinant; 0 if unknown.
        reason: the limit's joint, the singular value, or the bodies that are near.
        link: numbers of the tube, with which `Link` compares it with others; empty without one.
    """

    error: str
    status: str = ""
    sign: int = 0
    reason: str = ""
    link: Mapping[str, list[float]] = {}


def examine(data: Mapping[str, Any], boxes: Sequence[Box]) -> list[BoxResult]:
    """Return what is confirmed of boxes, one after the other.

    Args:
        data: a certificate; without its tree.
        boxes: that something is claimed of.
    """
    with ctx.workprec(64):
        robot, findings = Robot(data), list[BoxResult]()
        for box in boxes:
            try:
                findings.append(_finding(robot, box))
            except CertificateError as error:
                findings.append(BoxResult(str(error)))
        return findings


def _finding(robot: Robot, box: Box) -> BoxResult:
    if box.leaf["claim"] == "unreachable":
        return BoxResult("" if excludes(robot, box.low, box.high) else "a pose is not out of reach", "unreachable")
    tube = Tube(robot, box.low, box.high, box.leaf)
    parts = {"along": tube.along, "inverse": tube.inverse, "defect": tube.defect, "resolvent": tube.resolvent}
    link = {name: [float(x) for x in m.entries()] for name, m in parts.items()}
    link |= {"x": [float(a) for a in tube.x], "y": [float(a) for a in tube.y]}
    return BoxResult("", *_status(tube, box.leaf), link)


def _status(tube: Tube, leaf: Mapping[str, Any]) -> tuple[str, int, str]:
    """Return the status, the sign of the locked joints' determinant, and the reason."""
    robot, n = tube.robot, len(tube.low)
    bounds, data, inside = robot.data["bounds"], robot.data, True
    if bounds["limits"]:
        for (low, high), k, unit in zip(tube.ranges, robot.unknown, robot.units, strict=False):
            for end, sense in zip(robot.variables[k]["limits"], (1, -1), strict=True):
                if end is not None:
                    limit = arb(end, abs(end) * 2.0**-50) / unit
                    if sense * (limit - (high if sense > 0 else low)) > 0:
                        return "limit", 0, str(robot.variables[k]["name"])
                    inside = inside and bool(sense * ((low if sense > 0 else high) - limit) > 0)
    sign = _sign(tube, tube.locked, n) if len(tube.locked) == len(tube.x) else 0
    if bounds["sigma"] is not None and inside and sign:
        below, inside = list[str](), leaf["claim"] != "regular"  # of which no more is claimed
        for name, (least, most) in zip(("sigma_1", "sigma_2"), smallest(tube) if inside else [], strict=False):
            below += [name] if most < bounds["sigma"] else []
            inside = inside and bool(least > bounds["sigma"])
        if below and data["exact"]:
            return "sigma", sign, below[0]
    if bounds["clearance"] is not None and inside and sign:
        if leaf["claim"] == "clearance":
            return "clearance", sign, Bodies(tube).are_near(leaf["pair"], leaf["weights"])
        inside = leaf["claim"] != "regular" and Bodies(tube).are_apart(leaf["planes"])
    return ("proved" if inside and sign else "regular"), sign, ""


def _sign(tube: Tube, locked: list[int], n: int) -> int:
    """Return the sign of the determinant of the locked joints' columns, 0 if it is unknown: equation 5."""
    left = inverse(pick(tube.parts[0], tube.robot.data["rows"], locked))
    first, *by, rest = tube.less_identity(left, locked)
    bent = [m.mid() for m in by[:n]]
    rest += added_sizes([first, *by[n:]]) + radii(added(by[:n]))
    defect = rest + added_sizes(bent) * rest
    for a, m in enumerate(bent):
        defect += added_sizes([m * m, *(m * other + other * m for other in bent[:a])])
    weights = (inverse(identity(len(locked)) - defect) * column([1] * len(locked))).mid()
    if all(w > 0 and a < w for a, w in zip((defect * weights).entries(), weights.entries(), strict=True)):
        return 1 if left.det() > 0 else -1 if left.det() < 0 else 0
    return 0
