"""Fields that move a point to a goal around obstacles: a paraboloid that attracts, potentials that repel, vortices.

All of them are plain statements of the formulas, for many points at once: what is compiled elsewhere is tested against
them. Points are (m, 3), m, in one frame; one point (3,) will do as well; what moves in a plane has z = 0 and turns
about z. Potentials are in J and gradients in N, of forces that nothing feels: only their ratios matter.
"""

from cinegen.planning.fields.attraction import Paraboloid
from cinegen.planning.fields.discarding import facing, scissors
from cinegen.planning.fields.elliptical import Elliptical
from cinegen.planning.fields.firas import Firas
from cinegen.planning.fields.line_search import exact_step, line_search
from cinegen.planning.fields.nearness import CONTACT, closeness
from cinegen.planning.fields.parameter import FieldError
from cinegen.planning.fields.spherical import Spherical
from cinegen.planning.fields.turning import folding, shorter, turning_axis
from cinegen.planning.fields.vortex import Modulus, PointVortex, Vortex

__all__ = [
    "CONTACT",
    "Elliptical",
    "FieldError",
    "Firas",
    "Modulus",
    "Paraboloid",
    "PointVortex",
    "Spherical",
    "Vortex",
    "closeness",
    "exact_step",
    "facing",
    "folding",
    "line_search",
    "scissors",
    "shorter",
    "turning_axis",
]
