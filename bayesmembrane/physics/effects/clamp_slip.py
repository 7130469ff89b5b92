"""The film slides out of its clamp: its free length grows while it is pulled."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from scipy.special import expit

from bayesmembrane.data.motion import Motion
from bayesmembrane.ground.parameters import Array, HalfNormal, Uniform
from bayesmembrane.physics.effects._history import CREEPS, EXPONENT, JUMP, REPEATED, SATURATION, growth
from bayesmembrane.physics.effects.base import EffectParameter, Slack, running_max

PLACE = EffectParameter("place", "-", "where it comes, over the full range", Uniform(0.0, 1.0), (0.0, 1.1))
WIDTH = 0.015
"""Of the full range, in which a jump comes."""
JUMPS = tuple({"jump": 0.6, "place": place} for place in (0.4, 0.5, 0.6, 0.7, 0.8, 0.9))
"""Shapes to begin a search with: a jump is found from nearby only."""


@dataclass(frozen=True)
class ClampSlip(Slack):
    """Free length L (1 + slip [(1 - jump) G + jump / (1 + exp((place - m / D) / w))]), w = 0.015.

    G is the growth law of the test (1 after a first loading to its full range D), m the largest deflection so far: a
    film creeps out of its clamp, and sticks until it slips at once. What has slid out stays out: the film is slack
    until the longer film is taut.
    On an annulus of 10 and 35 mm a length s that slides out of the outer clamp acts as slip = 0.80 s / L, to a tenth of
    its effect (Yeoh film, 12 to 70 mm, against the exact solution: tests/reference/test_slip.py).
    """

    name: ClassVar[str] = "clamp_slip"
    title: ClassVar[str] = "slip in the clamp"
    reference: ClassVar[str] = "ISO 37:2017, 8 (grips and slippage); ASTM D638-14, 5.1.3"
    signature: ClassVar[str] = (
        "The curve starts later and later from cycle to cycle: a toe that grows with the largest deflection, unloading "
        "below loading, reloading on the unloading curve, and no return to the first curve."
    )
    twins_at_any_speed: ClassVar[tuple[str, ...]] = ("permanent_set",)  # both are a film that has become longer
    coordinates: ClassVar[tuple[EffectParameter, ...]] = (
        EffectParameter(
            "slip", "-", "length slid out on a first loading, over the free length", HalfNormal(0.02), (0.0, 0.5), 0.0
        ),
        EXPONENT,
        REPEATED,
        SATURATION,
        JUMP,
        PLACE,
        CREEPS,
    )

    @property
    def starts(self) -> list[dict[str, float]]:
        return [{"jump": 0.05, "place": 0.5}, *JUMPS]

    def excess(self, p: Array, deflection: Array, path: Motion) -> Array:
        slow = growth(p[:, 1:2], p[:, 2:3], deflection, path, p[:, 3:4], p[:, 6:7])
        at_once = expit((running_max(deflection) / path.full_range - p[:, 5:6]) / WIDTH)
        return np.asarray(p[:, :1] * ((1 - p[:, 4:5]) * slow + p[:, 4:5] * at_once))
