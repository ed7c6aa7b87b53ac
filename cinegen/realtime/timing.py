"""Timing statistics of a loop: kept in constant memory while it runs, readable at any time, also by another process."""

from __future__ import annotations

import math
import time
from collections import deque
from dataclasses import dataclass
from typing import Any

import numpy as np

LOW = 1e-7  # s: upper end of the first bin of a histogram; the clock itself resolves no less
PER_DECADE = 64  # bins, each 3.7 % wide
BINS = 2 + 9 * PER_DECADE  # the first one, then up to 100 s; longer times share the last

WIDTH = 10.0 ** (1.0 / PER_DECADE)
"""Ratio of a bin's ends: a percentile is reported at most this factor too large, and never too small."""


@dataclass(frozen=True, slots=True)
class Percentiles:
    """Distribution of a time over all ticks, s. The maximum is exact; the others are upper ends of bins 3.7 % wide.

    Attributes:
        p50: median.
        p99: 99th percentile.
        max: maximum.
    """

    p50: float
    p99: float
    max: float

    def __str__(self) -> str:
        return f"50 % within {_short(self.p50)}, 99 % within {_short(self.p99)}, at most {_short(self.max)}"


@dataclass(frozen=True, slots=True)
class TimingReport:
    """Timing of a clock's ticks, in seconds. Quantities that need more ticks than there were are NaN.

    Attributes:
        period: requested period, at present if it was changed.
        ticks: number of completed ticks.
        skipped: number of deadlines without a tick, because they had passed.
        seconds: time from the start of the first tick to the start of the last.
        mean: mean period between the starts of successive ticks.
        jitter: standard deviation of the period.
        error: absolute deviation of the period from the requested one.
        late: delay of a tick's start after its deadline (the first deadline that was skipped, if any was).
        work: duration of a tick.
        busy: fraction of the time spent in ticks.
        overruns: number of ticks that ended after the next deadline, or started so late that deadlines were skipped.
        longest: longest overrun.
        scheduling: scheduling of the loop that was obtained from the operating system.
        resting: whether no tick is due at present: the loop is at rest (`Clock.rest`), or does not run.
        pending: number of deadlines that have passed since the last tick began, which is still running or is late.
    """

    period: float
    ticks: int
    skipped: int
    seconds: float
    mean: float
    jitter: float
    error: Percentiles
    late: Percentiles
    work: Percentiles
    busy: float
    overruns: int
    longest: float
    scheduling: str
    resting: bool = True
    pending: int = 0

    def __str__(self) -> str:
        if not self.ticks:
            return f"no tick of {_short(self.period)} yet"
        overruns = f"{self.overruns} overruns, the longest {_short(self.longest)}" if self.overruns else "no overruns"
        return "\n".join(
            (
                f"{self.ticks} ticks of {_short(self.period)} in {self.seconds:.3f} s, {self.skipped} skipped",
                f"period  mean {1e3 * self.mean:.6f} ms, jitter {_short(self.jitter)}",
                f"error   {self.error}",
                f"late    {self.late}",
                f"work    {self.work}; busy {100.0 * self.busy:.1f} %",
                f"{overruns}; {self.scheduling}",
            )
        )


class Histogram:
    """Histogram of times with logarithmic bins.

    Args:
        counts: `BINS` integers, initially 0; the histogram's whole memory.
    """

    def __init__(self, counts: memoryview[int]) -> None:
        self._counts = counts

    def add(self, seconds: float) -> None:
        """Count one time."""
        i = 0
        if seconds > LOW:
            i = min(BINS - 1, 1 + int(PER_DECADE * math.log10(seconds / LOW)))
        self._counts[i] += 1

    def quantile(self, fraction: float) -> float:
        """Return the upper end of the bin of a quantile, s; NaN if the histogram is empty."""
        seen = np.cumsum(self._counts)
        if not seen[-1]:
            return math.nan
        i = int(np.searchsorted(seen, max(1, math.ceil(fraction * int(seen[-1]) - 1e-9))))
        return LOW * math.pow(10.0, i / PER_DECADE) if i < BINS - 1 else math.inf


# Indices of the numbers that are kept.
_TICKS, _SKIPPED, _OVERRUNS, _LONGEST = range(4)
_FIRST, _LAST, _ENDED, _DUE, _WORKED = range(4, 9)  # starts of the first and last tick, its end, next deadline
_PERIODS, _MEAN, _SQUARES = range(9, 12)  # mean and summed squares of the periods' deviations from the first
_MAX_ERROR, _MAX_LATE, _MAX_WORK = range(12, 15)
_ACTIVE = 15  # 1 from the start of a tick until the loop rests or ends
_PERIOD = 16  # requested at present
_BYTES_OF_NUMBERS = 8 * 17
_BYTES_OF_COUNTS = 8 * BINS


