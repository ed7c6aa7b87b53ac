"""Lines in Pluecker coordinates, and the geometry of lines that are dependent (Grassmann)."""

from cinegen.study.lines.dependence import Dependence
from cinegen.study.lines.dependent_set import DependentSet
from cinegen.study.lines.frame import Frame, Plane, Point
from cinegen.study.lines.grassmann import classify, near, nearness
from cinegen.study.lines.incidence import common_plane, common_point
from cinegen.study.lines.line import (
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
from cinegen.study.lines.screw import Screw
from cinegen.study.lines.transversal import Transversals, transversals
from cinegen.study.lines.variety import Variety

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
