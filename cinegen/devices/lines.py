"""Forward kinematics as a filter: values of the actuated joints in, values of all joints out, as lines of JSON."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import BinaryIO

from cinegen.arrays import Array, ArrayLike
from cinegen.errors import CinegenError, warn
from cinegen.model import ForwardKinematics, Mechanism
from cinegen.model.plausible import ImplausibleError, check_joint
from cinegen.tolerances import CLOSURE
from cinegen.typed_json import unique_keys
from raff2urdf.errors import raised_as

_CHUNK = 1 << 16  # bytes read at once


class Lines:
    """Answers lines such as `{"joint1": 0.1}` (rad, m) with a line of all joints, in the order of `mechanism.joints`.

    Joints that a line does not name keep their values; a blank line moves nothing. If a line is invalid, if a value can
    only be meant in degrees or mm, if the loops can't follow on their branch, or if a joint, actuated or not, would
    pass a limit, even if it came back, nothing moves and the answer is `{"error": "..."}`. The first answer whose
    branch is not proved (`ForwardKinematics.is_proved`) comes with a warning.

    Args:
        mechanism: mechanism to move.
        q: (nq,) initial configuration, closed; home unless given.

    Raises:
        CinegenError: q leaves loops open, or an actuated joint has more than one variable.
    """

    def __init__(self, mechanism: Mechanism, q: ArrayLike | None = None) -> None:
        self._motion, self._warns = ForwardKinematics(mechanism, q, within_limits=True), True
        self._template, self._picked = _template(mechanism)

    def answer(self, line: str) -> str:
        """Return the answer to a line, without a newline."""
        try:
            values = _values(line)
            self._check_units(values)
            q = self._moved(values)
        except (CinegenError, _NoValuesError) as error:
            return json.dumps({"error": str(error)})
        return self._template % tuple(q[self._picked].tolist())

    def _check_units(self, values: dict[str, float]) -> None:
        """Check that no value fits in degrees or mm only.

        Raises:
            ImplausibleError: one does.
        """
        mechanism = self._motion.mechanism
        for name, value in values.items():
            if name in mechanism.limits and isinstance(value, int | float):
                with raised_as(ImplausibleError, ImplausibleError, "", " Values are in rad and m"):
                    check_joint(mechanism, name, [value])

    def _moved(self, values: dict[str, float]) -> Array:
        """Move; return the configuration (nq,).

        Raises:
            CinegenError: the loops can't follow, or a joint would pass a limit; nothing moves.
        """
        q = self._motion.move(values)
        if self._warns and not self._motion.is_proved:
            self._warns = False
            warn(
                f"{self._motion.mechanism.name}: from here on answers are not proved to be on the branch of the start: "
                "the actuated joints do not determine the others there, or couplings are not linear"
            )
        return q

    def serve(self, stream: BinaryIO, write: Callable[[str], object]) -> None:
        """Answer all lines until the input ends.

        Args:
            stream: input. All bytes that are there are read at once, so that a single line is answered at once and many
                lines together.
            write: function that writes whole lines, and flushes them.
        """
        rest = b""
        while chunk := stream.read1(_CHUNK):  # type: ignore[attr-defined]
            *lines, rest = (rest + chunk).split(b"\n")
            if lines:
                write("".join([self._answer(line) for line in lines]))
        if rest:
            write(self._answer(rest))

    def _answer(self, line: bytes) -> str:
        return self.answer(line.decode("utf-8", errors="replace")) + "\n"


class _NoValuesError(Exception):
    """A line without values of joints."""


def _values(line: str) -> dict[str, float]:
    try:
        values = json.loads(line, object_pairs_hook=unique_keys)
    except json.JSONDecodeError as error:
        if not line.strip():
            return {}
        raise _NoValuesError(f"invalid JSON: {error.msg.lower()} in column {error.colno}") from None
    except (ValueError, RecursionError) as error:  # numbers without end, brackets without end, a joint twice
        raise _NoValuesError(f"invalid JSON: {error}") from None
    if not isinstance(values, dict):
        raise _NoValuesError('not an object of joints and values, such as {"joint1": 0.1}')
    return values


def _template(mechanism: Mechanism) -> tuple[str, list[int]]:
    """Return the format of an answer, and the indices of its numbers in q."""
    parts: list[str] = []
    picked: list[int] = []
    for name in (*mechanism.joints, *mechanism.balls):
        joint = mechanism.model.joints[mechanism.model.getJointId(name)]
        numbers = ", ".join(["%r"] * joint.nq)
        parts.append(json.dumps(name).replace("%", "%%") + ": " + (numbers if joint.nq == 1 else f"[{numbers}]"))
        picked += range(joint.idx_q, joint.idx_q + joint.nq)
    return "{" + ", ".join(parts) + "}", picked


def start_from(mechanism: Mechanism, text: str) -> Array:
    """Return the configuration (nq,) of an answer's line, closed.

    Raises:
        CinegenError: the line has no values of joints, or the loops can't be closed there.
    """
    try:
        values = _values(text)
        q = mechanism.configuration(values)
    except _NoValuesError as error:
        raise CinegenError(str(error)) from None
    except (TypeError, ValueError) as error:
        raise CinegenError(f"a joint's value is not a number: {error}") from None
    if mechanism.closure(q) > CLOSURE:  # for instance written with fewer digits
        q = mechanism.close(q, mechanism.actuated)
    return q
