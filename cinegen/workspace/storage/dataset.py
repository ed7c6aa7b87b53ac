"""`specification_of`: what a map that was opened says of itself; `held`: a map of fewer axes that is in it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING

from cinegen.workspace.errors import MapError
from cinegen.workspace.specification import MapSpecification

if TYPE_CHECKING:
    import xarray


_ATTRIBUTES = ("specification", "source", "folder")


def specification_of(dataset: xarray.Dataset) -> MapSpecification:
    """The specification that a map was made of; its robot is built from the texts in it, once.

    Args:
        dataset: as `open_map` and `make_map` return it, whole.

    Raises:
        MapError: it is no map, or only a part of one.
    """
    try:
        spec = _survey(*(str(dataset.attrs[name]) for name in _ATTRIBUTES))
    except KeyError:
        raise MapError("this dataset is no map: give what open_map or make_map returned") from None
    shape = tuple(dataset.sizes.get(name, 0) for name in spec.region.names)
    if shape != spec.region.shape:
        raise MapError(
            f"this is a part of a map, {' x '.join(map(str, shape))} of its {' x '.join(map(str, spec.region.shape))}"
            " cells: give all of it, and say with a condition where you mean"
        )
    return spec


def held(
    dataset: xarray.Dataset, spec: MapSpecification, cells: Mapping[str, int]
) -> tuple[xarray.Dataset, MapSpecification]:
    """The part of a map in which some axes stay in one cell, and the specification that would have made it.

    Args:
        dataset: a map.
        specification: of it.
        cells: the number of the cell by the axis' name; one axis at least must be left.

    Raises:
        MapError: none is left.
    """
    region = spec.region
    at = dict(region.at)
    at.update({axis.name: float(axis.middles()[cells[axis.name]]) for axis in region.axes if axis.name in cells})
    left = tuple(axis for axis in region.axes if axis.name not in cells)
    return dataset.isel(cells), replace(spec, region=replace(region, axes=left, at=at))


@lru_cache(maxsize=4)
def _survey(*attributes: str) -> MapSpecification:
    return MapSpecification.of_attributes(dict(zip(_ATTRIBUTES, attributes, strict=True)))
