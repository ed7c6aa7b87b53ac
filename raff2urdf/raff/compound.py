"""Joints of several variables, and the successive links that stand for them.

Let F be the frame in which the link's parameters place the joint, by all six of them unless a variable is one of them.
The link's own frame is then

    ball         F Rx(x) Ry(y) Rz(z)
    universal    F Ry(y)                where theta is the variable z
    cylindrical  F                      where theta is the variable z, and r the variable tz
    planar       F Tx(tx) Ty(ty) Rz(z)  where theta, which is not in F, is the variable z

Everything that computes with a robot takes the links of `expanded`, each with one variable at most. Their joints are
named after the link and the variable: joint5_X, joint5_TZ. The last of them is the link itself; the links before it
have no graphics and are no nodes of the robot.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from itertools import count

from raff2urdf.raff.document import (
    OF_JOINT,
    CompoundKind,
    JointType,
    RaffInertial,
    RaffLink,
    RaffParameters,
    RaffPart,
    RaffRobot,
    RaffVariable,
)

VARIABLES: Mapping[CompoundKind, Mapping[str, str | None]] = {
    CompoundKind.BALL: {"x": None, "y": None, "z": None},
    CompoundKind.UNIVERSAL: {"z": "theta", "y": None},
    CompoundKind.CYLINDRICAL: {"z": "theta", "tz": "r"},
    CompoundKind.PLANAR: {"tx": None, "ty": None, "z": "theta"},
}
"""The variables of each kind, from the parent on, each with the parameter that is its value, if one is."""

_NEXT_AXIS = RaffParameters(gamma=90.0, alpha=90.0)
"""Exchanges the axes cyclically: the new z axis is the x axis."""


def joint_of(link: RaffLink, variable: str) -> str:
    """Return the name of the joint that a variable is of."""
    return f"joint{link.number}_{variable.upper()}"


def intermediate_names(link: RaffLink) -> list[str]:
    """Return the names of the links that are put before a link whose joint has several variables."""
    return [part.node for part in _successive(link, count(1))[:-1]]


def spherical_joints(robot: RaffRobot) -> dict[str, list[str]]:
    """Return the ball joints whose variables have no limits, no drive and no friction, each with its three successive
    joints."""
    return {
        link.joint: [joint_of(link, variable) for variable in VARIABLES[CompoundKind.BALL]]
        for link in robot.links
        if link.compound is CompoundKind.BALL
        and not any(
            v.limits or v.velocity is not None or v.actuated or v.armature or v.damping or v.friction
            for v in link.variables
        )
    }


def expanded(robot: RaffRobot) -> RaffRobot:
    """Return a robot in which successive links stand for those whose joints have several variables."""
    if not any(link.compound for link in robot.links):
        return robot
    numbers = count(max(part.number for part in robot.parts) + 1)
    parts: list[RaffPart] = []
    for part in robot.parts:
        parts += _successive(part, numbers) if isinstance(part, RaffLink) and part.compound else [part]
    return replace(robot, parts=tuple(parts))


def _successive(link: RaffLink, numbers: Iterator[int]) -> list[RaffLink]:
    assert link.compound is not None
    written = {variable.name: variable for variable in link.variables}
    links: list[RaffLink] = []
    steps = _steps(link.compound, link.parameters, {name: variable.home for name, variable in written.items()})
    for i, (name, parameters) in enumerate(steps):
        declared, last = written.get(name, RaffVariable(name)), i == len(steps) - 1
        joint = joint_of(link, name) if name else link.joint
        kind = JointType.FIXED if not name else JointType.PRISMATIC if name.startswith("t") else JointType.REVOLUTE
        stated = {word: getattr(declared, word) for word in OF_JOINT}
        if link.compound is CompoundKind.BALL and name:
            stated["actuated"] = bool(declared.actuated)
        part = RaffLink(
            number=link.number if last else next(numbers),
            parameters=parameters,
            type=kind,
            pred=links[-1].number if links else link.pred,
            **stated,
            own_joint=joint,
            name=link.name if last else f"link{link.number}_{name.upper() or 0}",
            filenames=link.filenames if last else (),
            inertial=link.inertial if last or link.inertial is None else RaffInertial(mass=0.0),
            locations=link.locations,
        )
        links.append(part)
    return links


def _steps(kind: CompoundKind, written: RaffParameters, homes: Mapping[str, float]) -> list[tuple[str, RaffParameters]]:
    """Return the successive links, each as its variable, or none, and its parameters."""

    def about(name: str) -> tuple[str, RaffParameters]:
        return name, replace(_NEXT_AXIS, theta=homes.get(name, 0.0))

    def along(name: str) -> tuple[str, RaffParameters]:
        return name, replace(_NEXT_AXIS, r=homes.get(name, 0.0))

    if kind is CompoundKind.BALL:
        return [("", written), about("x"), about("y"), about("z")]
    if kind is CompoundKind.UNIVERSAL:
        second = RaffParameters(alpha=-90.0, theta=homes.get("y", 0.0))
        return [("z", written), ("y", second), ("", RaffParameters(alpha=90.0))]
    if kind is CompoundKind.CYLINDRICAL:
        return [("z", replace(written, r=0.0)), ("tz", RaffParameters(r=written.r))]
    about_z = replace(_NEXT_AXIS, theta=written.theta)
    return [("", replace(written, theta=0.0)), along("tx"), along("ty"), ("z", about_z)]
