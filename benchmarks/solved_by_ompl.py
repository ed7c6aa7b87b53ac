"""How many random scenes `plan` solves of those that OMPL's RRT-Connect solves with the same checker.

    python benchmarks/solved_by_ompl.py [COUNT] [FAMILY ...] [--first NUMBER] [--seconds S]

Families, by default all:

    table-ROBOT    among boxes on a table (ur5, ur10, panda, z1), from one random configuration to another
    bin-ROBOT      from above into a bin of five boards, to the configuration at a random point inside
    columns-delta4, columns-gough    a platform among columns, from one pose to another of the same assembly mode
    shelf-tall, shelf-thin, box, cage, kitchen, under-table    a panda's hand grasps in scenes as of MotionBenchMaker,
                   of random sizes: from one compartment of a shelf to another; from above into an open box on a table,
                   and into a cage of bars; between a counter, its sink, the cupboard below with an open door, and the
                   one above; and from above to under a table

Start and goal are joint values that keep twice the safety distance. Whether there is a path is not known.

    plan    `cinegen.planning.plan`
    ompl    RRT-Connect of OMPL in its default settings; a configuration is valid where `Clearance.least` is at least
            the safety distance, motions at OMPL's default resolution. With loops: RRT-Connect on
            OMPL's projected state space with the mechanism's closing of loops, motions tested every 0.05 rad or
            characteristic lengths

All seconds, limits too, are CPU seconds of this process: on a busy machine the result is that of an idle one. Paths of
`plan` are clear everywhere, and shortened; those of OMPL are clear where it tested them: what it solves may be too
much. They are not shortened, unless `--simplify` asks for it.
"""

from __future__ import annotations

import argparse
import time
import warnings
from collections.abc import Callable, Mapping
from functools import cache, partial
from statistics import median
from typing import Any

import numpy as np
import pinocchio as pin
from bench import EXAMPLES, CpuClock, rate, rrt_connect

import cinegen
from cinegen.arrays import Array
from cinegen.collision import Clearance, Scene, clearance_of, scene_for
from cinegen.collision.scene import unmoving_joints
from cinegen.errors import ClosureError
from cinegen.ik import FrameTask
from cinegen.ik.local_ik import LocalIK
from cinegen.model import Mechanism
from cinegen.planning import plan
from cinegen.planning.locked_joints import with_joints_locked
from cinegen.planning.sampling.ompl_trees import Trees
from cinegen.planning.sampling.path_sampler import SamplingSpace

Entry = dict[str, Any]

SAFETY = 0.005  # m
DELTA = 0.05  # rad or characteristic lengths: between tested configurations of robots with loops
LONGEST = 0.8  # rad or characteristic lengths: of a motion of robots with loops
ARMS = {  # file, node, reach (m), height of the node over what is inside a bin (m): the z1's gripper is long
    "ur5": ("ur_description/urdf/ur5_robot.urdf", "tool0", 0.85, 0.0),
    "ur10": ("ur_description/urdf/ur10_robot.urdf", "tool0", 1.3, 0.0),
    "panda": ("panda_description/urdf/panda.urdf", "panda_hand", 0.85, 0.0),
    "z1": ("z1_description/urdf/z1.urdf", "link06", 0.65, 0.15),
}


@cache
def arm(name: str) -> Mechanism:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return cinegen.load(EXAMPLES / ARMS[name][0])


@cache
def shipped(name: str) -> Mechanism:
    return cinegen.load(name)


def box(name: str, size: Array, point: Array, angle: float = 0.0) -> Entry:
    return {"name": name, "kind": "box", "size": np.asarray(size).tolist(), "point": list(point), "angle": angle}


def task(mechanism: Mechanism, node: str, obstacles: list[Entry], start: Array, goal: Array) -> Scene:
    """A scene from one configuration to another."""
    moving = [name for name in mechanism.actuated if name not in unmoving_joints(mechanism, node, ())]
    end = {name: float(goal[mechanism.q_index(name)]) for name in moving}
    first = {name: float(start[mechanism.q_index(name)]) for name in mechanism.actuated}
    return scene_for(mechanism, end, start=first, obstacles=obstacles, node=node, safety=SAFETY)


