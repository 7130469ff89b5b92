"""What is believed before the data: how probable effects, energies and what is foreign are. All priors of the sum."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import log, prod, sqrt


@dataclass(frozen=True)
class Beliefs:
    """Prior probabilities of hypotheses; those of parameters stand with their components, and of sizes in `SIZES`.

    How large the error of forms may be stands in `physics.form_error`.
    """

    effects: tuple[float, ...] = (0.45, 0.33, 0.15, 0.07)
    """Of none, one, two and three effects beyond those given that could be seen; sets of one size are as probable as
    the odds of their effects say (`Effect.odds`), which are alike for nearly all. Who sees one fault of a rig has often
    a second one: with a twentieth for three, answers on the calibration half of `make study-reliability` missed the
    further, weaker effect more often than they said; that was with parts of 40, 30, 20 and 10 % for effects of any
    size, of which some could not be seen."""
    visible: float = 3.0
    """Signal-to-noise ratio of its own trace, free of what the material and other effects absorb, from which on an
    effect counts as there: a best fit without it is expected to lose 4.5 in ln of the likelihood. From there to its
    expected size it is as probable on every scale: of the true effects of the calibration half of
    `make study-reliability` (cases 560 to 779) a tenth was below 0.03 times that size, a tenth above 2.5 times, and the
    median was 0.24 times. With that instead of Cauchy's prior alone and a rule for effects without support, the log
    score of 132 cases there went from -1.23 to -1.10, the truth was in the 95 % set of 126 instead of 117, and 29 of 30
    names were right both times."""
    plain_gain: float = 25.0
    """ln of the Bayes factor of the best explanation over none, from which on factors count much less than they say:
    real laws differ from the library's in more ways than the form error knows, which matters the more the larger the
    effects are. Chosen with the prior of the sizes by the log score of the calibration half of
    `make study-reliability` (cases 140 to 257, 69 of them with something to explain): -1.40 with 25, -1.43 with 50,
    -1.49 with 100 and -1.67 with 1000; -1.37 with 10, where half of the right names are lost."""
    least_counts: float = 0.3
    """However large that is; reached at a gain of 250. A film that no plain energy comes near has one of 100 000, which
    says nothing of the laws. With 0.2 the same log score."""
    foreign: float = 0.15
    """Of something that no effect of the library describes, on top of whatever else is at work."""
    supported: float = 1.0
    """ln of the Bayes factor that something foreign needs to count as seen, and the most that a trace promises of a set
    that was never fitted."""
    untried: float = 0.1
    """Part of what a trace promises, that a set keeps which was never fitted: nothing is excluded that nobody looked
    at. On the cases of `visible` any part from 0.02 to 0.3 gave the same log score to 0.01; with 0.02 the truth was in
    the 95 % set of 125, with 0.1 of 126, with 0.3 there was one name less."""
    apart: float = 4.0
    """Times by which one of two sets may be more probable than the other where they differ by effects that the test
    cannot tell apart (`twins`). Of six such names on the calibration half of `make study-reliability` (cases 60 to
    133) that were told to be nearly sure, two were wrong."""
    declared: float = 1 / 3
    """Of the energy that was declared; the others share the rest. Without one, all are equally probable. Twice the odds
    of each of five others: what somebody typed is a hint, and no other question."""

    @property
    def most(self) -> int:
        """Effects of the largest set."""
        return len(self.effects) - 1

    def counts(self, gain: float) -> float:
        """What part of every ln Bayes factor counts where the best explanation has ln K = ``gain`` over none."""
        return max(1.0 / sqrt(1.0 + max(gain, 0.0) / self.plain_gain), self.least_counts)

    def log_set(self, odds: Sequence[float], visible: Sequence[float]) -> float:
        """ln of the probability of one set of effects with these ``odds``, of ``visible`` ones with those.

        p(set) = p(size) prod odds / e_size(odds of all that are visible), with e the elementary symmetric polynomial,
        which is the sum of that product over all sets of the size.
        """
        size = len(odds)
        sums = [1.0, *[0.0] * size]
        for o in visible:
            for k in range(size, 0, -1):
                sums[k] += o * sums[k - 1]
        return log(self.effects[size]) + log(prod(odds)) - log(max(sums[size], prod(odds)))

    def log_foreign(self, kinds: int) -> float:
        """ln of the probability of one of the ``kinds`` of foreign things; of none of them if there are no kinds."""
        return log(self.foreign / kinds) if kinds else log(1 - self.foreign)

    def log_energy(self, name: str, declared: str | None, count: int) -> float:
        """ln of the probability of one energy of ``count``."""
        if declared is None or count == 1:
            return -log(count)
        return log(self.declared) if name == declared else log((1 - self.declared) / (count - 1))


BELIEFS = Beliefs()
