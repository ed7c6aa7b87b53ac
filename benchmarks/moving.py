"""Balls that fly at robots: how often they hit, with limits of acceleration and without.

    python benchmarks/moving.py [SCENES] [ROBOT ...]

A ball of 5 cm comes at 0.5 to 2 m/s towards a random point of a link, 0.8 s away, while the end is dragged to a new
target each 0.25 s. `avoidable` are the scenes in which any of 200 motions from rest avoids contact, within the same
limits: joints accelerate at random rates for a random time, and brake then; or the robot stays where it is. That is
judged by Pinocchio and coal alone. Of these:

    free        hits without limits of acceleration
    limited     hits with the default ones
    warned      hits among these that UNAVOIDABLE announced
    false       scenes in which UNAVOIDABLE was reported and nothing hit
    excess      largest acceleration with limits, as a fraction of these
    ms          CPU time of a tick with limits, median and 99 %
"""

from __future__ import annotations

import math
import sys
import time

import coal
import numpy as np
import pinocchio as pin
from random_scenes import robot

from cinegen.arrays import Array
from cinegen.collision import Clearance, clearance_of, scene_of
from cinegen.ik import Status
from cinegen.model.motion_limits import motion_limits
from cinegen.planning import AvoidingSolver

DT, AWAY, TICKS, RADIUS = 1 / 240, 0.8, 384, 0.05
MOTIONS, INSTANTS = 200, 40
ROBOTS = "planar_3r", "arm7", "delta4", "panda"
READY = [0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785, 0.02]  # of the panda, whose links overlap at home


def clearance(name: str) -> tuple[Clearance, Array]:
    """The robot's distances from a ball far away, and its configuration at the start."""
    ball = {"name": "ball", "kind": "sphere", "radius": RADIUS, "point": [9.0, 9.0, 0.0]}
    mechanism = robot(name)
    start = {"joints": dict(zip(mechanism.actuated, READY, strict=True))} if name == "panda" else {}
    document = {"safety": 0.01, "start": start, "goal": {"point": [0.0, 0.0, 0.0]}, "obstacle": [ball]}
    scene = scene_of(document, mechanism=mechanism)
    return clearance_of(scene), scene.start


def distance(near: Clearance, data: pin.Data, q: Array, ball: Array) -> float:
    """The least distance of all moving links from the ball."""
    pin.forwardKinematics(near.mechanism.model, data, q)
    at_ball, least = coal.Transform3s(np.eye(3), ball), math.inf
    for body in near.links:
        if body.joint:
            pose = data.oMi[body.joint] * body.placement
            if np.linalg.norm(pose.act(body.placement.actInv(body.centre)) - ball) - body.radius - RADIUS < least:
                at_body = coal.Transform3s(pose.rotation, pose.translation)
                asked, result = coal.DistanceRequest(), coal.DistanceResult()
                least = min(least, coal.distance(body.shape, at_body, coal.Sphere(RADIUS), at_ball, asked, result))
    return least


def is_avoidable(near: Clearance, home: Array, begin: Array, velocity: Array, rng: np.random.Generator) -> bool:
    mechanism, data = near.mechanism, near.mechanism.model.createData()
    limits = motion_limits(mechanism)
    columns = [mechanism.v_index(joint) for joint in mechanism.actuated]
    most, fastest = limits.acceleration[columns], limits.velocity[columns]
    times = np.linspace(0.0, TICKS * DT, INSTANTS + 1)
    between = near.distances(home)[near.groups > 0]  # of links from each other
    for number in range(MOTIONS):
        part = rng.uniform(-1.0, 1.0, len(columns)) if number else np.zeros(len(columns))
        if number % 2:
            part = np.sign(part) * (rng.random(len(columns)) < 0.6)
        until = rng.uniform(0.1, 0.9)
        rising = np.minimum(until, fastest / np.maximum(np.abs(part) * most, 1e-9))
        q, hit = home.copy(), False
        for t in times.tolist():
            up, last = np.minimum(t, rising), np.clip(t - until, 0.0, rising)
            moved = part * most * (0.5 * up * up + rising * np.clip(t - rising, 0.0, until - rising))
            moved += part * most * (rising * last - 0.5 * last * last)
            step = np.zeros(mechanism.model.nv)
            step[columns] = moved
            ahead = mechanism.integrate(home, step)
            if mechanism.is_constrained:
                for joint in mechanism.actuated:
                    q[mechanism.q_index(joint)] = ahead[mechanism.q_index(joint)]
                try:
                    q = mechanism.close(q, locked=mechanism.actuated)
                except Exception:
                    hit = True
                    break
            else:
                q = ahead
            if not mechanism.limits.within(q) or distance(near, data, q, begin + velocity * t) <= 0.0:
                hit = True
                break
        if not hit and (near.distances(q)[near.groups > 0] >= np.minimum(between, 0.0) - 1e-9).all():
            return True
    return False


