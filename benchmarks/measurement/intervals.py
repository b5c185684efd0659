# SPDX-License-Identifier: Apache-2.0
"""How sure a median is: an interval that needs no assumption on how the host disturbs."""

import math
from collections.abc import Sequence

CONFIDENCE = 0.95


def of_median(samples: Sequence[float]) -> tuple[float, float]:
    """Confidence interval of the median of independent samples, between two of them.

    The number of samples below the median is binomial with p = 1/2, whatever the distribution
    (David and Nagaraja, "Order Statistics", 3rd edition, section 7.1). The narrowest symmetric
    pair of order statistics that holds the median with ``CONFIDENCE`` is returned. Fewer than six
    samples cannot give 95 %: the interval is then unbounded.
    """
    ordered, n = sorted(samples), len(samples)
    outside, rank = 0.0, 0  # probability that the median is below the rank-th smallest sample
    while rank < n / 2 and 2.0 * (outside + math.comb(n, rank) / 2.0**n) <= 1.0 - CONFIDENCE:
        outside += math.comb(n, rank) / 2.0**n
        rank += 1
    if rank == 0:
        return -math.inf, math.inf
    return ordered[rank - 1], ordered[n - rank]
