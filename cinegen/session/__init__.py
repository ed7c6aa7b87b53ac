"""Robots that people and sensors move together: commands in, states out, at a fixed rate."""

from cinegen.session.commands import FRAMES as FRAMES_OF_COMMAND
from cinegen.session.commands import Command, Vocabulary, parse, read
from cinegen.session.errors import CommandError, SessionError
from cinegen.session.loop import Loop
from cinegen.session.report import Report, Reporter, Singularity
from cinegen.session.session import Session
from cinegen.session.setup import Device, Setup, SetupError, Stand, Switch, arrange, replayed, stand_of
from cinegen.session.state import Notice, PullState, Replayed, RobotState, SensorState, State

__all__ = [
    "FRAMES_OF_COMMAND",
    "Command",
    "CommandError",
    "Device",
    "Loop",
    "Notice",
    "PullState",
    "Replayed",
    "Report",
    "Reporter",
    "RobotState",
    "SensorState",
    "Session",
    "SessionError",
    "Setup",
    "SetupError",
    "Singularity",
    "Stand",
    "State",
    "Switch",
    "Vocabulary",
    "arrange",
    "parse",
    "read",
    "replayed",
    "stand_of",
]