class TimingRecord:
    """Timing of a loop's ticks. One thread writes; others may ask for a report meanwhile, also in another process if
    the memory is shared. Nothing is locked, so one number may be a tick older than another.

    Args:
        period: requested period at first, s.
        memory: `SIZE` bytes, initially 0; allocated unless given.
    """

    SIZE = _BYTES_OF_NUMBERS + 3 * _BYTES_OF_COUNTS

    def __init__(self, period: float, memory: Any = None) -> None:
        self._first, self._memory = period, bytearray(self.SIZE) if memory is None else memory
        whole = memoryview(self._memory).cast("B")
        self._numbers = whole[:_BYTES_OF_NUMBERS].cast("d")
        ends = range(_BYTES_OF_NUMBERS, self.SIZE, _BYTES_OF_COUNTS)
        if not self._numbers[_PERIOD]:
            self._numbers[_PERIOD] = period
        self._error, self._late, self._work = (Histogram(whole[end : end + _BYTES_OF_COUNTS].cast("q")) for end in ends)

    def __reduce__(self) -> tuple[type[TimingRecord], tuple[float, Any]]:
        return TimingRecord, (self._first, self._memory)

    @property
    def period(self) -> float:
        """Requested period, s; it may be set between two ticks."""
        return float(self._numbers[_PERIOD])

    @period.setter
    def period(self, period: float) -> None:
        self._numbers[_PERIOD] = period

    def begun(self, start: float, late: float, skipped: int) -> None:
        """Record the start of a tick.

        Args:
            start: time of the start, s.
            late: delay after its deadline, or after the first deadline that was skipped, s.
            skipped: number of skipped deadlines.
        """
        n = self._numbers
        if n[_ACTIVE]:
            period = start - n[_LAST]
            off = period - self._first
            n[_PERIODS] += 1.0
            delta = off - n[_MEAN]  # B. P. Welford, Technometrics 4, 1962
            n[_MEAN] += delta / n[_PERIODS]
            n[_SQUARES] += delta * (off - n[_MEAN])
            error = abs(period - n[_PERIOD])
            self._error.add(error)
            n[_MAX_ERROR] = max(n[_MAX_ERROR], error)
        elif not n[_TICKS]:
            n[_FIRST] = start
        n[_LAST], n[_ACTIVE] = start, 1.0
        self._late.add(late)
        n[_MAX_LATE] = max(n[_MAX_LATE], late)
        n[_SKIPPED] += skipped
        behind = n[_TICKS] and n[_ENDED] > n[_DUE]  # that overrun is counted already; it may have grown
        if skipped or behind:
            n[_OVERRUNS] += not behind
            n[_LONGEST] = max(n[_LONGEST], late)

    def ended(self, end: float, due: float) -> None:
        """Record the end of a tick.

        Args:
            end: time of the end, s.
            due: next deadline, s.
        """
        n = self._numbers
        n[_ENDED], n[_DUE] = end, due
        work = end - n[_LAST]
        self._work.add(work)
        n[_MAX_WORK] = max(n[_MAX_WORK], work)
        n[_WORKED] += work
        n[_TICKS] += 1.0
        if end > due:
            n[_OVERRUNS] += 1.0
            n[_LONGEST] = max(n[_LONGEST], end - due)

    def rest(self) -> None:
        """Record that no tick is due until the next one begins."""
        self._numbers[_ACTIVE] = 0.0

    def report(self, scheduling: str = "") -> TimingReport:
        """Return the statistics up to now.

        Args:
            scheduling: description of the loop's scheduling, for the report.
        """
        n = self._numbers.tolist()
        ticks, periods, active = int(n[_TICKS]), n[_PERIODS], bool(n[_ACTIVE])
        passed = int((time.perf_counter() - n[_LAST]) / self.period) if active else 0
        return TimingReport(
            period=self.period,
            ticks=ticks,
            skipped=int(n[_SKIPPED]),
            seconds=n[_LAST] - n[_FIRST],
            mean=self._first + n[_MEAN] if periods else math.nan,
            jitter=math.sqrt(n[_SQUARES] / periods) if periods else math.nan,
            error=_percentiles(self._error, n[_MAX_ERROR]),
            late=_percentiles(self._late, n[_MAX_LATE]),
            work=_percentiles(self._work, n[_MAX_WORK]),
            busy=n[_WORKED] / max(self.period, n[_ENDED] - n[_FIRST]) if ticks else math.nan,
            overruns=int(n[_OVERRUNS]),
            longest=n[_LONGEST],
            scheduling=scheduling,
            resting=not active,
            pending=max(0, passed - 1),
        )


class RecentTiming:
    """Ticks and missed deadlines of the last second, from successive reports."""

    def __init__(self) -> None:
        self._counts = deque([(time.monotonic(), 0, 0)])  # time, ticks, missed deadlines

    def add(self, report: TimingReport) -> tuple[float, int]:
        """Return the ticks per second, and the deadlines without a tick per second, both in the last second up to the
        present report; in a longer time if there was no report for longer."""
        now, counts = time.monotonic(), self._counts
        counts.append((now, report.ticks, report.skipped + report.pending))
        while len(counts) > 2 and counts[1][0] <= now - 1.0:
            counts.popleft()
        then, ticks, missed = counts[0]
        seconds = max(1e-3, now - then)
        return (report.ticks - ticks) / seconds, max(0, round((counts[-1][2] - missed) / max(1.0, seconds)))


def _percentiles(histogram: Histogram, largest: float) -> Percentiles:
    p50, p99 = histogram.quantile(0.5), histogram.quantile(0.99)
    if math.isnan(p50):
        return Percentiles(math.nan, math.nan, math.nan)
    return Percentiles(min(p50, largest), min(p99, largest), largest)


def _short(seconds: float) -> str:
    return f"{1e3 * seconds:.3g} ms" if seconds < 1.0 else f"{seconds:.3g} s"
