"""`Measurements`: what was measured on a robot, in one CSV file for devices of any kind.

    pose,  joint1 [deg], joint2 [deg], tool.x [mm], tool.y [mm], tool(0 0 50mm).distance(1000mm 0 0) [mm]
    sigma, ,             ,             0.05,        0.05,        0.02
    1,     12.5,         -30,          412.31,      80.12,
    2,     14.0,         -35,          ,            ,            655.902

A line is a configuration of the robot, a column one number that was read: the unit is in its header, or in the
cell. An empty cell was not measured. A line `sigma` holds the standard deviations of the lines below it, up to the
next one.

| column | what was read |
| --- | --- |
| `joint1` | a joint's encoder; without sigma its reading is exact |
| `tool.x`, `.y`, `.z` | coordinate of a node's origin in the world |
| `tool.rx`, `.ry`, `.rz` | roll, pitch and yaw of a node, R = Rz(rz) Ry(ry) Rx(rx) |
| `tool.distance(X Y Z)` | distance from a fixed point (ball bar, laser interferometer) |
| `tool.along(X Y Z)` | coordinate along a direction: touched planes, dial gauges |

`tool(X Y Z).x` and so on measure a point that is fixed on the node, given in the node's axes; `tool(ball).x` one that
is not known, and is estimated. `tool.x @ tracker` is what a device reads in its own frame, whose pose is estimated,
too.
"""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cinegen.arrays import Array, ArrayLike
from cinegen.design.errors import DesignError
from cinegen.model.mechanism import Mechanism
from cinegen.model.plausible import ImplausibleError, check_joint, check_lengths
from raff2urdf.errors import did_you_mean
from raff2urdf.escape import csv_cell, csv_text
from raff2urdf.files import read_bytes
from raff2urdf.quantities import ANGLE, LENGTH, Dimension, QuantityError, has_unit, parse, parse_list, refused_as

COORDINATES = ("x", "y", "z", "rx", "ry", "rz")
"""Of a node's pose, m and rad."""

_DEVICE = re.compile(r"(?P<what>.*\S)\s*@\s*(?P<device>[^\W\d]\w*)")
_TARGET = re.compile(r"[^\W\d]\w*")
_OF_NODE = re.compile(r"(?P<node>[^()]+?)(?:\((?P<point>[^()]*)\))?\.(?P<kind>\w+)(?:\((?P<of>[^()]*)\))?")
_HEADER = re.compile(r"(?P<what>[^\[\]]*?)\s*(?:\[(?P<unit>[^\[\]]*)\])?")
_COMMA = re.compile(r"[-+]?\d+,\d+(?![\d,])")
_SCALES = {LENGTH: {"mm": 1e3, "m": 1.0}, ANGLE: {"deg": math.degrees(1.0), "rad": 1.0}}


