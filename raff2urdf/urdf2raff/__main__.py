"""`python -m raff2urdf.urdf2raff`."""

from raff2urdf.entry import urdf2raff

urdf2raff()
