"""`python -m cinegen`."""

from raff2urdf.entry import cinegen

cinegen()
