"""What moves a mechanism: sensors, what they hold, and scripts that play one."""

from cinegen.devices.gamepad import Gamepad
from cinegen.devices.hold import Grip, Hold
from cinegen.devices.kinds import KINDS, open_sensor, overrides
from cinegen.devices.lines import Lines, start_from
from cinegen.devices.path import SHAPES, Path, fitted
from cinegen.devices.record import Recorder, RecordError
from cinegen.devices.scripted import Scripted
from cinegen.devices.tap import Tap, Taps
from cinegen.sensor import Reading, Sensor, SensorError, SensorState, SensorStatus

__all__ = [
    "KINDS",
    "SHAPES",
    "Gamepad",
    "Grip",
    "Hold",
    "Lines",
    "Path",
    "Reading",
    "RecordError",
    "Recorder",
    "Scripted",
    "Sensor",
    "SensorError",
    "SensorState",
    "SensorStatus",
    "Tap",
    "Taps",
    "fitted",
    "open_sensor",
    "overrides",
    "start_from",
]
