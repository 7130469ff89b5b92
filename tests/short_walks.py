"""Sampling that ends at a limit of 40 steps, and says so: for what becomes of draws, and not for what they are."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any

from bayesmembrane.calibration.sampling.proposals import mixture
from bayesmembrane.calibration.sampling.walk import Settings

FEW = {"walkers": 16, "chunk": 40, "most_steps": 40}


def shorten(put: Callable[[Any, str, Any], None] = setattr) -> None:
    """Short walks wherever nothing but the ESS is asked for, and densities of one component for draws so few."""
    usual = zip(inspect.signature(Settings).parameters, Settings.__init__.__defaults__ or (), strict=True)
    put(Settings.__init__, "__defaults__", tuple({**dict(usual), **FEW}.values()))
    put(mixture, "COUNTS", (1,))
