"""Small numerical tools that need no other package."""

from __future__ import annotations

from collections.abc import Callable


def bisected(holds: Callable[[float], bool], low: float, high: float, halvings: int) -> tuple[float, float]:
    """(low, high) with ``holds(low)`` and not ``holds(high)``, (high - low) 2^-halvings apart.

    ``holds`` is true below some place between the two and false above it; it is not asked at the ends themselves.
    """
    for _ in range(halvings):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if holds(middle) else (low, middle)
    return low, high