@dataclass(frozen=True)
class MeasuredQuantity:
    """One number that a device reads.

    Attributes:
        name: as the header of its column writes it, without the unit.
        kind: `joint`, one of `COORDINATES`, `distance` or `along`.
        of: the joint or the node.
        point: on the node, in its axes, m.
        reference: of a distance the fixed point, m; of `along` the direction, of length 1; in the world's axes.
        dimension: length or angle.
        device: that measures in a frame of its own, whose pose is not known; "" for one that measures in the world's.
        target: that is measured on the node, at a pose that is not known; "" for a known point.
    """

    name: str
    kind: str
    of: str
    point: tuple[float, float, float] = (0.0, 0.0, 0.0)
    reference: tuple[float, float, float] = (0.0, 0.0, 0.0)
    dimension: Dimension = LENGTH
    device: str = ""
    target: str = ""

    @classmethod
    def parse(cls, text: str, mechanism: Mechanism) -> MeasuredQuantity:
        """Return the quantity that the header of a column names.

        Raises:
            DesignError: no such joint, node or quantity; suggests the nearest.
        """
        name = " ".join(text.split())
        if name in mechanism.joints:
            return cls(name, "joint", name, dimension=LENGTH if mechanism.is_prismatic(name) else ANGLE)
        behind = _DEVICE.fullmatch(name)
        device = behind["device"] if behind else ""
        found = _OF_NODE.fullmatch(behind["what"] if behind else name)
        kinds = (*COORDINATES, "distance", "along")
        if found is None:
            known = [*mechanism.joints, *(f"{mechanism.end}.{kind}" for kind in kinds)]
            raise DesignError(
                f"'{name}' is neither a joint ({', '.join(mechanism.joints[:3])} ...) nor NODE.WHAT, such as "
                f"{mechanism.end}.x or {mechanism.end}.distance(1 0 0){did_you_mean(name, known)}"
            )
        node, kind = found["node"].strip(), found["kind"]
        if node not in mechanism.nodes:
            raise DesignError(f"'{name}': {mechanism.name} has no node '{node}'{did_you_mean(node, mechanism.nodes)}")
        if kind not in kinds:
            raise DesignError(f"'{name}': '{kind}' is none of {', '.join(kinds)}{did_you_mean(kind, kinds)}")
        if (found["of"] is not None) != (kind in ("distance", "along")):
            wanted = "a fixed point or a direction in parentheses" if found["of"] is None else "nothing in parentheses"
            raise DesignError(f"'{name}': {kind} takes {wanted}")
        point, target = (0.0, 0.0, 0.0), ""
        if found["point"] is not None and _TARGET.fullmatch(found["point"].strip()):
            target = found["point"].strip()
        elif found["point"] is not None:
            point = _vector(name, found["point"])
        for one in (device, target):
            if one in mechanism.nodes or one in mechanism.joints:
                raise DesignError(
                    f"'{name}': '{one}' is a part of {mechanism.name}: give a device or target its own name"
                )
        reference = _vector(name, found["of"]) if found["of"] is not None else (0.0, 0.0, 0.0)
        if kind == "along":
            size = math.hypot(*reference)
            if size == 0.0:
                raise DesignError(f"'{name}': a direction is not 0 0 0")
            reference = reference[0] / size, reference[1] / size, reference[2] / size
        return cls(name, kind, node, point, reference, ANGLE if kind in ("rx", "ry", "rz") else LENGTH, device, target)


