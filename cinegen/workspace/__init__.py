"""Maps: where a mechanism reaches, how well, and where it fails."""

from cinegen.workspace.errors import MapError
from cinegen.workspace.make import make_map, open_map
from cinegen.workspace.quantities import QUANTITIES
from cinegen.workspace.region import GridAxis, Region, straight
from cinegen.workspace.settled import How
from cinegen.workspace.specification import MapSpecification

__all__ = [
    "QUANTITIES",
    "GridAxis",
    "How",
    "MapError",
    "MapSpecification",
    "Region",
    "make_map",
    "open_map",
    "straight",
]
