"""The valleys of a material as it is, and with effects beside it: where they lie to each other, range by range."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from bayesmembrane.data.measurement import Measurement
from bayesmembrane.ground.errors import SettingsError
from bayesmembrane.ground.parameters import Array
from bayesmembrane.ground.showable import Showable
from bayesmembrane.physics.forward import Solve
from bayesmembrane.physics.hypothesis import Hypothesis
from bayesmembrane.valleys.follow import RISE, between, valleys
from bayesmembrane.valleys.result import Between, Valley, Valleys
from bayesmembrane.valleys.sentences import CLOSE, point
from bayesmembrane.valleys.surface import unaided

SAME = 1e-4  # of the least loss: a change smaller than this is none


@dataclass(frozen=True, eq=False, repr=False)
class Beside(Showable):
    """Valleys ``without`` effects and ``added`` with them; ``pairs`` has the closest approach of both in each range.

    The approach is that of the floors seen along the effects: in the material's parameters alone.
    """

    without: Valleys
    added: Valleys
    pairs: tuple[Between, ...]

    @property
    def sentences(self) -> tuple[str, ...]:
        """What the effects do to the valley, then what is said of either."""
        without = (f"Without effects: {s}" for s in self.without.sentences)
        return (*(p.sentence for p in self.pairs), *self.added.sentences, *without)

    def summary(self) -> dict[str, Any]:
        """The JSON answer of ``valleys`` with effects, and what it is without beside it."""
        return {
            **self.added.summary(),
            "without_effects": self.without.summary(),
            "beside": [p.summary() for p in self.pairs],
            "sentences": list(self.sentences),
        }


def valleys_beside(
    measurement: Measurement,
    hypothesis: Hypothesis,
    ranges: Sequence[float] = (),
    *,
    rise: float = RISE,
    seed: int = 0,
    draws: Mapping[float, Array] | None = None,
    solve: Solve = unaided,
) -> Beside:
    """`valleys` of ``hypothesis``, and of its material without the effects; ``draws`` are those of the former.

    Raises `SettingsError` if there are no effects, and what `valleys` raises.
    """
    if not hypothesis.effects:
        raise SettingsError(f"{hypothesis.label()} has no effects to be left out", remedy="name some, or ask `valleys`")
    plain = replace(hypothesis, effects=())
    without = valleys(measurement, plain, ranges, rise=rise, seed=seed, solve=solve)
    added = valleys(measurement, hypothesis, ranges, rise=rise, seed=seed, draws=draws, solve=solve)
    both = zip(without.ranges, added.ranges, strict=True)
    return Beside(without, added, tuple(between(a, b, sentence_beside) for a, b in both))


def sentence_beside(a: Valley, b: Valley, distance: float, _: Sequence[float] | None) -> str:
    """What effects do to the valley ``a``, in words."""
    names = " and ".join(e.name.replace("_", " ") for e in b.hypothesis.effects)
    change = 100 * (b.best_loss / a.best_loss - 1)
    n = a.best.size
    loss = (
        f"{abs(change):.2g} % {'lower' if change < 0 else 'higher'}, {b.best_loss:.3g} N instead of {a.best_loss:.3g}"
    )
    start = (
        f"Up to {1e3 * a.end:.4g} mm, with {names} the least loss is {loss}, and the optimum of "
        f"{a.hypothesis.material.title} moves from ({point(a, a.best)}) to ({point(a, b.best[:n])})"
    )
    if distance < CLOSE:
        return f"{start}; the valleys with and without come as close as {distance:.2g} posterior standard deviations."
    return (
        f"{start}; the valleys with and without stay {distance:.3g} posterior standard deviations apart, so that the "
        "material's parameters depend on the effects assumed."
    )
