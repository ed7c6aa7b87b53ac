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
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from cinegen.arrays import Array, ArrayLike
from cinegen.design.errors import DesignError
from cinegen.errors import read_all
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
_IN_ROUND_BRACKETS = re.compile(r"(?P<what>.*\S)\s*\((?P<unit>[^()\s]+)\)")
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
        match = _OF_NODE.fullmatch(behind["what"] if behind else name)
        kinds = (*COORDINATES, "distance", "along")
        if match is None:
            known = [*mechanism.joints, *(f"{mechanism.end}.{kind}" for kind in kinds)]
            raise DesignError(
                f"'{name}' is neither a joint ({', '.join(mechanism.joints[:3])} ...) nor NODE.WHAT, such as "
                f"{mechanism.end}.x or {mechanism.end}.distance(1 0 0){did_you_mean(name, known)}"
            )
        node, kind = match["node"].strip(), match["kind"]
        if node not in mechanism.nodes:
            raise DesignError(f"'{name}': {mechanism.name} has no node '{node}'{did_you_mean(node, mechanism.nodes)}")
        if kind not in kinds:
            raise DesignError(f"'{name}': unknown quantity '{kind}'{did_you_mean(kind, kinds)}")
        if (match["of"] is not None) != (kind in ("distance", "along")):
            wanted = "a fixed point or a direction in parentheses" if match["of"] is None else "nothing in parentheses"
            raise DesignError(f"'{name}': {kind} takes {wanted}")
        point, target = (0.0, 0.0, 0.0), ""
        if match["point"] is not None and _TARGET.fullmatch(match["point"].strip()):
            target = match["point"].strip()
        elif match["point"] is not None:
            point = _vector(name, match["point"])
        for each in (device, target):
            if each in mechanism.nodes or each in mechanism.joints:
                raise DesignError(
                    f"'{name}': '{each}' is a part of {mechanism.name}: give a device or target its own name"
                )
        reference = _vector(name, match["of"]) if match["of"] is not None else (0.0, 0.0, 0.0)
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
        measurements = cls(quantities, numbers, np.array(spread), labels)
        for k, quantity in enumerate(quantities):
            exact = 0.0 if quantity.kind == "joint" else np.nextafter(0.0, 1.0)
            if not (measurements.sigmas[np.isfinite(numbers[:, k]), k] >= exact).all():
                raise DesignError(f"{quantity.name}: give the standard deviation of its errors, in {_unit(quantity)}")
        return measurements

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
        columns = dict[str, _Column]()
        lines = _Lines(source, len(header), columns)
        where = f"{source}, line {line}"
        reads = {
            "header": partial(_check_header, header, where),
            "columns": partial(_read_columns, header, mechanism, where, columns),
        }
        read_all(reads | {str(line): partial(lines.read, line, cells) for line, cells in body}, DesignError)
        if not lines.labels:
            raise DesignError(f"{source}: no poses: each line below the header is one")
        quantities = tuple(quantity for quantity, _ in columns.values())
        measurements = cls(quantities, np.array(lines.values), np.array(lines.sigmas), tuple(lines.labels), source)
        has_units = [bool(unit) for _, unit in columns.values()]
        checks = (partial(measurements._check_plausible, mechanism, lines.numbers, *of) for of in enumerate(has_units))
        read_all((("", check) for check in checks), DesignError)
        return measurements

    def text(self, unit_of_length: str = "mm", unit_of_angle: str = "deg", digits: int = 10) -> str:
        """Return the CSV text: lengths and angles in these units, with a line `sigma` wherever sigmas change."""
        out = io.StringIO()
        writer = csv.writer(out, lineterminator="\n")
        units = [unit_of_angle if quantity.dimension is ANGLE else unit_of_length for quantity in self.quantities]
        scales = [_SCALES[quantity.dimension][unit] for quantity, unit in zip(self.quantities, units, strict=True)]
        names = [f"{quantity.name} [{unit}]" for quantity, unit in zip(self.quantities, units, strict=True)]
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

    def _check_plausible(self, mechanism: Mechanism, lines: Sequence[int], column: int, has_unit: bool) -> None:
        """Refuse the first number of a column that only fits in another unit."""
        quantity = self.quantities[column]
        for line, value in zip(lines, self.values[:, column], strict=True):
            try:
                if quantity.kind == "joint" and math.isfinite(value):
                    check_joint(mechanism, quantity.of, [value])
                elif quantity.dimension is LENGTH and math.isfinite(value) and not quantity.device:
                    check_lengths(mechanism, quantity.name, [value])
            except ImplausibleError as error:
                written = "" if has_unit else f" (the header gives no unit: write {quantity.name} [{_other(quantity)}])"
                raise DesignError(f"{self.source}, line {line}, column {quantity.name}: {error}{written}") from None


_Column = tuple[MeasuredQuantity, str]
"""A quantity, and the unit of its column, "" where none is given."""


