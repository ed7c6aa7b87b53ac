"""`Table`: what a sweep found, a row for each variant."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from cinegen.singularities.singularity import SingularityType
from cinegen.workspace.extent import Extent
from cinegen.workspace.sweep.box import Box
from cinegen.workspace.sweep.dexterity import Dexterity
from cinegen.workspace.sweep.regular import Regularity
from raff2urdf.writer import number


@dataclass(frozen=True)
class Row:
    """What was found of a variant.

    Attributes:
        name: such as `link2.d=1500`.
        values: by the heading of each variation, in the RAFF file's own unit.
        extent: of what it reaches in all the region; None where there is no map.
        length: its characteristic length, m, by which lengths are divided before singular values are taken.
        dexterity: inside the wanted box; None where there is no map.
        regularity: of what is reached of the wanted box; None where that is nothing.
        remark: why there is no map, or what else is to be known.
    """

    name: str
    values: Mapping[str, float]
    extent: Extent | None = None
    length: float = math.nan
    dexterity: Dexterity | None = None
    regularity: Regularity | None = None
    remark: str = ""

    @property
    def whole(self) -> bool:
        """Whether the wanted box is wholly reached."""
        return self.dexterity is not None and self.dexterity.whole

    @property
    def good(self) -> bool:
        """Whether the wanted box is wholly reached, on one branch, and free of singularities."""
        return self.whole and bool(self.regularity)

    @property
    def singular(self) -> str:
        """Whether there are singularities in what is reached of the wanted box, in words."""
        if self.regularity is None:
            return "-"
        kind: SingularityType = self.regularity.kind
        if kind is not SingularityType.NONE:
            return str(kind.value)
        return "no" if self.regularity.joined else "branches meet"

    def as_dict(self) -> dict[str, Any]:
        """Flat, with the names of a CSV file's columns; None where there is no number."""
        known, regular = self.dexterity, self.regularity
        numbers = {
            "extent": self.extent.value if self.extent else math.nan,
            "extent_error": self.extent.error if self.extent else math.nan,
            "length_m": self.length,
            "reached": known.reached if known else math.nan,
            "sigma_1_worst": known.sigma_1.worst if known else math.nan,
            "sigma_1_mean": known.sigma_1.mean if known else math.nan,
            "conditioning_worst": known.conditioning.worst if known else math.nan,
            "conditioning_mean": known.conditioning.mean if known else math.nan,
            "sigma_2_worst": known.sigma_2 if known else math.nan,
        }
        return {
            **self.values,
            **{name: value if math.isfinite(value) else None for name, value in numbers.items()},
            "whole": self.whole,
            "type_1": regular.first if regular is not None else None,
            "type_2": regular.second if regular is not None else None,
            "one_branch": regular.joined if regular is not None else None,
            "good": self.good,
            "remark": self.remark,
        }


@dataclass(frozen=True)
class Table:
    """What a sweep found.

    Attributes:
        robot: its name.
        units: of lengths in its RAFF file.
        headings: of the variations.
        box: that was wanted.
        rows: one for each variant, the last variation fastest.
    """

    robot: str
    units: str
    headings: tuple[str, ...]
    box: Box
    rows: tuple[Row, ...]

    @property
    def unit(self) -> str:
        """Of extents; nothing where there is none."""
        return next((row.extent.unit for row in self.rows if row.extent), "")

    @property
    def good(self) -> tuple[Row, ...]:
        """Those that reach all of the wanted box without a singularity."""
        return tuple(row for row in self.rows if row.good)

    def as_dict(self) -> dict[str, Any]:
        """As JSON has it."""
        return {
            "robot": self.robot,
            "varied": list(self.headings),
            "units": self.units,
            "extent_unit": self.unit,
            "box": self.box.document(),
            "rows": [{"variant": row.name, **row.as_dict()} for row in self.rows],
        }

    def csv(self) -> str:
        """As a file of comma-separated values, empty where there is no number."""
        out = io.StringIO()
        writer = csv.DictWriter(out, ["variant", *(self.rows[0].as_dict() if self.rows else ())], lineterminator="\n")
        writer.writeheader()
        writer.writerows({"variant": row.name, **row.as_dict()} for row in self.rows)
        return out.getvalue()

    def text(self) -> str:
        """For people; of remarks what comes first."""
        heads = [*self.headings, "reaches", "of the box", "sigma 1 worst", "mean"]
        heads += ["1/condition worst", "mean", "sigma 2 worst", "singular"]
        lines = [heads, *(self._cells(row) for row in self.rows)]
        widths = [max(len(line[k]) for line in lines) for k in range(len(heads))]
        shown = ["  ".join(word.rjust(width) for word, width in zip(line, widths, strict=True)) for line in lines]
        remarks = ["", *(f"  {row.remark.partition('; ')[0]}" for row in self.rows)]
        return "\n".join((line + remark).rstrip() for line, remark in zip(shown, remarks, strict=True))

    def _cells(self, row: Row) -> list[str]:
        values = [number(row.values[heading]) for heading in self.headings]
        known = row.dexterity
        if known is None:
            return [*values, "-", *[""] * 7]
        return [
            *values,
            str(row.extent),
            _percent(known),
            *(_short(value) for one in (known.sigma_1, known.conditioning) for value in (one.worst, one.mean)),
            _short(known.sigma_2),
            row.singular,
        ]


def _percent(known: Dexterity) -> str:
    """What is reached, rounded down: 100 % is all of it."""
    tenths = math.floor(1000.0 * known.reached)
    return "< 100 %" if tenths == 1000 and not known.whole else f"{tenths / 10.0:g} %"


def _short(value: float) -> str:
    return f"{value:.3f}" if math.isfinite(value) else "-"
