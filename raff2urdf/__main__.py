"""`python -m raff2urdf`."""

from raff2urdf.entry import raff2urdf

raff2urdf()