@dataclass(frozen=True, eq=False)
class Measurements:
    """Configurations of a robot, and what was measured there; m and rad.

    Attributes:
        quantities: of the columns.
        values: (poses, columns) readings; NaN where nothing was measured.
        sigmas: (poses, columns) their standard deviations; 0 for exact readings of joints.
        labels: (poses,) names of the poses, for messages.
        source: name of the file, for messages.
    """

    quantities: tuple[MeasuredQuantity, ...]
    values: Array
    sigmas: Array
    labels: tuple[str, ...]
    source: str = "measurements"

    def __len__(self) -> int:
        return len(self.values)

    def __repr__(self) -> str:
        return f"<Measurements: {int(np.isfinite(self.values).sum())} numbers in {len(self)} poses>"

    @classmethod
    def of(cls, mechanism: Mechanism, columns: Iterable[str], values: ArrayLike, sigmas: ArrayLike) -> Measurements:
        """Return measurements from arrays.

        Args:
            mechanism: the robot.
            columns: as headers of the file, without units.
            values: (poses, columns), m and rad, NaN where nothing was measured.
            sigmas: (columns,) or (poses, columns), m and rad; 0 for exact readings of joints.

        Raises:
            DesignError: an unknown column, a wrong shape, a sigma that is missing.
        """
        quantities = tuple(MeasuredQuantity.parse(text, mechanism) for text in columns)
        numbers = np.array(values, dtype=float)
        if numbers.ndim != 2 or numbers.shape[1] != len(quantities):
            raise DesignError(f"values are (poses, {len(quantities)}), not {numbers.shape}")
        spread = np.broadcast_to(np.asarray(sigmas, dtype=float), numbers.shape)
        labels = tuple(str(i) for i in range(1, len(numbers) + 1))
        found = cls(quantities, numbers, np.array(spread), labels)
        for k, one in enumerate(quantities):
            exact = 0.0 if one.kind == "joint" else np.nextafter(0.0, 1.0)
            if not (found.sigmas[np.isfinite(numbers[:, k]), k] >= exact).all():
                raise DesignError(f"{one.name}: give the standard deviation of its errors, in {_unit(one)}")
        return found

    @classmethod
    def load(cls, path: str | Path, mechanism: Mechanism) -> Measurements:
        """Read a CSV file; its fields are separated by commas, semicolons or tabs. `#` begins a comment.

        Raises:
            DesignError: names the line and the column, and what is wrong there.
            raff2urdf.RaffError: the file can't be read.
        """
        return cls.loads(read_bytes(path).decode(errors="replace"), mechanism, str(path))

    @classmethod
    def loads(cls, text: str, mechanism: Mechanism, source: str = "measurements") -> Measurements:
        """Return the measurements of a CSV text; see `load`."""
        rows = _rows(text)
        if not rows:
            raise DesignError(f"{source}: the file is empty; its first line names the columns")
        (line, header), *body = rows
        columns = _columns(header, mechanism, f"{source}, line {line}")
        values, sigmas, labels, lines = list[list[float]](), list[list[float]](), list[str](), list[int]()
        spread = [math.nan] * len(columns)
        for line, cells in body:
            where = f"{source}, line {line}"
            if len(cells) > len(header) and not any(cells[len(header) :]):
                cells = cells[: len(header)]
            if len(cells) != len(header):
                commas = ": write decimal points, not commas" if len(cells) > len(header) else ""
                raise DesignError(f"{where}: {len(cells)} cells, but the header has {len(header)} columns{commas}")
            numbers = [_number(c, one, unit, where) for c, (one, unit) in zip(cells[1:], columns, strict=True)]
            if cells[0].lower() == "sigma":
                for number, (one, _) in zip(numbers, columns, strict=True):
                    if number < 0.0 or (number == 0.0 and one.kind != "joint"):
                        raise DesignError(f"{where}, column {one.name}: a standard deviation is above 0")
                spread = numbers
                continue
            for number, sigma, (one, _) in zip(numbers, spread, columns, strict=True):
                if math.isfinite(number) and not math.isfinite(sigma) and one.kind != "joint":
                    raise DesignError(
                        f"{where}, column {one.name}: no sigma is given: write a line 'sigma,...' above, with the "
                        f"standard deviation of its errors in this column"
                    )
            values.append(numbers)
            sigmas.append([0.0 if one.kind == "joint" and not math.isfinite(s) else s
                           for s, (one, _) in zip(spread, columns, strict=True)])  # fmt: skip
            labels.append(cells[0] or str(len(values)))
            lines.append(line)
        if not values:
            raise DesignError(f"{source}: no poses: each line below the header is one")
        found = cls(tuple(one for one, _ in columns), np.array(values), np.array(sigmas), tuple(labels), source)
        found._check_plausible(mechanism, lines, [bool(unit) for _, unit in columns])
        return found

    def text(self, unit_of_length: str = "mm", unit_of_angle: str = "deg", digits: int = 10) -> str:
        """Return the CSV text: lengths and angles in these units, with a line `sigma` wherever sigmas change."""
        out = io.StringIO()
        writer = csv.writer(out, lineterminator="\n")
        units = [unit_of_angle if one.dimension is ANGLE else unit_of_length for one in self.quantities]
        scales = [_SCALES[one.dimension][unit] for one, unit in zip(self.quantities, units, strict=True)]
        names = [f"{one.name} [{unit}]" for one, unit in zip(self.quantities, units, strict=True)]
        writer.writerow(["pose", *map(csv_cell, names)])

        def cells(numbers: Array) -> list[str]:
            return [f"{s * x:.{digits}g}" if math.isfinite(x) else "" for s, x in zip(scales, numbers, strict=True)]

        last: list[str] | None = None
        for label, values, sigmas in zip(self.labels, self.values, self.sigmas, strict=True):
            spread = cells(np.where(sigmas == 0.0, np.nan, sigmas))
            if spread != last:
                writer.writerow(["sigma", *spread])
                last = spread
            writer.writerow([csv_cell(label), *cells(values)])
        return out.getvalue()

    def cell(self, pose: int, column: int) -> str:
        """Return the position of a number, for messages."""
        return f"pose {self.labels[pose]}, {self.quantities[column].name}"

    def _check_plausible(self, mechanism: Mechanism, lines: Sequence[int], has_units: Sequence[bool]) -> None:
        """Refuse numbers that only fit in another unit."""
        for k, one in enumerate(self.quantities):
            for line, value in zip(lines, self.values[:, k], strict=True):
                try:
                    if one.kind == "joint" and math.isfinite(value):
                        check_joint(mechanism, one.of, [value])
                    elif one.dimension is LENGTH and math.isfinite(value) and not one.device:
                        check_lengths(mechanism, one.name, [value])
                except ImplausibleError as error:
                    written = "" if has_units[k] else f" (the header gives no unit: write {one.name} [{_other(one)}])"
                    raise DesignError(f"{self.source}, line {line}, column {one.name}: {error}{written}") from None


