"""Missions: record the motion of robots, replay it, check it, and export it as a joint trajectory."""

from cinegen.mission.check import Finding, FindingKind, Findings, check
from cinegen.mission.export import ExportReport, export, report_text
from cinegen.mission.file_format import BasePose, MissionError, RecordedTask, RobotSample
from cinegen.mission.formats import FORMATS
from cinegen.mission.player import Player
from cinegen.mission.recorder import MissionRecorder
from cinegen.mission.recording import Recording
from cinegen.mission.trajectory import Trajectory, resampled

__all__ = [
    "FORMATS",
    "BasePose",
    "ExportReport",
    "Finding",
    "FindingKind",
    "Findings",
    "MissionError",
    "MissionRecorder",
    "Player",
    "RecordedTask",
    "Recording",
    "RobotSample",
    "Trajectory",
    "check",
    "export",
    "report_text",
    "resampled",
]