def run(
    near: Clearance, start: Array, begin: Array, velocity: Array, seed: int, limited: bool
) -> tuple[bool, bool, float, list[float]]:
    """Whether the ball hits, whether that was announced, the largest acceleration, and CPU times of ticks, s."""
    mechanism, data, rng = near.mechanism, near.mechanism.model.createData(), np.random.default_rng(seed)
    near.move(0, pin.SE3(np.eye(3), begin))
    solver = AvoidingSolver(near, DT, 0.01, q=start, acceleration=None if limited else math.inf)
    task = solver.add_task(mechanism.end, rotation=0, axes="world")
    home, flat = task.target.translation.copy(), np.array([1.0, 1.0, 0.0 if mechanism.name == "planar_3r" else 1.0])
    columns = [mechanism.v_index(joint) for joint in mechanism.actuated]
    most, before, excess = motion_limits(mechanism).acceleration[columns], np.zeros(len(columns)), 0.0
    times: list[float] = []
    warned = False
    for tick in range(TICKS):
        if tick % 60 == 0:
            aim = home + 0.2 * mechanism.length * rng.uniform(-1.0, 1.0, 3) * flat
            task.target = pin.SE3(task.target.rotation, aim)
        ball, last = begin + velocity * (tick * DT), solver.q
        solver.move(0, pin.SE3(np.eye(3), ball))
        since = time.thread_time()
        step = solver.step()
        times.append(time.thread_time() - since)
        if step.exceptions:
            raise step.exceptions[0]
        v = mechanism.difference(last, step.q)[columns] / DT
        excess, before = max(excess, float((np.abs(v - before) / DT / most).max())), v
        if distance(near, data, step.q, ball) <= 0.0:
            return True, warned, excess, times
        warned = warned or step.status is Status.UNAVOIDABLE
    return False, warned, excess, times


def main() -> None:
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 20
    columns = ("avoidable", "free", "limited", "warned", "false", "excess", "ms", "99 %")
    print(f"{'':<10}", *(f"{name:>9}" for name in columns), flush=True)
    for name in sys.argv[2:] or ROBOTS:
        near, start = clearance(name)
        mechanism, data = near.mechanism, near.mechanism.model.createData()
        avoidable, hits, warned, false, excess = 0, [0, 0], 0, 0, 0.0
        times: list[float] = []
        for number in range(count):
            rng = np.random.default_rng(number)
            pin.forwardKinematics(mechanism.model, data, start)
            moving = [link for link in near.links if link.joint]
            body = moving[rng.integers(len(moving))]
            direction = rng.normal(size=3) * (1.0, 1.0, 0.0 if name == "planar_3r" else 1.0)
            velocity = rng.uniform(0.5, 2.0) * direction / np.linalg.norm(direction)
            aim = data.oMi[body.joint].act(body.centre) + rng.uniform(-0.05, 0.05, 3)
            begin = aim - velocity * AWAY
            if distance(near, data, start, begin) < 0.1 or not is_avoidable(near, start, begin, velocity, rng):
                continue
            avoidable += 1
            hits[0] += run(near, start, begin, velocity, number, False)[0]
            hit, announced, most, spent = run(near, start, begin, velocity, number, True)
            hits[1], warned, false = hits[1] + hit, warned + (hit and announced), false + (announced and not hit)
            excess, times = max(excess, most), times + spent
            if hit:
                print(f"  hit in scene {number} of {name}, {'announced' if announced else 'not announced'}", flush=True)
        ms = 1e3 * np.array(times or [math.nan])
        print(f"{name:<10} {avoidable:>9} {hits[0]:>9} {hits[1]:>9} {warned:>9} {false:>9} {excess:>9.4f}"
              f" {np.median(ms):>9.2f} {np.percentile(ms, 99):>9.2f}", flush=True)  # fmt: skip


if __name__ == "__main__":
    main()
