"""Rates with their confidence intervals."""

from __future__ import annotations

from scipy.stats import binomtest


def rate(solved: int, count: int) -> str:
    """Return a rate with its 95 % confidence interval by E. B. Wilson (1927), such as '19 of 20 (76 to 99 %)'."""
    if not count:
        return "0 of 0"
    interval = binomtest(solved, count).proportion_ci(method="wilson")
    return f"{solved} of {count} ({100.0 * interval.low:.0f} to {100.0 * interval.high:.0f} %)"
