"""mink in one scene: see worker.py."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Iterable
from importlib.metadata import version

import mink
import mujoco
import numpy as np
from worker import Scene, poses, serve

SOLVER = "quadprog"
"""Of quadprog, daqp, proxqp and osqp the fastest, or within noise of it; compare.py --qp tries others."""

LOOP = 100.0
"""Weight of loops beside the task's 1. From 10 to 1000 nothing changes: these targets don't fight the loops."""


class Mink:
    """FrameTask: a FrameTask. Loops: RelativeFrameTasks of great weight. Limits: mink's own two.

    Loops could also be <equality> in MuJoCo's model with an EqualityConstraintTask: that is as accurate, but a solve
    takes 1.7 times as long (192 us for the delta, not 113). As hard constraints their rows would have to be
    independent: those of a planar loop aren't, and for the others that is no faster.
    """

    def __init__(self, scene: Scene) -> None:
        self.qp = scene.get("qp", SOLVER)
        self.version = f"mink {version('mink')} ({self.qp})"
        self.scene, self.dt, self.repeat = scene, scene["dt"], 1
        self.model = mujoco.MjModel.from_xml_string(mjcf(scene))
        self.indices = [int(self.model.joint(joint["name"]).qposadr[0]) for joint in scene["joints"]]
        turns = 1.0 if scene["rotation"] else 0.0
        self.task = mink.FrameTask(scene["node"], "body", 1.0, turns, gain=scene["gain"])
        self.tasks = [self.task]
        for loop in scene["loops"]:
            about = [LOOP, LOOP, LOOP if loop["kind"] == "rigid" else 0.0]  # a revolute loop is free about its z
            task = mink.RelativeFrameTask(loop["second"], "body", loop["first"], "body", LOOP, about)
            task.set_target(mink.SE3.identity())
            self.tasks.append(task)
        fastest = {joint["name"]: joint["velocity"] for joint in scene["joints"] if joint["velocity"] is not None}
        self.limits = [mink.ConfigurationLimit(self.model), mink.VelocityLimit(self.model, fastest)]
        self.targets = [mink.SE3.from_matrix(pose) for pose in poses(scene)]
        self.home()

    def home(self) -> None:
        """Back to the start."""
        q = np.zeros(self.model.nq)
        q[self.indices] = [joint["home"] for joint in self.scene["joints"]]
        self.configuration = mink.Configuration(self.model, q)

    def step(self, target: mink.SE3) -> None:
        """What is timed."""
        self.task.set_target(target)
        for _ in range(self.repeat):
            v = mink.solve_ik(self.configuration, self.tasks, self.dt, self.qp, limits=self.limits)
            self.configuration.integrate_inplace(v, self.dt)

    def q(self) -> list[float]:
        """The joints' values, in the scene's order."""
        return self.configuration.q[self.indices].tolist()


def mjcf(scene: Scene) -> str:
    """The scene's URDF as MJCF. Masses are made up, for MuJoCo wants some; they count for nothing here."""
    urdf = ElementTree.parse(scene["urdf"]).getroot()
    moving = {joint["name"]: joint for joint in scene["joints"]}
    above = {joint.find("child").get("link"): joint for joint in urdf.findall("joint")}
    root = ElementTree.Element("mujoco")
    ElementTree.SubElement(root, "compiler", angle="radian")
    world = ElementTree.SubElement(root, "worldbody")
    bodies = {"world": world}  # a name that MuJoCo keeps for itself; where a URDF uses it, that is its root

    def body(link: str) -> ElementTree.Element:
        if link in bodies:
            return bodies[link]
        joint = above.get(link)
        parent = world if joint is None else body(joint.find("parent").get("link"))
        made = bodies[link] = ElementTree.SubElement(parent, "body", name=link)
        ElementTree.SubElement(made, "inertial", pos="0 0 0", mass="1", diaginertia="1 1 1")
        if joint is None:
            return made
        origin = joint.find("origin")
        if origin is not None:
            made.set("pos", origin.get("xyz", "0 0 0"))
            angles = (float(word) for word in origin.get("rpy", "0 0 0").split())
            made.set("quat", _words(mink.SO3.from_rpy_radians(*angles).wxyz))
        if joint.get("name") in moving:
            limits = moving[joint.get("name")]
            ElementTree.SubElement(
                made,
                "joint",
                name=limits["name"],
                type="slide" if joint.get("type") == "prismatic" else "hinge",
                axis=joint.find("axis").get("xyz"),
                limited="true",
                range=_words((limits["low"], limits["high"])),
            )
        return made

    for link in urdf.findall("link"):
        body(link.get("name", ""))
    return ElementTree.tostring(root, encoding="unicode")


def _words(numbers: Iterable[float]) -> str:
    return " ".join(repr(float(number)) for number in numbers)


if __name__ == "__main__":
    serve(Mink)
