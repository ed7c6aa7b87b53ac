"""One device for several nodes: its owner reads it once a tick, and every reader gets that reading."""

from __future__ import annotations

from collections import deque

from cinegen.sensor import Reading, Sensor, SensorStatus

_MOST = 64  # presses that are kept for a reader


class SharedSensor:
    """A sensor gives each reading to its first reader only. This class reads it once, at the start of a tick:

        shared.read()
        for one in teleoperations:
            one.advance(dt)

    Until the next call of `read`, all readers return the same reading, in any order. Only the thread that calls `read`
    may use the readers; any thread may make one.

    Args:
        sensor: sensor; it is started and closed by its owner.
    """

    def __init__(self, sensor: Sensor) -> None:
        self.sensor = sensor
        self.last: Reading | None = None
        self.pressed: deque[tuple[int, int]] = deque(maxlen=_MOST)  # number of the press, from 1, and its button
        self.presses = 0

    def read(self) -> Reading | None:
        """Read the sensor once a tick, for all readers; return the reading (for a recorder, say)."""
        reading = self.sensor.read()
        if reading is not None:
            for button in reading.pressed:
                self.presses += 1
                self.pressed.append((self.presses, button))
            self.last = reading
        return reading

    def reader(self) -> SensorReader:
        """Return a sensor that has the readings of this one from now on."""
        return SensorReader(self)


class SensorReader:
    """Sensor with the readings of a shared one; made by `SharedSensor.reader`.

    Attributes:
        url: address of the shared sensor.
        timeout: its time-out, s.
    """

    def __init__(self, shared: SharedSensor) -> None:
        self.url, self.timeout = shared.sensor.url, shared.sensor.timeout
        self._shared = shared
        self._seen = shared.last  # earlier readings were not meant for this reader's node
        self._presses = shared.presses

    @property
    def status(self) -> SensorStatus:
        """Status of the shared sensor."""
        return self._shared.sensor.status

    def start(self) -> None:
        """Do nothing: the owner starts the sensor."""

    def close(self) -> None:
        """Do nothing: others may still read the sensor."""

    def read(self) -> Reading | None:
        """Return the newest reading that was not read yet, with all presses (the last 64) since the previous one."""
        shared = self._shared
        newest = shared.last
        if newest is None or newest is self._seen:
            return None
        self._seen = newest
        if shared.presses == self._presses:
            return newest
        pressed = tuple(button for number, button in shared.pressed if number > self._presses)
        self._presses = shared.presses
        return newest._replace(pressed=pressed)
