"""How well a loop kept its period: kept in constant memory while it runs, and told at any time."""

from __future__ import annotations

import math
from dataclasses import dataclass

LOW = 1e-7  # s: times up to this share the first bin of a histogram; the clock itself reads no finer
PER_DECADE = 64  # bins, each 3.7 % wide
BINS = 2 + 9 * PER_DECADE  # the first one, then up to 100 s; longer times share the last

WIDTH = 10.0 ** (1.0 / PER_DECADE)
"""The ratio of a bin's ends: a percentile is told at most this factor too large, and never too small."""


@dataclass(frozen=True, slots=True)
class Spread:
    """How a time spreads over all ticks, s. Percentiles are the upper ends of bins 3.7 % wide, the largest is exact.

    Attributes:
        p50: half are at most this.
        p99: 99 % are.
        max: all are.
    """

    p50: float
    p99: float
    max: float

    def __str__(self) -> str:
        return f"50 % within {_short(self.p50)}, 99 % within {_short(self.p99)}, at most {_short(self.max)}"


@dataclass(frozen=True, slots=True)
class Report:
    """How a clock kept its period. Times in seconds; what needs more ticks than there were is nan.

    Attributes:
        period: as asked for.
        ticks: how many ended.
        skipped: deadlines that no tick was made for, because they had passed.
        seconds: from the first tick's begin to the last one's.
        mean: of the periods: from a tick's begin to the next one's.
        jitter: their standard deviation.
        error: how far the periods were from the one asked for, either way.
        late: how long after its deadline a tick began; after the first of those skipped, where some were.
        work: how long a tick took.
        busy: the part of all time that ticks took.
        overruns: ticks that had not ended when the next was due, or began so late that others were skipped.
        longest: the longest overrun: how much too late.
        scheduling: how the system was asked to schedule the loop, and what became of it.
    """

    period: float
    ticks: int
    skipped: int
    seconds: float
    mean: float
    jitter: float
    error: Spread
    late: Spread
    work: Spread
    busy: float
    overruns: int
    longest: float
    scheduling: str

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
    """Times by the logarithm of their length.

    Args:
        counts: `BINS` integers, 0 at the beginning; the histogram's whole memory.
    """

    def __init__(self, counts: memoryview[int]) -> None:
        self._counts = counts

    def add(self, seconds: float) -> None:
        """Counts one more."""
        i = 0
        if seconds > LOW:
            i = min(BINS - 1, 1 + int(PER_DECADE * math.log10(seconds / LOW)))
        self._counts[i] += 1

    def quantile(self, part: float) -> float:
        """The upper end of the bin that the smallest time is in which `part` of all are not above; nan if empty."""
        counts = self._counts.tolist()
        rank = max(1, math.ceil(part * sum(counts) - 1e-9))
        seen = 0
        for i, count in enumerate(counts):
            seen += count
            if seen >= rank:
                return LOW * math.pow(10.0, i / PER_DECADE) if i < BINS - 1 else math.inf
        return math.nan


# The numbers that are kept, by their place.
_TICKS, _SKIPPED, _OVERRUNS, _LONGEST = range(4)
_FIRST, _LAST, _ENDED, _DUE, _WORKED = range(4, 9)  # begin of the first tick and the last, its end, the next's due
_PERIODS, _MEAN, _SQUARES = range(9, 12)  # mean and summed squares of the periods less the one asked for
_MAX_ERROR, _MAX_LATE, _MAX_WORK = range(12, 15)
_BYTES_OF_NUMBERS = 8 * 15
_BYTES_OF_COUNTS = 8 * BINS


class Record:
    """What is kept of a loop's ticks. One thread writes; any may ask for a report meanwhile, also from another
    process if the memory is shared: nothing is locked, so a number may be one tick older than the next one.

    Args:
        period: s.
        memory: `SIZE` bytes, 0 at the beginning; its own unless given.
    """

    SIZE = _BYTES_OF_NUMBERS + 3 * _BYTES_OF_COUNTS

    def __init__(self, period: float, memory: memoryview[int] | None = None) -> None:
        whole = memoryview(bytearray(self.SIZE)) if memory is None else memory
        self.period = period
        self._numbers = whole[:_BYTES_OF_NUMBERS].cast("d")
        ends = range(_BYTES_OF_NUMBERS, self.SIZE, _BYTES_OF_COUNTS)
        self._error, self._late, self._work = (Histogram(whole[end : end + _BYTES_OF_COUNTS].cast("q")) for end in ends)

    def begun(self, start: float, late: float, skipped: int) -> None:
        """A tick began.

        Args:
            start: when, s on the clock that all times are taken from.
            late: s after it, or the first of those skipped, was due.
            skipped: how many deadlines.
        """
        n = self._numbers
        if n[_TICKS]:
            off = start - n[_LAST] - self.period
            n[_PERIODS] += 1.0
            delta = off - n[_MEAN]  # B. P. Welford, Technometrics 4, 1962
            n[_MEAN] += delta / n[_PERIODS]
            n[_SQUARES] += delta * (off - n[_MEAN])
            error = abs(off)
            self._error.add(error)
            n[_MAX_ERROR] = max(n[_MAX_ERROR], error)
        else:
            n[_FIRST] = start
        n[_LAST] = start
        self._late.add(late)
        n[_MAX_LATE] = max(n[_MAX_LATE], late)
        n[_SKIPPED] += skipped
        behind = n[_TICKS] and n[_ENDED] > n[_DUE]  # that overrun is counted already; it may have grown
        if skipped or behind:
            n[_OVERRUNS] += not behind
            n[_LONGEST] = max(n[_LONGEST], late)

    def ended(self, end: float, due: float) -> None:
        """The tick ended.

        Args:
            end: when.
            due: when the next one is due.
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

    def report(self, scheduling: str = "") -> Report:
        """All that is known up to now.

        Args:
            scheduling: what to say of it.
        """
        n = self._numbers.tolist()
        ticks, periods = int(n[_TICKS]), n[_PERIODS]
        return Report(
            period=self.period,
            ticks=ticks,
            skipped=int(n[_SKIPPED]),
            seconds=n[_LAST] - n[_FIRST],
            mean=self.period + n[_MEAN] if periods else math.nan,
            jitter=math.sqrt(n[_SQUARES] / periods) if periods else math.nan,
            error=_spread(self._error, n[_MAX_ERROR]),
            late=_spread(self._late, n[_MAX_LATE]),
            work=_spread(self._work, n[_MAX_WORK]),
            busy=n[_WORKED] / max(self.period, n[_ENDED] - n[_FIRST]) if ticks else math.nan,
            overruns=int(n[_OVERRUNS]),
            longest=n[_LONGEST],
            scheduling=scheduling,
        )


def _spread(histogram: Histogram, largest: float) -> Spread:
    p50, p99 = histogram.quantile(0.5), histogram.quantile(0.99)
    if math.isnan(p50):
        return Spread(math.nan, math.nan, math.nan)
    return Spread(min(p50, largest), min(p99, largest), largest)


def _short(seconds: float) -> str:
    return f"{1e3 * seconds:.3g} ms" if seconds < 1.0 else f"{seconds:.3g} s"
