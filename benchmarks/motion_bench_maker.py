"""MotionBenchMaker's problems of the panda (C. Chamzas et al., RA-L 7(2), 2022): `plan` against plain OMPL.

    python benchmarks/motion_bench_maker.py FOLDER ... [--seconds S] [--first NUMBER] [--count N] [--safety M]

A folder has pairs of files `requestNNNN.yaml`, a MoveIt motion plan request, and `sceneNNNN.yaml`, a planning scene.
The robot is the stock panda of example-robot-data, its goals exact joint values; fingers are as in the request, within
their limits.

    plan    `cinegen.planning.plan`, one time limit
    ompl    RRT-Connect of OMPL in its default settings, then its `simplifySolution`; a configuration is valid where
            `Clearance.least` is at least the safety distance, tested at OMPL's default resolution

Paths of both are judged by coal's bounding volume hierarchies of the meshes, built here: pairs of links that MoveIt's
scene allows to touch are left out, and configurations are tested every 2 mrad. All seconds, limits too, are CPU seconds
of this process: on a busy machine the result is that of an idle one.
"""

from __future__ import annotations

import argparse
import itertools
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from statistics import median
from typing import Any

import coal
import numpy as np
import pinocchio as pin
import yaml
from bench import EXAMPLES, CpuClock, rate, rrt_connect

import cinegen
from cinegen.arrays import Array
from cinegen.collision import Scene, clearance_of, scene_of
from cinegen.collision.mesh_check import MeshCheck
from cinegen.planning import plan
from cinegen.planning.locked_joints import with_joints_locked

DESCRIPTION = EXAMPLES / "panda_description"
URDF = DESCRIPTION / "urdf/panda.urdf"
STEP = 2e-3  # rad: between configurations that are judged


@cache
def panda() -> cinegen.Mechanism:
    return cinegen.load(URDF)


def read(request: Path, scene: Path, safety: float) -> Scene:
    """Return the problem of a MoveIt request and its scene."""
    asked, world = (yaml.safe_load(path.read_text()) for path in (request, scene))
    state = asked["start_state"]["joint_state"]
    limits = panda().limits
    start = {
        name: float(np.clip(value, *limits[name][:2]))
        for name, value in zip(state["name"], state["position"], strict=True)
    }
    goal = {each["joint_name"]: each["position"] for each in asked["goal_constraints"][0]["joint_constraints"]}
    return scene_of(
        {
            "name": request.stem.replace("request", f"{request.parent.name} "), "node": "panda_hand", "safety": safety,
            "start": {"joints": start}, "goal": {"joints": goal}, "obstacle": list(obstacles(world)),
        },
        mechanism=panda(),
    )  # fmt: skip


