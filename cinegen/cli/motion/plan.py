"""`cinegen plan`: a path to a goal around obstacles."""

from __future__ import annotations

import math
import textwrap
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import typer

from cinegen.cli.files import check_outputs, disabled_pairs, print_result, unchecked_links, write_figure
from cinegen.cli.motion.mode_change import change_advice, change_document, change_lines, goal_text, mode_index
from cinegen.cli.motion.plan_recording import record_path, show_path
from cinegen.cli.options import (
    JSON,
    PLOT,
    PLOT_JOINTS,
    SELF_CLEARANCE,
    UNITS,
    VIEW,
    SceneRobotOptions,
    exclude,
    output_option,
)
from cinegen.cli.progress import Progress
from cinegen.cli.served_page import PageOptions
from raff2urdf.command.command_line import option
from raff2urdf.errors import counted
from raff2urdf.files import output_path, stem_of
from raff2urdf.quantities import ANGLE, LENGTH, NUMBER, shown, shown_scale

if TYPE_CHECKING:
    from cinegen.arrays import Array
    from cinegen.collision import Scene
    from cinegen.planning import ModeChange, Plan

_WIDTH = 100  # columns


def run(
    page: PageOptions,
    robot: SceneRobotOptions,
    scene: Path = typer.Argument(..., metavar="SCENE", help="robot, obstacles, start and goal: a .toml or .json file"),
    timeout: float = option("S", "time limit, s", 10.0, min=0, max=10_000_000),
    planner: Literal["auto", "vortex", "rrtconnect"] = option(
        None,
        "auto follows the field and samples configurations (rrtconnect) in turn, until one of them reaches the goal",
        "auto",
        unless="--modes",
    ),
    modes: str = option(
        "any|N", "go to any other assembly mode, or to mode N of `cinegen modes`; a pose as goal does not count", ""
    ),
    singular: Literal["avoid", "cross"] = option(
        None,
        "with --modes: cross allows a path through a singularity of type 2, if none is found around",
        "avoid",
        needs="--modes",
    ),
    lock: str | None = option("JOINTS", "joints that do not move, such as joint3,joint4", unless="--modes"),
    self_clearance: float | None = SELF_CLEARANCE,
    output: str | None = output_option("FILE.jsonl", "record the path, for `cinegen replay` and `export`", ".jsonl"),
    plot: Path | None = PLOT,
    plot_joints: Path | None = PLOT_JOINTS,
    json: bool = JSON,
    view: bool = VIEW,
    units: Literal["m", "mm"] = UNITS,
) -> int:
    """Plan a path to a goal around obstacles, by vortex fields, then by sampling.

    Plans a path from the start of a scene to its goal that keeps the safety distance of the scene. The exit code is 1
    if the goal is not reached.
    """
    exclude(json=json, view=view)
    mode = mode_index(modes)
    recording = output_path(output, f"{stem_of(scene)}.jsonl") if output else None
    check_outputs(plot, plot_joints, force=page.force, json=json)
    check_outputs(recording, force=page.force, json=json, remakeable=False)
    loaded = robot.load_scene(scene, self_clearance)
    if not json:
        print("\n".join(_task(loaded, goal_text(mode, loaded) if modes else None)), flush=True)
    settings: dict[str, Any] = {"mode": mode, "singular": singular}
    if not modes:
        joints = lock.replace(",", " ").split() if lock else ()
        settings = {"locked": joints, "planner": planner}
    path, change = _planned(loaded, bool(modes), {**settings, "seconds": timeout})
    if json:
        document = _document(path) | ({"mode_change": change_document(change)} if change is not None else {})
        print_result({"file": str(scene), "planner": None if modes else planner, **document}, None, json)
    elif change is not None:
        _print([*change_lines(change), *_result(path)[1:]], change_advice(change, singular, timeout))
    else:
        _print(_result(path), "" if path else _advice(path, timeout))
    moves = bool((path.path[1:] != path.path[0]).any())
    _write(path, moves, plot, plot_joints, recording, json)
    if view:
        show_path(path, page) if moves else print("there is no path to show")
    return 0 if path else 1