class _Lines:
    """Lines below the header, as they are read.

    Args:
        source: name of the file.
        width: number of cells in the header.
        columns: those that could be read, by the numbers of their cells.

    Attributes:
        values: readings of each line; NaN where nothing was measured.
        sigmas: their standard deviations.
        labels: names of the poses.
        numbers: of the lines in the file.
    """

    def __init__(self, source: str, width: int, columns: Mapping[str, _Column]) -> None:
        self.values, self.sigmas = list[list[float]](), list[list[float]]()
        self.labels, self.numbers = list[str](), list[int]()
        self._source, self._width, self._columns = source, width, columns
        self._spread: dict[str, float] = {}

    def read(self, line: int, cells: list[str]) -> None:
        """Read a line.

        Raises:
            DesignError: names the columns, and what is wrong there.
        """
        where = f"{self._source}, line {line}"
        cells = cells[: self._width] if not any(cells[self._width :]) else cells
        if len(cells) != self._width:
            commas = ": write decimal points, not commas" if len(cells) > self._width else ""
            raise DesignError(f"{where}: {len(cells)} cells, but the header has {self._width} columns{commas}")
        is_sigma, numbers = cells[0].lower() == "sigma", dict[str, float]()
        read = self._sigma if is_sigma else self._reading
        try:
            read_all({at: partial(read, at, cells[int(at)], where) for at in self._columns}, DesignError, numbers)
        finally:
            if is_sigma:
                self._spread = dict.fromkeys(self._columns, 1.0) | numbers  # of one that can't be read it is given
        if not is_sigma:
            self.values.append([*numbers.values()])
            self.sigmas.append([self._spread.get(at, 0.0) for at in self._columns])
            self.labels.append(cells[0] or str(len(self.values)))
            self.numbers.append(line)

    def _sigma(self, at: str, cell: str, where: str) -> float:
        quantity, unit = self._columns[at]
        number = _number(cell, quantity, unit, where)
        if number < 0.0 or (number == 0.0 and quantity.kind != "joint"):
            raise DesignError(f"{where}, column {quantity.name}: a standard deviation is above 0")
        return 0.0 if quantity.kind == "joint" and math.isnan(number) else number

    def _reading(self, at: str, cell: str, where: str) -> float:
        quantity, unit = self._columns[at]
        number = _number(cell, quantity, unit, where)
        if math.isfinite(number) and quantity.kind != "joint" and not math.isfinite(self._spread.get(at, math.nan)):
            self._spread[at] = 1.0  # the same is wrong with the lines below
            raise DesignError(
                f"{where}, column {quantity.name}: no sigma is given: write a line 'sigma,...' above, with the "
                f"standard deviation of its errors in this column"
            )
        return number


def _rows(text: str) -> list[tuple[int, list[str]]]:
    """Return the lines that hold something, each behind its number, as stripped cells."""
    first = next((line for line in text.splitlines() if line.strip() and not line.lstrip().startswith("#")), "")
    mark = next((mark for mark in ("\t", ";") if mark in first), ",")
    reader = csv.reader(io.StringIO(text.removeprefix("\ufeff")), delimiter=mark, skipinitialspace=True)
    rows = []
    for row in reader:
        cells = [csv_text(cell.strip()) for cell in row]
        if any(cells) and not cells[0].startswith("#"):
            rows.append((reader.line_num, cells))
    return rows


def _check_header(header: Sequence[str], where: str) -> None:
    if header[0].lower() != "pose":
        raise DesignError(f"{where}: the first column is 'pose', the names of the poses, not '{header[0]}'")
    if not header[1:]:
        raise DesignError(f"{where}: no column but the poses' names")


def _read_columns(header: Sequence[str], mechanism: Mechanism, where: str, columns: dict[str, _Column]) -> None:
    """Read the columns behind the first one, by the numbers of their cells.

    Raises:
        DesignError: names the columns that can't be read.
    """

    def column(text: str, at: str) -> _Column:
        match = _HEADER.fullmatch(text)
        if match is None or not match["what"]:
            raise DesignError(f"{at}: '{text}': write a quantity and its unit, such as joint1 [deg]")
        try:
            quantity = MeasuredQuantity.parse(match["what"], mechanism)
            unit = (match["unit"] or "").strip()
            parse(f"1 {unit}", quantity.dimension)
        except QuantityError as error:
            text = str(error).replace(f"'1 {unit}'", f"[{unit}]", 1)
            raise DesignError(f"{at}: {quantity.name}: {text}") from None
        except DesignError as error:
            of, why = _IN_ROUND_BRACKETS.fullmatch(text), str(error)
            if of and any(of["unit"] in dimension.units for dimension in _SCALES):
                why = f"'{text}': write the unit in square brackets: {of['what']} [{of['unit']}]"
            raise DesignError(f"{at}: {why}") from None
        if quantity.name in (other.name for other, _ in columns.values()):
            raise DesignError(f"{at}: {quantity.name} has two columns: a second measurement is another line")
        return quantity, unit

    cells = enumerate(header[1:], 1)
    read_all(((str(k), partial(column, text, f"{where}, column {k + 1}")) for k, text in cells), DesignError, columns)


def _number(cell: str, quantity: MeasuredQuantity, unit: str, where: str) -> float:
    """Return a cell in m or rad; NaN if it is empty."""
    if not cell:
        return math.nan
    try:
        return parse(cell, quantity.dimension, unit or None)
    except QuantityError as error:
        why = f"'{cell}' has a decimal comma: write {cell.replace(',', '.')}" if _COMMA.match(cell) else str(error)
        raise DesignError(f"{where}, column {quantity.name}: {why}") from None


def _vector(name: str, text: str) -> tuple[float, float, float]:
    words = text.split()
    if len(words) != 3:
        raise DesignError(f"'{name}': '{text}' is not three numbers, such as (0 0 50mm)")
    with refused_as(DesignError, f"'{name}'"):
        values = parse_list(words, LENGTH)
    if any(not has_unit(word) and abs(value) > 1e3 for word, value in zip(words, values, strict=True)):
        raise DesignError(f"'{name}': '{text}' is in m, which can't be meant: write the unit, such as {words[0]}mm")
    return values[0], values[1], values[2]


def _unit(quantity: MeasuredQuantity) -> str:
    return "m" if quantity.dimension is LENGTH else "rad"


def _other(quantity: MeasuredQuantity) -> str:
    return "mm" if quantity.dimension is LENGTH else "rad"
