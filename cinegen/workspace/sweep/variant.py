"""`variants`: documents that differ from one in a few numbers, each a RAFF file of its own."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path

from cinegen.workspace.errors import MapError
from cinegen.workspace.sweep.variation import Variation
from raff2urdf.check import check_sizes, check_tree
from raff2urdf.document import Document
from raff2urdf.errors import RaffError
from raff2urdf.writer import number, write

MOST = 10_000
"""Variants of one sweep."""


@dataclass(frozen=True)
class Variant:
    """A document in which some parameters have other values.

    Attributes:
        name: such as `link2.d=1500`, several joined by ','.
        values: by the heading of each variation, in the file's own unit.
        document: the whole file.
    """

    name: str
    values: Mapping[str, float]
    document: Document

    def raff(self) -> str:
        """The text of its RAFF file: reads back to the same document."""
        source = Path(self.document.source.name).name
        return write(self.document, (f"{source} with {self.name.replace(',', ', ')}",))


def variants(document: Document, variations: Sequence[Variation], robot: str | None = None) -> list[Variant]:
    """All combinations of all variations' values, the last variation fastest.

    Args:
        document: what is varied; what it says else stays.
        variations: of parameters that are all different.
        robot: of a document that holds several, which one is varied; the first unless said.

    Raises:
        RaffError: no such robot.
        MapError: a parameter that is not there, or is varied twice; values that no file may hold; too many.
    """
    if not variations:
        raise MapError("a sweep varies at least one parameter: say which, such as link2.d=100..200:5")
    chosen = document.robot(robot)
    named = Counter((p.whose(chosen), p.name) for variation in variations for p in variation.parameters)
    for (node, name), times in named.items():
        if times > 1:
            raise MapError(f"{node}.{name} is varied twice: join parameters that vary together by '+'")
    count = math.prod(variation.count for variation in variations)
    if count > MOST:
        raise MapError(f"{count} variants: at most {MOST} can be compared. Give fewer values")
    found = []
    for values in product(*(variation.values for variation in variations)):
        given = dict(zip((variation.heading for variation in variations), values, strict=True))
        name = ",".join(f"{heading}={number(value)}" for heading, value in given.items())
        changed = chosen
        for variation, value in zip(variations, values, strict=True):
            for parameter in variation.parameters:
                changed = parameter.put(changed, value)
        robots = tuple(changed if one is chosen else one for one in document.robots)
        found.append(Variant(name, given, _checked(replace(document, robots=robots), changed.name, name)))
    return found


def _checked(document: Document, robot: str, name: str) -> Document:
    try:
        check_tree(document)
        check_sizes(document, document.robot(robot))
    except RaffError as error:
        words = "; ".join(problem.message for problem in error.problems)
        raise MapError(f"{name}: this is no robot: {words}") from None
    return document