def simplest(mechanism: Mechanism, node: str, q: Array) -> Array:
    """The same pose without whole revolutions, which an arm can't make at a table. Joints that don't move the node,
    such as a gripper's, are half open: a plan locks them, so start and goal have to agree."""
    locked = unmoving_joints(mechanism, node, ())
    values = {name: sum(mechanism.limits[name][:2]) / 2.0 for name in locked}
    for name in set(mechanism.actuated).difference(locked):
        angle = float(np.remainder(q[mechanism.q_index(name)] + np.pi, 2.0 * np.pi) - np.pi)
        if mechanism.limits[name][0] <= angle <= mechanism.limits[name][1]:
            values[name] = angle
    return mechanism.configuration(values, q)


def among(mechanism: Mechanism, node: str, obstacles: list[Entry]) -> Clearance:
    home = {name: float(mechanism.q_home[mechanism.q_index(name)]) for name in mechanism.actuated}
    return clearance_of(scene_for(mechanism, home, obstacles=obstacles, node=node, safety=SAFETY))


def is_clear(near: Clearance, q: Array) -> bool:
    """Whether obstacles are twice as far as the safety distance, and links as far from each other as they must be."""
    of_links = near.pairs[:, 1] < len(near.links)
    return bool((near.distances(q) > np.where(of_links, SAFETY, 2.0 * SAFETY)).all())


def posture(mechanism: Mechanism, node: str, point: Array, near: Clearance, rng: np.random.Generator) -> Array | None:
    """A clear configuration with the node at a point; None if 20 tries don't find one."""
    target = pin.SE3(np.eye(3), np.asarray(point, dtype=float))
    local = LocalIK(mechanism, (FrameTask(node, target, 3, 0, axes="world"),))
    for _ in range(20):
        if local.solve(local.random_start(rng), 1e-10):
            q = simplest(mechanism, node, local.best)
            if is_clear(near, q):
                return q
    return None


# --- scenes ------------------------------------------------------------------------------------------------------


def table(name: str, number: int) -> Scene:
    rng, mechanism, (_, node, reach, _) = np.random.default_rng(number), arm(name), ARMS[name]
    obstacles = [box("top", [3.0 * reach, 3.0 * reach, 0.02], [0.0, 0.0, -0.06])]
    for i in range(5):
        size = rng.uniform([0.1, 0.1, 0.15], [0.25, 0.25, 0.5]) * reach
        turn, far = rng.uniform(-1.5, 1.5), rng.uniform(0.45, 0.8) * reach
        point = [far * np.cos(turn), far * np.sin(turn), size[2] / 2.0 - 0.05]
        obstacles.append(box(f"box{i}", size, point, rng.uniform(0.0, np.pi)))
    near, ends = among(mechanism, node, obstacles), list[Array]()
    while len(ends) < 2:
        turn, far = rng.uniform(-1.5, 1.5), rng.uniform(0.4, 0.85) * reach
        point = np.array([far * np.cos(turn), far * np.sin(turn), rng.uniform(0.08, 0.4) * reach])
        q = posture(mechanism, node, point, near, rng)
        if q is not None:
            ends.append(q)
    return task(mechanism, node, obstacles, *ends)


