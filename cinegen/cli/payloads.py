"""The option `--payload`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from cinegen.cli.numbers import quantity
from cinegen.cli.options import option
from raff2urdf.quantities import MASS

if TYPE_CHECKING:
    from cinegen.dynamics import Payload
    from cinegen.model import Mechanism

PAYLOADS = option("MASS[@NODE]", "mass that a node carries at its origin (kg)", (), "--payload")


def carried(mechanism: Mechanism, texts: Sequence[str], node: str | None = None) -> list[Payload]:
    """Return payloads, on a node or the end unless they name another."""
    from cinegen.dynamics import Payload

    end, found = mechanism.end if node is None else node, []
    for text in texts:
        mass, _, where = text.partition("@")
        found.append(Payload(where or end, quantity(mass, "--payload", MASS)))
    return found
