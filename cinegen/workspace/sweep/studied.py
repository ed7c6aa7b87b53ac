"""`studied`: one variant: loaded, mapped, and judged inside the wanted box."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cinegen.errors import ClosureError
from cinegen.model.load import load
from cinegen.workspace.errors import MapError
from cinegen.workspace.extent import extent
from cinegen.workspace.make import Say, make_map
from cinegen.workspace.region import Region
from cinegen.workspace.specification import MapSpecification
from cinegen.workspace.sweep.box import Box
from cinegen.workspace.sweep.dexterity import dexterity
from cinegen.workspace.sweep.field import Field
from cinegen.workspace.sweep.regular import regularity
from cinegen.workspace.sweep.table import Row

_NEEDED = ("sigma_1", "sigma_2", "condition")


@dataclass(frozen=True)
class Plan:
    """What is done with each variant.

    Attributes:
        region: of all maps.
        box: that is wanted.
        robot: of a file that holds several.
        settings: others of `MapSpecification`.
    """

    region: Region
    box: Box
    robot: str | None
    settings: dict[str, Any]

    def spec(self, path: Path) -> MapSpecification:
        """Of a variant's RAFF file.

        Raises:
            ClosureError: its loops can't be closed.
            MapError: settings that make no sense for it.
        """
        settings = {**self.settings, "quantities": (*_NEEDED, *self.settings.get("quantities", ()))}
        return MapSpecification(load(path, self.robot), self.region, **settings)

    def check(self, path: Path) -> None:
        """Whether it makes sense for the robot as it is, if that can be said.

        Raises:
            MapError: it does not.
            UnknownNameError: no such node.
        """
        self.box.cells(self.region)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # each variant has its own
            try:
                self.spec(path)
            except ClosureError:
                return


def studied(
    plan: Plan, name: str, values: dict[str, float], folder: Path, scheduler: str | None = None, say: Say | None = None
) -> Row:
    """The row of a variant.

    Args:
        plan: what is done.
        name: of the variant.
        values: that it has.
        folder: where its robot.raff is, and its map.zarr will be.
        scheduler: that helps, as of `make_map`; this process alone does it else.
        say: as of `make_map`.

    Raises:
        MapError: the map can't be made.
    """
    with warnings.catch_warnings(record=True) as warned:
        warnings.simplefilter("always")
        try:
            spec = plan.spec(folder / "robot.raff")
        except ClosureError as error:
            return Row(name, values, remark=_words("\n".join(problem.message for problem in error.problems)))
        except MapError as error:
            return Row(name, values, remark=_words(str(error)))
    dataset = make_map(spec, folder / "map.zarr", workers=1, scheduler=scheduler, say=say)
    lattice = plan.box.lattice(plan.region)
    touched = dataset["configuration"].isel(dict(zip(plan.region.names, lattice.cells, strict=True)))
    field = Field(spec, lattice, touched.values)
    return Row(
        name,
        values,
        extent(dataset),
        spec.mechanism.length,
        dexterity(field),
        regularity(field) if field.parts else None,
        "; ".join(_words(str(warning.message)) for warning in warned),
    )


def _words(text: str) -> str:
    """On one line."""
    return "; ".join(" ".join(line.split()) for line in text.splitlines() if line.strip())
