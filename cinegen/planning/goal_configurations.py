"""Configurations in which a goal is reached, and the tests of start and goal with which every planner begins."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from cinegen.arrays import Array
from cinegen.collision.clearance import Clearance
from cinegen.collision.mesh_check import MeshCheck
from cinegen.collision.scene import Scene
from cinegen.collision.scene_table import about_z
from cinegen.errors import ClosureError
from cinegen.ik.local_ik import LocalIK
from cinegen.ik.task import FrameTask
from cinegen.model import Mechanism
from cinegen.planning.attempt import PlanStatus
from cinegen.planning.attraction import TaskAttraction
from cinegen.planning.path_constraints import Kept, TaskProjection, path_tasks, projection
from cinegen.tolerances import CLOSURE
from raff2urdf.quantities import LENGTH, shown

TOLERANCE = 1e-4
"""Tolerance of a goal, characteristic lengths and rad."""

_STARTS = 200  # start configurations of the search
_STARTS_OF_DRAGS = 40  # of the search during a drag, one in a tick
_ENOUGH = 24  # configurations
_SAMPLES = 200
_DISTINCT = 0.1  # rad or characteristic lengths: nearer configurations count as one


class Refusal(NamedTuple):
    """Why no path is searched: START_IN_COLLISION, GOAL_IN_COLLISION or OUT_OF_REACH, with an explanation."""

    status: PlanStatus
    reason: str


def free_goals(
    scene: Scene, clearance: Clearance, check: MeshCheck, report: Callable[[str], None], tasks: Kept = ()
) -> tuple[Array, ...] | Refusal:
    """Return the configurations at the goal that are free of collisions, at least one; or a refusal, also if the start
    is in collision.

    Args:
        scene: scene.
        clearance: distances of its robot.
        check: check of its meshes.
        report: called with a text about what is done.
        tasks: satisfied at the goal, too, as all along the path.
    """
    if tasks and not _satisfies(scene, scene.start, tasks):
        return Refusal(PlanStatus.OUT_OF_REACH, "the tasks to be kept along the path are not satisfied at the start")
    distances = clearance.distances(scene.start)
    if len(distances) and distances.min() < scene.safety:
        pair = int(distances.argmin())
        return Refusal(PlanStatus.START_IN_COLLISION, _too_near(clearance, scene, pair, float(distances[pair])))
    if touching := check.contact(scene.start):
        return Refusal(PlanStatus.START_IN_COLLISION, touching)
    report("searching configurations at the goal")
    configurations, blocked = _search(scene, clearance, tasks)
    contacts = [check.contact(q) for q in configurations]
    free = tuple(q for q, touching in zip(configurations, contacts, strict=True) if not touching)
    if free:
        return free
    if contacts:
        return Refusal(PlanStatus.GOAL_IN_COLLISION, contacts[0])
    if blocked:
        distance, pair = max(blocked)
        return Refusal(PlanStatus.GOAL_IN_COLLISION, _too_near(clearance, scene, pair, distance))
    return Refusal(PlanStatus.OUT_OF_REACH, f"no configuration was found in which '{scene.node}' is at the goal")


def _search(scene: Scene, clearance: Clearance, tasks: Kept) -> tuple[list[Array], list[tuple[float, int]]]:
    """Search closed configurations within all limits at the goal.

    Returns:
        configurations (nq,) with all distances above the safety distance, the one nearest to the start first, then
        always the one that differs most from those before; and of others the smallest distance, m, and its pair.
    """
    mechanism = scene.mechanism
    free, blocked = list[Array](), list[tuple[float, int]]()
    for q in _with_joint_values(scene, tasks) if scene.goal_joints else _with_pose(scene, tasks):
        if any(mechanism.distance(q, other) < _DISTINCT for other in free):
            continue
        if clearance.least(q) < scene.safety:
            distances = clearance.distances(q)
            blocked.append((float(distances.min()), int(distances.argmin())))
            continue
        free.append(q)
        if len(free) == _ENOUGH:
            break
    return _varied(scene, free), blocked[:_ENOUGH]


def _with_pose(scene: Scene, tasks: Kept) -> Iterator[Array]:
    """Yield configurations in which the node is at its goal, and on which the path's constraints are satisfied.

    The search starts at the scene's start, then at configurations sampled over the whole range of motion: an empty
    result means that none of these leads to the goal.
    """
    mechanism, rng, poses = scene.mechanism, np.random.default_rng(0), goal_poses(scene)
    task = FrameTask(scene.node, scene.goal, scene.translation, scene.rotation, axes="world")
    local = LocalIK(mechanism, (task, *path_tasks(scene)))
    project = TaskProjection(mechanism, local.tasks, tasks) if tasks else None
    starts = [scene.start]
    if mechanism.is_constrained:
        starts += list(LocalIK(mechanism).samples(_SAMPLES, rng))
    for count in range(_STARTS):
        local.tasks[0].target = next(poses)
        start = starts[count] if count < len(starts) else local.random_start(rng)
        reached = local.solve(start, 1e-10) and local.closure <= CLOSURE
        if project is None:
            if reached:
                yield local.best
            continue
        project.frames[0].target = local.tasks[0].target
        if (q := project(local.best if reached else start)) is not None:
            yield q


def goal_poses(scene: Scene) -> Iterator[pin.SE3]:
    """Yield poses of the goal: of a region the one nearest to the node at the start, then random ones; else always the
    goal pose."""
    goal, rng = scene.goal, np.random.default_rng(1)
    tolerance = np.zeros(3) if scene.tolerance is None else scene.tolerance
    pose = scene.mechanism.placement(scene.start, scene.node)
    rotation = goal.rotation
    if scene.cone is not None:
        across = np.cross(pose.rotation[:, 2], goal.rotation[:, 2])
        angle, size = _angle(pose.rotation[:, 2], goal.rotation[:, 2]), float(np.linalg.norm(across))
        axis = across / size if size > 1e-9 else pose.rotation[:, 0]
        rotation = pin.exp3(max(angle - scene.cone, 0.0) * axis) @ pose.rotation
    yield pin.SE3(rotation, np.clip(pose.translation, goal.translation - tolerance, goal.translation + tolerance))
    while True:
        point = goal.translation + tolerance * rng.uniform(-1.0, 1.0, 3)
        if scene.cone is not None:
            yaw, spin = rng.uniform(-np.pi, np.pi, 2)
            tilt = [about_z(yaw), pin.exp3(np.array([0.0, scene.cone * rng.random() ** 0.5, 0.0])), about_z(spin)]
            rotation = goal.rotation @ tilt[0] @ tilt[1] @ tilt[2]
        yield pin.SE3(rotation, point)


def _angle(axis: Array, other: Array) -> float:
    """Return the angle between two unit vectors (3,), rad."""
    return float(np.arctan2(np.linalg.norm(np.cross(axis, other)), axis @ other))


def _with_joint_values(scene: Scene, tasks: Kept) -> Iterator[Array]:
    """Yield configurations in which the joints of the goal have their values: first that of the scene, then with other
    values of the joints that are free."""
    mechanism, rng, end = scene.mechanism, np.random.default_rng(0), scene.goal_configuration
    assert end is not None
    if _satisfies(scene, end, tasks):
        yield end
    fixed = {*scene.goal_joints, *scene.locked}
    if fixed.issuperset(mechanism.actuated):
        return
    local = LocalIK(mechanism)
    values = {name: value for name, value in mechanism.values(end).items() if name in fixed}
    for _ in range(_STARTS):
        q = mechanism.configuration(values, local.random_start(rng))
        try:
            q = mechanism.close(q, locked=[name for name in mechanism.joints if name in fixed])
        except ClosureError:
            continue
        if mechanism.limits.within(q) and _satisfies(scene, q, tasks):
            yield q


def _satisfies(scene: Scene, q: Array, tasks: Kept) -> bool:
    """Return whether the path's constraints and tasks are satisfied at q (nq,)."""
    project = projection(scene, tasks)
    near = q if project is None else project(q)
    return near is not None and scene.mechanism.distance(q, near) < TOLERANCE


