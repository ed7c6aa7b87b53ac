"""A sensor that reads its device in a thread, and opens it again when it is lost."""

from __future__ import annotations

import re
import threading
from abc import ABC, abstractmethod

from cinegen.devices.latest_reading import DeviceSensor
from cinegen.errors import CinegenError
from cinegen.exception_log import ExceptionLog
from cinegen.sensor import SensorState

_SHORTEST, _LONGEST = 0.1, 3.0  # s between two attempts to open: doubled from one to the next
_PATIENCE = 3.0  # s that `close` waits for the thread


class DeviceLostError(CinegenError):
    """The device is gone. This ends the connection; readers never get it."""


class WrongDeviceError(CinegenError):
    """Another kind of device answers. This ends the connection; readers never get it."""


class ThreadedSensor(DeviceSensor, ABC):
    """Base of sensors that wait for input: a subclass implements `serve`, which runs while the device is open.

    Args:
        url: address of the device.

    Attributes:
        longest: longest time between two attempts to open it, s.
        exception_log: exceptions of `serve` other than `OSError` and `CinegenError`, each logged once.
    """

    def __init__(self, url: str) -> None:
        super().__init__(url)
        self.longest = _LONGEST
        self.exception_log = ExceptionLog()
        self._ending = threading.Event()
        self._thread_local = threading.local()  # a thread that hung while the sensor was closed still ends
        self._thread: threading.Thread | None = None

    @abstractmethod
    def serve(self) -> None:
        """Open the device, call `live`, put readings into `newest` until `ending`, and close the device in any case.

        Raises:
            Exception: the device can't be opened, or is gone; it is opened again later.
        """

    # --- interface of a sensor -------------------------------------------------------------------------------------

    def start(self) -> None:
        """Start the thread, and return at once."""
        if self._thread is not None and self._thread.is_alive() and not self._ending.is_set():
            return
        self._ending = threading.Event()
        self._reported = SensorState.OPENING, f"{self.url} is being opened"
        self._thread = threading.Thread(target=self._run, args=(self._ending,), name=f"sensor {self.url}", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Close the sensor, and wait for its thread for a while; a thread in a system call ends after it."""
        self._ending.set()
        thread = self._thread
        if thread is not None and thread is not threading.current_thread():
            thread.join(_PATIENCE)
        self._reported = SensorState.CLOSED, f"{self.url} is closed"

    # --- for subclasses --------------------------------------------------------------------------------------------

    @property
    def ending(self) -> bool:
        """True when `serve` should return."""
        return self._own_ending.is_set()

    def wait(self, seconds: float) -> bool:
        """Wait (s). Return whether `serve` should return."""
        return self._own_ending.wait(seconds)

    def live(self, message: str) -> None:
        """Report that the device is connected, with a description."""
        if not self.ending:
            self._reported = SensorState.LIVE, message

    @property
    def _own_ending(self) -> threading.Event:
        ending: threading.Event = getattr(self._thread_local, "ending", self._ending)
        return ending

    # --- the thread ----------------------------------------------------------------------------------------------

    def _run(self, ending: threading.Event) -> None:
        self._thread_local.ending = ending
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
    """Return the message of the operating system, without the text that pyserial adds."""
    text = str(error) or type(error).__name__
    texts = re.findall(r"\[Errno -?\d+\] ([^:\[\]]+)|\(\d+, '([^']+)'\)", text)
    return "".join(texts[-1]).strip().lower() if texts else text