def _planned(scene: Scene, changes_mode: bool, settings: dict[str, Any]) -> tuple[Plan, ModeChange | None]:
    """Return the plan to a goal, or to another assembly mode and the change of that, and show the progress."""
    from cinegen.planning import change_mode, plan

    with Progress() as progress:
        if not changes_mode:
            return plan(scene, **settings, report=progress.text), None
        change = change_mode(scene, **settings, report=progress.text)
        return change.plan, change


def _print(lines: list[str], advice: str) -> None:
    print("\n".join(["", *lines, "", *textwrap.wrap(advice, _WIDTH)]).rstrip(), flush=True)


def _write(
    path: Plan, moves: bool, plot: Path | None, plot_joints: Path | None, recording: Path | None, quiet: bool
) -> None:
    """Write pictures and a recording; joints and a recording only if the robot moves."""
    if plot:
        from cinegen.plotting import draw_plan

        write_figure(plot, draw_plan(path), quiet=quiet)
    if plot_joints and moves:
        from cinegen.plotting import draw_joints

        write_figure(plot_joints, draw_joints(path), quiet=quiet)
    elif plot_joints and not quiet:
        print(f"there is no path: {plot_joints} is not written")
    if recording:
        message = record_path(path, recording) if moves else f"there is no path: {recording} is not written"
        if not quiet:
            print(message)


# --- the result --------------------------------------------------------------------------------------------------


def _task(scene: Scene, goal: str | None) -> list[str]:
    """Return lines about the robot, its goal (by default that of the scene) and the obstacles."""
    mechanism = scene.mechanism
    if scene.mobile is None:
        robot = f"robot '{mechanism.name}', {counted(len(mechanism.joints), 'joint')}"
        robot += f", {counted(len(mechanism.loops), 'loop')}" if mechanism.loops else ""
    else:
        robot = f"mobile robot, radius {_length_text(scene.mobile)}" if scene.mobile else "mobile robot, a point"
    orientation = {0: "", 1: ", with its rotation about z", 3: ", with its orientation"}[scene.rotation]
    reached = f"{scene.node} to {_point(scene.goal.translation[: scene.translation])}{orientation}"
    if scene.tolerance is not None:
        reached += f", within {' x '.join(_length_text(size) for size in scene.tolerance)}"
    if scene.cone is not None:
        reached += f", in a cone of {shown(scene.cone, ANGLE, 3)}"
    if scene.goal_configuration is not None:
        reached = f"to {_joint_values(scene)}"
    held = ", ".join(f"{held.name} to {held.node}" for held in scene.attached)
    weights = ", ".join(f"{name} {weight:g}" for name, weight in scene.weights.items())
    obstacles = ", ".join(f"{o.name} ({o.kind})" if o.name != o.kind else o.name for o in scene.obstacles)
    return [
        *textwrap.wrap(f"{scene.name}: {robot}; {goal or reached}", _WIDTH, subsequent_indent="  "),
        *([f"  {disabled_pairs(mechanism)}"] if mechanism.source.srdf else []),
        *([f"  {lost}"] if (lost := unchecked_links(mechanism)) else []),
        *([f"  locked: {', '.join(scene.locked)}"] if scene.locked else []),
        *([f"  attached: {held}"] if held else []),
        *([f"  weights: {weights}"] if weights else []),
        *([f"  {scene.node} {_path_constraints(scene)} all along the path"] if scene.path_constraints else []),
        *textwrap.wrap(
            f"{counted(len(scene.obstacles), 'obstacle')}{': ' * bool(obstacles)}{obstacles}", _WIDTH,
            initial_indent="  ", subsequent_indent="    ",
        ),
    ]  # fmt: skip


def _path_constraints(scene: Scene) -> str:
    """Return the constraints along the path as text."""
    upright, line, plane = scene.path_constraints
    texts = ["upright"] if upright else []
    if line is not None:
        texts.append("on a line along " + ", ".join(f"{x:.3g}" for x in line))
    if plane is not None:
        texts.append("in a plane with normal " + ", ".join(f"{x:.3g}" for x in plane))
    return " and ".join(texts)


