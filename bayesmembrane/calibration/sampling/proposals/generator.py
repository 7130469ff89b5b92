"""emcee hands its proposals a RandomState of old; ours draw from a Generator that is seeded by it."""

from __future__ import annotations

from typing import Any

import numpy as np


def generator_of(random: Any) -> np.random.Generator:
    """A generator that follows from the state of ``random``, and moves it on."""
    return np.random.default_rng(random.randint(2**31, size=4))
