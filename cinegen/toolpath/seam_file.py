"""`open_seam`: a seam by its URL, `seam:FILE?options`: a file of points and normals, and how the tool moves along them.

The file is CSV: a line with the names of the columns, then a line for each point. x, y, z are in the world, in m or in
the unit behind the name or the number (`x [mm]`, `250 mm`); nx, ny, nz is the normal of the surface, of any length but
0. Other columns, and comments after `#`, are ignored.

Options are separated by `&`: lengths in m, angles in degrees, speeds in m/s and degrees/s, times in s, or with a unit.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from cinegen.arrays import Array
from cinegen.errors import read_all
from cinegen.model import Mechanism
from cinegen.model.plausible import ImplausibleError, check_lengths
from cinegen.sensor import SensorError
from cinegen.toolpath.curve import PointError
from cinegen.toolpath.seam import AGAIN, Seam
from raff2urdf.errors import RaffError, counted, did_you_mean, raised_as
from raff2urdf.files import read_bytes
from raff2urdf.quantities import ANGLE, ANGULAR_SPEED, LENGTH, NUMBER, SPEED, TIME, Dimension, parse, refused_as, shown

OPTIONS: Mapping[str, Dimension] = {
    "distance": LENGTH,
    "work": ANGLE,
    "travel": ANGLE,
    "speed": SPEED,
    "roll": ANGLE,
    "approach": LENGTH,
    "turning": ANGULAR_SPEED,
    "ramp": TIME,
    "wait": TIME,
}
"""Options with a number, and their dimensions; `again` takes a word."""

_COLUMNS = ("x", "y", "z", "nx", "ny", "nz")
_FAR = 5.0
"""Multiple of the seam's length, or of `_SHORT`, beyond which a distance, or a distance in 1 s, can't be meant."""
_SHORT = 0.2  # m


def open_seam(url: str, mechanism: Mechanism | None = None) -> Seam:
    """Return a seam by its URL, such as `seam:weld.csv?distance=10mm&speed=20mm/s`.

    Args:
        url: of the seam.
        mechanism: robot whose reach the points are compared with, if it is known.

    Raises:
        SensorError: the URL or the file is wrong; gives the line. Or a number would fit in mm only.
    """
    name, _, query = url.removeprefix("seam:").partition("?")
    if not name:
        raise SensorError(f"'{url}': write seam:FILE.csv, a file of points and normals")
    points, normals, lines = read_points(name)
    try:
        options = _options(query)
        seam = Seam(points, normals, **options, url=f"seam:{name}")
        _check_plausible(name, points, options, seam.length, mechanism)
        return seam
    except PointError as error:
        raise SensorError(f"{name}:{lines[error.index]}: {error.message}") from None
    except SensorError as error:
        raise SensorError(f"'{url}': {error}") from None


def read_points(path: str | Path) -> tuple[Array, Array, list[int]]:
    """Return points (n, 3) m, normals (n, 3) and the numbers of their lines (n,), from 1.

    Raises:
        SensorError: the file can't be read, or is wrong; gives all such lines.
    """
    try:
        text = read_bytes(path).decode("utf-8-sig")
    except RaffError as error:
        raise SensorError(str(error)) from None
    except UnicodeDecodeError:
        raise SensorError(f"{path}: is not UTF-8 text") from None
    where, units, width = list[int](), list[str](), 0  # positions of the columns, and their units
    rows, lines = list[list[float]](), list[int]()

    def read(number: int, line: str) -> None:
        nonlocal where, units, width
        try:
            cells = [cell.strip() for cell in next(csv.reader([line]))]
            if not width:
                width = len(cells)
                where, units = _header(cells)
            elif len(cells) != width:
                raise SensorError(f"{counted(len(cells), 'value')}, but {width} columns are named")
            elif where:
                columns = zip(where, _COLUMNS, units, strict=True)
                reads = (
                    (name, partial(_number, cells[i], name, LENGTH if unit else NUMBER, unit))
                    for i, name, unit in columns
                )
                rows.append([*read_all(reads, SensorError).values()])
                lines.append(number)
        except (SensorError, csv.Error) as error:
            raise SensorError("\n".join(f"{path}:{number}: {why}" for why in str(error).split("\n"))) from None

    texts = enumerate((line.partition("#")[0] for line in text.splitlines()), 1)
    read_all((("", partial(read, *of)) for of in texts if of[1].strip()), SensorError)
    if not where:
        raise SensorError(f"{path}: is empty; begin it with a line x,y,z,nx,ny,nz")
    values = np.array(rows).reshape(-1, 6)
    return values[:, :3], values[:, 3:], lines


def _check_plausible(
    name: str, points: Array, options: Mapping[str, Any], length: float, mechanism: Mechanism | None
) -> None:
    """Refuse lengths that would fit in mm only."""
    most = _FAR * max(length, _SHORT)
    for option in ("distance", "approach", "speed"):
        value = abs(options.get(option, 0.0))
        if most < value <= 1000.0 * most:
            unit = "mm/s" if option == "speed" else "mm"
            raise SensorError(
                f"{option}: {shown(value, OPTIONS[option])}, for a seam of {shown(length, LENGTH)}: did you mean "
                f"{option}={value:g}{unit}?"
            )
    if mechanism is not None:
        with raised_as(SensorError, ImplausibleError, "", " Then name the columns x [mm], y [mm], z [mm]"):
            check_lengths(mechanism, name, points.ravel().tolist())


def _header(cells: list[str]) -> tuple[list[int], list[str]]:
    """Return the positions of the columns, and their units: m unless named, none of normals.

    Raises:
        SensorError: a column is missing, named twice, or has an unknown unit.
    """
    split = [re.fullmatch(r"(\w+)\s*[\[(]\s*(\S+?)\s*[\])]", cell) for cell in cells]
    names = [cell.lower() if named is None else named[1].lower() for cell, named in zip(cells, split, strict=True)]

    def check(name: str) -> None:
        if name not in names:
            raise SensorError(f"no column '{name}'; the first line names the columns: x,y,z,nx,ny,nz")
        if names.count(name) > 1:
            raise SensorError(f"two columns '{name}'")

    read_all({name: partial(check, name) for name in _COLUMNS}, SensorError)
    where = [names.index(name) for name in _COLUMNS]
    chosen = [split[i] for i in where]
    units = ["m" if named is None else named[2] for named in chosen[:3]]
    for name, unit in zip(_COLUMNS, units, strict=False):
        if unit not in LENGTH.units:
            raise SensorError(f"column '{name}': '{unit}' is not a unit of length ({LENGTH.shown})")
    return where, [*units, "", "", ""]


def _number(text: str, name: str, dimension: Dimension, unit: str = "") -> float:
    with refused_as(SensorError, name):
        return parse(text, dimension, unit or None)


def _options(query: str) -> dict[str, Any]:
    """Return the options of a URL, in SI."""
    options: dict[str, Any] = {}
    for name, _, value in (text.partition("=") for text in query.split("&") if text):
        if name in options:
            raise SensorError(f"{name} is given twice")
        if name in OPTIONS:
            options[name] = _number(value, name, OPTIONS[name])
        elif name != "again":
            raise SensorError(f"unknown option '{name}'{did_you_mean(name, (*OPTIONS, 'again'))}")
        elif value not in AGAIN:
            raise SensorError(f"unknown value '{value}' of again{did_you_mean(value, AGAIN)}")
        else:
            options[name] = value
    return options
