"""`ExceptionLog`: report exceptions that must not end a loop, each of them once."""

from __future__ import annotations

import logging
import traceback
from contextlib import suppress


class ExceptionLog:
    """Report exceptions that are caught where none may be raised, for instance in a control loop.

    Each distinct exception is logged once, with its traceback, at level ERROR by the logger "cinegen", so that a loop
    that meets the same one in every tick does not flood the log. Two exceptions are the same if they have the same
    source and type and were raised by the same line of code; their texts may differ.

    Attributes:
        messages: one for each exception that was logged, oldest first, without traceback.
    """

    def __init__(self) -> None:
        self.messages: list[str] = []
        self._known: set[tuple[str, str, str, str, int]] = set()

    def report(self, source: str, error: Exception) -> None:
        """Log an exception, unless the same one was logged before. Never raises.

        Args:
            source: what raised it, for people.
            error: that was caught. What earlier raises of this very object left in its traceback is removed.
        """
        kind = type(error)
        key = (source, kind.__module__, kind.__qualname__, *_raised_at(error))
        if key in self._known:
            return
        self._known.add(key)
        message = f"{source}: {''.join(traceback.format_exception_only(error)).strip()}"
        self.messages.append(message)
        with suppress(Exception):  # of a handler or filter of the program's own
            logging.getLogger("cinegen").error("%s (logged once)", message, exc_info=error)


def _raised_at(error: Exception) -> tuple[str, int]:
    """Return the file and the line that raised an exception. Cuts the traceback where it begins again: an object that
    is raised in every tick collects the frames of all of them."""
    first = entry = error.__traceback__
    if first is None or entry is None:
        return "", 0
    while entry.tb_next is not None and entry.tb_next.tb_frame.f_code is not first.tb_frame.f_code:
        entry = entry.tb_next
    entry.tb_next = None
    return entry.tb_frame.f_code.co_filename, entry.tb_lineno