def container(name: str, number: int) -> Scene:
    rng, mechanism, (_, node, reach, tool) = np.random.default_rng(number), arm(name), ARMS[name]
    wide, long, high, wall = *(rng.uniform([0.35, 0.35, 0.2], [0.5, 0.6, 0.35]) * reach), 0.02
    centre = np.array([rng.uniform(0.5, 0.6) * reach, rng.uniform(-0.3, 0.3) * reach, 0.0])
    obstacles = [box("floor", [wide, long, wall], centre)]
    for i, side in enumerate((-1.0, 1.0)):
        obstacles.append(box(f"x{i}", [wall, long, high], centre + np.array([side * wide / 2.0, 0.0, high / 2.0])))
        obstacles.append(box(f"y{i}", [wide, wall, high], centre + np.array([0.0, side * long / 2.0, high / 2.0])))
    near, end, start = among(mechanism, node, obstacles), None, None
    while end is None or start is None:
        inside = centre + rng.uniform([-0.3, -0.3, 0.4], [0.3, 0.3, 0.9]) * [wide, long, high] + [0.0, 0.0, tool]
        outside = [rng.uniform(-0.2, 0.6) * reach, rng.choice([-1.0, 1.0]) * 0.5 * reach, rng.uniform(0.2, 0.5) * reach]
        end = posture(mechanism, node, inside, near, rng) if end is None else end
        start = posture(mechanism, node, np.array(outside), near, rng) if start is None else start
    return task(mechanism, node, obstacles, start, end)


def columns(name: str, number: int) -> Scene:
    """Three columns that stand where the legs of a delta, or of a Gough platform, and the platform may hit them."""
    rng, mechanism = np.random.default_rng(number), shipped(name)
    node, far = mechanism.end, {"delta4": 1.0, "gough": 0.12}[name]
    home = mechanism.placement(mechanism.q_home, node)
    while True:
        obstacles = []
        for i in range(3):
            turn, r = rng.uniform(-np.pi, np.pi), rng.uniform(*((0.2, 1.0) if name == "delta4" else (0.5, 2.5))) * far
            top = rng.uniform(-0.35, -0.1) if name == "delta4" else rng.uniform(-0.5, -0.05)
            point = home.translation + np.array([r * np.cos(turn), r * np.sin(turn), top - 0.5])
            post = {"name": f"post{i}", "kind": "cylinder", "length": 1.0, "point": point.tolist()}
            obstacles.append(post | {"radius": rng.uniform(0.01, 0.05) * (2.0 if name == "delta4" else 1.0)})
        near, ends = among(mechanism, node, obstacles), list[Array]()
        for turn in rng.uniform(-np.pi, np.pi) + np.array([0.0, np.pi]):
            move = far * np.array([np.cos(turn), np.sin(turn), rng.uniform(-0.4, -0.1)])
            target = pin.SE3(home.rotation, home.translation + move)
            reached = cinegen.inverse_kinematics(mechanism, [FrameTask(node, target, 3, 0)], mechanism.q_home)
            if reached and mechanism.limits.within(reached.q) and is_clear(near, reached.q):
                ends.append(reached.q)
        if len(ends) == 2:
            try:
                made = task(mechanism, node, obstacles, *ends)
            except cinegen.CinegenError:  # the joint values lead to another assembly mode
                continue
            if is_clear(near, made.start) and is_clear(near, made.goal_configuration):
                return made


# --- as of MotionBenchMaker --------------------------------------------------------------------------------------

FORWARD, DOWN = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, -1.0])
TIP = 0.11  # m: from the origin of the panda's hand to between its finger tips


def grasp(point: Array, approach: Array, near: Clearance, rng: np.random.Generator) -> Array | None:
    """A clear configuration with the finger tips at a point, the hand along a direction up to 0.3 rad, turned about it
    in any way; None if 20 tries don't find one."""
    mechanism, node = arm("panda"), ARMS["panda"][1]
    local = LocalIK(mechanism, (FrameTask(node, pin.SE3.Identity(), 3, 3, axes="world"),))
    for _ in range(20):
        along = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), approach).toRotationMatrix()
        turned = (
            pin.exp3(rng.uniform(-0.3, 0.3, 3)) @ along @ pin.exp3(np.array([0.0, 0.0, rng.uniform(-np.pi, np.pi)]))
        )
        local.tasks[0].target = pin.SE3(turned, np.asarray(point) - TIP * turned[:, 2])
        if local.solve(local.random_start(rng), 1e-10):
            q = simplest(mechanism, node, local.best)
            if is_clear(near, q):
                return q
    return None


