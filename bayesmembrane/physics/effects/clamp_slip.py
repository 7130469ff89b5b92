"""The film slides out of its clamp: its free length grows while it is pulled."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from scipy.special import expit

from bayesmembrane.data.motion import Motion
from bayesmembrane.ground.parameters import Array, HalfNormal, LogNormal, Normal, Uniform
from bayesmembrane.physics.effects._history import CREEPS, EXPONENT, JUMP, REPEATED, SATURATION, SECOND, growth
from bayesmembrane.physics.effects.base import EffectParameter, Slack, running_max

PLACE = EffectParameter("place", "-", "where it comes, over the full range", Uniform(0.0, 1.0), (0.0, 1.1), event="way")
SECOND_PLACE = replace(PLACE, name="second_place", meaning="where the second event comes, over the full range")
WIDTH = EffectParameter(
    "width", "-", "how long it slides at once, over the full range", LogNormal(0.005, 1.2), (1e-4, 0.3), begin=0.015
)
EVEN, EVEN_WITHIN = Normal(0.0, 0.01), (-0.04, 0.04)
"""Prior and bounds of `eased` where films are not clamped all round."""
JUMPS = tuple({"jump": 0.6, "place": place} for place in (0.4, 0.5, 0.6, 0.7, 0.8, 0.9))
"""Shapes to begin a search with: a jump is found from nearby only."""
SECOND_PLACES = tuple(np.linspace(0.1, 1.0, 19).tolist())
"""Of the full range, where a second one is looked for."""


@dataclass(frozen=True)
class ClampSlip(Slack):
    """Free length L {1 + slip (1 + eased (1 - delta / D)) [(1 - jump) G
    + jump ((1 - second) H(place) + second H(second_place))]}, with H(p) = 1 / (1 + exp((p - m / D) / width)).

    G is the growth law of the test (1 after a first loading to its full range D), m the largest deflection so far: a
    film creeps out of its clamp, and sticks until it slips at once, sticks again, and slips a second time. What has
    slid out stays out: the film is slack until the longer film is taut.
    On an annulus what slides out of the outer clamp is stretched less than the film is on the whole, the less the
    farther the disc is lifted, and at the disc it is the other way round: a length s out of a clamp of 35 mm, beside
    a disc of 10 mm, acts as slip = 0.69 s / L and ``eased`` = 0.95, to 4 % of its effect, and by one number alone to
    20 % (Yeoh film, lifted by 8 to 50 mm; by 12 to 70 mm 0.77, 0.3, 8 % and 10 %; against the exact solution:
    tests/reference/test_slip.py).
    """

    name: ClassVar[str] = "clamp_slip"
    title: ClassVar[str] = "slip in the clamp"
    reference: ClassVar[str] = "ISO 37:2017, 8 (grips and slippage); ASTM D638-14, 5.1.3"
    signature: ClassVar[str] = (
        "The curve starts later and later from cycle to cycle: a toe that grows with the largest deflection, unloading "
        "below loading, reloading on the unloading curve, and no return to the first curve."
    )
    twins_at_any_speed: ClassVar[tuple[str, ...]] = ("permanent_set",)  # both are a film that has become longer
    twins_one_way: ClassVar[tuple[str, ...]] = ("machine_compliance",)  # both leave it less way, which only one returns
    like_foreign: ClassVar[tuple[str, ...]] = ("lost_steps",)
    second: ClassVar[tuple[str, str, str] | None] = ("second", "place", "second_place")
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
        SECOND,
        SECOND_PLACE,
        WIDTH,
        EffectParameter(
            "eased",
            "-",
            "by what part of it it is felt more at rest than at the full range",
            Normal(0.4, 0.4),
            (-1.0, 1.7),
        ),
    )

    def __post_init__(self) -> None:
        """A strip that slides out of its grips is a longer strip, at any stretch."""
        super().__post_init__()
        if self.reach is not None and not self.reach.clamped:
            own = (replace(p, prior=EVEN, bounds=EVEN_WITHIN) if p.name == "eased" else p for p in self.coordinates)
            object.__setattr__(self, "coordinates", tuple(own))

    @property
    def starts(self) -> list[dict[str, float]]:
        return [{"jump": 0.05, "place": 0.5}, *JUMPS]

    @property
    def second_places(self) -> list[float]:
        return list(SECOND_PLACES)

    def excess(self, p: Array, deflection: Array, path: Motion) -> Array:
        slow = growth(p[:, 1:2], p[:, 2:3], deflection, path, p[:, 3:4], p[:, 6:7])
        reached = running_max(deflection) / path.full_range
        first, then = (expit((reached - p[:, i : i + 1]) / p[:, 9:10]) for i in (5, 8))
        at_once = first + p[:, 7:8] * (then - first)
        felt = 1 + p[:, 10:11] * (1 - np.abs(deflection) / path.full_range)
        return np.asarray(p[:, :1] * felt * ((1 - p[:, 4:5]) * slow + p[:, 4:5] * at_once))
