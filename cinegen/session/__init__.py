"""Robots that people and sensors move together: commands in, states out, at a fixed rate."""

from cinegen.session.cloud import Cloud, ShownMap
from cinegen.session.commands import FRAMES as FRAMES_OF_COMMAND
from cinegen.session.commands import Command, Vocabulary, parse, read
from cinegen.session.errors import CommandError, SessionError
from cinegen.session.loop import Loop
from cinegen.session.obstacle import is_obstacle
from cinegen.session.on_map import on_map
from cinegen.session.report import Report, Reporter, Singularity
from cinegen.session.session import Session
from cinegen.session.setup import (
    Device,
    MapBeside,
    Setup,
    SetupError,
    Stand,
    Surroundings,
    Switch,
    arrange,
    replayed,
    stand_of,
)
from cinegen.session.solids import solids_of
from cinegen.session.state import Notice, Replayed, RobotState, SensorState, State, TaskState
from cinegen.session.surroundings import in_scene

__all__ = [
    "FRAMES_OF_COMMAND",
    "Cloud",
    "Command",
    "CommandError",
    "Device",
    "Loop",
    "MapBeside",
    "Notice",
    "Replayed",
    "Report",
    "Reporter",
    "RobotState",
    "SensorState",
    "Session",
    "SessionError",
    "Setup",
    "SetupError",
    "ShownMap",
    "Singularity",
    "Stand",
    "State",
    "Surroundings",
    "Switch",
    "TaskState",
    "Vocabulary",
    "arrange",
    "in_scene",
    "is_obstacle",
    "on_map",
    "parse",
    "read",
    "replayed",
    "solids_of",
    "stand_of",
]
