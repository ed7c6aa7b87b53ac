"""Certificates of inverse solutions: what is certified is reached, and what is not a solution is not certified."""

import math
from dataclasses import replace

import mpmath
import numpy as np
import pinocchio as pin
import pytest
from mpmath import mp
from numpy.random import default_rng as rng
from test_all_solutions import PUMA, chain, random_pose, solved

import cinegen
from cinegen.ik import FrameTask

ROBOTS = ["scara", "delta4", "belt_five_bar"]


def exact(placement):
    """(4, 4) of a placement, with a rotation that is exactly one."""
    x, _, z = (mp.matrix(column.tolist()) for column in placement.rotation.T)
    z = z / mp.norm(z)
    x = x - (x.T * z)[0] * z
    x = x / mp.norm(x)
    y = [z[1] * x[2] - z[2] * x[1], z[2] * x[0] - z[0] * x[2], z[0] * x[1] - z[1] * x[0]]
    rows = [[x[i], y[i], z[i], mp.mpf(float(placement.translation[i]))] for i in range(3)]
    return mp.matrix([*rows, [0, 0, 0, 1]])


def reached(arm, values):
    """(4, 4) of the tool of a serial arm whose joints rotate about z."""
    model, here = arm.model, mp.eye(4)
    for j, value in enumerate(values, 1):
        c, s = mp.cos(value), mp.sin(value)
        turn = mp.matrix([[c, -s, 0, 0], [s, c, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
        here = here * exact(model.jointPlacements[j]) * turn
    return here * exact(model.frames[arm.frame_id("tool")].placement)


def refined(arm, pose, q):
    """Joint values near q that reach a pose, to 50 digits."""
    values, target, tiny = [mp.mpf(float(x)) for x in q], exact(pose), mp.mpf(10) ** -25

    def missing(values):
        gap = target**-1 * reached(arm, values) - mp.eye(4)
        return mp.matrix([gap[i, j] for i in range(3) for j in range(4)])

    for _ in range(5):
        here = missing(values)
        jacobian = mp.matrix(12, len(values))
        for k in range(len(values)):
            jacobian[:, k] = (missing([x + tiny * (i == k) for i, x in enumerate(values)]) - here) / tiny
        values = [x + step for x, step in zip(values, mp.lu_solve(jacobian, -here), strict=True)]
    return values, max(map(abs, missing(values)))


def test_solutions_of_arms_are_in_their_boxes():
    pose = random_pose(PUMA, 1)
    found = solved(PUMA, pose)
    assert found.certified == len(found) > 0
    with mpmath.workdps(50):
        for q, certificate in zip(found, found.certificates, strict=True):
            values, left = refined(PUMA, pose, q)
            assert left < 1e-40
            off = max(abs(mp.mpf(float(x)) - value) for x, value in zip(q, values, strict=True))
            assert off <= certificate.error < certificate.radius
            assert (certificate.equations, certificate.others) == (6, 0)


@pytest.mark.parametrize("name", ROBOTS)
def test_solutions_of_our_robots_are_certified(robot, name):
    m = robot(name)
    found = cinegen.inverse_kinematics(m, {m.end: m.placement(m.random_closed(2, 1)[-1], m.end)}, all=True)
    assert found.certified == sum(count == 1 for count in found.coincident) > 0
    assert all(one.gap < 1e-12 for one in found.certificates if one)


def test_what_is_no_solution_is_not_certified(robot):
    for name in ("rx90", "five_bar", "delta4"):
        m = robot(name)
        found = cinegen.inverse_kinematics(m, {m.end: m.placement(m.random_closed(2, 1)[-1], m.end)}, all=True)
        for seed in range(3):
            off = 1e-3 * rng(seed).normal(size=m.model.nq)
            assert replace(found, configurations=tuple(q + off for q in found)).certified == 0
        moved = found.task.copy()
        moved.target = found.task.target * pin.SE3(np.eye(3), np.array([1e-3, 0.0, 0.0]))
        assert replace(found, task=moved).certified == 0


def test_an_end_that_is_turned_by_half_a_revolution_is_no_solution(robot):
    m = robot("rx90")
    found = cinegen.inverse_kinematics(m, {m.end: m.placement(m.random_closed(2, 1)[-1], m.end)}, all=True)
    for axis in np.eye(3):
        turned = found.task.copy()
        turned.target = found.task.target * pin.SE3(pin.exp3(math.pi * axis), np.zeros(3))
        assert replace(found, task=turned).certified == 0
    task = FrameTask(m.end, found.task.target, rotation=2)
    task.target = found.task.target * pin.SE3(pin.exp3(math.pi * np.eye(3)[0]), np.zeros(3))
    assert replace(found, task=task, unknowns=found.unknowns._replace(rank=5)).certified == 0


def test_a_stretched_arm_is_not_certified():
    """At the border of its reach two solutions coincide."""
    arm = chain(
        ("revolute", (0, 0, 0), (0, 0, 0)), ("revolute", (0.5, 0, 0), (0, 0, 0)), ("fixed", (0.5, 0, 0), (0, 0, 0))
    )
    task = FrameTask("tool", pin.SE3(np.eye(3), np.array([1.0, 0.0, 0.0])), translation=2, rotation=0)
    found = cinegen.inverse_kinematics(arm, [task], all=True)
    assert found.certified == 0
    task.target = pin.SE3(np.eye(3), np.array([0.75, 0.0, 0.0]))
    assert cinegen.inverse_kinematics(arm, [task], all=True).certified == 2
