"""`SweepResult`: what a design sweep found, one `VariantResult` for each variant."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import reduce
from typing import Any

from cinegen.html import table
from cinegen.singularities.singularity import SingularityType
from cinegen.typed_json import as_json
from cinegen.workspace.extent import Extent
from cinegen.workspace.sweep.box import Dexterity, Regularity, WantedBox
from raff2urdf.escape import csv_cell
from raff2urdf.quantities import shown_unit
from raff2urdf.raff.writer import number


@dataclass(frozen=True)
class VariantResult:
    """Result of a variant.

    Attributes:
        name: such as `link2.d=1500`.
        values: by the heading of each variation, in the unit of the RAFF file.
        extent: of what it reaches in the whole region; None where there is no map.
        length: its characteristic length, m, by which lengths are divided in singular values.
        dexterity: in the wanted box; None where there is no map.
        regularity: of the part of the wanted box that is reached; None where nothing is.
        remark: why there is no map, or warnings.
    """

    name: str
    values: Mapping[str, float]
    extent: Extent | None = None
    length: float = math.nan
    dexterity: Dexterity | None = None
    regularity: Regularity | None = None
    remark: str = ""

    def __repr__(self) -> str:
        return f"<VariantResult {self.name[:100]}: {self.extent or 'no map'}{', suitable' if self.suitable else ''}>"

    @property
    def covers_box(self) -> bool:
        """True if the whole wanted box is reached."""
        return self.dexterity is not None and self.dexterity.whole

    @property
    def suitable(self) -> bool:
        """True if the whole wanted box is reached, on one branch, and is free of singularities."""
        return self.covers_box and bool(self.regularity)

    @property
    def singular(self) -> str:
        """Singularities in the part of the wanted box that is reached, for people."""
        if self.regularity is None:
            return "-"
        kind: SingularityType = self.regularity.kind
        if kind is not SingularityType.NONE:
            return str(kind.value)
        return "no" if self.regularity.joined else "branches meet"

    def as_dict(self) -> dict[str, Any]:
        """Return flat JSON values, with the names of the columns of a CSV file; None for missing numbers."""
        return {**self.values, **as_json(self, **{name: _attribute(self, path) for name, path in _FIELDS.items()})}

    def cells(self) -> list[str]:
        """Return the columns of a table for people, but for the remark."""
        values, known = [number(value) for value in self.values.values()], self.dexterity
        if known is None:
            return [*values, "-", *[""] * 7]
        tenths = math.floor(1000.0 * known.reached)  # rounded down: 100 % is all of it
        reached = "< 100 %" if tenths == 1000 and not known.whole else f"{tenths / 10.0:g} %"
        measures = (known.sigma_1.worst, known.sigma_1.mean, known.conditioning.worst, known.conditioning.mean)
        short = [f"{value:.3f}" if math.isfinite(value) else "-" for value in (*measures, known.sigma_2)]
        return [*values, str(self.extent), reached, *short, self.singular]


_FIELDS = {
    "extent": "extent.value",
    "extent_error": "extent.error",
    "length_m": "length",
    "reached": "dexterity.reached",
    "sigma_1_worst": "dexterity.sigma_1.worst",
    "sigma_1_mean": "dexterity.sigma_1.mean",
    "conditioning_worst": "dexterity.conditioning.worst",
    "conditioning_mean": "dexterity.conditioning.mean",
    "sigma_2_worst": "dexterity.sigma_2",
    "covers_box": "covers_box",
    "type_1": "regularity.first",
    "type_2": "regularity.second",
    "one_branch": "regularity.joined",
    "suitable": "suitable",
    "remark": "remark",
}
"""Attributes of a variant by their names in JSON and CSV."""


def _attribute(of: Any, path: str) -> Any:
    """Return an attribute of an attribute; None where one is missing."""
    return reduce(lambda value, name: None if value is None else getattr(value, name), path.split("."), of)


_COLUMNS = ("reaches", "of the box", "sigma 1 worst", "mean", "1/condition worst", "mean", "sigma 2 worst", "singular")


@dataclass(frozen=True)
class SweepResult:
    """Result of a sweep.

    Attributes:
        robot: name of the robot.
        units: of lengths in its RAFF file.
        headings: of the variations.
        box: the wanted box.
        rows: one for each variant, the last variation fastest.
        si: by heading, the factor from the unit of its file to SI units and radians, and the latter unit.
    """

    robot: str
    units: str
    headings: tuple[str, ...]
    box: WantedBox
    rows: tuple[VariantResult, ...]
    si: Mapping[str, tuple[float, str]] = field(default_factory=dict)

    def __repr__(self) -> str:
        return f"<SweepResult of {self.robot[:60]}: {len(self.rows)} variants, {len(self.suitable)} suitable>"

    def _repr_html_(self) -> str:
        rows = ([*row.cells(), row.remark] for row in self.rows)
        return table(repr(self), [*self.headings, *_COLUMNS, "remark"], rows)

    @property
    def unit(self) -> str:
        """Unit of extents; empty where there is none."""
        return next((row.extent.unit for row in self.rows if row.extent), "")

    @property
    def suitable(self) -> tuple[VariantResult, ...]:
        """Variants that reach the whole wanted box without a singularity."""
        return tuple(row for row in self.rows if row.suitable)

    def in_si(self, heading: str, value: float) -> float:
        """Return a value of a variation, given in the unit of the RAFF file, in SI units and radians."""
        return float(f"{value * self.si.get(heading, (1.0, ''))[0]:.15g}")

    def as_dict(self) -> dict[str, Any]:
        """Return JSON values, in SI units and radians."""
        return {
            "robot": self.robot,
            "varied": list(self.headings),
            "units": {name: unit for name, (_, unit) in self.si.items()},
            "extent_unit": self.unit,
            "box": {name: list(ends) for name, ends in sorted(self.box.ranges.items())},
            "rows": [
                {"variant": row.name, **row.as_dict(), **{k: self.in_si(k, v) for k, v in row.values.items()}}
                for row in self.rows
            ],
        }

    def csv(self) -> str:
        """Return a file of comma-separated values, empty for missing numbers."""
        out = io.StringIO()
        writer = csv.writer(out, lineterminator="\n")
        writer.writerow(["variant", *map(csv_cell, self.rows[0].as_dict() if self.rows else ())])
        writer.writerows([csv_cell(row.name), *row.as_dict().values()] for row in self.rows)
        return out.getvalue()

    def text(self) -> str:
        """Return a table for people, with the first remark of each variant."""
        units = {name: shown_unit(unit) for name, (_, unit) in self.si.items()}
        headings = [f"{name} ({units[name][1]})" if name in units else name for name in self.headings]
        lines = [[*headings, *_COLUMNS]]
        for row in self.rows:
            values = (self.in_si(name, value) * units.get(name, (1.0, ""))[0] for name, value in row.values.items())
            lines.append([*(f"{value:.6g}" for value in values), *row.cells()[len(row.values) :]])
        widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
        shown = ["  ".join(word.rjust(width) for word, width in zip(line, widths, strict=True)) for line in lines]
        remarks = ["", *(f"  {row.remark.partition('; ')[0]}" for row in self.rows)]
        return "\n".join((line + remark).rstrip() for line, remark in zip(shown, remarks, strict=True))
