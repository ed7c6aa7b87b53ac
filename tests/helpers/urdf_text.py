"""URDF of robots without loops, as text, from their joints."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple


class UrdfJoint(NamedTuple):
    """A joint from a link to another one; `limit`: lower and upper, rad or m."""

    name: str
    parent: str
    child: str
    xyz: str = "0 0 0"
    axis: str = "0 0 1"
    kind: str = "revolute"
    limit: tuple[float, float] = (-3.0, 3.0)
    effort: float = 1.0
    velocity: float = 1.0
    rpy: str = "0 0 0"
    more: str = ""


def urdf_text(joints: Sequence[UrdfJoint], links: Mapping[str, str] | None = None, name: str = "arm") -> str:
    """Return the URDF of joints and of the links that they join.

    Args:
        joints: from the root on.
        links: elements of links by name, none unless said.
        name: of the robot.
    """
    names = dict.fromkeys(link for joint in joints for link in (joint.parent, joint.child))
    text = "".join(f'<link name="{link}">{(links or {}).get(link, "")}</link>' for link in names)
    for joint in joints:
        text += f'<joint name="{joint.name}" type="{joint.kind}"><parent link="{joint.parent}"/>'
        text += f'<child link="{joint.child}"/><origin xyz="{joint.xyz}" rpy="{joint.rpy}"/>{joint.more}'
        if joint.kind not in ("fixed", "floating"):
            text += f'<axis xyz="{joint.axis}"/>'
        if joint.kind in ("revolute", "prismatic"):
            text += f'<limit lower="{joint.limit[0]}" upper="{joint.limit[1]}" effort="{joint.effort}" '
            text += f'velocity="{joint.velocity}"/>'
        text += "</joint>"
    return f'<robot name="{name}">{text}</robot>'
