"""What happened, kept: a mission is recorded, played again, and handed on as the joint motion of a robot."""

from cinegen.mission.check import Finding, Findings, Kind, check
from cinegen.mission.export import ExportReport, export, report_text
from cinegen.mission.formats import FORMATS
from cinegen.mission.line import MissionError, Motion, Place, RecordedTask
from cinegen.mission.player import Player
from cinegen.mission.recorder import Recorder
from cinegen.mission.recording import Recording
from cinegen.mission.trajectory import Trajectory, resampled

__all__ = [
    "FORMATS",
    "ExportReport",
    "Finding",
    "Findings",
    "Kind",
    "MissionError",
    "Motion",
    "Place",
    "Player",
    "RecordedTask",
    "Recorder",
    "Recording",
    "Trajectory",
    "check",
    "export",
    "report_text",
    "resampled",
]
