"""`cinegen plan`: a way to a goal around obstacles."""

from __future__ import annotations

import argparse
import json
import math
import tempfile
import textwrap
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cinegen.cli.drive import of_page, show
from cinegen.cli.files import count, ignoring_loops, progress, write_figure
from raff2urdf.files import is_stream

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from cinegen.collision import Scene
    from cinegen.planning import Plan

_FIELDS = ("vortex", "firas", "spherical", "elliptical", "literal")
_REPELLING = ("firas", "spherical", "elliptical")
_SEARCH = 10.0  # s
_SHOWN = 4.0  # s: what takes less is shown slower
_BROAD = 100  # columns


def add(commands: Any) -> None:
    """Adds the command."""
    plan = commands.add_parser(
        "plan", help="a way to a goal around obstacles, by vortex fields or by sampling",
        description="Looks for a way from a scene's start to its goal on which nothing comes nearer to anything than "
        "the scene's safety distance, and says how it went. The exit code is 0 where the goal is reached, else 1. "
        "Lengths in mm; as JSON, m and rad.",
    )  # fmt: skip
    plan.add_argument("scene", metavar="SCENE", help="a robot, obstacles, start and goal: a .toml or .json file")
    plan.add_argument(
        "--field", default="vortex", choices=_FIELDS,
        help="what leads round obstacles (%(default)s); the others are there to be compared: potentials that repel, "
        "and the vortices of the paper to the letter",
    )  # fmt: skip
    plan.add_argument(
        "--planner", default="vortex", choices=["vortex", "rrtconnect"],
        help="rrtconnect: samples postures, for --seconds at most (10); finds ways that no field does (%(default)s)",
    )  # fmt: skip
    ignoring_loops(plan)
    plan.add_argument("-o", "--output", metavar="FILE.jsonl", help="record the way, for `cinegen replay` and `export`")
    plan.add_argument("--plot", metavar="FILE", help="draw the way: .png, .svg or .pdf")
    shown = plan.add_mutually_exclusive_group()
    shown.add_argument("--json", action="store_true", help="all of it as JSON")
    shown.add_argument("--view", action="store_true", help="show the way in the page")
    of_page(plan.add_argument_group("with --view"))
    plan.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Looks for the way; prints, draws, records and shows it."""
    from cinegen.collision import load_scene
    from cinegen.errors import CinegenError

    if options.planner != "vortex" and options.field != "vortex":
        raise CinegenError(f"--field {options.field}: --planner {options.planner} follows no field; leave one out")
    if options.output and Path(options.output).is_file() and not is_stream(options.output):
        raise CinegenError(f"{options.output}: is there already; name another file, or remove it first")
    scene = load_scene(options.scene, options.ignore_loops)
    if not options.json:
        print("\n".join(_given(scene)), flush=True)
    with progress() as say:
        found = _planned(scene, options, say)
    if options.json:
        print(json.dumps(_document(found, options), indent=1, ensure_ascii=False, allow_nan=False))
    else:
        print("\n".join(["", *_told(found), "", *_advice(found, options)]).rstrip(), flush=True)
    if options.plot:
        _draw(found, options)
    moves = bool((found.path[1:] != found.path[0]).any())
    if options.output:
        _record(found, options, moves)
    if options.view:
        _view(found, options, moves)
    return 0 if found else 1


def _planned(scene: Scene, options: argparse.Namespace, say: Any) -> Plan:
    from cinegen.planning import plan, rrt_connect

    if options.planner == "rrtconnect":
        return rrt_connect(scene, seconds=_SEARCH if options.seconds is None else options.seconds, say=say)
    return plan(scene, field=options.field, say=say)


# --- what is told ------------------------------------------------------------------------------------------------


def _given(scene: Scene) -> list[str]:
    """Lines: the robot, where it is to go, and what stands in its way."""
    mechanism = scene.mechanism
    if scene.mobile is None:
        robot = f"robot '{mechanism.name}', {count(mechanism.joints, 'joint')}"
        robot += f", {count(mechanism.loops, 'loop')}" if mechanism.loops else ""
    else:
        robot = f"mobile robot, radius {_mm(scene.mobile)}" if scene.mobile else "mobile robot, a point"
    turned = {0: "", 1: ", and its turn about z", 3: ", and its orientation"}[scene.rotation]
    goal = _place(scene.goal.translation[: scene.translation])
    obstacles = ", ".join(f"{one.name} ({one.kind})" if one.name != one.kind else one.name for one in scene.obstacles)
    lines = [f"{scene.name}: {robot}; {scene.node} to {goal}{turned}"]
    lines += textwrap.wrap(
        f"{count(scene.obstacles, 'obstacle')}{': ' * bool(obstacles)}{obstacles}", _BROAD,
        initial_indent="  ", subsequent_indent="    ",
    )  # fmt: skip
    return lines


def _told(found: Plan) -> list[str]:
    """Lines: the status, what the way is like, and a table of attempts."""
    lines = textwrap.wrap(_status(found), _BROAD, subsequent_indent="  ")
    if len(found.path) > 1 or found:
        lines += [
            f"  steps      {len(found.path) - 1}",
            f"  way        {_mm(_length(found))}, of {found.scene.node}",
            f"  motion     {_motion(found)}, of the joints",
        ]
    lines.append(f"  clearance  {_clearance(found)}")
    if found.attempts:
        lines += textwrap.wrap(f"  meshes     {_meshes(found)}", _BROAD, subsequent_indent=" " * 13)
    if found.attempts:
        rows = [(one.status.value, str(len(one.path) - 1), one.words) for one in found.attempts]
        widths = [max(map(len, column)) for column in list(zip(*rows, strict=True))[:2]]
        status, steps = max(widths[0], len("status")), max(widths[1], len("steps"))
        lines += ["", f"  attempt  {'status':<{status}}  {'steps':>{steps}}  led by"]
        for k, (word, number, led) in enumerate(rows, 1):
            lines.append(f"  {k:>7}  {word:<{status}}  {number:>{steps}}  {led}")
    return lines


def _status(found: Plan) -> str:
    """The status first; where that is no goal, where it is, and why."""
    from cinegen.planning import PlanStatus

    scene = found.scene
    if found:
        return f"{found.status.value}: {scene.node} is at its goal"
    if not found.attempts or found.status is PlanStatus.TIME_LIMIT:
        return str(found)
    here = found.trace[-1][: scene.translation]
    left = math.dist(here, scene.goal.translation[: scene.translation])
    words = f"{found.status.value}: {scene.node} at {_place(here)}, {_mm(left)} from its goal: {found.reason}"
    told = found.attempts[-1].held_by or (found.field is not None and found.field.value in _REPELLING)
    return words if told else words + _nearest(found)


def _nearest(found: Plan) -> str:
    """What is next to each other at the end of the way."""
    from cinegen.collision.around import surroundings

    clearance, _ = surroundings(found.scene)
    distances = clearance.distances(found.path[-1])
    if not len(distances):
        return ""
    one, other = clearance.names(int(distances.argmin()))
    near = f"'{one}', {_mm(float(distances.min()))} from '{other}'"
    return f"; nearest is {near}"


def _clearance(found: Plan) -> str:
    kept = f"{_mm(found.scene.safety)} {'is' if found.scene.safety == 0.0 else 'are'} to be kept"
    if math.isinf(found.clearance):
        return f"there is nothing to meet; {kept}"
    where = "at least, all along" if len(found.path) > 1 else "at the start"
    return f"{_mm(found.clearance)} {where}; {kept}"


def _meshes(found: Plan) -> str:
    """What the check of the path against the meshes covered."""
    left_out = [f"{one}-{other}" for one, other in (*found.mesh_check.unchecked, *found.scene.allowed_collisions)]
    words = f"no contact on this path, checked every {_mm(found.mesh_check.step)} of motion"
    return f"{words}; not checked: {', '.join(left_out)}" if left_out else words


def _advice(found: Plan, options: argparse.Namespace) -> list[str]:
    """What may be tried where the goal is not reached."""
    from cinegen.planning import PlanStatus

    if found:
        return []
    match found.status:
        case PlanStatus.START_IN_COLLISION:
            words = "Start somewhere else (start), move the obstacle, or make the distance to be kept (safety) smaller."
        case PlanStatus.GOAL_IN_COLLISION:
            words = "Every posture at the goal that was found is too near to something: move the goal or the obstacle, "
            words += "leave more of the goal open, or make the distance to be kept (safety) smaller."
        case PlanStatus.IN_COLLISION:
            words = (
                "The convex solids around the links are kept clear, but the meshes touch: try another start or goal."
            )
        case PlanStatus.OUT_OF_REACH:
            words = "Bring the goal nearer, or leave more of it open: its orientation, or z."
        case PlanStatus.TIME_LIMIT:
            longer = 6.0 * (_SEARCH if options.seconds is None else options.seconds)
            words = f"Try --seconds {longer:g}, or a smaller distance to be kept (safety): there may be no way at all."
        case _ if options.field != "vortex":
            words = "Try --field vortex, or --planner rrtconnect: it samples postures instead of following a field."
        case _:
            words = "Try --planner rrtconnect: it samples postures instead of following a field, with the same "
            words += "distances, and finds ways through places that hold a local method."
    return textwrap.wrap(words, _BROAD)


def _mm(metres: float) -> str:
    """In mm, with three digits at least."""
    value = 1e3 * metres
    return f"{value:.3g} mm" if abs(value) < 100.0 else f"{value:.0f} mm"


def _place(point: NDArray[np.float64]) -> str:
    """Two or three coordinates of a point (m), in mm."""
    return (
        ", ".join(f"{name} {round(1e3 * value) + 0:g}" for name, value in zip("xyz", point.tolist(), strict=False))
        + " mm"
    )


def _length(found: Plan) -> float:
    """Of the way that the node goes, m: between the configurations of the path it may go on curves."""
    import numpy as np

    from cinegen.planning.fine import fine

    mechanism, node = found.scene.mechanism, found.scene.node
    trace = np.array([mechanism.placement(q, node).translation for q in fine(mechanism, found.path)])
    return float(np.linalg.norm(np.diff(trace, axis=0), axis=1).sum())


def _motion(found: Plan) -> str:
    """Turns in rad, slides in m; of a mechanism that has both, both in characteristic lengths and rad."""
    mechanism = found.scene.mechanism
    slides = [mechanism.slides(joint) for joint in mechanism.joints]
    if mechanism.floating or (any(slides) and not all(slides)):
        return f"{found.motion:.3g} rad and lengths of {_mm(mechanism.length)}"
    return f"{found.motion * mechanism.length:.3g} m" if any(slides) else f"{found.motion:.3g} rad"


def _document(found: Plan, options: argparse.Namespace) -> dict[str, Any]:
    """As JSON has it: m and rad, null for a distance to nothing."""
    scene, mechanism = found.scene, found.scene.mechanism
    columns = [mechanism.q_index(name) for name in mechanism.joints]
    document: dict[str, Any] = {
        "scene": scene.name,
        "file": str(options.scene),
        "robot": mechanism.name,
        "planner": options.planner,
        "field": None if found.field is None else found.field.value,
        "status": found.status.value,
        "reason": found.reason,
        "node": scene.node,
        "goal": scene.document()["goal"],
        "safety": scene.safety,
        "clearance": _finite(found.clearance),
        "mesh_check": {
            "step": found.mesh_check.step,
            "unchecked": [list(pair) for pair in found.mesh_check.unchecked],
            "allowed": [list(pair) for pair in found.scene.allowed_collisions],
        },
        "length": _length(found),
        "motion": found.motion,
        "attempts": [
            {
                "led_by": one.words,
                "status": one.status.value,
                "steps": len(one.path) - 1,
                "held_by": [list(pair) for pair in one.held_by],
                "reason": one.reason,
            }
            for one in found.attempts
        ],
        "path": [dict(zip(mechanism.joints, q[columns].tolist(), strict=True)) for q in found.path],
        "trace": found.trace.tolist(),
        "clearances": [_finite(distance) for distance in found.clearances.tolist()],
    }
    if mechanism.floating:
        document["base"] = found.path[:, :7].tolist()
    return document


def _finite(number: float) -> float | None:
    return number if math.isfinite(number) else None


# --- pictures, recordings ----------------------------------------------------------------------------------------


def _draw(found: Plan, options: argparse.Namespace) -> None:
    from cinegen.plotting import draw_plan

    path = Path(options.plot)
    write_figure(path, draw_plan(found))
    if not options.json:
        print(f"picture: {path.resolve()}")


def _record(found: Plan, options: argparse.Namespace, moves: bool) -> None:
    """The robot alone: what exports it asks for no other."""
    from cinegen.mission.results import record_plan
    from cinegen.session import in_scene

    path = Path(options.output)
    said = f"there is no way: {path} is not written"
    if moves:
        setup = in_scene(found.scene)
        name = next(iter(setup.robots))
        times = record_plan(found, path, name, {name: setup.robots[name]})
        said = f"recorded: {path}, {times[-1]:.1f} s" + ("" if found else ", as far as it came")
    if not options.json:
        print(said)


def _view(found: Plan, options: argparse.Namespace, moves: bool) -> None:
    """Shows the way in the page, between its obstacles."""
    from cinegen.mission import BasePose
    from cinegen.mission.results import record_plan
    from cinegen.session import in_scene, replayed

    if not moves:
        print("there is no way to be shown")
        return
    setup = in_scene(found.scene)
    bases = {name: BasePose(None, None, stand.placement) for name, stand in setup.stands.items()}
    with tempfile.TemporaryDirectory(prefix="cinegen-") as folder:
        recording = Path(folder) / f"{found.scene.name}.jsonl"
        times = record_plan(found, recording, next(iter(setup.robots)), setup.robots, bases)
        tempo = min(1.0, max(0.01, float(times[-1]) / _SHOWN))
        show(replayed(recording, tempo), options, found.scene.name)
