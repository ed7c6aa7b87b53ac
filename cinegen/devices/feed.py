"""A sensor with a thread of its own: it opens a device, hands on what that says, and opens it again when it is lost."""

from __future__ import annotations

import re
import threading
from abc import ABC, abstractmethod

from cinegen.devices.newest import Newest
from cinegen.errors import CinegenError
from cinegen.exception_log import ExceptionLog
from cinegen.sensor import Reading, SensorState, SensorStatus

_SHORTEST, _LONGEST = 0.1, 3.0  # s between two attempts to open: doubled from one to the next
_PATIENCE = 3.0  # s that `close` waits for the thread


class LostError(CinegenError):
    """A device that is gone. Ends a session, never reaches whoever reads."""


class RefusedError(CinegenError):
    """Something is there, and is not what it should be. Ends a session, never reaches whoever reads."""


class Feed(ABC):
    """What the sensors with input and output share; a kind is what it does while it is open: `serve`.

    Args:
        url: where the device is.

    Attributes:
        timeout: s: if nothing comes for so long after a reading that was not at rest, the device has fallen silent.
        longest: s between two attempts to open it, at most.
        exception_log: what `serve` raised so far, other than `OSError` and `CinegenError`; each is logged once.
    """

    timeout = 0.25

    def __init__(self, url: str) -> None:
        self.url = url
        self.longest = _LONGEST
        self.newest = Newest()
        self.damaged = 0
        self.exception_log = ExceptionLog()
        self._said = SensorState.CLOSED, f"{url} is not started"
        self._ending = threading.Event()
        self._own = threading.local()  # a thread that hung when it was closed still knows that it should end
        self._thread: threading.Thread | None = None

    def __repr__(self) -> str:
        return f"<{type(self).__name__} {self.url}: {self.status.state.value}>"

    @abstractmethod
    def serve(self) -> None:
        """Opens the device, says `live`, and puts what it says into `newest` until `ending`; closes it in any case.

        Raises:
            Exception: it can't be opened, or is gone; it is tried again after a while.
        """

    # --- of a sensor ---------------------------------------------------------------------------------------------

    def start(self) -> None:
        """Begins, in a thread of its own; returns at once."""
        if self._thread is not None and self._thread.is_alive() and not self._ending.is_set():
            return
        self._ending = threading.Event()
        self._said = SensorState.OPENING, f"{self.url} is being opened"
        self._thread = threading.Thread(target=self._run, args=(self._ending,), name=f"sensor {self.url}", daemon=True)
        self._thread.start()

    def read(self) -> Reading | None:
        """The newest reading, if there is one that was not read yet."""
        return self.newest.take()

    @property
    def status(self) -> SensorStatus:
        """What it is doing."""
        state, words = self._said
        if state is SensorState.LIVE:
            silent = self.newest.silence()
            if silent > self.timeout:
                state, words = SensorState.SILENT, f"{self.url} has said nothing for {silent:.1f} s"
        return SensorStatus(state, words, self.newest.count, self.damaged)

    def close(self) -> None:
        """Ends. Waits for the thread a while; one that hangs in a system call ends when that does."""
        self._ending.set()
        thread = self._thread
        if thread is not None and thread is not threading.current_thread():
            thread.join(_PATIENCE)
        self._said = SensorState.CLOSED, f"{self.url} is closed"

    # --- for its kinds -------------------------------------------------------------------------------------------

    @property
    def ending(self) -> bool:
        """Whether `serve` should return."""
        return self._own_ending.is_set()

    def wait(self, seconds: float) -> bool:
        """Waits; whether `serve` should return."""
        return self._own_ending.wait(seconds)

    def live(self, words: str) -> None:
        """The device is there, and is this."""
        if not self.ending:
            self._said = SensorState.LIVE, words

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
            except RefusedError as error:
                end = SensorState.REFUSED, str(error)
            except Exception as error:  # whatever a driver raises: a sensor never stops anything
                end = SensorState.LOST, f"{self.url.rstrip(':')}: {_sentence(error)}"
                if not isinstance(error, OSError | CinegenError):  # a device that is gone is no bug
                    self.exception_log.report(self.url, error)
            if ending.is_set():
                return  # `close` has had its say
            was_live = self._said[0] is SensorState.LIVE
            self._said = end
            self.newest.end()
            pause = _SHORTEST if was_live else min(2.0 * pause, self.longest)
            if ending.wait(pause):
                return


def _sentence(error: Exception) -> str:
    """What the system says, out of what pyserial has put around it."""
    text = str(error) or type(error).__name__
    said = re.findall(r"\[Errno -?\d+\] ([^:\[\]]+)|\(\d+, '([^']+)'\)", text)
    return "".join(said[-1]).strip().lower() if said else text
