"""The summary of a map, as text and for JSON."""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING, Any

from cinegen.cli.files import unchecked_links
from cinegen.cli.numbers import UNITS, dimension_of
from raff2urdf.quantities import LENGTH, NUMBER, shown, shown_unit

if TYPE_CHECKING:
    import xarray

    from cinegen.workspace import MapSpecification


_WIDTH = 100  # columns of text


_ROUNDING = 1e-9  # relative error of a sum over cells


REACTIONS = ("reaction_force", "reaction_moment")


def summary(dataset: xarray.Dataset, spec: MapSpecification) -> dict[str, Any]:
    """Return the summary of a map for JSON: m, rad and sr; null for values without bound."""
    import numpy as np

    from cinegen.workspace import CellStatus
    from cinegen.workspace.extent import extent
    from cinegen.workspace.loads import left_out, notes

    counts = np.bincount(dataset["status"].values.ravel(), minlength=len(CellStatus))
    measured = extent(dataset)
    quantities = dict[str, dict[str, Any]]()
    for name in spec.quantities:
        values = dataset[name].values[dataset["reachable"].values].astype(float)
        values = values[~np.isnan(values)]
        if len(values):
            three = {"min": values.min(), "median": np.median(values), "max": values.max()}
            quantities[name] = {
                "unit": dataset[name].attrs["units"],
                **{key: float(value) if np.isfinite(value) else None for key, value in three.items()},
            }
            quantities[name]["undetermined"] = list(left_out(spec, name)) if name in REACTIONS else []
    return {
        "robot": spec.mechanism.name,
        "node": spec.node,
        "over": {axis.name: [axis.low, axis.high, axis.count] for axis in spec.region.axes},
        "at": dict(spec.region.at),
        "cells": spec.region.size,
        "reachable": int(dataset["reachable"].values.sum()),
        "status": {status.label: int(number) for status, number in zip(CellStatus, counts, strict=True) if number},
        "checked": "joint limits in each cell, not between cells"
        + ("" if spec.over_joints and not spec.mechanism.loops else "; branches by continuation, not proved"),
        "quantities": quantities,
        **({} if spec.scene is None else {"not_checked": dict(spec.mechanism.unchecked_links)}),
        "notes": notes(spec, spec.quantities),
        "extent": {"value": measured.value, "error": measured.error, "unit": measured.unit},
    }


def summary_lines(name: str, spec: MapSpecification, result: dict[str, Any]) -> list[str]:
    """Return the summary as lines of text."""
    shape = " x ".join(map(str, spec.region.shape))
    what = f"{name}: {shape} cells over {', '.join(spec.region.names)}"
    if spec.region.at:
        what += f", at {', '.join(_coordinate(spec, key, value) for key, value in spec.region.at.items())}"
    if not spec.over_joints:
        orientation = {0: "free", 2: "of its z axis given", 3: "given"}[spec.rotation]
        what += f"; of {spec.node}, orientation {orientation}"
    share = 100.0 * result["reachable"] / result["cells"]
    measured = result["extent"]
    scale, unit = shown_unit(measured["unit"])
    error = f" ± {scale * measured['error']:.2g}" if measured["error"] > _ROUNDING * measured["value"] else ""
    size = f"{scale * measured['value']:.4g}{error} {unit}"
    lines = [
        *textwrap.wrap(what, _WIDTH, subsequent_indent="  "),
        f"  reachable       {size}, {share:.3g} % of the region",
        *textwrap.wrap(f"  status          {counts_of(result)}", _WIDTH, subsequent_indent=" " * 18),
    ]
    lines += textwrap.wrap(f"  checked         {result['checked']}", _WIDTH, subsequent_indent=" " * 18)
    if spec.scene is not None and (lost := unchecked_links(spec.mechanism)):
        lines += textwrap.wrap(f"  clearance       {lost}", _WIDTH, subsequent_indent=" " * 18)
    for quantity, values in result["quantities"].items():
        scale, unit = (1.0, "") if values["unit"] == "1" else shown_unit(values["unit"])
        three = ", ".join(
            f"{key} {'unbounded' if values[key] is None else f'{scale * values[key]:.3g}'}"
            for key in ("min", "median", "max")
        )
        more = f", along {', '.join(f'{x:.3g}' for x in spec.along)}" if quantity in ("velocity", "force") else ""
        if quantity in REACTIONS:
            more, left = f", in {spec.reaction}", ", ".join(values["undetermined"])
            more += f", without {left}, which statics does not determine" if left else ""
        lines += textwrap.wrap(f"  {quantity:<15} {three} {unit}".rstrip() + more, _WIDTH, subsequent_indent=" " * 18)
    lines += [line for note in result["notes"] for line in textwrap.wrap(f"  note: {note}", _WIDTH)]
    return lines


def counts_of(result: dict[str, Any]) -> str:
    """Return the number of cells of each status, as text."""
    return ", ".join(f"{number:,} {how}" for how, number in result["status"].items())


def _coordinate(spec: MapSpecification, name: str, value: float) -> str:
    return f"{name} = {shown(value, dimension_of(spec.mechanism, name) or NUMBER)}"


def node_at_home(spec: MapSpecification) -> str:
    """Return where the node is at home: mistaken units and frames are common."""
    home = (round(float(value), 6) for value in spec.home.translation)
    position = ", ".join(f"{name} = {shown(value, LENGTH)}" for name, value in zip("xyz", home, strict=True))
    return f"At home {spec.node} is at {position}; numbers are {UNITS}"
