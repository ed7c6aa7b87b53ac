"""Time all inverse solutions of calibrated 6R arms, and compare them with those of Newton's method from many starts.

    nice python benchmarks/calibrated_arms.py [ARMS [STARTS]]

Arms are a UR and a Puma whose parameters are off by 1e-9 to 1e-2 (m, rad), and general ones, by turns. Printed are
medians and the largest time for the first pose of an arm and for a second one, how many results are proved to be all,
how many solutions are certified, and what only one of both methods found. Newton's method steps by Pinocchio's
Jacobian, and shares nothing with elimination.
"""

from __future__ import annotations

import math
import sys
import time

import numpy as np
import pinocchio as pin

import cinegen

RIGHT = math.pi / 2.0
WRITTEN = {
    "ur": ((0, -0.6127, -0.57155, 0, 0, 0), (0.1807, 0, 0, 0.17415, 0.11985, 0.11655), (RIGHT, 0, 0, RIGHT, -RIGHT, 0)),
    "puma": ((0, 0.4318, 0.0203, 0, 0, 0), (0, 0, 0.15005, 0.4318, 0, 0.1), (RIGHT, 0, -RIGHT, RIGHT, -RIGHT, 0)),
}
ITERATIONS, LONGEST = 60, 0.7  # steps; rad


def arm(number: int, rng: np.random.Generator) -> cinegen.Mechanism:
    """Six hinges by Denavit's and Hartenberg's parameters."""
    if number % 3 == 2:
        a, d, alpha = rng.uniform(-1, 1, 6), rng.uniform(-1, 1, 6), rng.uniform(-3, 3, 6)
    else:
        off = 10.0 ** rng.uniform(-9, -2)
        a, d, alpha = (np.array(row) + off * rng.normal(size=6) for row in WRITTEN[("ur", "puma")[number % 3]])
    model, before = pin.Model(), pin.SE3.Identity()
    for k in range(6):
        model.addJoint(k, pin.JointModelRZ(), before, f"joint{k + 1}")
        before = pin.SE3(pin.exp3(np.array([alpha[k], 0, 0])), np.array([a[k], 0, d[k]]))
    model.addFrame(pin.Frame("tool", 6, before, pin.FrameType.BODY))
    return cinegen.load(model)


def apart(q: np.ndarray, other: np.ndarray) -> float:
    return float(np.abs((q - other + math.pi) % (2 * math.pi) - math.pi).max())


def guessed(model: pin.Model, pose: pin.SE3, starts: int, rng: np.random.Generator) -> list[np.ndarray]:
    """What Newton's method finds from random starts."""
    data, frame = model.createData(), model.getFrameId("tool")
    q, solutions = rng.uniform(-math.pi, math.pi, (starts, 6)), list[np.ndarray]()
    for _ in range(ITERATIONS):
        errors, jacobians = np.zeros((len(q), 6)), np.zeros((len(q), 6, 6))
        for k, row in enumerate(q):
            pin.computeJointJacobians(model, data, row)
            errors[k] = pin.log6(pin.updateFramePlacement(model, data, frame).actInv(pose)).vector
            jacobians[k] = pin.getFrameJacobian(model, data, frame, pin.LOCAL)
        reached = np.abs(errors).max(axis=1) < 1e-10
        for row in q[reached]:
            if all(apart(row, other) > 1e-4 for other in solutions):
                solutions.append(row)
        left = ~reached & (np.abs(np.linalg.det(jacobians)) > 1e-300)
        steps = np.linalg.solve(jacobians[left], errors[left, :, None])[:, :, 0]
        q = q[left] + steps * np.minimum(1.0, LONGEST / np.abs(steps).max(axis=1))[:, None]
    return solutions


def main(arms: int = 30, starts: int = 1000) -> None:
    times, proved, certified, total, missing, more = [], 0, 0, 0, 0, 0
    for number in range(arms):
        rng = np.random.default_rng(number)
        robot, spent = arm(number, rng), []
        for _ in range(2):
            pose = robot.placement(rng.uniform(-3, 3, 6), "tool")
            begun = time.perf_counter()
            solutions = cinegen.inverse_kinematics(robot, {"tool": pose}, all=True)
            spent.append(time.perf_counter() - begun)
            proved += solutions.proved
        times.append(spent)
        others = guessed(robot.model, pose, starts, rng)
        total, certified = total + len(solutions), certified + solutions.certified
        missing += sum(min((apart(q, solution) for solution in solutions), default=9.0) > 1e-4 for q in others)
        more += sum(min((apart(q, other) for other in others), default=9.0) > 1e-4 for q in solutions)
    median, most = np.median(times, axis=0), np.max(times, axis=0)
    print(f"first pose: median {median[0]:.3f} s, at most {most[0]:.3f} s; second: {median[1]:.3f} s, {most[1]:.3f} s")
    print(f"{proved} of {2 * arms} proved to be all; second poses: {total} solutions, {certified} certified")
    print(f"found only by Newton's method: {missing}; only by elimination: {more}")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
