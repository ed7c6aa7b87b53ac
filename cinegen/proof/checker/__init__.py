"""Check a certificate of a workspace by ball arithmetic (python-flint) alone: shares no code with what wrote it.

docs/proof.md has the mathematics; numbers of equations are its. A certificate has the equations of a robot, a region
halved into boxes, and of each box a claim, a configuration x and a radius y; all else is computed again.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from math import inf
from typing import Any

from flint import arb, ctx

from cinegen.proof.checker.balls import CertificateError
from cinegen.proof.checker.box import Box, BoxResult, examine
from cinegen.proof.checker.branch import Node, branch
from cinegen.proof.checker.equations import Robot

__all__ = ["BoxResult", "CertificateError", "Spread", "check", "one_by_one"]

_TASK = 4  # boxes that are examined together
_REFUTED = "limit", "sigma", "clearance", "unreachable"
_ROUND = {"box": 0, "cylinder": 2, "ball": 6}

Examine = Callable[[Mapping[str, Any], Sequence[Box]], list[BoxResult]]
Spread = Callable[[Examine, Iterable[list[Box]], Mapping[str, Any]], Iterator[tuple[list[Box], list[BoxResult]]]]
"""Calls a function with a certificate and each of many lists of boxes, in any order and in any processes."""


def one_by_one(
    function: Examine, tasks: Iterable[list[Box]], data: Mapping[str, Any]
) -> Iterator[tuple[list[Box], list[BoxResult]]]:
    """Examine boxes in this process."""
    return ((boxes, function(data, boxes)) for boxes in tasks)


def check(
    certificate: Mapping[str, Any], report: Callable[[int, int], None] = lambda done, of: None,
    dropped: set[int] | None = None, findings: dict[int, BoxResult] | None = None, spread: Spread = one_by_one,
) -> dict[str, Any]:  # fmt: skip
    """Return the result of a certificate: shares of the region's volume, witnesses, and the number of boxes.

    Args:
        certificate: its JSON values.
        report: is called with the number of boxes that are examined, and of all.
        dropped: numbers of boxes whose claims are not confirmed are added to it, and these boxes are undecided.
        findings: of boxes that were examined before, which is not done again; others are added.
        spread: examines boxes in other processes.

    Raises:
        CertificateError: a claim is not confirmed.
    """
    with ctx.workprec(64):
        try:
            return _result(certificate, report, dropped, {} if findings is None else findings, spread)
        except CertificateError:
            raise
        except Exception as error:  # numbers and structures of any kind
            raise CertificateError(f"it is damaged ({type(error).__name__}: {error})") from None


def _result(
    certificate: Mapping[str, Any], report: Callable[[int, int], None], dropped: set[int] | None,
    findings: dict[int, BoxResult], spread: Spread,
) -> dict[str, Any]:  # fmt: skip
    robot, over = Robot(certificate), certificate["over"].values()
    root, boxes, shares = _read(certificate)

    def refuse(box: int, message: str) -> None:
        if dropped is None:
            error = CertificateError(message)
            error.box = box
            raise error
        dropped.add(box)

    claimed, edge = list[Box](), [(float(a), float(b)) for a, b in over][: _ROUND[certificate["shape"]]]
    for box in boxes:
        claim = box.leaf["claim"]
        if claim == "outside" and not _square(box, edge) > 1:
            raise CertificateError("a box that is called outside is not")
        if claim not in ("outside", "open") and box.number not in findings:
            claimed.append(box)
    done, data = len(boxes) - len(claimed), {key: value for key, value in certificate.items() if key != "tree"}
    tasks = (claimed[i : i + _TASK] for i in range(0, len(claimed), _TASK))
    for task, examined in spread(examine, tasks, data):
        done += len(task)
        report(done, len(boxes))
        for box, confirmed in zip(task, examined, strict=True):
            if confirmed.error:
                refuse(box.number, confirmed.error)
            else:
                findings[box.number] = confirmed
    joined, statuses = branch(robot, root, boxes, findings), list[str]()
    volumes = defaultdict[str, float](float)
    witnesses, signs = list[dict[str, Any]](), dict[int, int]()
    for i, (box, share) in enumerate(zip(boxes, shares, strict=True)):
        finding, claim, status = findings.get(i), box.leaf["claim"], "outside"
        if claim != "outside":
            status = "undecided"
            volumes["all"] += share
        if finding is not None and (i in joined or finding.status == "unreachable"):
            status = finding.status
            if status != "unreachable":
                signs.setdefault(finding.sign, i)
            if status in _REFUTED:
                witnesses.append(_witness(robot, box, finding, **({status: finding.reason} if finding.reason else {})))
            if claim != "regular" and status != claim:
                refuse(i, f"a box is {status}, not {claim}")
        statuses.append("refuted" if status in _REFUTED else "undecided" if status == "regular" else status)
        volumes[statuses[-1]] += share
    if 1 in signs and -1 in signs:
        witnesses += [_witness(robot, boxes[signs[s]], findings[signs[s]], determinant=s) for s in (1, -1)]
    parts = {key: volumes[key] / volumes["all"] for key in ("proved", "refuted", "undecided")}
    count = sum(box.leaf["claim"] != "outside" for box in boxes)
    return {**parts, "statuses": statuses, "witnesses": witnesses, "boxes": count}


def _read(certificate: Mapping[str, Any]) -> tuple[Any, list[Box], list[float]]:
    """Return the region, a box's number or a `Node`; all boxes that are not halved; and their shares of its volume."""
    tree, boxes, shares = iter(certificate["tree"]), list[Box](), list[float]()

    def read(low: list[float], high: list[float], share: float) -> Any:
        node = next(tree)
        if isinstance(node, dict):
            boxes.append(Box(len(boxes), low, high, node))
            shares.append(share)
            return len(boxes) - 1
        middle = (low[node] + high[node]) / 2
        if not low[node] < middle < high[node]:
            raise CertificateError("a box is empty")
        ends = [*high[:node], middle, *high[node + 1 :]], [*low[:node], middle, *low[node + 1 :]]
        return Node(node, (read(low, ends[0], share / 2), read(ends[1], high, share / 2)))

    low, high = ([float(x[i]) for x in certificate["over"].values()] for i in range(2))
    if not all(-inf < a < b < inf for a, b in zip(low, high, strict=True)):
        raise CertificateError("the region is empty")
    root = read(low, high, 1.0)
    if next(tree, None) is not None:
        raise CertificateError("boxes are left over")
    return root, boxes, shares


def _square(box: Box, edge: Sequence[tuple[float, float]]) -> arb:
    """Return the square of a box's distance from the centre, in the axes of the round part of the region."""
    total = arb(0)
    for a, b, (start, end) in zip(box.low, box.high, edge, strict=False):
        c, r = (arb(start) + end) / 2, (arb(end) - start) / 2
        total += (max(a - c, c - b, arb(0)) / r) ** 2
    return total


def _witness(robot: Robot, box: Box, finding: BoxResult, **why: Any) -> dict[str, Any]:
    names = [[robot.variables[k]["name"] for k in part] for part in (robot.over, robot.unknown)]
    pose = [float((arb(a) + b) / 2) for a, b in zip(box.low, box.high, strict=True)]
    x = [float(a * u) for a, u in zip(finding.link.get("x", ()), robot.units, strict=False)]
    configuration = dict(zip(names[1], x, strict=True)) if x else {}
    return {"pose": dict(zip(names[0], pose, strict=True)), "configuration": configuration, **why}
