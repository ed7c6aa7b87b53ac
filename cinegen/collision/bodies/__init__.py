"""The links of a mechanism as convex bodies, and which of them may collide."""

from cinegen.collision.bodies.geometry import geometry_model
from cinegen.collision.bodies.links import bodies_of
from cinegen.collision.bodies.neighbours import neighbours
from cinegen.collision.bodies.pairs import pairs_of, sorted_pairs

__all__ = ["bodies_of", "geometry_model", "neighbours", "pairs_of", "sorted_pairs"]
