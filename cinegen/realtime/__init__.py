"""Loops at a fixed rate, in the calling thread, another thread or another process, with timing statistics."""

from cinegen.realtime.channel import ClockError
from cinegen.realtime.clock import Clock, Tick
from cinegen.realtime.timing import Percentiles, TimingReport

__all__ = ["Clock", "ClockError", "Percentiles", "Tick", "TimingReport"]
