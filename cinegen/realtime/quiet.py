"""What the interpreter and the system can do for a loop's punctuality; everything is as before once it has ended.

The interpreter: a thread that wakes must have the global interpreter lock, and whoever holds it is asked to hand it
over only after the switch interval, 5 ms as a rule. That interval is read by the one that waits, when it begins to
wait. So it is short while a loop sleeps, and long while a tick is on its way: the loop gets in soon, and those who
wait don't cut its tick into pieces. And a full garbage collection takes tens of milliseconds once a robot is loaded,
in whatever thread it begins: what exists is kept out of collections.

The system: a thread that sleeps in the real-time class SCHED_FIFO runs as soon as it wakes, whoever else is busy.
"""

from __future__ import annotations

import gc
import os
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress

from cinegen.realtime.board import ClockError

_SHORT = 1e-4  # s: a loop that is due waits this long until it asks for the lock
_LONG = (
    1e-3  # s: and others this long while a tick is on its way; also a tick that let go of the lock and wants it back
)

_lock = threading.Lock()
_loops = 0
_interval = 0.0
_frozen = False


def asleep() -> None:
    """A loop goes to sleep: it wants the interpreter soon when it wakes."""
    sys.setswitchinterval(_SHORT)


def awake() -> None:
    """A tick begins: it wants to be left alone."""
    sys.setswitchinterval(_LONG)


@contextmanager
def quiet_interpreter() -> Iterator[None]:
    """As long as any loop is in here, this process's switch interval is theirs, and garbage collections are short:
    of what is made from now on."""
    global _loops, _interval, _frozen
    with _lock:
        _loops += 1
        if _loops == 1:
            _interval = sys.getswitchinterval()
            awake()
            _frozen = gc.get_freeze_count() == 0  # else the program does so itself
            if _frozen:
                gc.freeze()
    try:
        yield
    finally:
        with _lock:
            _loops -= 1
            if _loops == 0:
                sys.setswitchinterval(_interval)
                if _frozen:
                    gc.unfreeze()


@contextmanager
def scheduled(priority: int, cores: frozenset[int]) -> Iterator[str]:
    """Has the calling thread scheduled in real time, where that is permitted; yields in words what became of it.

    Args:
        priority: of SCHED_FIFO; 0 leaves it as it is.
        cores: on which it may run; any if empty.

    Raises:
        ClockError: it may run on none of these cores.
    """
    words = "ordinary scheduling"
    if not hasattr(os, "sched_setscheduler"):
        yield f"{words} (this system offers no other)" if priority or cores else words
        return
    policy, parameters, allowed = os.sched_getscheduler(0), os.sched_getparam(0), os.sched_getaffinity(0)
    if cores:
        try:
            os.sched_setaffinity(0, cores)
        except (OSError, OverflowError, ValueError) as error:
            raise ClockError(f"a clock can't run on cores {_listed(cores)}; it may on {_listed(allowed)}") from error
    try:
        if priority:
            try:  # threads and processes that a tick starts are ordinary ones again
                fifo = os.SCHED_FIFO | os.SCHED_RESET_ON_FORK
                os.sched_setscheduler(0, fifo, os.sched_param(priority))
                words = f"SCHED_FIFO {priority}"
            except OSError as error:
                words += f" (no real time: {(error.strerror or str(error)).lower()})"
        yield words + (f", on cores {_listed(cores)}" if cores else "")
    finally:
        for reset in (0, os.SCHED_RESET_ON_FORK):  # that flag may be one's own to set, but not to clear
            with suppress(OSError):
                os.sched_setscheduler(0, policy | reset, parameters)
                break
        if cores:
            with suppress(OSError):
                os.sched_setaffinity(0, allowed)


def _listed(cores: frozenset[int] | set[int]) -> str:
    return ", ".join(str(core) for core in sorted(cores))
