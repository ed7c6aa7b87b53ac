"""cinegen in one scene: see worker.py. Through the public functions only."""

from __future__ import annotations

import pinocchio as pin
from worker import Scene, poses, serve

import cinegen


class Ours:
    """One tick per target: a tick closes the loops itself, so `repeat` has no use here."""

    def __init__(self, scene: Scene) -> None:
        self.version = "cinegen, as it is here"
        self.scene, self.repeat = scene, 1
        self.mechanism = cinegen.load(scene["urdf"])
        home = {joint["name"]: joint["home"] for joint in scene["joints"]}
        self.start = self.mechanism.configuration(home)
        self.indices = [self.mechanism.q_index(name) for name in home]
        self.targets = [pin.SE3(pose) for pose in poses(scene)]
        self.home()

    def home(self) -> None:
        """Back to the start."""
        self.solver = cinegen.Solver(self.mechanism, self.scene["dt"], q=self.start)
        self.task = self.solver.add_task(self.scene["node"], rotation=self.scene["rotation"])

    def step(self, target: pin.SE3) -> None:
        """What is timed."""
        self.task.target = target
        self.solver.step()

    def q(self) -> list[float]:
        """The joints' values, in the scene's order."""
        return self.solver.q[self.indices].tolist()


if __name__ == "__main__":
    serve(Ours)