def grasps(
    obstacles: list[Entry], ends: list[Callable[[], tuple[Array, Array]]], rng: np.random.Generator
) -> Scene | None:
    """A panda from one grasp to another, each at a random point and along a random direction; None without them."""
    near, grasped = among(arm("panda"), ARMS["panda"][1], obstacles), list[Array]()
    for sample in ends:
        tries = (grasp(*sample(), near, rng) for _ in range(20))
        grasped += [q for q in (next((q for q in tries if q is not None), None),) if q is not None]
    return task(arm("panda"), ARMS["panda"][1], obstacles, *grasped) if len(grasped) == 2 else None


def over_table(rng: np.random.Generator) -> tuple[Array, Array]:
    """A point in front of the robot, and down."""
    return rng.uniform([0.3, -0.5, 0.5], [0.6, 0.5, 0.8]), DOWN


def retried(make: Callable[[np.random.Generator], Scene | None], number: int) -> Scene:
    """The first scene in which there are grasps."""
    rng = np.random.default_rng(number)
    while (made := make(rng)) is None:
        pass
    return made


def bookshelf(rng: np.random.Generator, height: tuple[float, float], rows: int) -> Scene | None:
    high, wide, deep, low = (
        rng.uniform(*height),
        rng.uniform(0.5, 0.8),
        rng.uniform(0.25, 0.35),
        rng.uniform(0.05, 0.2),
    )
    x, y, angle, board = rng.uniform(0.7, 0.85), rng.uniform(-0.15, 0.15), rng.uniform(-0.3, 0.3), 0.02
    turn = np.array([[np.cos(angle), -np.sin(angle), 0.0], [np.sin(angle), np.cos(angle), 0.0], [0.0, 0.0, 1.0]])
    obstacles, corner = list[Entry](), np.array([x, y, low])

    def put(name: str, size: list[float], at: list[float]) -> None:
        obstacles.append(box(name, np.array(size), corner + turn @ at, angle))

    for i in range(rows + 1):
        put(f"board{i}", [deep, wide, board], [0.0, 0.0, i * high])
    for i, side in enumerate((-1.0, 0.0, 1.0)):
        put(f"side{i}", [deep, board, rows * high], [0.0, side * wide / 2.0, rows * high / 2.0])
    cells = [(row, side) for row in range(rows) for side in (-1.0, 1.0)]
    for i in rng.permutation(len(cells))[:3]:
        row, side = cells[i]
        at = [rng.uniform(0.0, 0.1), side * wide * rng.uniform(0.1, 0.4), row * high + 0.08]
        can = {"name": f"can{i}", "kind": "cylinder", "radius": 0.03, "length": 0.12}
        obstacles.append(can | {"point": (corner + turn @ at).tolist()})

    def inside(row: int, side: float) -> tuple[Array, Array]:
        at = [rng.uniform(-0.1, 0.05), side * wide * rng.uniform(0.12, 0.38), (row + rng.uniform(0.35, 0.65)) * high]
        return corner + turn @ at, turn @ FORWARD

    chosen = [cells[i] for i in rng.permutation(len(cells))[:2]]
    return grasps(obstacles, [partial(inside, *cell) for cell in chosen], rng)


def open_box(rng: np.random.Generator) -> Scene | None:
    wide, long, high, wall = *rng.uniform([0.35, 0.35, 0.2], [0.5, 0.6, 0.35]), 0.015
    angle, centre = rng.uniform(-0.5, 0.5), np.array([rng.uniform(0.45, 0.6), rng.uniform(-0.3, 0.3), 0.1])
    turn = np.array([[np.cos(angle), -np.sin(angle), 0.0], [np.sin(angle), np.cos(angle), 0.0], [0.0, 0.0, 1.0]])
    obstacles = [box("table", [0.7, 1.6, 0.04], [0.65, 0.0, 0.05]), box("floor", [wide, long, wall], centre, angle)]
    for i, side in enumerate((-1.0, 1.0)):
        x, y = turn @ [side * wide / 2.0, 0.0, high / 2.0], turn @ [0.0, side * long / 2.0, high / 2.0]
        obstacles += [box(f"x{i}", [wall, long, high], centre + x, angle)]
        obstacles += [box(f"y{i}", [wide, wall, high], centre + y, angle)]
    lid = turn @ [wide / 2.0 + 0.02, 0.0, high * 1.5]  # it stands open
    obstacles += [box("lid", [wall, long, high], centre + lid, angle)]

    def inside() -> tuple[Array, Array]:
        at = rng.uniform([-0.3, -0.3, 0.2], [0.3, 0.3, 0.5]) * [wide, long, high]
        return centre + turn @ at, DOWN

    return grasps(obstacles, [partial(over_table, rng), inside], rng)


