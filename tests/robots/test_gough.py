"""The six-legged platforms against their inverse kinematics, which is closed form: a leg is as long as the way from its
joint on the base to its joint on the platform.

All 21 joints follow from the platform's pose too: with w the way of a leg in the frame of its universal joint, before
it turns, the last axis is (cos t1 sin t2, sin t1 sin t2, -cos t2), since both turns come behind a Rx(90) each.
"""

import math
from dataclasses import dataclass
from functools import cache

import numpy as np
import pinocchio as pin
import pytest
from elementary import document, link, local, placed, turn, wrapped
from scipy.spatial.transform import Rotation

import cinegen

LEGS = tuple(f"joint{n}" for n in (3, 9, 12, 15, 18, 21))
NAMES = ("gough", "tssm")


@dataclass(frozen=True)
class Platform:
    """Joint centres of the six legs, (6, 3) each, m: on the base in the world, on the platform in its frame."""

    base: np.ndarray
    platform: np.ndarray

    def legs(self, pose: np.ndarray) -> np.ndarray:
        """(6,) lengths of the legs, the platform at a (4, 4) pose."""
        return np.linalg.norm(self.platform @ pose[:3, :3].T + pose[:3, 3] - self.base, axis=1)


@cache
def geometry(name: str) -> Platform:
    """From the parameters of the RAFF file."""
    text = document(name)
    robot = text.robot()
    home = placed(text, robot, {})
    first = {6: 1, **{int(leg[5:]): int(leg[5:]) - 2 for leg in LEGS[1:]}}  # where a leg's end and its begin are
    ends = [(6, 6), *((loop.first, loop.second) for loop in robot.loops)]
    centre = np.linalg.inv(home["platform"])
    return Platform(
        base=np.array([home[robot.nodes[first[leg]].node][:3, 3] for leg, _ in ends]),
        platform=np.array([(centre @ home[robot.nodes[on].node])[:3, 3] for _, on in ends]),
    )


def spherical(way: np.ndarray) -> tuple[float, float]:
    """t1 and t2 of Rz(t1) Rx(90) Rz(t2) Rx(90) whose last axis points along `way`; t2 in (0, pi)."""
    return math.atan2(way[1], way[0]), math.acos(-way[2] / float(np.linalg.norm(way)))


def inverse(name: str, pose: np.ndarray) -> dict[str, float]:
    """All 21 joints from the platform's pose."""
    text = document(name)
    robot, shape = text.robot(), geometry(name)
    feet = placed(text, robot, {f"joint{n}": 0.0 for n in range(1, 22)})
    found = {}
    for leg, foot, end in zip(LEGS, shape.base, shape.platform, strict=True):
        n = int(leg[5:])
        way = pose[:3, :3] @ end + pose[:3, 3] - foot
        t1, t2 = spherical(feet[f"link{n - 2}"][:3, :3].T @ way)
        found |= {f"joint{n - 2}": t1, f"joint{n - 1}": t2, leg: float(np.linalg.norm(way))}
    top = placed(text, robot, found)
    wanted = pose @ np.linalg.inv(local(text, link(text, 30)))  # link 6
    turned = top["link3"][:3, :3].T @ wanted[:3, :3]
    turned = local(text, link(text, 4), 0.0)[:3, :3].T @ turned
    t4, t5 = spherical(turned[:, 2])
    rest = np.linalg.inv(turn("z", t4) @ turn("x", math.pi / 2) @ turn("z", t5) @ turn("x", math.pi / 2))[:3, :3]
    last = rest @ turned
    return found | {"joint4": t4, "joint5": t5, "joint6": math.atan2(last[1, 0], last[0, 0])}


def random_pose(name: str, rng: np.random.Generator, far: float, turned: float) -> np.ndarray:
    home = placed(document(name), document(name).robot(), {})["platform"]
    pose = home.copy()
    pose[:3, 3] += rng.uniform(-far, far, 3)
    pose[:3, :3] = Rotation.from_rotvec(rng.uniform(-turned, turned, 3)).as_matrix() @ pose[:3, :3]
    return pose


REACH = {"gough": 0.25, "tssm": 0.005}  # m


@pytest.mark.parametrize("name", NAMES)
def test_the_closed_form_of_all_joints_closes_every_loop_at_random_poses(robot, name):
    mechanism, rng = robot(name), np.random.default_rng(1)
    for _ in range(80):
        pose = random_pose(name, rng, REACH[name], 0.6)
        q = mechanism.configuration(inverse(name, pose))
        assert mechanism.closure(q) <= 1e-12
        assert mechanism.placement(q, "platform").homogeneous == pytest.approx(pose, abs=1e-12)


@pytest.mark.parametrize("name", NAMES)
def test_dragged_to_random_poses_all_joints_are_where_the_closed_form_says(robot, name):
    mechanism, rng, arrived = robot(name), np.random.default_rng(2), 0
    low, high = mechanism.model.lowerPositionLimit, mechanism.model.upperPositionLimit
    while arrived < 15:
        pose = random_pose(name, rng, 0.6 * REACH[name], 0.25)
        goal = mechanism.configuration(inverse(name, pose))
        if not ((goal > low + 0.01 * mechanism.scale).all() and (goal < high - 0.01 * mechanism.scale).all()):
            continue
        solver = cinegen.Solver(mechanism, dt=0.2)
        solver.add_task("platform", pin.SE3(pose))
        for _ in range(200):
            step = solver.step()
            if max(step.errors[0][0] / mechanism.length, step.errors[0][1]) <= 1e-10:
                break
        assert np.abs(wrapped((step.q - goal) / mechanism.scale)).max() <= 1e-8, step.status
        arrived += 1
