"""Sessions: robots that users and sensors drive together; commands in, states out, at a fixed rate."""

from cinegen.mission import BasePose
from cinegen.session.cloud import Cloud, ShownMap
from cinegen.session.commands import Command, CommandError, CommandFrame, KnownNames, decode_command
from cinegen.session.map_setup import map_setup
from cinegen.session.report import Reporter, RobotReport
from cinegen.session.runner import SessionError, SessionRunner
from cinegen.session.scene_setup import scene_setup
from cinegen.session.session import Session
from cinegen.session.setup import (
    Avoidance,
    Device,
    MapOverlay,
    SensorSwitch,
    Setup,
    SetupError,
    arrange,
    parse_base_pose,
    replay_setup,
)
from cinegen.session.state import SessionState

__all__ = [
    "Avoidance",
    "BasePose",
    "Cloud",
    "Command",
    "CommandError",
    "CommandFrame",
    "Device",
    "KnownNames",
    "MapOverlay",
    "Reporter",
    "RobotReport",
    "SensorSwitch",
    "Session",
    "SessionError",
    "SessionRunner",
    "SessionState",
    "Setup",
    "SetupError",
    "ShownMap",
    "arrange",
    "decode_command",
    "map_setup",
    "parse_base_pose",
    "replay_setup",
    "scene_setup",
]
