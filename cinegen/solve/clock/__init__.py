"""A loop at a fixed rate, in the calling thread, a thread of its own or a process of its own, that times itself."""

from cinegen.solve.clock.board import ClockError
from cinegen.solve.clock.clock import Clock, Tick
from cinegen.solve.clock.record import Report, Spread

__all__ = ["Clock", "ClockError", "Report", "Spread", "Tick"]
