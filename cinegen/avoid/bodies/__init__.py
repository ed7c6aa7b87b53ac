"""The links of a mechanism as convex bodies, and which of them may collide."""

from cinegen.avoid.bodies.geometry import geometry_model
from cinegen.avoid.bodies.links import bodies_of
from cinegen.avoid.bodies.neighbours import neighbours
from cinegen.avoid.bodies.pairs import pairs_of, sorted_pairs

__all__ = ["bodies_of", "geometry_model", "neighbours", "pairs_of", "sorted_pairs"]