def goal_distance(scene: Scene) -> Callable[[Array], float]:
    """Return a function of q (nq,): the distance from the goal, rad or characteristic lengths."""
    mechanism, end = scene.mechanism, scene.goal_configuration
    if end is None and scene.tolerance is None and scene.cone is None:
        return TaskAttraction(mechanism, scene.node, scene.goal, scene.translation, scene.rotation).remaining
    if end is None:
        return lambda q: _outside_region(scene, mechanism.placement(q, scene.node))
    starts = [mechanism.model.joints[mechanism.model.getJointId(name)] for name in scene.goal_joints]
    columns = np.concatenate([np.arange(joint.idx_v, joint.idx_v + joint.nv) for joint in starts])
    return lambda q: float(np.abs(mechanism.scaled_difference(q, end)[columns]).max())


def _outside_region(scene: Scene, pose: pin.SE3) -> float:
    """Return how far a pose is from a region, rad or characteristic lengths."""
    tolerance = np.zeros(3) if scene.tolerance is None else scene.tolerance
    beyond = np.maximum(np.abs(pose.translation - scene.goal.translation) - tolerance, 0.0)[: scene.translation]
    angle = 0.0
    if scene.cone is not None:
        angle = max(_angle(pose.rotation[:, 2], scene.goal.rotation[:, 2]) - scene.cone, 0.0)
    elif scene.rotation == 3:
        angle = float(np.linalg.norm(pin.log3(scene.goal.rotation.T @ pose.rotation)))
    return float(np.hypot(np.linalg.norm(beyond) / scene.mechanism.length, angle))


