"""Settings of the interpreter and the operating system for punctual loops, restored when the last loop ends.

Interpreter: a thread that wakes needs the global interpreter lock, which its holder releases only after the switch
interval, 5 ms by default. The waiting thread reads that interval when it starts to wait. So the interval is short while
a loop sleeps and long during a tick: the loop gets the lock soon, and waiting threads do not interrupt its tick. A full
garbage collection takes tens of milliseconds once a robot is loaded: existing objects are frozen out of collections.

Operating system: a thread in the real-time class SCHED_FIFO runs as soon as it wakes, whatever other load there is.
For other programs to run too, there are fewer such loops on a machine than cores; further ones are scheduled as usual.
"""

from __future__ import annotations

import gc
import os
import socket
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress

_SHORT = 1e-4  # s: switch interval while a loop sleeps
_LONG = 1e-3  # s: during a tick, also for a tick that released the lock and wants it back
_RESERVED = "\0cinegen real-time loop "  # names of reservations, each with its number

_lock = threading.Lock()
_loops = 0
_interval = 0.0
_frozen = False


def asleep() -> None:
    """Prepare for a sleep of the loop: it is to get the interpreter soon when it wakes."""
    sys.setswitchinterval(_SHORT)


def awake() -> None:
    """Prepare for a tick: other threads are not to interrupt it."""
    sys.setswitchinterval(_LONG)


@contextmanager
def quiet_interpreter() -> Iterator[None]:
    """Set the process's switch interval and freeze existing objects while any loop is in this context."""
    global _loops, _interval, _frozen
    with _lock:
        _loops += 1
        if _loops == 1:
            _interval = sys.getswitchinterval()
            awake()
            _frozen = gc.get_freeze_count() == 0  # else the program has done so itself
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
def scheduled(priority: int) -> Iterator[str]:
    """Schedule the calling thread in real time, where that is permitted; yield a description of the result.

    Args:
        priority: priority of SCHED_FIFO; 0 leaves the scheduling unchanged, and so do other loops in real time on all
            cores but one.
    """
    scheduling = "ordinary scheduling"
    if not hasattr(os, "sched_setscheduler"):
        yield f"{scheduling} (this system offers no real-time scheduling)" if priority else scheduling
        return
    policy, parameters, cores = os.sched_getscheduler(0), os.sched_getparam(0), len(os.sched_getaffinity(0))
    reservation = _reservation(cores) if priority else None
    try:
        if priority and reservation is None:
            scheduling += f" (no real time: one of {cores} cores must remain for other programs)"
        elif reservation is not None:
            try:  # threads and processes that a tick starts are scheduled as usual
                fifo = os.SCHED_FIFO | os.SCHED_RESET_ON_FORK
                os.sched_setscheduler(0, fifo, os.sched_param(priority))
                scheduling = f"SCHED_FIFO {priority}"
            except OSError as error:
                scheduling += f" (no real time: {(error.strerror or str(error)).lower()})"
                reservation.close()
        yield scheduling
    finally:
        for reset in (0, os.SCHED_RESET_ON_FORK):  # this flag may be permitted to be set, but not to be cleared
            with suppress(OSError):
                os.sched_setscheduler(0, policy | reset, parameters)
                break
        if reservation is not None:
            reservation.close()


def _reservation(cores: int) -> socket.socket | None:
    """Reserve one of `cores` for real time; return None if only one is left.

    A reservation is a name among Linux's abstract sockets: all programs on a machine share them, and it vanishes with
    its process. Nothing listens there.
    """
    for number in range(cores - 1):
        name = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        try:
            name.bind(f"{_RESERVED}{number}")
            return name
        except OSError:
            name.close()
    return None
