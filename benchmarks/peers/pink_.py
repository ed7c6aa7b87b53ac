"""pink (pin-pink) in one scene: see worker.py."""

from __future__ import annotations

from importlib.metadata import version

import numpy as np
import pink
import pinocchio as pin
from pink.limits import ConfigurationLimit, VelocityLimit
from pink.tasks import FrameTask, RelativeFrameTask
from worker import Scene, poses, serve

SOLVER = "quadprog"
"""Of quadprog, daqp, proxqp and osqp the fastest, or within noise of it; compare.py --qp tries others."""

LOOP = 100.0
"""Weight of loops beside the task's 1. From 10 to 1000 nothing changes: these targets don't fight the loops."""


class Pink:
    """FrameTask: a FrameTask. Rigid loops: RelativeFrameTasks as equality constraints, the fastest way. Revolute loops:
    the same tasks in the cost, with great weight, for a constraint holds all six rows. Limits: pink's own two."""

    def __init__(self, scene: Scene) -> None:
        self.qp = scene.get("qp", SOLVER)
        self.version = f"pink {version('pin-pink')} ({self.qp})"
        self.scene, self.dt, self.repeat = scene, scene["dt"], 1
        self.model = pin.buildModelFromUrdf(scene["urdf"])
        joints = [self.model.joints[self.model.getJointId(joint["name"])] for joint in scene["joints"]]
        self.indices = [joint.idx_q for joint in joints]
        fastest = np.full(self.model.nv, np.inf)
        for joint, said in zip(joints, scene["joints"], strict=True):
            if said["velocity"] is not None:
                fastest[joint.idx_v] = said["velocity"]
        self.limits = [ConfigurationLimit(self.model), VelocityLimit(self.model, fastest)]
        turns = 1.0 if scene["rotation"] else 0.0
        self.task = FrameTask(scene["node"], 1.0, turns, gain=scene["gain"])
        self.tasks, self.constraints = [self.task], []
        for loop in scene["loops"]:
            rigid = loop["kind"] == "rigid"
            about = [LOOP, LOOP, LOOP if rigid else 0.0]  # a revolute loop is free about its z
            task = RelativeFrameTask(loop["second"], loop["first"], LOOP, about)
            task.set_target(pin.SE3.Identity())
            (self.constraints if rigid else self.tasks).append(task)
        self.targets = [pin.SE3(pose) for pose in poses(scene)]
        self.home()

    def home(self) -> None:
        """Back to the start."""
        q = np.zeros(self.model.nq)
        q[self.indices] = [joint["home"] for joint in self.scene["joints"]]
        self.configuration = pink.Configuration(self.model, self.model.createData(), q)

    def step(self, target: pin.SE3) -> None:
        """What is timed."""
        self.task.set_target(target)
        for _ in range(self.repeat):
            v = pink.solve_ik(
                self.configuration, self.tasks, self.dt, self.qp, limits=self.limits, constraints=self.constraints
            )
            self.configuration.integrate_inplace(v, self.dt)

    def q(self) -> list[float]:
        """The joints' values, in the scene's order."""
        return self.configuration.q[self.indices].tolist()


if __name__ == "__main__":
    serve(Pink)
