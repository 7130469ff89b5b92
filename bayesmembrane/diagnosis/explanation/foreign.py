"""What no effect of the library describes: changes, waves, faults of drive and load cell, or nothing known."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from bayesmembrane.diagnosis.candidates.candidate import Candidate
from bayesmembrane.diagnosis.explanation.limit import Limit
from bayesmembrane.ground.parameters import Array
from bayesmembrane.physics.effects.base import AT, Effect

SUDDEN, PASSING, LOST = "sudden_change", "passing_change", "lost_steps"
"""The force changes at a moment, or for a while; the zero of the deflection does."""
WAVE, PLAY, STOP = "ripple", "play", "end_stop"
RANGE, CLIPPED = "gain_range", "clipped"
"""Of an amplifier, from some force on; of a load cell at its limit."""
UNNAMED = "unnamed"
KINDS = (SUDDEN, PASSING, LOST, WAVE, PLAY, STOP, RANGE, CLIPPED, UNNAMED)


@dataclass(frozen=True, eq=False)
class Foreign:
    """Something foreign beside a model.

    kind : one of `KINDS`
    base : the model
    gain : ln of the Bayes factor over the model without it, its chance included
    chance : ln of the chance that the data find it where it was found, of all the places or waves where it could be
    size : of the most probable member, N, or part of the force if ``relative``; of a play and of lost steps m
    relative : see ``size``
    place : number of the reading at which a step comes, else 0
    level : force, N, from which on an amplifier has another range, or deflection, m, from which on something is met
    moment : its time in s, or None
    on_clock : the same on the clock of the test (`Motion.clock`), s
    period : of a wave, s or m
    against : "time" or "deflection": what a wave repeats with
    share : part of the squares that the model leaves, of all tests, which it takes away
    trace : (N,) N, what it changes, of the readings of all tests: nothing in the others
    soft : of a limit, over what part of it the reading yields; 0 where it is met at once
    limit : that limit
    test, label : of several tests, the number and the label of the one that it is in
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
    level: float = 0.0
    share: float = 0.0
    trace: Array | None = None
    soft: float = 0.0
    limit: Limit | None = None
    test: int | None = None
    label: str = ""

    @property
    def key(self) -> str:
        """Kind, and the test that it is in: what is foreign in two tests is two things."""
        return self.kind if self.test is None else f"{self.kind}{AT}{self.label}"

    @property
    def falls(self) -> bool:
        """True if the force falls at some moment, and stays lower."""
        return (self.kind == SUDDEN and self.size < 0) or (self.kind == LOST and self.size > 0)

    def shares_test_with(self, effect: Effect) -> bool:
        """True if ``effect`` is at work in the test that this is in."""
        return self.test is None or effect.within(self.test) is not None

    def counted(self, counts: float) -> float:
        """ln of the Bayes factor of which a part ``counts``: laws may be off, yet not where a thing could have been."""
        return counts * (self.gain - self.chance) + self.chance


def kinds_of(found: Sequence[Foreign]) -> int:
    """How many kinds were looked for, in each of several tests for itself."""
    return len({f.key for f in found})
