"""A sensor that reads its device in a thread, and opens it again when it is lost."""

from __future__ import annotations

import re
import threading
from abc import ABC, abstractmethod

from cinegen.devices.latest_reading import LatestReading
from cinegen.errors import CinegenError
from cinegen.exception_log import ExceptionLog
from cinegen.sensor import Reading, SensorState, SensorStatus

_SHORTEST, _LONGEST = 0.1, 3.0  # s between two attempts to open: doubled from one to the next
_PATIENCE = 3.0  # s that `close` waits for the thread


class DeviceLostError(CinegenError):
    """The device is gone. This ends the connection; readers never get it."""


class WrongDeviceError(CinegenError):
    """Another kind of device answers. This ends the connection; readers never get it."""


class ThreadedSensor(ABC):
    """Base of sensors that wait for input: a subclass implements `serve`, which runs while the device is open.

    Args:
        url: address of the device.

    Attributes:
        timeout: time without a reading, s, after which a deflected sensor counts as silent.
        longest: longest time between two attempts to open it, s.
        exception_log: exceptions of `serve` other than `OSError` and `CinegenError`, each logged once.
    """

    timeout = 0.25

    def __init__(self, url: str) -> None:
        self.url = url
        self.longest = _LONGEST
        self.newest = LatestReading()
        self.damaged = 0
        self.exception_log = ExceptionLog()
        self._reported = SensorState.CLOSED, f"{url} is not started"
        self._ending = threading.Event()
        self._own = threading.local()  # a thread that hung while the sensor was closed still ends
        self._thread: threading.Thread | None = None

    def __repr__(self) -> str:
        return f"<{type(self).__name__} {self.url}: {self.status.state.value}>"

    @abstractmethod
    def serve(self) -> None:
        """Open the device, call `live`, put readings into `newest` until `ending`, and close the device in any case.

        Raises:
            Exception: the device can't be opened, or is gone; it is opened again later.
        """

    # --- of a sensor ---------------------------------------------------------------------------------------------

    def start(self) -> None:
        """Start the thread, and return at once."""
        if self._thread is not None and self._thread.is_alive() and not self._ending.is_set():
            return
        self._ending = threading.Event()
        self._reported = SensorState.OPENING, f"{self.url} is being opened"
        self._thread = threading.Thread(target=self._run, args=(self._ending,), name=f"sensor {self.url}", daemon=True)
        self._thread.start()

    def read(self) -> Reading | None:
        """Return the newest reading that was not read yet, or None."""
        return self.newest.take()

    @property
    def status(self) -> SensorStatus:
        """Status of the connection."""
        state, message = self._reported
        if state is SensorState.LIVE:
            silent = self.newest.silence()
            if silent > self.timeout:
                state, message = SensorState.SILENT, f"{self.url} has sent nothing for {silent:.1f} s"
        return SensorStatus(state, message, self.newest.count, self.damaged)

    def close(self) -> None:
        """Close the sensor, and wait for its thread for a while; a thread in a system call ends after it."""
        self._ending.set()
        thread = self._thread
        if thread is not None and thread is not threading.current_thread():
            thread.join(_PATIENCE)
        self._reported = SensorState.CLOSED, f"{self.url} is closed"

    # --- for its kinds -------------------------------------------------------------------------------------------

    @property
    def ending(self) -> bool:
        """Whether `serve` should return."""
        return self._own_ending.is_set()

    def wait(self, seconds: float) -> bool:
        """Waits; whether `serve` should return."""
        return self._own_ending.wait(seconds)

    def live(self, message: str) -> None:
        """The device is there, and is this."""
        if not self.ending:
            self._reported = SensorState.LIVE, message

    @property
    def _own_ending(self) -> threading.Event:
        own: threading.Event = getattr(self._own, "ending", self._ending)
        return own

    # --- the thread ----------------------------------------------------------------------------------------------

    def _run(self, ending: threading.Event) -> None:
        self._own.ending = ending
        pause = _SHORTEST
        while not ending.is_set():
            try:
                self.serve()
                end = SensorState.LOST, f"{self.url} has ended"
            except WrongDeviceError as error:
                end = SensorState.REFUSED, str(error)
            except Exception as error:  # a driver may raise anything; a sensor never stops the program
                end = SensorState.LOST, f"{self.url.rstrip(':')}: {_sentence(error)}"
                if not isinstance(error, OSError | CinegenError):  # a device that is gone is not a bug
                    self.exception_log.report(self.url, error)
            if ending.is_set():
                return  # the status is that of `close`
            was_live = self._reported[0] is SensorState.LIVE
            self._reported = end
            self.newest.end()
            pause = _SHORTEST if was_live else min(2.0 * pause, self.longest)
            if ending.wait(pause):
                return


def _sentence(error: Exception) -> str:
    """What the system says, out of what pyserial has put around it."""
    text = str(error) or type(error).__name__
    said = re.findall(r"\[Errno -?\d+\] ([^:\[\]]+)|\(\d+, '([^']+)'\)", text)
    return "".join(said[-1]).strip().lower() if said else text
