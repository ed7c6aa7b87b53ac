"""What moves a mechanism line by line: values of the actuated joints come in as JSON, those of all joints go out."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import BinaryIO

from cinegen.errors import CinegenError
from cinegen.model import ForwardKinematics, Mechanism
from raff2urdf.closure import CLOSED

_CHUNK = 1 << 16  # bytes that are taken at once, if so many are there


class Lines:
    """Answers lines such as `{"joint1": 0.1}` (rad, m) with a line of all joints, in the order of `mechanism.joints`.

    Joints that a line does not name stay where the line before has left them; a blank line moves nothing. Where a line
    makes no sense, or the loops can't follow it on their branch, nothing moves and the answer is `{"error": "..."}`.

    Args:
        motion: what the lines move.
    """

    def __init__(self, motion: ForwardKinematics) -> None:
        self._motion = motion
        self._template, self._picked = _template(motion.mechanism)

    def answer(self, line: str) -> str:
        """The answer to a line, without a line's end."""
        try:
            q = self._motion.move(_values(line))
        except (CinegenError, _NoValuesError) as error:
            return json.dumps({"error": str(error)})
        return self._template % tuple(q[self._picked].tolist())

    def serve(self, given: BinaryIO, say: Callable[[str], object]) -> None:
        """Answers all lines until there are no more.

        Args:
            given: where they come from. It is read as far as there is something to read, so that whoever writes a line
                and waits is answered at once, and whoever writes many not one by one.
            say: takes answers, whole lines, which must not wait then.
        """
        rest = b""
        while chunk := given.read1(_CHUNK):  # type: ignore[attr-defined]
            *lines, rest = (rest + chunk).split(b"\n")
            if lines:
                say("".join([self._answer(line) for line in lines]))
        if rest:
            say(self._answer(rest))

    def _answer(self, line: bytes) -> str:
        return self.answer(line.decode("utf-8", errors="replace")) + "\n"


class _NoValuesError(Exception):
    """A line that says nothing of joints."""


def _values(line: str) -> dict[str, float]:
    try:
        values = json.loads(line)
    except json.JSONDecodeError as error:
        if not line.strip():
            return {}
        raise _NoValuesError(f"no JSON: {error.msg.lower()} in column {error.colno}") from None
    except (ValueError, RecursionError) as error:  # numbers without end, brackets without end
        raise _NoValuesError(f"no JSON that makes sense here: {error}") from None
    if not isinstance(values, dict):
        raise _NoValuesError('not an object of joints and values, such as {"joint1": 0.1}')
    return values


def _template(mechanism: Mechanism) -> tuple[str, list[int]]:
    """How an answer is written, and where in q its numbers stand."""
    parts: list[str] = []
    picked: list[int] = []
    for name in mechanism.joints:
        joint = mechanism.model.joints[mechanism.model.getJointId(name)]
        numbers = ", ".join(["%r"] * joint.nq)
        parts.append(json.dumps(name).replace("%", "%%") + ": " + (numbers if joint.nq == 1 else f"[{numbers}]"))
        picked += range(joint.idx_q, joint.idx_q + joint.nq)
    return "{" + ", ".join(parts) + "}", picked


def start_from(mechanism: Mechanism, text: str) -> ForwardKinematics:
    """Stands where a line says that was an answer: on the branch that this is on.

    Raises:
        CinegenError: it says nothing of joints, or the loops can't be closed there.
    """
    try:
        values = _values(text)
        q = mechanism.configuration(values)
    except _NoValuesError as error:
        raise CinegenError(str(error)) from None
    except (TypeError, ValueError) as error:
        raise CinegenError(f"a joint's value is no number: {error}") from None
    if mechanism.closure(q) > CLOSED:  # written with fewer digits, say
        q = mechanism.close(q, mechanism.actuated)
    return ForwardKinematics(mechanism, q)
