"""A mobile robot: a disc that moves in the plane, or a point of it; the same mechanism, whatever its radius."""

from __future__ import annotations

from functools import cache

import coal
import pinocchio as pin

from cinegen.collision.body import Body
from cinegen.model import Mechanism
from cinegen.model.load import build
from raff2urdf.readers.urdf import UNLIMITED

X, Y, NODE = "x", "y", "mobile"

_LINKS = "".join(f'<link name="{name}"/>' for name in ("ground", "rail", NODE))
_SLIDES = "".join(
    f'<joint name="{name}" type="prismatic"><parent link="{parent}"/><child link="{child}"/><axis xyz="{axis}"/>'
    f'<limit effort="0" velocity="0" lower="{-UNLIMITED}" upper="{UNLIMITED}"/></joint>'
    for name, parent, child, axis in ((X, "ground", "rail", "1 0 0"), (Y, "rail", NODE, "0 1 0"))
)


@cache
def mobile() -> Mechanism:
    """Two slides without limits, along x and y of the world, and the node that they carry."""
    joints = [
        {"name": name, "type": "prismatic", "home": 0.0, "limits": None, "velocity": None, "actuated": True}
        for name in (X, Y)
    ]
    urdf = f'<robot name="{NODE}">{_LINKS}{_SLIDES}</robot>'
    beside = {"robot": NODE, "nodes": ["ground", "rail", NODE], "floating": None, "joints": joints, "loops": []}
    return build(urdf, beside, name=NODE)


def body(radius: float) -> Body:
    """What it fills: a ball about its node (radius in m, 0: a point), in the plane a disc."""
    return Body(NODE, mobile().model.getJointId(Y), pin.SE3.Identity(), coal.Sphere(radius))
