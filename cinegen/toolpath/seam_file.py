"""`open_seam`: a seam by its URL, `seam:FILE?options`: a file of points and normals, and how the tool moves along them.

The file is CSV: a line with the names of the columns, then a line for each point. x, y, z are in mm, in the world; nx,
ny, nz is the normal of the surface, of any length but 0. Other columns, and comments after `#`, are ignored.

Options are separated by `&`: lengths in mm, angles in degrees, speeds in mm/s and degrees/s, times in s.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cinegen.sensor import SensorError
from cinegen.toolpath.curve import PointError
from cinegen.toolpath.seam import AGAIN, Seam
from raff2urdf.errors import did_you_mean

Array = NDArray[np.float64]

_MM, _DEGREE = 1e-3, math.radians(1.0)

OPTIONS: Mapping[str, float] = {
    "distance": _MM,
    "work": _DEGREE,
    "travel": _DEGREE,
    "speed": _MM,
    "roll": _DEGREE,
    "approach": _MM,
    "turning": _DEGREE,
    "ramp": 1.0,
    "wait": 1.0,
}
"""Options with a number, and their units in SI; `again` takes a word."""

_COLUMNS = ("x", "y", "z", "nx", "ny", "nz")


def open_seam(url: str) -> Seam:
    """Return a seam by its URL, such as `seam:weld.csv?distance=10&speed=20`.

    Raises:
        SensorError: the URL or the file is wrong; gives the line.
    """
    name, _, query = url.removeprefix("seam:").partition("?")
    if not name:
        raise SensorError(f"'{url}': write seam:FILE.csv, a file of points and normals")
    points, normals, lines = read_points(name)
    try:
        return Seam(points, normals, **_options(query), url=f"seam:{name}")
    except PointError as error:
        raise SensorError(f"{name}:{lines[error.index]}: {error.message}") from None
    except SensorError as error:
        raise SensorError(f"'{url}': {error}") from None


def read_points(path: str | Path) -> tuple[Array, Array, list[int]]:
    """Return points (n, 3) m, normals (n, 3) and the numbers of their lines (n,), from 1.

    Raises:
        SensorError: the file can't be read, or is wrong; gives the line.
    """
    try:
        text = Path(path).read_text(encoding="utf-8-sig")
    except OSError as error:
        raise SensorError(f"{path}: can't be read: {(error.strerror or str(error)).lower()}") from None
    except UnicodeDecodeError:
        raise SensorError(f"{path}: is not UTF-8 text") from None
    where, width, rows, lines = list[int](), 0, list[list[float]](), list[int]()  # where: positions of the columns
    for number, line in enumerate((line.partition("#")[0] for line in text.splitlines()), 1):
        if not line.strip():
            continue
        try:
            cells = [cell.strip() for cell in next(csv.reader([line]))]
            if not where:
                where, width = _header(cells), len(cells)
                continue
            if len(cells) != width:
                raise SensorError(f"{len(cells)} value{'s' * (len(cells) != 1)}, but {width} columns are named")
            rows.append([_number(cells[i], name) for i, name in zip(where, _COLUMNS, strict=True)])
        except (SensorError, csv.Error) as error:
            raise SensorError(f"{path}:{number}: {error}") from None
        lines.append(number)
    if not where:
        raise SensorError(f"{path}: is empty; begin it with a line x,y,z,nx,ny,nz")
    values = np.array(rows).reshape(-1, 6)
    return _MM * values[:, :3], values[:, 3:], lines


def _header(cells: list[str]) -> list[int]:
    """Return the positions of the columns."""
    names = [cell.lower() for cell in cells]
    for name in _COLUMNS:
        if name not in names:
            raise SensorError(f"no column '{name}'; the first line names the columns: x,y,z,nx,ny,nz")
        if names.count(name) > 1:
            raise SensorError(f"two columns '{name}'")
    return [names.index(name) for name in _COLUMNS]


def _number(text: str, name: str) -> float:
    try:
        value = float(text)
    except ValueError:
        raise SensorError(f"{name}: '{text[:40]}' is not a number") from None
    if not math.isfinite(value):
        raise SensorError(f"{name}: '{text[:40]}' is not finite")
    return value


def _options(query: str) -> dict[str, Any]:
    """Return the options of a URL, in SI."""
    found: dict[str, Any] = {}
    for name, _, value in (text.partition("=") for text in query.split("&") if text):
        if name in found:
            raise SensorError(f"{name} is given twice")
        if name in OPTIONS:
            found[name] = OPTIONS[name] * _number(value, name)
        elif name != "again":
            raise SensorError(f"unknown option '{name}'{did_you_mean(name, (*OPTIONS, 'again'))}")
        elif value not in AGAIN:
            raise SensorError(f"unknown value '{value}' of again{did_you_mean(value, AGAIN)}")
        else:
            found[name] = value
    return found
