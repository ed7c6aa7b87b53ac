"""placo in one scene: see worker.py."""

from __future__ import annotations

from importlib.metadata import version

import numpy as np
import placo
from numpy.typing import NDArray
from worker import Scene, poses, serve


class Placo:
    """FrameTask: a soft task. Loops: hard tasks between the two ends. Limits: the solver's own, as bounds of its QP.

    The rest is as it comes. A regularisation task on top of the QP's own 1e-8 makes a step slower (4.0 us instead of
    3.6 for the panda) and no target nearer; the problem's options for sparsity gain nothing here.
    """

    def __init__(self, scene: Scene) -> None:
        self.version = f"placo {version('placo')} (its own QP)"
        self.scene, self.repeat = scene, 1
        assert scene["gain"] == 1.0  # placo's tasks have no gain: they always ask for the whole error
        self.robot = placo.RobotWrapper(scene["urdf"], placo.Flags.ignore_collisions)
        self.solver = placo.KinematicsSolver(self.robot)
        self.solver.mask_fbase(True)
        self.solver.dt = scene["dt"]
        self.solver.enable_joint_limits(True)
        self.solver.enable_velocity_limits(True)
        second = scene.get("second")  # a point of another node, in the freedom that the first task leaves
        first = "hard" if second else "soft"
        if scene["rotation"]:
            self.task = self.solver.add_frame_task(scene["node"], np.eye(4))
            self.task.configure("task", first, 1.0, 1.0)
        else:
            self.task = self.solver.add_position_task(scene["node"], np.zeros(3))
            self.task.configure("task", first, 1.0)
        if second:
            lower = self.solver.add_position_task(second["node"], np.array(second["target"]))
            lower.configure("second", "soft", 1.0)
        for i, loop in enumerate(scene["loops"]):
            self._close(f"loop{i}", loop)
        self.targets = [pose if scene["rotation"] else pose[:3, 3].copy() for pose in poses(scene)]
        self.indices = [self.robot.get_joint_offset(joint["name"]) for joint in scene["joints"]]
        for joint in scene["joints"]:
            if joint["velocity"] is None:
                self.robot.set_velocity_limit(joint["name"], 1e9)
        self.home()

    def _close(self, name: str, loop: dict[str, str]) -> None:
        first, second = loop["first"], loop["second"]
        if loop["kind"] == "rigid":
            self.solver.add_relative_frame_task(first, second, np.eye(4)).configure(name, "hard", 1.0, 1.0)
            return
        # The pin of a planar linkage. Its other rows are dependent, and hard tasks must be independent.
        task = self.solver.add_relative_position_task(first, second, np.zeros(3))
        task.mask.set_axises("xy")
        task.configure(name, "hard", 1.0)

    def home(self) -> None:
        """Back to the start."""
        for joint in self.scene["joints"]:
            self.robot.set_joint(joint["name"], joint["home"])
        self.robot.update_kinematics()

    def step(self, target: NDArray[np.float64]) -> None:
        """What is timed."""
        if self.scene["rotation"]:
            self.task.T_world_frame = target
        else:
            self.task.target_world = target
        for _ in range(self.repeat):
            self.robot.update_kinematics()
            self.solver.solve(True)

    def q(self) -> list[float]:
        """The joints' values, in the scene's order."""
        return self.robot.state.q[self.indices].tolist()


if __name__ == "__main__":
    serve(Placo)