def obstacles(world: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """Yield the obstacles of a planning scene as a scene of cinegen has them."""
    for thing in world["world"]["collision_objects"]:
        for i, (shape, pose) in enumerate(zip(thing["primitives"], thing["primitive_poses"], strict=True)):
            size, turn = shape["dimensions"], pin.Quaternion(np.array(pose["orientation"], dtype=float))
            rpy = pin.rpy.matrixToRpy(turn.toRotationMatrix()).tolist()
            placed = {"name": f"{thing['id']} {i}", "kind": shape["type"], "point": pose["position"], "rpy": rpy}
            match shape["type"]:
                case "box":
                    yield placed | {"size": size}
                case "sphere":
                    yield placed | {"radius": size[0]}
                case "cylinder":
                    yield placed | {"length": size[0], "radius": size[1]}
                case kind:
                    raise ValueError(f"{thing['id']}: a shape of type {kind} is not known")


# --- the judge ----------------------------------------------------------------------------------------------------


class Judge:
    """Contact of the panda's meshes with the obstacles of a MoveIt scene and with each other."""

    def __init__(self, scene: Path) -> None:
        world = yaml.safe_load(scene.read_text())
        self._model = pin.buildModelFromUrdf(str(URDF))
        folder = str(DESCRIPTION.parents[2])
        geometry = pin.buildGeomFromUrdf(self._model, str(URDF), pin.GeometryType.COLLISION, package_dirs=[folder])
        matrix = world["allowed_collision_matrix"]
        allowed = {
            frozenset((name, other))
            for name, row in zip(matrix["entry_names"], matrix["entry_values"], strict=True)
            for other, free in zip(matrix["entry_names"], row, strict=True)
            if free
        }
        links = list(geometry.geometryObjects)
        names = [self._model.frames[link.parentFrame].name for link in links]
        pairs = itertools.combinations(range(len(links)), 2)
        for i, k in pairs:
            if names[i] != names[k] and frozenset((names[i], names[k])) not in allowed:
                geometry.addCollisionPair(pin.CollisionPair(i, k))
        for thing in world["world"]["collision_objects"]:
            for shape, pose in zip(thing["primitives"], thing["primitive_poses"], strict=True):
                size = shape["dimensions"]
                solid = {
                    "box": lambda size=size: coal.Box(*size),
                    "cylinder": lambda size=size: coal.Cylinder(size[1], size[0]),
                    "sphere": lambda size=size: coal.Sphere(size[0]),
                }[shape["type"]]()
                placed = pin.XYZQUATToSE3(np.array([*pose["position"], *pose["orientation"]], dtype=float))
                k = geometry.addGeometryObject(pin.GeometryObject(f"{thing['id']} {len(links)}", 0, placed, solid))
                for i, link in enumerate(links):
                    if link.parentJoint:
                        geometry.addCollisionPair(pin.CollisionPair(i, k))
        self._geometry, self._data, self._shapes = geometry, self._model.createData(), geometry.createData()

    def is_free(self, path: Array) -> bool:
        """Return whether nothing touches on a path (n, nq)."""
        for begin, end in itertools.pairwise(path):
            count = max(1, int(np.ceil(np.abs(end - begin).max() / STEP)))
            for part in np.linspace(0.0, 1.0, count + 1):
                q = begin + part * (end - begin)
                if pin.computeCollisions(self._model, self._data, self._geometry, self._shapes, q, True):
                    return False
        return True


# --- plain OMPL ---------------------------------------------------------------------------------------------------


def ompl_path(scene: Scene, seconds: float) -> tuple[Array | None, float]:
    """Return the path of OMPL's RRT-Connect, simplified by OMPL, and the CPU seconds without that."""
    mechanism, clearance = scene.mechanism, clearance_of(scene)
    at = [mechanism.q_index(name) for name in scene.goal_joints]
    assert scene.goal_configuration is not None

    def configuration(values: Array) -> Array:
        q = scene.start.copy()
        q[at] = values
        return q

    path, spent = rrt_connect(
        (mechanism.limits.lower[at], mechanism.limits.upper[at]),
        lambda values: clearance.least(configuration(values)) >= scene.safety, scene.start[at],
        scene.goal_configuration[None, at], seconds, simplifies=True,
    )  # fmt: skip
    return None if path is None else np.array(list(map(configuration, path))), spent


# --- the comparison -----------------------------------------------------------------------------------------------


@dataclass
class Results:
    """Of one method: problem -> length, CPU seconds; whether the path is free."""

    lengths: dict[str, float] = field(default_factory=dict)
    times: dict[str, float] = field(default_factory=dict)
    touching: list[str] = field(default_factory=list)

    def add(self, name: str, path: Array | None, spent: float, judge: Judge) -> None:
        """Add the path of a problem, and judge it."""
        self.times[name] = spent
        if path is not None:
            self.lengths[name] = float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum())
            if not judge.is_free(path):
                self.touching.append(name)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folders", type=Path, nargs="+", metavar="FOLDER")
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--first", type=int, default=1)
    parser.add_argument("--count", type=int, default=1000)
    parser.add_argument("--safety", type=float, default=1e-3, help="safety distance, m")
    options = parser.parse_args()
    time.monotonic = CpuClock()  # for the limits of plan
    results = {"plan": Results(), "ompl": Results()}
    searches = dict[str, float]()
    requests = [
        request
        for folder in options.folders
        for request in sorted(folder.glob("request*.yaml"))[options.first - 1 :][: options.count]
    ]
    for request in requests:
        file = request.with_name(request.name.replace("request", "scene"))
        problem = f"{request.parent.name} {request.stem.removeprefix('request')}"
        scene, judge = read(request, file, options.safety), Judge(file)
        clearance_of(with_joints_locked(scene)), MeshCheck(scene)  # bodies and pairs are found once for the mechanism
        begin = time.process_time()
        made = plan(scene, seconds=options.seconds)
        results["plan"].add(problem, made.path if made else None, time.process_time() - begin, judge)
        begin = time.process_time()
        path, searches[problem] = ompl_path(scene, options.seconds)
        results["ompl"].add(problem, path, time.process_time() - begin, judge)
        lengths = "  ".join(
            f"{name} {run.times[problem]:6.2f} s, {run.lengths.get(problem, np.nan):6.2f} rad"
            for name, run in results.items()
        )
        last = made.attempts[-1].strategy if made.attempts else made.reason
        print(f"{problem}  {lengths}  {made.status.value}: {last}", flush=True)
    for name, run in results.items():
        print(
            f"{name}: {rate(len(run.lengths), len(requests))} solved, {len(run.touching)} in contact {run.touching}, "
            f"median {median(run.times.values()):.2f} s, length {median(run.lengths.values() or [np.nan]):.2f} rad"
        )
    times, ompl = (np.array([*results[name].times.values()]) for name in ("plan", "ompl"))
    search = np.array([*searches.values()])
    print(
        f"CPU time, plan by ompl: {median(times) / median(ompl):.2f} of medians, median {median(times / ompl):.2f}; by "
        f"ompl without simplifying: {median(times) / median(search):.2f}, {median(times / search):.2f}"
    )
    both = results["plan"].lengths.keys() & results["ompl"].lengths.keys()
    if both:
        ratios = [results["plan"].lengths[name] / results["ompl"].lengths[name] for name in both]
        print(f"length, plan by ompl: median {median(ratios):.3f}, mean {np.mean(ratios):.3f} of {len(both)}")


if __name__ == "__main__":
    main()