def _joint_values(scene: Scene) -> str:
    """Return the joint values of a goal as text."""
    mechanism, end = scene.mechanism, scene.goal_configuration
    assert end is not None
    texts = []
    for name in scene.goal_joints:
        value = mechanism.values(end)[name]
        if isinstance(value, list):
            texts.append(f"{name} {value}")
        else:
            texts.append(f"{name} {shown(value, LENGTH if mechanism.is_prismatic(name) else ANGLE, 4)}")
    return ", ".join(texts)


def _result(plan: Plan) -> list[str]:
    """Return lines about the status and the path, and a table of attempts."""
    lines = textwrap.wrap(_status(plan), _WIDTH, subsequent_indent="  ")
    if len(plan.path) > 1 or plan:
        lines += [
            f"  steps      {len(plan.path) - 1}",
            f"  path       {_length_text(_length(plan))}, of {plan.scene.node}",
            f"  motion     {_motion(plan)}, of the joints",
        ]
    lines.append(f"  clearance  {_clearance(plan)}")
    if lost := unchecked_links(plan.scene.mechanism):
        lines += textwrap.wrap(f"             {lost}", _WIDTH, subsequent_indent=" " * 13)
    if plan.attempts:
        lines += textwrap.wrap(f"  meshes     {_meshes(plan)}", _WIDTH, subsequent_indent=" " * 13)
        rows = [("status", "steps", "strategy")]
        rows += [(attempt.status.value, str(len(attempt.path) - 1), attempt.strategy) for attempt in plan.attempts]
        status, steps = (max(len(row[k]) for row in rows) for k in (0, 1))
        numbers = ["attempt", *map(str, range(1, len(rows)))]
        lines += [""] + [
            f"  {number:>7}  {row[0]:<{status}}  {row[1]:>{steps}}  {row[2]}"
            for number, row in zip(numbers, rows, strict=True)
        ]
    return lines


def _status(plan: Plan) -> str:
    """Return the status; if the goal is not reached, where the robot is, and why."""
    from cinegen.planning import PlanStatus

    scene = plan.scene
    if plan:
        return f"{plan.status.value}: {'joints are at their' if scene.goal_joints else f'{scene.node} is at its'} goal"
    if not plan.attempts or plan.status is PlanStatus.TIME_LIMIT:
        return str(plan)
    end = plan.trace[-1][: scene.translation]
    left = math.dist(end, scene.goal.translation[: scene.translation])
    text = f"{plan.status.value}: {scene.node} at {_point(end)}, {_length_text(left)} from its goal: {plan.reason}"
    return text if plan.attempts[-1].blocked_by else text + _nearest(plan)


def _nearest(plan: Plan) -> str:
    """Return which two bodies are nearest to each other at the end of the path."""
    from cinegen.collision import clearance_of

    clearance = clearance_of(plan.scene)
    distances = clearance.distances(plan.path[-1])
    if not len(distances):
        return ""
    first, second = clearance.names(int(distances.argmin()))
    return f"; nearest is '{first}', {_length_text(float(distances.min()))} from '{second}'"


def _clearance(plan: Plan) -> str:
    required = f"{_length_text(plan.scene.safety)} required"
    if math.isinf(plan.clearance):
        return f"no obstacles; {required}"
    return f"{_length_text(plan.clearance)} {'along the path' if len(plan.path) > 1 else 'at the start'}; {required}"


def _meshes(plan: Plan) -> str:
    """Return what the check of the path against the meshes covered."""
    scene = plan.scene
    touching = [(held.name, other) for held in scene.attached for other in held.touches]
    pairs = (*plan.mesh_check.unchecked, *scene.allowed_collisions, *touching)
    mechanism, step = scene.mechanism, plan.mesh_check.step
    left_out = [*mechanism.unchecked_links, *(f"{first}-{second}" for first, second in pairs)]
    checked = f"checked every {_length_text(step)} of motion"
    if mechanism.loops or not all(coupling.is_linear for coupling in mechanism.couplings):
        text = f"no contact on this path, {checked}: an estimate, as loops or couplings determine the motion"
    else:
        apart = _length_text(step / 2.0)
        text = f"no contact on this path: proved where shapes are more than {apart} apart, elsewhere {checked}"
    return f"{text}; not checked: {', '.join(left_out)}" if left_out else text


