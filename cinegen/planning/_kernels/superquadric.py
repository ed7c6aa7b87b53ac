"""Contours of Volpe and Khosla's potential, compiled; see `cinegen.planning.potential_fields.Elliptical`."""

from __future__ import annotations

import math

from numba import types

from cinegen.jit.compiled import Array, compiled, entry, prepare

CONTACT = 1e-12
"""Largest K, or distance in m, that counts as contact."""

_ROUNDS = 80  # at most
_SAME = 1e-14  # of K


@entry
def find_contours(logs: Array, shares: Array, rounding: float, k: Array) -> None:
    """Compute the root K of each point's equation by Newton's method, with bisection where that leaves the bracket.

    Args:
        logs: (m, 3) log |x_i / h_i|.
        shares: (3,) (h_i / a)^2.
        rounding: beta.
        k: (m,) becomes K; 0 on the box and in it.
    """
    all_shares = shares[0] + shares[1] + shares[2]
    for i in range(logs.shape[0]):
        largest = max(logs[i, 0], logs[i, 1], logs[i, 2])
        if largest <= 0.0 or _excess(logs[i], largest, shares, rounding, CONTACT)[0] <= 0.0:
            k[i] = 0.0
            continue
        low = 0.0
        high = math.sqrt(all_shares) * math.exp(largest) - 1.0  # a bound for every n: the largest term times all shares
        here = high
        for _ in range(_ROUNDS):
            excess, slope = _excess(logs[i], largest, shares, rounding, here)
            if excess > 0.0:
                low = here
            else:
                high = here
            before, here = here, here - excess / slope
            if not low < here < high:
                here = 0.5 * (low + high)
            if abs(here - before) <= _SAME * here:
                break
        k[i] = here


@compiled
def _excess(logs: Array, largest: float, shares: Array, rounding: float, k: float) -> tuple[float, float]:
    """Return the log of a point's n-norm less that of the contour K, positive beyond it; and its derivative by K, exact
    at the root, approximate elsewhere."""
    n = -1.0 / math.expm1(-rounding * max(k, CONTACT))
    total, mean = 0.0, 0.0
    for j in range(3):
        term = shares[j] * math.exp(2.0 * n * (logs[j] - largest))
        total += term
        mean += term * logs[j]
    norm = math.log1p(k)
    by_n = (mean / total - norm) / n
    slope = by_n * -rounding * math.exp(-rounding * k) * n * n - 1.0 / (1.0 + k)
    return largest + math.log(total) / (2.0 * n) - norm, slope


def prepare_contours() -> None:
    """Compile the kernel, or load it from disk."""
    prepare(find_contours, types.float64[:, ::1], types.float64[::1], types.float64, types.float64[::1])
