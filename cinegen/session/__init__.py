"""Robots that people and sensors move together: commands in, states out, at a fixed rate."""

from cinegen.session.commands import FRAMES as FRAMES_OF_COMMAND
from cinegen.session.commands import Command, Vocabulary, parse, read
from cinegen.session.errors import CommandError, SessionError
from cinegen.session.loop import Loop
from cinegen.session.obstacle import is_obstacle
from cinegen.session.report import Report, Reporter, Singularity
from cinegen.session.session import Session
from cinegen.session.setup import Device, Setup, SetupError, Stand, Surroundings, Switch, arrange, replayed, stand_of
from cinegen.session.solids import solids_of
from cinegen.session.state import Notice, PullState, Replayed, RobotState, SensorState, State
from cinegen.session.surroundings import in_scene

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
    "Surroundings",
    "Switch",
    "Vocabulary",
    "arrange",
    "in_scene",
    "is_obstacle",
    "parse",
    "read",
    "replayed",
    "solids_of",
    "stand_of",
]
