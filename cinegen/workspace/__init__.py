"""Maps: where a mechanism reaches, how well, and where it fails."""

from __future__ import annotations

from typing import TYPE_CHECKING

from cinegen.lazy import lazy_names

if TYPE_CHECKING:
    from cinegen.workspace.errors import MapError as MapError
    from cinegen.workspace.make import make_map as make_map
    from cinegen.workspace.make import open_map as open_map
    from cinegen.workspace.quantities import QUANTITIES as QUANTITIES
    from cinegen.workspace.region import GridAxis as GridAxis
    from cinegen.workspace.region import Region as Region
    from cinegen.workspace.region import straight as straight
    from cinegen.workspace.settled import How as How
    from cinegen.workspace.specification import MapSpecification as MapSpecification

__all__, __getattr__, __dir__ = lazy_names(
    __name__,
    {
        "cinegen.workspace.errors": ["MapError"],
        "cinegen.workspace.make": ["make_map", "open_map"],
        "cinegen.workspace.quantities": ["QUANTITIES"],
        "cinegen.workspace.region": ["GridAxis", "Region", "straight"],
        "cinegen.workspace.settled": ["How"],
        "cinegen.workspace.specification": ["MapSpecification"],
    },
)
