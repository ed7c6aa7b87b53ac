"""Input devices: 3D mice, gamepad, programs, recordings and scripted paths, and how they move a task's target."""

from cinegen.devices.gamepad import Gamepad
from cinegen.devices.kinds import KINDS, open_sensor, overrides
from cinegen.devices.lines import Lines, start_from
from cinegen.devices.replay import ReadingRecorder, RecordError
from cinegen.devices.scripted_path import SHAPES, ScriptedPath, ScriptedSensor, fit_path
from cinegen.devices.teleoperation import Teleoperation, TwistMapping
from cinegen.sensor import Reading, Sensor, SensorError, SensorState, SensorStatus

__all__ = [
    "KINDS",
    "SHAPES",
    "Gamepad",
    "Lines",
    "Reading",
    "ReadingRecorder",
    "RecordError",
    "ScriptedPath",
    "ScriptedSensor",
    "Sensor",
    "SensorError",
    "SensorState",
    "SensorStatus",
    "Teleoperation",
    "TwistMapping",
    "fit_path",
    "open_sensor",
    "overrides",
    "start_from",
]
