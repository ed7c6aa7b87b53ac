"""Maps: where a robot reaches, how well, and where it is singular."""

from __future__ import annotations

from typing import TYPE_CHECKING

from raff2urdf.lazy import lazy_names

if TYPE_CHECKING:
    from cinegen.workspace.cells import CellStatus as CellStatus
    from cinegen.workspace.errors import MapError as MapError
    from cinegen.workspace.maps import make_map as make_map
    from cinegen.workspace.maps import open_map as open_map
    from cinegen.workspace.quantities import QUANTITIES as QUANTITIES
    from cinegen.workspace.region import GridAxis as GridAxis
    from cinegen.workspace.region import Region as Region
    from cinegen.workspace.region import line_region as line_region
    from cinegen.workspace.specification import MapSpecification as MapSpecification

__all__, __getattr__, __dir__ = lazy_names(__name__)
