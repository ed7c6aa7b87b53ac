"""URDFs as text: their elements, and robots without loops from their joints."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple


def link(name: str, inside: str = "") -> str:
    """A link, which has more elements inside."""
    return f'<link name="{name}">{inside}</link>' if inside else f'<link name="{name}"/>'


def links(*names: str) -> str:
    """Links without masses and shapes."""
    return "".join(map(link, names))


def joint_text(name: str, parent: str, child: str, inside: str = "", kind: str = "continuous") -> str:
    """A joint, which has more elements inside."""
    return f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>{inside}</joint>'


def joint_at(name: str, parent: str, child: str, xyz: str = "0 0 0", inside: str = "", kind: str = "continuous") -> str:
    """A joint at a place of its parent, along or about z."""
    return joint_text(name, parent, child, f'<origin xyz="{xyz}"/><axis xyz="0 0 1"/>{inside}', kind)


def limit(lower: float, upper: float, velocity: float = 1, effort: float = 1) -> str:
    """Limits of a joint."""
    return f'<limit lower="{lower}" upper="{upper}" velocity="{velocity}" effort="{effort}"/>'


def robot(*parts: str, name: str = "r") -> str:
    """A URDF of these elements."""
    return "\n".join([f'<robot name="{name}">', *parts, "</robot>"])


BARS = f"""<robot name="bars">
  {links("ground", "crank", "coupler", "rocker")}
  {joint_at("drive", "ground", "crank")}
  {joint_at("elbow", "crank", "coupler", "0 1 0")}
  {joint_at("swing", "ground", "rocker", "2.5 0 0")}
"""
"""Bars that are no closed four-bar yet; what is added begins on line 6."""


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
    names = dict.fromkeys(end for joint in joints for end in (joint.parent, joint.child))
    parts = [link(name, (links or {}).get(name, "")) for name in names]
    for joint in joints:
        inside = f'<origin xyz="{joint.xyz}" rpy="{joint.rpy}"/>{joint.more}'
        if joint.kind not in ("fixed", "floating"):
            inside += f'<axis xyz="{joint.axis}"/>'
        if joint.kind in ("revolute", "prismatic"):
            inside += limit(*joint.limit, joint.velocity, joint.effort)
        parts.append(joint_text(joint.name, joint.parent, joint.child, inside, joint.kind))
    return robot(*parts, name=name)
