"""One place that every random stream of a test passes: BAYESMEMBRANE_TEST_SEED moves all of them to others.

Without it, or with 0, `numpy.random.default_rng` is what it is. With n, a whole number or several as seed s become
[n, s]; whatever else is a seed (a generator, a sequence, None) stays. The package draws from the same function, so that
its own streams move with those of the test.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from numbers import Integral
from typing import Any

import numpy as np

NAME = "BAYESMEMBRANE_TEST_SEED"
NUMPY = np.random.default_rng


def moved(offset: int) -> Callable[..., np.random.Generator]:
    """`numpy.random.default_rng` with ``offset`` before every seed that is made of whole numbers."""

    def default_rng(seed: Any = None) -> np.random.Generator:
        if isinstance(seed, Integral):
            return NUMPY([offset, int(seed)])
        if isinstance(seed, Sequence | np.ndarray) and all(isinstance(s, Integral) for s in seed):
            return NUMPY([offset, *(int(s) for s in seed)])
        return NUMPY(seed)

    return default_rng


def move() -> int:
    """Move all streams of this process by what the environment asks for; returns that."""
    offset = int(os.environ.get(NAME, "0"))
    np.random.default_rng = moved(offset) if offset else NUMPY
    return offset
