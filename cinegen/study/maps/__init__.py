"""Maps: where a mechanism reaches, how well, and where it fails."""

from cinegen.study.maps.errors import MapError
from cinegen.study.maps.make import make_map, open_map
from cinegen.study.maps.quantities import QUANTITIES
from cinegen.study.maps.region import GridAxis, Region, straight
from cinegen.study.maps.settled import How
from cinegen.study.maps.survey import Survey

__all__ = ["QUANTITIES", "GridAxis", "How", "MapError", "Region", "Survey", "make_map", "open_map", "straight"]