def _advice(plan: Plan, seconds: float) -> str:
    """Return what may help to reach the goal."""
    from cinegen.planning import PlanStatus

    match plan.status:
        case PlanStatus.START_IN_COLLISION:
            return "Choose another start (start), move the obstacle, or reduce the safety distance (safety)."
        case PlanStatus.GOAL_IN_COLLISION:
            return (
                "All configurations found at the goal are too close to something: move the goal or the obstacle, leave "
                "more of the goal free, or reduce the safety distance (safety)."
            )
        case PlanStatus.IN_COLLISION:
            return "The convex bodies around the links keep clear, but the meshes touch: try another start or goal."
        case PlanStatus.OUT_OF_REACH:
            return "Bring the goal nearer, or leave more of it free: its orientation, or z."
        case PlanStatus.TIME_LIMIT:
            return f"Try --timeout {6.0 * seconds:g}, or a smaller safety distance (safety): there may be no path."
        case _:
            return (
                "Try --planner auto: it also samples configurations, keeps the same distances, and leaves local minima."
            )


def _length_text(metres: float) -> str:
    return shown(metres, LENGTH, 3)


def _point(point: Array) -> str:
    """Return two or three coordinates of a point (m) as text."""
    scale, unit = shown_scale(LENGTH)
    coordinates = zip("xyz", point.tolist(), strict=False)
    return ", ".join(f"{name} {scale * (round(value, 3) + 0.0):g}" for name, value in coordinates) + f" {unit}"


def _length(plan: Plan) -> float:
    """Return the length of the node's path, m; between configurations it may be curved."""
    import numpy as np

    from cinegen.planning.search import refined

    mechanism, node = plan.scene.mechanism, plan.scene.node
    trace = np.array([mechanism.placement(q, node).translation for q in refined(mechanism, plan.path)])
    return float(np.linalg.norm(np.diff(trace, axis=0), axis=1).sum())


def _motion(plan: Plan) -> str:
    """Return the motion of the joints: an angle; a length if all are prismatic; of both kinds, rad and lengths."""
    mechanism = plan.scene.mechanism
    prismatic = [mechanism.is_prismatic(joint) for joint in mechanism.joints]
    if mechanism.floating or (any(prismatic) and not all(prismatic)):
        return f"{shown(plan.motion, NUMBER, 3)} rad and lengths of {_length_text(mechanism.length)}"
    return _length_text(plan.motion * mechanism.length) if any(prismatic) else shown(plan.motion, ANGLE, 3)


def _document(plan: Plan) -> dict[str, Any]:
    """Return the plan for JSON: m and rad, null for the distance to nothing."""
    from cinegen.typed_json import as_json

    scene, mechanism = plan.scene, plan.scene.mechanism
    lost = dict(mechanism.unchecked_links)
    return as_json(
        plan, "field", "status", "reason", "clearance", "motion", "weighted_motion", "trace", "clearances",
        scene=scene.name, robot=mechanism.name, locked=scene.locked, attached=[held.name for held in scene.attached],
        node=scene.node, goal=scene.document()["goal"], safety=scene.safety, length=_length(plan),
        mesh_check=as_json(plan.mesh_check, "step", "unchecked", allowed=scene.allowed_collisions, lost=lost),
        attempts=[
            as_json(attempt, "strategy", "status", "blocked_by", "reason", steps=len(attempt.path) - 1)
            for attempt in plan.attempts
        ],
        path=[mechanism.values(q) for q in plan.path],
        **({"base": plan.path[:, :7]} if mechanism.floating else {}),
    )  # fmt: skip