def cage(rng: np.random.Generator) -> Scene | None:
    wide, high, bar = rng.uniform(0.4, 0.55), rng.uniform(0.35, 0.5), rng.uniform(0.01, 0.02)
    centre, angle = np.array([rng.uniform(0.5, 0.65), rng.uniform(-0.25, 0.25), 0.05]), rng.uniform(-0.8, 0.8)
    turn = np.array([[np.cos(angle), -np.sin(angle), 0.0], [np.sin(angle), np.cos(angle), 0.0], [0.0, 0.0, 1.0]])
    obstacles, half, gap = [box("floor", [wide, wide, 0.02], centre, angle)], wide / 2.0, wide / 2.0
    for i, part in enumerate(np.arange(-half, half + 1e-9, gap)):
        for k, at in enumerate(([part, -half, 0.0], [part, half, 0.0], [-half, part, 0.0], [half, part, 0.0])):
            point = (centre + turn @ at + [0.0, 0.0, high / 2.0]).tolist()
            post = {"name": f"post{i}-{k}", "kind": "cylinder", "radius": bar, "length": high}
            obstacles.append(post | {"point": point})
        rod = turn @ [part, 0.0, high]
        obstacles.append(box(f"rod{i}", [2.0 * bar, wide, 2.0 * bar], centre + rod, angle))

    def inside() -> tuple[Array, Array]:
        at = rng.uniform([-0.3, -0.3, 0.2], [0.3, 0.3, 0.6]) * [wide, wide, high]
        return centre + turn @ at, DOWN if rng.random() < 0.5 else turn @ FORWARD

    return grasps(obstacles, [partial(over_table, rng), inside], rng)


def kitchen(rng: np.random.Generator) -> Scene | None:
    deep, long, top, board = rng.uniform(0.45, 0.55), rng.uniform(1.2, 1.6), rng.uniform(0.15, 0.3), 0.02
    front, y, bay = rng.uniform(0.4, 0.48), rng.uniform(-0.15, 0.15), rng.uniform(0.4, 0.5)
    middle, sink, bottom, above = front + deep / 2.0, rng.choice([-1.0, 1.0]) * bay, -0.35, top + rng.uniform(0.4, 0.5)
    obstacles, half = [box("wall", [0.02, 2.0, 2.0], [front + deep + 0.02, 0.0, 0.6])], bay / 2.0

    def plate(name: str, low: tuple[float, float, float], high: tuple[float, float, float]) -> None:
        ends = np.array([low, high]) + np.array([0.0, y, 0.0])
        obstacles.append(box(name, np.abs(ends[1] - ends[0]), ends.mean(axis=0)))

    back = front + deep
    for i, (left, right) in enumerate(((-long / 2.0, sink - half), (sink + half, long / 2.0))):  # the sink between them
        plate(f"top{i}", (front, left, top - board), (back, right, top))
    plate("sink-floor", (front, sink - half, top - 0.2), (back, sink + half, top - 0.18))
    plate("sink-front", (front, sink - half, top - 0.2), (front + 0.05, sink + half, top))
    for i, side in enumerate((-long / 2.0, -half, half, long / 2.0)):  # the cupboard below is open between two of them
        plate(f"side{i}", (front, side - board / 2.0, bottom), (back, side + board / 2.0, top - 0.21))
    plate("bottom", (front, -long / 2.0, bottom), (back, long / 2.0, bottom + board))
    plate("door", (front - 0.35, -half - board, bottom), (front, -half, top - 0.21))
    hung = back - rng.uniform(0.25, 0.3)
    for i in range(3):
        plate(f"shelf{i}", (hung, -long / 2.0, above + 0.27 * i), (back, long / 2.0, above + 0.27 * i + board))
    for i in range(4):
        r, h = rng.uniform(0.03, 0.04), rng.uniform(0.08, 0.2)
        point = [rng.uniform(front + 0.15, back - 0.1), y + rng.uniform(-0.5, 0.5) * long, top + 0.01 + h / 2.0]
        can = {"name": f"can{i}", "kind": "cylinder", "radius": r, "length": h, "point": point}
        obstacles.append(can)

    def on_top() -> tuple[Array, Array]:
        at = [rng.uniform(front + 0.05, middle), y + rng.uniform(-0.35, 0.35) * long, top + rng.uniform(0.05, 0.15)]
        return np.array(at), rng.choice([FORWARD, DOWN])

    def in_sink() -> tuple[Array, Array]:
        at = [rng.uniform(front + 0.12, middle), y + sink + rng.uniform(-0.2, 0.2) * bay, top - rng.uniform(0.0, 0.1)]
        return np.array(at), DOWN

    def below() -> tuple[Array, Array]:
        at = [
            rng.uniform(front, front + 0.1),
            y + rng.uniform(-0.25, 0.25) * bay,
            rng.uniform(bottom + 0.15, top - 0.3),
        ]
        return np.array(at), FORWARD

    def hung_up() -> tuple[Array, Array]:
        at = [hung + rng.uniform(0.0, 0.1), y + rng.uniform(-0.3, 0.3) * long, above + rng.uniform(0.1, 0.17)]
        return np.array(at), FORWARD

    places = [on_top, in_sink, below, hung_up]
    return grasps(obstacles, [places[i] for i in rng.permutation(len(places))[:2]], rng)


