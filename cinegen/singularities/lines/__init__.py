"""Lines in Pluecker coordinates, and the geometry of lines that are dependent (Grassmann)."""

from cinegen.singularities.lines.dependence import Dependence
from cinegen.singularities.lines.dependent_set import DependentSet
from cinegen.singularities.lines.frame import Frame, Plane, Point
from cinegen.singularities.lines.grassmann import classify, near, nearness
from cinegen.singularities.lines.incidence import common_plane, common_point
from cinegen.singularities.lines.line import (
    Line,
    LineAtInfinity,
    LineError,
    angle,
    are_coplanar,
    are_parallel,
    distance,
    meet,
    mutual_moment,
)
from cinegen.singularities.lines.screw import Screw
from cinegen.singularities.lines.transversal import Transversals, transversals
from cinegen.singularities.lines.variety import Variety

__all__ = [
    "Dependence",
    "DependentSet",
    "Frame",
    "Line",
    "LineAtInfinity",
    "LineError",
    "Plane",
    "Point",
    "Screw",
    "Transversals",
    "Variety",
    "angle",
    "are_coplanar",
    "are_parallel",
    "classify",
    "common_plane",
    "common_point",
    "distance",
    "meet",
    "mutual_moment",
    "near",
    "nearness",
    "transversals",
]
