"""The node with a stand-in for rclpy, which is not on PyPI: it has topics, parameters and a logger, and messages with
the fields of rosbags' definitions."""

import importlib
import sys
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest
from rosbags.typesys import Stores, get_typestore

import cinegen

TYPES = get_typestore(Stores.ROS2_HUMBLE)
MESSAGES = (
    "sensor_msgs/msg/JointState",
    "trajectory_msgs/msg/JointTrajectory",
    "trajectory_msgs/msg/JointTrajectoryPoint",
)


def message(name):
    """A class like those of rclpy: fields by keyword, lists of Python's numbers only."""
    fields = [field for field, _ in TYPES.fielddefs[name][1]]

    def made(**fields_set):
        assert set(fields_set) <= set(fields)
        for value in fields_set.values():
            assert not isinstance(value, np.ndarray)
            assert not isinstance(value, list) or all(type(entry) in (float, str, SimpleNamespace) for entry in value)
        return SimpleNamespace(**(dict.fromkeys(fields, ()) | fields_set))

    return made


class Node:
    """What the node uses of rclpy.node.Node."""

    parameters: dict[str, object] = {}  # noqa: RUF012
    remapped: dict[str, str] = {}  # noqa: RUF012

    def __init__(self, name):
        self.name, self.callbacks, self.published, self.logged = name, {}, [], []

    def declare_parameter(self, name, default):
        return SimpleNamespace(value=self.parameters.get(name, default))

    def create_publisher(self, kind, topic, depth):
        topic = self.remapped.get(topic, topic)
        return SimpleNamespace(topic_name=topic, publish=lambda sent: self.published.append((topic, sent)))

    def create_subscription(self, kind, topic, callback, depth):
        topic = self.remapped.get(topic, topic)
        self.callbacks[topic] = callback
        return SimpleNamespace(topic_name=topic)

    def get_logger(self):
        def log(level):
            return lambda text, throttle_duration_sec=None: self.logged.append((level, text))

        return SimpleNamespace(**{level: log(level) for level in ("info", "warning", "error", "fatal")})


@pytest.fixture
def node(root, monkeypatch):
    """Returns the node for parameters and remapped topics."""
    modules = {name: ModuleType(name) for name in ("rclpy", "rclpy.node", "rclpy.executors")}
    modules["rclpy.node"].Node = Node
    modules["rclpy.executors"].ExternalShutdownException = type("Ended", (Exception,), {})
    for name in MESSAGES:
        package, _, kind = name.split("/")
        module = modules.setdefault(f"{package}.msg", ModuleType(f"{package}.msg"))
        modules.setdefault(package, ModuleType(package))
        setattr(module, kind, message(name))
    for name, module in modules.items():
        monkeypatch.setitem(sys.modules, name, module)
    monkeypatch.delitem(sys.modules, "cinegen_joint_states.node", raising=False)
    module = importlib.import_module("cinegen_joint_states.node")

    def made(remapped=None, **parameters):
        monkeypatch.setattr(Node, "parameters", {"robot": str(root / "generated/delta4.urdf")} | parameters)
        monkeypatch.setattr(Node, "remapped", remapped or {})
        return module.CompletionNode()

    yield made
    sys.modules.pop("cinegen_joint_states.node", None)


def test_joint_states_are_completed(node):
    running = node()
    header = object()
    names, rates = ["joint12", "joint1", "joint6"], [1.0, 0.0, 0.0]
    joint_state = SimpleNamespace(header=header, name=names, position=[0.1, 0.2, 0.3], velocity=rates)
    running.callbacks["actuated_joint_states"](joint_state)
    ((topic, made),) = running.published
    assert (topic, made.header) == ("joint_states", header)
    delta = cinegen.load(running.parameters["robot"])
    q = delta.configuration(dict(zip(made.name, made.position, strict=True)))
    assert delta.closure(q) < 1e-12
    assert made.velocity[made.name.index("joint12")] == 1.0
    assert any(abs(made.velocity[i]) > 1e-3 for i, name in enumerate(made.name) if name not in delta.actuated)


def test_what_cannot_be_completed_is_reported_and_not_published(node):
    running = node()
    running.callbacks["actuated_joint_states"](SimpleNamespace(header=0, name=["joint1"], position=[], velocity=[]))
    assert running.published == []
    assert running.logged[-1] == ("warning", "joint state: 1 joints are named, with 0 positions and 0 velocities")


def point(positions, velocities=(), accelerations=(), at=0):
    return SimpleNamespace(positions=positions, velocities=velocities, accelerations=accelerations, time_from_start=at)


def test_trajectories_are_those_of_the_actuated_joints(node):
    running = node()
    names = ["joint12", "joint1", "joint6"]
    points = [point([0.1 * k] * 3, [1.0] * 3, at=k) for k in range(3)]
    running.callbacks["trajectory"](SimpleNamespace(header=7, joint_names=names, points=points))
    ((topic, made),) = running.published
    assert (topic, made.header, made.joint_names) == ("actuated_trajectory", 7, ["joint1", "joint6", "joint12"])
    assert [waypoint.time_from_start for waypoint in made.points] == [0, 1, 2]
    assert made.points[2].positions == pytest.approx([0.2] * 3)
    assert made.points[2].velocities == pytest.approx([1.0] * 3)
    assert made.points[2].accelerations == []


def test_wrong_trajectories_are_reported(node):
    running, names = node(), ["joint1", "joint6", "joint12"]
    for points, text in (
        ([point([0.0])], "point 0 has 1 positions of 3 joints"),
        ([point([0.0] * 3, [0.0] * 3), point([0.0] * 3)], "points 0 and 1: only one of them has velocities"),
    ):
        running.callbacks["trajectory"](SimpleNamespace(header=0, joint_names=names, points=points))
        assert running.published == []
        assert running.logged[-1][0] == "error"
        assert text in running.logged[-1][1]


def test_what_is_missing_or_leads_in_a_circle_is_told(node):
    with pytest.raises(cinegen.CinegenError, match="robot:=FILE"):
        node(robot="")
    with pytest.raises(cinegen.CinegenError, match="/js is both read and published: remap one"):
        node({"joint_states": "/js", "actuated_joint_states": "/js"})