def under_table(rng: np.random.Generator) -> Scene | None:
    top, wide, long, leg = rng.uniform(0.35, 0.5), rng.uniform(0.5, 0.7), rng.uniform(0.8, 1.2), 0.05
    near_edge, y = rng.uniform(0.35, 0.45), rng.uniform(-0.15, 0.15)
    centre = np.array([near_edge + wide / 2.0, y, top])
    obstacles = [box("top", [wide, long, 0.03], centre)]
    for i, (a, b) in enumerate(((-1, -1), (-1, 1), (1, -1), (1, 1))):
        at = [a * (wide - leg) / 2.0, b * (long - leg) / 2.0, -top / 2.0]
        obstacles.append(box(f"leg{i}", [leg, leg, top - 0.04], centre + at))
    for i in range(4):
        r, h = rng.uniform(0.03, 0.05), rng.uniform(0.1, 0.25)
        at = [
            rng.uniform(-0.45, 0.45) * wide,
            rng.uniform(-0.45, 0.45) * long,
            0.02 + h / 2.0 if i % 2 else h / 2.0 - top,
        ]
        can = {"name": f"can{i}", "kind": "cylinder", "radius": r, "length": h}
        obstacles.append(can | {"point": (centre + at).tolist()})

    def below() -> tuple[Array, Array]:
        at = [rng.uniform(-0.4, 0.0) * wide, rng.uniform(-0.35, 0.35) * long, -rng.uniform(0.35, 0.6) * top]
        return centre + at, FORWARD

    return grasps(obstacles, [partial(over_table, rng), below], rng)


FAMILIES: Mapping[str, Callable[[int], Scene]] = {
    **{f"table-{name}": partial(table, name) for name in ARMS},
    **{f"bin-{name}": partial(container, name) for name in ARMS},
    **{f"columns-{name}": partial(columns, name) for name in ("delta4", "gough")},
    "shelf-tall": partial(retried, partial(bookshelf, height=(0.28, 0.36), rows=3)),
    "shelf-thin": partial(retried, partial(bookshelf, height=(0.2, 0.25), rows=4)),
    "box": partial(retried, open_box),
    "cage": partial(retried, cage),
    "kitchen": partial(retried, kitchen),
    "under-table": partial(retried, under_table),
}


# --- OMPL --------------------------------------------------------------------------------------------------------


