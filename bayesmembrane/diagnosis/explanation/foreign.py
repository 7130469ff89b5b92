"""What no effect of the library describes: steps, waves, play of the drive, a load cell at its limit, or nothing known."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from bayesmembrane.diagnosis.candidates.candidate import Candidate
from bayesmembrane.diagnosis.explanation.limit import Limit
from bayesmembrane.ground.parameters import Array

SUDDEN, WAVE, PLAY, CLIPPED, UNNAMED = "sudden_change", "ripple", "play", "clipped", "unnamed"
KINDS = (SUDDEN, WAVE, PLAY, CLIPPED, UNNAMED)


@dataclass(frozen=True, eq=False)
class Foreign:
    """Something foreign beside a model.

    kind : one of `KINDS`
    base : the model
    gain : ln of the Bayes factor over the model without it, its chance included
    chance : ln of the chance that the data find it where it was found, of all the places or waves where it could be
    size : of the most probable member, N, or part of the force if ``relative``; of a play m
    relative : see ``size``
    place : number of the reading at which a step comes, else 0
    moment : its time in s, or None
    on_clock : the same on the clock of the test (`Motion.clock`), s
    period : of a wave, s or m
    against : "time" or "deflection": what a wave repeats with
    share : part of the squares that the model leaves, which it takes away
    trace : (N,) N, what it changes
    soft : of a limit, over what part of it the reading yields; 0 where it is met at once
    limit : that limit
    """

    kind: str
    base: Candidate
    gain: float
    chance: float = 0.0
    size: float = 0.0
    relative: bool = False
    place: int = 0
    moment: float | None = None
    on_clock: float = 0.0
    period: float = 0.0
    against: str = ""
    share: float = 0.0
    trace: Array | None = None
    soft: float = 0.0
    limit: Limit | None = None

    @property
    def falls(self) -> bool:
        """True if the force falls at some moment, and stays lower."""
        return self.kind == SUDDEN and self.size < 0

    def counted(self, counts: float) -> float:
        """ln of the Bayes factor of which a part ``counts``: laws may be off, yet not where a thing could have been."""
        return counts * (self.gain - self.chance) + self.chance


def kinds_of(found: Sequence[Foreign]) -> int:
    """How many kinds were looked for."""
    return len({f.kind for f in found})
