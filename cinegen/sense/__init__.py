"""What moves a mechanism: sensors, what they hold, and scripts that play one."""

from cinegen.sense.gamepad import Gamepad
from cinegen.sense.hold import Grip, Hold
from cinegen.sense.kinds import KINDS, open_sensor, overrides
from cinegen.sense.lines import Lines, start_from
from cinegen.sense.path import SHAPES, Path, fitted
from cinegen.sense.reading import Reading, Sensor, SensorError, State, Status
from cinegen.sense.record import Recorder, RecordError
from cinegen.sense.scripted import Scripted
from cinegen.sense.seam import Seam
from cinegen.sense.tap import Tap, Taps

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
    "Seam",
    "Sensor",
    "SensorError",
    "State",
    "Status",
    "Tap",
    "Taps",
    "fitted",
    "open_sensor",
    "overrides",
    "start_from",
]
