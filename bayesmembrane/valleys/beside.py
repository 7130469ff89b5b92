"""The valleys of a material as it is, and with effects beside it: where they lie to each other, range by range."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from bayesmembrane.data.measurement import Measurement
from bayesmembrane.ground.errors import SettingsError
from bayesmembrane.ground.pieces import within
from bayesmembrane.ground.showable import Showable
from bayesmembrane.physics.forward import Solve
from bayesmembrane.physics.hypothesis import Hypothesis
from bayesmembrane.physics.mechanics.api import unaided
from bayesmembrane.valleys.follow import RISE, between, valleys
from bayesmembrane.valleys.result import Between, Valley, Valleys


@dataclass(frozen=True, eq=False, repr=False)
class Beside(Showable):
    """Valleys ``without`` effects and ``added`` with them; ``pairs`` has the closest approach of both in each range.

    The approach is that of the floors seen along the effects: in the material's parameters alone.
    """

    without: Valleys
    added: Valleys
    pairs: tuple[Between, ...]

    @property
    def compared(self) -> tuple[tuple[Valley, Valley, Between], ...]:
        """Each range: the valley without effects, that with them, and how they lie to each other."""
        return tuple(zip(self.without.ranges, self.added.ranges, self.pairs, strict=True))

    def summary(self) -> dict[str, Any]:
        """Plain values: those with effects, and what they are without beside them."""
        return {
            **self.added.summary(),
            "without_effects": self.without.summary(),
            "beside": [p.summary() for p in self.pairs],
        }


def valleys_beside(
    measurement: Measurement,
    hypothesis: Hypothesis,
    ranges: Sequence[float] = (),
    *,
    rise: float = RISE,
    seed: int = 0,
    solve: Solve = unaided,
) -> Beside:
    """`valleys` of ``hypothesis``, and of its material without the effects.

    Raises `SettingsError` if there are no effects, and what `valleys` raises.
    """
    hypothesis = hypothesis.with_frame(measurement)
    if not hypothesis.in_question:
        raise SettingsError(f"{hypothesis.label()} has no effects to be left out", remedy="name some, or ask `valleys`")
    plain = replace(hypothesis, effects=tuple(e for e in hypothesis.effects if e.known))
    with within("without"):
        without = valleys(measurement, plain, ranges, rise=rise, seed=seed, solve=solve)
    added = valleys(measurement, hypothesis, ranges, rise=rise, seed=seed, solve=solve)
    both = zip(without.ranges, added.ranges, strict=True)
    return Beside(without, added, tuple(between(a, b) for a, b in both))