def _rows(text: str) -> list[tuple[int, list[str]]]:
    """Return the lines that hold something, each behind its number, as stripped cells."""
    first = next((line for line in text.splitlines() if line.strip() and not line.lstrip().startswith("#")), "")
    mark = next((mark for mark in ("\t", ";") if mark in first), ",")
    reader = csv.reader(io.StringIO(text.removeprefix("\ufeff")), delimiter=mark, skipinitialspace=True)
    found = []
    for row in reader:
        cells = [csv_text(cell.strip()) for cell in row]
        if any(cells) and not cells[0].startswith("#"):
            found.append((reader.line_num, cells))
    return found


def _columns(header: Sequence[str], mechanism: Mechanism, where: str) -> list[tuple[MeasuredQuantity, str]]:
    """Return the quantities of the columns behind the first one, and their units, "" where none is given."""
    if header[0].lower() != "pose":
        raise DesignError(f"{where}: the first column is 'pose', the names of the poses, not '{header[0]}'")
    columns = list[tuple[MeasuredQuantity, str]]()
    for number, text in enumerate(header[1:], 2):
        at = f"{where}, column {number}"
        found = _HEADER.fullmatch(text)
        if found is None or not found["what"]:
            raise DesignError(f"{at}: '{text}': write a quantity and its unit, such as joint1 [deg]")
        try:
            one = MeasuredQuantity.parse(found["what"], mechanism)
            unit = (found["unit"] or "").strip()
            parse(f"1 {unit}", one.dimension)
        except QuantityError as error:
            text = str(error).replace(f"'1 {unit}'", f"[{unit}]", 1)
            raise DesignError(f"{at}: {one.name}: {text}") from None
        except DesignError as error:
            raise DesignError(f"{at}: {error}") from None
        if one.name in (other.name for other, _ in columns):
            raise DesignError(f"{at}: {one.name} has two columns: a second measurement is another line")
        columns.append((one, unit))
    if not columns:
        raise DesignError(f"{where}: no column but the poses' names")
    return columns


def _number(cell: str, one: MeasuredQuantity, unit: str, where: str) -> float:
    """Return a cell in m or rad; NaN if it is empty."""
    if not cell:
        return math.nan
    try:
        return parse(cell, one.dimension, unit or None)
    except QuantityError as error:
        why = f"'{cell}' has a decimal comma: write {cell.replace(',', '.')}" if _COMMA.match(cell) else str(error)
        raise DesignError(f"{where}, column {one.name}: {why}") from None


def _vector(name: str, text: str) -> tuple[float, float, float]:
    words = text.split()
    if len(words) != 3:
        raise DesignError(f"'{name}': '{text}' is not three numbers, such as (0 0 50mm)")
    with refused_as(DesignError, f"'{name}'"):
        values = parse_list(words, LENGTH)
    if any(not has_unit(word) and abs(value) > 1e3 for word, value in zip(words, values, strict=True)):
        raise DesignError(f"'{name}': '{text}' is in m, which can't be meant: write the unit, such as {words[0]}mm")
    return values[0], values[1], values[2]


def _unit(one: MeasuredQuantity) -> str:
    return "m" if one.dimension is LENGTH else "rad"


def _other(one: MeasuredQuantity) -> str:
    return "mm" if one.dimension is LENGTH else "rad"
