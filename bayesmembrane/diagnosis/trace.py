"""Which effect, which pair, or which other material explains what a model lacks: everything is refitted."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from bayesmembrane.data.measurement import Measurement
from bayesmembrane.diagnosis.candidates import Candidate, Search, starts_with, with_effects
from bayesmembrane.diagnosis.detection import periodicity
from bayesmembrane.diagnosis.saturated import SPLINE, LackOfFit, lack_of_fit, splines
from bayesmembrane.diagnosis.whitening import orthonormal
from bayesmembrane.ground.parameters import Array
from bayesmembrane.ground.registry import materials
from bayesmembrane.physics.effects.base import Effect
from bayesmembrane.physics.hypothesis import Hypothesis

DECISIVE = 4.0
"""ln of the Bayes factor beyond which a rival is out."""
PROBABLE = 3.0
"""ln of the Bayes factor over the null model that an explanation needs: the tests may have raised a false alarm."""
LOOKALIKES = ((15.0, 6.0), (30.0, 5.0))
"""(degrees, the same for rivals whose trace makes less than that with the winner's)."""
ENERGY_DECISIVE, ENERGY_SHARE = 8.0, 0.05
"""The same for other energies, and as a part of the best effect's: an instrument is blamed only far beyond them."""
FORM_SHARE = 0.25
"""Of the ln K that the best leaves beyond noise: a rival nearer than that is not out, for the best's form is farther
off than what sets them apart."""
FOREIGN, FOREIGN_SHARE = 1.0, 0.02
"""A sudden change from outside is rarer than an effect: how far beyond the best one's ln K it must be to be its rival,
and, as a part of that but by no less than `DECISIVE`, to put it out."""
UNEXPLAINED, ALLOWED, LEVEL, MODEST = 0.2, 0.05, 0.01, 1.5
"""A model explains the curve if what is left is no more than chance makes of the second part of the misfit: of a small
misfit, noise alone leaves a larger part. Or if no more than the second part is left, or no more than the first where
the reduced chi-square is modest too: of a large misfit a fifth is a lot."""
WAVES, RIPPLE = 1e-3, 0.2
"""No smooth effect takes waves away: where the residual still repeats, at the first level, and the wave has more than
the second part of the squares that a model takes away, the model explains nothing."""
BEAM, EARNS, EARNED_SHARE = 4, 15.0, 0.045  # of pairs: how many singles are followed, ln K and part of chi^2 to gain
SINGLE_VALUED = 0.02  # part of a signature that deflection alone does not explain
LEAST_WEIGHT = 0.05
FOLLOWED = 3  # explanations that are tried with other energies

Tell = Callable[[str], None]


@dataclass(frozen=True, eq=False)
class Judged:
    """A candidate and how well it fits.

    unexplained : part of the null model's misfit that is left
    p_value : of what is left, if `ALLOWED` of the null model's misfit may be
    gain : ln of the Bayes factor over the null model
    ripples : True if waves are left that weigh as much as what it takes away
    """

    candidate: Candidate
    fit: LackOfFit
    unexplained: float
    p_value: float
    gain: float
    ripples: bool

    @property
    def explains(self) -> bool:
        """True if the null model is no rival of it, and it leaves noise, or little beside what was there."""
        return little(self.fit, self.unexplained, self.p_value) and self.gain > PROBABLE and not self.ripples

    @property
    def log_evidence(self) -> float:
        return self.candidate.log_evidence


@dataclass(frozen=True, eq=False)
class Tracer:
    """Refits candidates beside ``null`` and judges them.

    basis : (N, p) the saturated reference
    """

    search: Search
    basis: Array
    null: Candidate

    @property
    def measurement(self) -> Measurement:
        return self.search.measurement

    @cached_property
    def _before(self) -> LackOfFit:
        """Of the null model."""
        return lack_of_fit(self.null.residual, self.null.slopes, self.basis, self.search.noise.cautious())

    def judged(self, candidate: Candidate) -> Judged:
        """Its lack of fit, and the part of the null model's that is left."""
        fit, left, p_value = self._left(candidate.residual, candidate.slopes)
        gain = candidate.log_evidence - self.null.log_evidence
        return Judged(candidate, fit, left, p_value, gain, self._ripples(candidate, self._before.chi2 - fit.chi2))

    def explained_by(self, residual: Array, slopes: Array) -> bool:
        """True if what a model with these slopes (N, k) leaves (N,) is noise, or little beside what was there."""
        return little(*self._left(residual, slopes))

    def _left(self, residual: Array, slopes: Array) -> tuple[LackOfFit, float, float]:
        """(lack of fit, part of the null model's that is left, probability of it if `ALLOWED` may be left)."""
        fit, before = lack_of_fit(residual, slopes, self.basis, self.search.noise.cautious()), self._before
        left = max(fit.ratio - 1, 0.0) / max(before.ratio - 1, 1e-12) if before.ratio > 1 else 0.0
        return fit, float(left), fit.p_if_left(ALLOWED, before)

    def _ripples(self, candidate: Candidate, taken: float) -> bool:
        """True if a wave is left that has more than its part of the squares ``taken`` away."""
        known = np.column_stack([self.basis, candidate.slopes])
        wave = periodicity(self.measurement, candidate.residual, known, self.search.noise.cautious())
        return wave is not None and wave.p_value < WAVES and wave.squares > RIPPLE * max(taken, 0.0)

    def singles(self, effects: Sequence[Effect], tell: Tell) -> list[Judged]:
        """The null model with each effect, refitted; the most probable first."""
        out, bases = [], [self.null.x, *self.search.sane(self.null.hypothesis)]
        for effect in effects:
            tell(f"refitting with {effect.title}")
            hypothesis = with_effects(self.null.hypothesis, [effect])
            found = self.search.fit(hypothesis, starts_with(bases, effect))
            if found is not None:
                out.append(self.judged(found))
        return ranked(out)

    def pairs(self, singles: Sequence[Judged], effects: Sequence[Effect], tell: Tell) -> list[Judged]:
        """The best few single effects, each with every other effect; the most probable pair first.

        The first effect of a pair is often not the best single one: hence several are followed.
        """
        out: dict[frozenset[str], Judged] = {}
        for first in singles[:BEAM]:
            for effect in effects:
                key = frozenset((*first.candidate.names, effect.name))
                if effect.name in first.candidate.names:
                    continue
                tell("refitting pairs: " + " with ".join(sorted(key)))
                hypothesis = with_effects(first.candidate.hypothesis, [effect])
                found = self.search.fit(hypothesis, starts_with([first.candidate.x], effect))
                if found is None:
                    continue
                judged = self.judged(found)
                if key not in out or judged.log_evidence > out[key].log_evidence:
                    out[key] = judged
        return ranked(out.values())

    def materials(self, tell: Tell) -> list[Judged]:
        """The other strain energies, with the effects of the null model; the most probable first."""
        out = []
        base: Hypothesis = self.null.hypothesis
        for name, kind in materials().items():
            if name == base.material.name:
                continue
            tell(f"trying the energy {kind.title}")
            other = replace(base, material=kind)
            found = self.search.fit(other, self.search.sane(other))
            if found is not None:
                out.append(self.judged(found))
        return ranked(out)

    def elsewhere(self, judged: Sequence[Judged], tell: Tell) -> list[Judged]:
        """The effects of the first few of ``judged`` with every other energy; the most probable first.

        A wrong energy leaves structure, and an effect whose law is free may follow that instead of the true one's.
        """
        out = []
        for name, kind in materials().items():
            if name == self.null.hypothesis.material.name:
                continue
            tell(f"trying the energy {kind.title} with effects")
            for j in judged[:FOLLOWED]:
                h = j.candidate.hypothesis
                other, size = replace(h, material=kind), h.material_size
                starts = [
                    np.concatenate([x[: other.material_size], j.candidate.x[size:]]) for x in self.search.sane(other)
                ]
                found = self.search.fit(other, starts)
                if found is not None:
                    out.append(self.judged(found))
        return ranked(out)

    def again(self, judged: Iterable[Judged]) -> list[Judged]:
        """The same candidates fitted anew from where they are, with the search's present noise and weight."""
        out = []
        for j in judged:
            found = self.search.fit(j.candidate.hypothesis, [j.candidate.x])
            out.append(self.judged(found) if found is not None else j)
        return ranked(out)

    def single_valued(self, candidate: Candidate) -> bool:
        """True if its effects change the curve by a function of deflection alone, on this path."""
        if np.all(np.diff(self.measurement.path.deflection) >= 0) and not self.measurement.holds:
            return True
        n = candidate.hypothesis.material_size
        d = self.measurement.deflection
        smooth = orthonormal(_smooth(d))
        for slope in candidate.slopes[:, n:].T:
            size = float(np.linalg.norm(slope))
            rest = slope - smooth @ (smooth.T @ slope)
            if size > 0 and float(np.linalg.norm(rest)) > SINGLE_VALUED**0.5 * size:
                return False
        return True


def little(fit: LackOfFit, unexplained: float, p_value: float) -> bool:
    """True if what is left is noise, or little beside what was there."""
    return p_value > LEVEL or unexplained <= (UNEXPLAINED if fit.reduced_chi2 <= MODEST else ALLOWED)


def ranked(judged: Iterable[Judged]) -> list[Judged]:
    """The most probable first."""
    return sorted(judged, key=lambda j: -j.log_evidence)


def effective_weight(residual_white: Array) -> float:
    """n_eff / N = (1 - r1) / (1 + r1) of whitened residuals (N,), at most 1: what correlation is left."""
    if residual_white.size < 3:
        return 1.0
    r = residual_white - residual_white.mean()
    scale = float(r @ r)
    r1 = float(r[1:] @ r[:-1]) / scale if scale > 0 else 0.0
    return float(np.clip((1 - r1) / (1 + r1), LEAST_WEIGHT, 1.0))


def _smooth(d: Array) -> Array:
    return splines(d, min(SPLINE, max(np.unique(d).size // 3, 4)))
