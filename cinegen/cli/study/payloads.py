"""The options `--payload`, `--wrench` and `--gravity`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from cinegen.cli.numbers import parts, point, quantity
from raff2urdf.command.command_line import UsageError, option
from raff2urdf.quantities import ACCELERATION, FORCE, MASS, TORQUE, parse_list, refused_as

if TYPE_CHECKING:
    from cinegen.dynamics import Payload
    from cinegen.model import Mechanism

PAYLOADS = option("MASS[@NODE]", "mass that a node carries at its origin (kg)", (), "--payload")
WRENCHES = option(
    "NODE=F", "force, or force and moment, on a node in the world's axes: tool=0,0,-10 or tool=0,0,-10,0,0,2 (N, Nm)",
    (), "--wrench",
)  # fmt: skip
GRAVITY = option(
    "X,Y,Z", "acceleration in the world (m/s2; 0,0,0 for none; default: the file's, or else 0,0,-9.81)", "", "--gravity"
)


def carried(mechanism: Mechanism, texts: Sequence[str], node: str | None = None) -> list[Payload]:
    """Return payloads, on a node or the end unless they name another."""
    from cinegen.dynamics import Payload

    end, payloads = mechanism.end if node is None else node, []
    for text in texts:
        mass, _, where = text.partition("@")
        payloads.append(Payload(where or end, quantity(mass, "--payload", MASS)))
    return payloads


def wrenches(texts: Sequence[str]) -> list[Payload]:
    """Return wrenches on nodes.

    Raises:
        UsageError: one is no wrench.
    """
    from cinegen.dynamics import Payload

    loads = []
    for text in texts:
        where, equals, numbers = text.partition("=")
        components = parts(numbers)
        if not equals or len(components) not in (3, 6):
            raise UsageError(f"--wrench: '{text}': write NODE=FX,FY,FZ or NODE=FX,FY,FZ,MX,MY,MZ, such as tool=0,0,-10")
        with refused_as(UsageError, "--wrench"):
            force, moment = parse_list(components[:3], FORCE), parse_list(components[3:], TORQUE)
        loads.append(Payload(where, wrench=(*force, *(moment or (0.0, 0.0, 0.0)))))
    return loads


def gravity_of(text: str) -> tuple[float, float, float] | None:
    """Return the acceleration of gravity, m/s^2; None if none is given: then it is the mechanism's.

    Raises:
        UsageError: it is no vector.
    """
    return point(text, "--gravity", ACCELERATION) if text else None
