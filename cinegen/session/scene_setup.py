"""Scenes in a session: their robots keep clear, their obstacles are driven too."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from pathlib import Path

from cinegen.collision import Scene
from cinegen.ik import Solver
from cinegen.mission import BasePose
from cinegen.model import Mechanism
from cinegen.model.load import build
from cinegen.session.avoiding import AvoidingRobot
from cinegen.session.driven_obstacle import DrivenObstacle
from cinegen.session.looks import Looks
from cinegen.session.obstacle import mechanism_of
from cinegen.session.robot import DrivenRobot
from cinegen.session.setup import RATE, Avoidance, Setup, arrange
from cinegen.session.solids import KEY, said


def scene_setup(
    scene: Scene,
    sensors: Collection[str] = (),
    follow: str | None = None,
    node: str | None = None,
    rate: float = RATE,
    record: str | None = None,
) -> Setup:
    """A session with a scene's robot, which keeps clear of the scene's obstacles, and these.

    Args:
        scene: the robot begins where it starts. It is called as its file, a mobile robot "mobile".
        sensors: see `arrange`; so are the others.

    Raises:
        SetupError: what is asked makes no sense.
        UnknownNameError: a node that there is not.
    """
    looks = Looks(scene)
    if scene.mobile is not None:
        scene = replace(scene, mechanism=_seen(scene.mechanism, looks, scene.mobile))
    name = _path_safe(Path(scene.robot).stem if isinstance(scene.robot, str) else scene.mechanism.name)
    setup = arrange({name: scene.mechanism}, None, tuple(sensors), follow, node, (), rate, record)
    robots, bases, names = dict(setup.robots), dict(setup.bases), list[str]()
    for obstacle in scene.obstacles:
        called = _path_safe(obstacle.name)
        while called in robots:
            called += "'"
        robots[called] = mechanism_of(obstacle, called, looks)
        bases[called] = BasePose(placement=obstacle.placement)
        names.append(called)
    return replace(setup, robots=robots, bases=bases, avoidance=Avoidance(name, scene, tuple(names)))


def driven(setup: Setup) -> dict[str, DrivenRobot]:
    """The robots of a session."""
    dt, around = 1.0 / setup.rate, setup.avoidance
    if around is None:
        return {name: DrivenRobot(name, Solver(mechanism, dt)) for name, mechanism in setup.robots.items()}
    robot = AvoidingRobot(around.robot, around.scene, around.obstacles, dt)
    found: dict[str, DrivenRobot] = {}
    for name, mechanism in setup.robots.items():
        if name == around.robot:
            found[name] = robot
        elif name in around.obstacles:
            number = around.obstacles.index(name)
            found[name] = DrivenObstacle(name, mechanism, around.scene.obstacles[number], number, robot, dt)
        else:
            found[name] = DrivenRobot(name, Solver(mechanism, dt))
    return found


def _seen(mechanism: Mechanism, looks: Looks, radius: float) -> Mechanism:
    """A mobile robot with what is drawn of it."""
    source = mechanism.source
    drawn = {**(source.constraints or {}), KEY: said([looks.mobile(radius)])}
    return build(source.urdf, drawn, source.folder, source.name)


def _path_safe(name: str) -> str:
    """A name as the page's scene can have it, where a slash parts names."""
    return " ".join(name.replace("/", "-").split())