def is_solved_by_ompl(unlocked: Scene, seconds: float, simplify: bool = False) -> bool:
    """Whether OMPL finds a path within CPU seconds."""
    scene = with_joints_locked(unlocked)
    mechanism, clearance = scene.mechanism, clearance_of(scene)
    space = SamplingSpace(scene, clearance)
    if mechanism.loop_rank:
        return _is_solved_by_projection(scene, clearance, space, seconds)

    def is_valid(point: Array) -> bool:
        q = space.at(point)
        return bool(mechanism.limits.within(q)) and clearance.least(q) >= scene.safety

    goals = space.points(scene.goal_configuration)
    return (
        rrt_connect((space.low, space.high), is_valid, space.point(scene.start), goals, seconds, simplify)[0]
        is not None
    )


def _is_solved_by_projection(scene: Scene, clearance: Clearance, space: SamplingSpace, seconds: float) -> bool:
    """The same for a robot with loops: motions are tested at projected samples; trees that do not meet start anew."""
    mechanism = scene.mechanism

    def closed(x: Array) -> Array | None:
        try:
            return mechanism.close(space.at(x), locked=scene.locked)
        except ClosureError:
            return None

    def close(x: Array) -> Array | None:
        q = closed(x)
        return None if q is None else space.point(q)

    def free(begin: Array, end: Array) -> bool:
        count = int(np.ceil(np.linalg.norm(end - begin) / DELTA))
        before = begin
        for part in np.linspace(0.0, 1.0, count + 1):
            q = closed(begin + part * (end - begin))
            if q is None or not mechanism.limits.within(q) or clearance.least(q) < scene.safety:
                return False
            x = space.point(q)
            if np.linalg.norm(x - before) > 2.0 * DELTA:  # a jump to another assembly mode
                return False
            before = x
        return True

    goals = space.points(scene.goal_configuration)
    start = space.point(scene.start)
    trees = Trees(space.low, space.high, start, goals, free, LONGEST, 1, close, mechanism.loop_rank)
    return trees.grow(time.monotonic() + seconds) is not None


# --- the comparison ----------------------------------------------------------------------------------------------


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("count", nargs="?", type=int, default=10)
    parser.add_argument("families", nargs="*", default=list(FAMILIES), metavar="FAMILY")
    parser.add_argument("--first", type=int, default=0, metavar="NUMBER")
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--simplify", action="store_true", help="shorten OMPL's paths, too (not of robots with loops)")
    options = parser.parse_args()
    time.monotonic = CpuClock()  # for limits
    for family in options.families:
        solved: dict[str, list[int]] = {"plan": [], "ompl": []}
        times: dict[str, list[float]] = {"plan": [], "ompl": []}
        for number in range(options.first, options.first + options.count):
            scene = FAMILIES[family](number)
            begin = time.process_time()
            planned = plan(scene, seconds=options.seconds)
            times["plan"].append(time.process_time() - begin)
            if planned and times["plan"][-1] <= options.seconds:
                solved["plan"].append(number)
            begin = time.process_time()
            is_solved = is_solved_by_ompl(scene, options.seconds, options.simplify)
            times["ompl"].append(time.process_time() - begin)
            if is_solved and times["ompl"][-1] <= options.seconds:
                solved["ompl"].append(number)
            last = planned.attempts[-1].strategy if planned.attempts else planned.reason
            spent = ", ".join(f"{name} {times[name][-1]:.2f} s" for name in times)
            print(f"{family} {number}: {planned.status.value} ({last}); {spent}", flush=True)
        plan_, ompl = (set(solved[name]) for name in ("plan", "ompl"))
        spent = ", ".join(f"{name} {median(seconds):.2f} s" for name, seconds in times.items())
        print(
            f"{family}: plan solved {rate(len(plan_), options.count)}, ompl {rate(len(ompl), options.count)}; "
            f"only plan: {len(plan_ - ompl)}, only ompl: {sorted(ompl - plan_)}; median CPU time {spent}",
            flush=True,
        )


if __name__ == "__main__":
    main()
