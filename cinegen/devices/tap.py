"""One device for several nodes: whoever has it reads it once a tick, and every tap says what it said."""

from __future__ import annotations

from collections import deque

from cinegen.sensor import Reading, Sensor, SensorStatus

_MOST = 64  # presses that a tap has not read yet


class Taps:
    """A sensor gives each reading to its first reader only; here it is read by one, once at the beginning of a tick:

        taps.read()
        for hold in holds:
            hold.advance(dt)

    Until it is read again, all taps say the same, in whatever order and however often they are asked. Only the thread
    that reads may read the taps; any may make one.

    Args:
        sensor: started and closed by whoever has it.
    """

    def __init__(self, sensor: Sensor) -> None:
        self.sensor = sensor
        self.last: Reading | None = None
        self.pressed: deque[tuple[int, int]] = deque(maxlen=_MOST)  # each with its number, from 1
        self.presses = 0

    def read(self) -> Reading | None:
        """What the sensor has said since, for all taps and for whoever asks (a recorder, say); once a tick."""
        reading = self.sensor.read()
        if reading is not None:
            for button in reading.pressed:
                self.presses += 1
                self.pressed.append((self.presses, button))
            self.last = reading
        return reading

    def tap(self) -> Tap:
        """A sensor that says what this one says from now on."""
        return Tap(self)


class Tap:
    """A sensor that says what another one says: made by `Taps.tap`. Dropped when nobody needs it any more.

    Attributes:
        url: where that sensor is.
        timeout: that sensor's, s.
    """

    def __init__(self, taps: Taps) -> None:
        self.url, self.timeout = taps.sensor.url, taps.sensor.timeout
        self._taps = taps
        self._seen = taps.last  # what was said before was not meant for this tap's node
        self._presses = taps.presses

    @property
    def status(self) -> SensorStatus:
        """The sensor's."""
        return self._taps.sensor.status

    def start(self) -> None:
        """Does nothing: the sensor is started by whoever has it."""

    def close(self) -> None:
        """Does nothing: others may read the sensor still."""

    def read(self) -> Reading | None:
        """The newest reading, if this tap did not give it yet, with all presses (the last 64) since the one before."""
        taps = self._taps
        newest = taps.last
        if newest is None or newest is self._seen:
            return None
        self._seen = newest
        if taps.presses == self._presses:
            return newest
        pressed = tuple(button for number, button in taps.pressed if number > self._presses)
        self._presses = taps.presses
        return newest._replace(pressed=pressed)
