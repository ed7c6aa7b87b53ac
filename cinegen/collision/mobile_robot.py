"""The mobile robot of scenes: a disc, or a point, that moves in the plane; one mechanism for all radii."""

from __future__ import annotations

from functools import cache

import coal
import pinocchio as pin

from cinegen.collision.body import Body
from cinegen.model import Mechanism
from cinegen.model.build import build
from raff2urdf.bounds import UNLIMITED

X, Y, NODE = "x", "y", "mobile"

_LINKS = "".join(f'<link name="{name}"/>' for name in ("ground", "rail"))
_JOINTS = "".join(
    f'<joint name="{name}" type="prismatic"><parent link="{parent}"/><child link="{child}"/><axis xyz="{axis}"/>'
    f'<limit effort="0" velocity="0" lower="{-UNLIMITED}" upper="{UNLIMITED}"/></joint>'
    for name, parent, child, axis in ((X, "ground", "rail", "1 0 0"), (Y, "rail", NODE, "0 1 0"))
)


@cache
def mobile_robot(visual: str = "") -> Mechanism:
    """Return two prismatic joints without limits, along x and y of the world, and the node that they carry.

    Args:
        visual: `<visual>` elements of that node, in URDF.
    """
    joints = [
        {"name": name, "type": "prismatic", "home": 0.0, "limits": None, "velocity": None, "actuated": True}
        for name in (X, Y)
    ]
    urdf = f'<robot name="{NODE}">{_LINKS}<link name="{NODE}">{visual}</link>{_JOINTS}</robot>'
    constraints = {"robot": NODE, "nodes": ["ground", "rail", NODE], "floating": None, "joints": joints, "loops": []}
    return build(urdf, constraints, name=NODE)


def mobile_body(radius: float) -> Body:
    """Return the body of the robot: a sphere around its node (radius in m, 0: a point), which is a disc in the
    plane."""
    return Body(NODE, mobile_robot().model.getJointId(Y), pin.SE3.Identity(), coal.Sphere(radius))
