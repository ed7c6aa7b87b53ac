"""What moves a mechanism: sensors, what they hold, and scripts that play one."""

from cinegen.sense.hold import Grip, Hold
from cinegen.sense.kinds import KINDS, SensorError, open_sensor, overrides
from cinegen.sense.lines import Lines, start_from
from cinegen.sense.path import SHAPES, Path, fitted
from cinegen.sense.reading import Reading, Sensor, State, Status
from cinegen.sense.record import Recorder, RecordError
from cinegen.sense.scripted import Scripted

__all__ = [
    "KINDS",
    "SHAPES",
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
    "State",
    "Status",
    "fitted",
    "open_sensor",
    "overrides",
    "start_from",
]
