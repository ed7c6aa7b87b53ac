"""Read SDF: what a file holds (`model`), and its conversion to a URDF with loops and couplings (`conversion`)."""

from raff2urdf.readers.sdf.reading import read

__all__ = ["read"]
