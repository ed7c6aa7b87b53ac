"""A loop at a fixed rate, in the calling thread, a thread of its own or a process of its own, that times itself."""

from cinegen.realtime.board import ClockError
from cinegen.realtime.clock import Clock, Tick
from cinegen.realtime.record import Report, Spread

__all__ = ["Clock", "ClockError", "Report", "Spread", "Tick"]
