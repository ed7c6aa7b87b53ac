"""Start and goal of a scene, and the constraints of its path."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from cinegen.arrays import Array
from cinegen.collision.errors import SceneError
from cinegen.collision.mobile_robot import X, Y, mobile_robot
from cinegen.collision.scene import UNCONSTRAINED, PathConstraints, heading
from cinegen.collision.scene_table import LEAST, SceneTable, about_z, read_each
from cinegen.errors import ClosureError, read_all
from cinegen.model import Mechanism
from cinegen.model.plausible import FAR, ImplausibleError, check_joint, check_lengths
from cinegen.tolerances import AT_LIMIT
from raff2urdf.errors import raised_as
from raff2urdf.quantities import ANGLE, LENGTH, NUMBER, shown

_STEP = 0.1  # rad or characteristic lengths: largest step of the actuated joints from home to the start


def check_length(table: SceneTable, robot: Mechanism, name: str, values: list[float], far: float = FAR) -> None:
    """Refuse lengths of a table that would fit in mm only."""
    with raised_as(SceneError, ImplausibleError, f"{table.where}: "):
        check_lengths(robot, name, values, far)


def read_start(table: SceneTable, mechanism: Mechanism, radius: float | None) -> Array:
    """Return the configuration (nq,) of a start: of a mobile robot at `point`, the origin by default."""
    if radius is None:
        q = _configuration(table, mechanism, np.array(mechanism.q_home))
    else:
        x, y = table.vector("point", 2).tolist() if "point" in table else (0.0, 0.0)
        table.finish()
        q = mobile_robot().configuration({X: x, Y: y})
    q.flags.writeable = False
    return q


def _configuration(table: SceneTable, mechanism: Mechanism, home: Array) -> Array:
    """Return the configuration (nq,) of a start or a goal, loops closed, within all limits.

    `joints` are names and values, of ball joints quaternions (x y z w); the other joints are as in `home` (nq,): a
    start's at home, a goal's at the start. A floating base is placed by `point` and `rpy`. With loops, actuated joints
    have the given values, and the others follow the motion of these from `home`; unless a passive joint is named, too:
    the values are then the guess from which the loops are closed.

    Raises:
        SceneError: a joint is unknown or beyond its limits, or the loops can't be closed.
    """
    values, placement = values_and_base(table, mechanism)
    if placement is not None:
        home[:7] = pin.SE3ToXYZQUAT(placement)
    q = mechanism.configuration(values, home)
    if mechanism.is_constrained:
        with raised_as(partial(table.error, "joints"), ClosureError, "do not allow closed loops: "):
            q = _closed(mechanism, home, q, any(name not in mechanism.actuated for name in values))
        unwound = mechanism.limits.unwound(q)  # a guess far away may have added revolutions to passive joints
        for name in mechanism.limits.exceeded(q, AT_LIMIT):
            if name not in mechanism.actuated:
                q[mechanism.q_index(name)] = unwound[mechanism.q_index(name)]
    for name in mechanism.limits.exceeded(q, AT_LIMIT):
        low, high, *_ = mechanism.limits[name]
        dimension = LENGTH if mechanism.is_prismatic(name) else ANGLE
        value, *limits = (shown(x, dimension, 6) for x in (float(q[mechanism.q_index(name)]), low, high))
        why = f"'{name}' is at {value}, its limits are {limits[0]} and {limits[1]}"
        raise table.error("joints", why if name in values else f"{why}: give its value, or other actuated joints")
    return q


def values_and_base(table: SceneTable, mechanism: Mechanism) -> tuple[dict[str, float | Array], pin.SE3 | None]:
    """Return the `joints` of a start or a goal, by their names, and the pose of a floating base, if it has one."""
    is_placed = mechanism.floating and ("point" in table or "rpy" in table or "angle" in table)
    values, placement, _ = read_each(
        lambda: _joint_values(table.table("joints"), mechanism) if "joints" in table else {},
        lambda: table.pose() if is_placed else None,
        table.finish,
    )
    return values, placement


def _joint_values(table: SceneTable, mechanism: Mechanism) -> dict[str, float | Array]:
    known = (*mechanism.joints, *mechanism.balls)

    def value(name: str) -> float | Array:
        table.check_name("", name, known, f"a joint of {mechanism.name}")
        if name in mechanism.balls:
            return table.vector(name, 4, dimension=NUMBER)
        number = table.number(name, LENGTH if mechanism.is_prismatic(name) else ANGLE)
        with raised_as(SceneError, ImplausibleError, f"{table.where}: "):
            check_joint(mechanism, name, [number])
        return number

    return read_all({name: partial(value, name) for name in table}, SceneError)


def _closed(mechanism: Mechanism, home: Array, q: Array, is_guess: bool) -> Array:
    """Return q (nq,) with closed loops and its values of the actuated joints: from home along the straight line of
    these, or from q itself if it is a guess for the others, too."""
    actuated = [mechanism.q_index(name) for name in mechanism.actuated]
    columns = [mechanism.v_index(name) for name in mechanism.actuated]
    if not is_guess:
        line = q[actuated] - home[actuated]
        steps = int(np.ceil(np.abs(line / mechanism.scale[columns]).max(initial=0.0) / _STEP))
        closed = home.copy()
        for step in range(1, steps + 1):
            closed[actuated] = home[actuated] + line * (step / steps)
            closed = mechanism.close(closed, locked=mechanism.actuated)
        closed[actuated] = q[actuated]
        q = closed
    return mechanism.close(q, locked=mechanism.actuated)


class SceneGoal(NamedTuple):
    """`Scene.goal_joints` and `goal_configuration`, `goal` with `translation` and `rotation`, `tolerance`, `cone`."""

    joints: tuple[str, ...]
    q: Array | None = None
    pose: tuple[pin.SE3, int, int] | None = None
    tolerance: Array | None = None
    cone: float | None = None


def read_goal(table: SceneTable, mechanism: Mechanism, radius: float | None, values: Mapping[str, Any]) -> SceneGoal:
    """Return the goal: `joints`, or a pose and its region. Without a start only names and values are checked."""
    q, node = values.get("start q"), values["node"]
    if "joints" not in table:
        pose = pin.SE3.Identity() if q is None else mechanism.placement(q, node)
        robot = mechanism if radius is None else None
        goal, region, _ = read_each(lambda: read_goal_pose(table, robot, pose), lambda: _region(table), table.finish)
        return SceneGoal((), None, goal, *region)
    joints = tuple(table.table("joints"))
    if not joints:
        raise table.error("joints", "is empty: name the joints whose values are the goal")
    if q is None:
        values_and_base(table, mechanism)
        return SceneGoal(joints)
    end = _configuration(table, mechanism, q.copy())
    end.flags.writeable = False
    return SceneGoal(joints, end, (mechanism.placement(end, node), 3, 3))


def read_goal_pose(table: SceneTable, robot: Mechanism | None, node: pin.SE3) -> tuple[pin.SE3, int, int]:
    """Return the goal pose, and how many of its translations and rotations count (see `Scene`).

    `point` has three numbers, or two: z does not count then. With `rpy` the orientation counts, with `angle` only the
    direction of the node's x axis in the xy plane, rad; with neither, the orientation does not count.

    Args:
        table: of a scene.
        robot: whose reach the point is compared with; None for a mobile robot.
        node: pose of the node at the start: what does not count stays as it is there.
    """

    def point() -> Array:
        coordinates = table.vector("point", 2, 3)
        if robot is not None:
            check_length(table, robot, "point", coordinates.tolist())
        return coordinates

    def rotation() -> tuple[Array, int]:
        turned, count = table.orientation(), 3 if "rpy" in table else int("angle" in table)
        if count != 1:
            return turned, count
        if np.linalg.norm(node.rotation[:2, 0]) < LEAST:
            raise table.error("angle", "is undefined: the node's x axis is vertical at the start; write rpy")
        return about_z(table.number("angle", ANGLE) - heading(node)) @ node.rotation, 1

    position, (turned, count) = read_each(point, rotation)
    return pin.SE3(turned, np.array([*position, node.translation[2]])[:3]), len(position), count


def _region(table: SceneTable) -> tuple[Array | None, float | None]:
    """Return `tolerance`, half of the size of a box about the goal's point, m; and `cone`, rad."""

    def tolerance() -> Array | None:
        size = table.vector("tolerance", 3) if "tolerance" in table else None
        if size is not None and (size < 0.0).any():
            raise table.error("tolerance", f"must not be below 0, not {size.tolist()}")
        return size

    def cone() -> float | None:
        angle = table.number("cone", ANGLE) if "cone" in table else None
        if angle is not None and not 0.0 <= angle <= np.pi:
            raise table.error("cone", f"must be an angle from 0 to 180 deg, not {shown(angle, ANGLE, 6)}")
        if angle is not None and "rpy" not in table:
            raise table.error("cone", "needs rpy: its axis is z of the goal's orientation")
        return angle

    box, angle = read_each(tolerance, cone)
    if (box is not None or angle is not None) and "angle" in table:
        raise table.error("angle", "cannot be combined with a region: write rpy, and cone, or leave it out")
    return box, angle


def read_path_constraints(table: SceneTable, radius: float | None) -> PathConstraints:
    """Return `upright`, and the direction of a `line` or the normal of a `plane`."""
    if "path" not in table:
        return UNCONSTRAINED
    if radius is not None:
        raise table.error("path", "is for robots: a mobile robot has no constraints along its path")
    inner = table.table("path")
    upright, line, plane, _ = read_each(
        lambda: "upright" in inner and inner.flag("upright"),
        lambda: inner.direction("line", 3) if "line" in inner else None,
        lambda: inner.direction("plane", 3) if "plane" in inner else None,
        inner.finish,
    )
    if line is not None and plane is not None:
        raise inner.error("plane", "cannot be combined with line: remove one of them")
    return PathConstraints(upright, line, plane)