def _varied(scene: Scene, configurations: list[Array]) -> list[Array]:
    """Return the configurations, sorted: the one nearest to the start, then always the furthest from all before, by the
    largest motion of a joint in the scene's metric."""

    def distance(begin: Array, end: Array) -> float:
        return float(np.abs(scene.mechanism.difference(begin, end) / scene.metric).max(initial=0.0))

    left = sorted(configurations, key=lambda q: distance(scene.start, q))
    chosen = left[:1]
    left = left[1:]
    while left:
        at = int(np.argmax([min(distance(q, other) for other in chosen) for q in left]))
        chosen.append(left.pop(at))
    return chosen


def _too_near(clearance: Clearance, scene: Scene, pair: int, distance: float) -> str:
    (link, other), inner = clearance.names(pair), clearance.pairs[pair].max() < len(clearance.links)
    if distance <= 0.0:
        enclosed = any(clearance.bodies[i].exact is not None for i in clearance.pairs[pair])
        reason = f"'{link}' penetrates '{other}' by {shown(-distance, LENGTH, 3)}{' at most' * enclosed}"
    else:
        kept = ("self-clearance", scene.self_clearance) if inner else ("safety distance", scene.safety)
        reason = f"'{link}' is {shown(distance - clearance.offset(pair), LENGTH, 3)} from '{other}', "
        reason += f"below the {kept[0]} of {shown(kept[1], LENGTH, 3)}"
    held = {body.name: each.name for each in scene.attached for body in each.bodies(scene.mechanism)}
    owners = {body.name: each.name for each in scene.obstacles for body in each.pieces}
    for body, touching in ((link, other), (other, link)):
        if body in held:
            touching = touching if inner else owners[touching]
            return f"{reason}; if they may touch, add '{touching}' to touches of '{held[body]}'"
    return reason + (f'; if these links may touch, add allowed_collisions = [["{link}", "{other}"]]' if inner else "")


def clear_configurations(
    mechanism: Mechanism, clearance: Clearance, tasks: Sequence[FrameTask], safety: float
) -> Iterator[list[Array] | None]:
    """Search for configurations in which all targets are reached and the safety distance is kept.

    Yields None after each start, and the configurations found at the end.
    """
    local, rng = LocalIK(mechanism, tuple(tasks)), np.random.default_rng(0)
    configurations = []
    for _ in range(_STARTS_OF_DRAGS):
        if local.solve(local.random_start(rng), 1e-8) and local.closure <= CLOSURE:
            q = local.best
            if clearance.least(q) >= safety:
                configurations.append(q)
        yield None
    yield configurations
