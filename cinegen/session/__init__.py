"""Sessions: robots that users and sensors drive together; commands in, states out, at a fixed rate."""

from cinegen.session.arrangement import arrange, base_poses
from cinegen.session.commands import Command
from cinegen.session.decoding import decode_command
from cinegen.session.message_types import CommandError
from cinegen.session.report import Reporter, RobotReport, agreed_status
from cinegen.session.runner import SessionError, SessionRunner
from cinegen.session.scene_setup import map_setup, scene_setup
from cinegen.session.session import Session
from cinegen.session.setup import Setup, SetupError, replay_setup
from cinegen.session.state import SessionState

__all__ = [
    "Command",
    "CommandError",
    "Reporter",
    "RobotReport",
    "Session",
    "SessionError",
    "SessionRunner",
    "SessionState",
    "Setup",
    "SetupError",
    "agreed_status",
    "arrange",
    "base_poses",
    "decode_command",
    "map_setup",
    "replay_setup",
    "scene_setup",
]
