"""What explains a misfit: singles, pairs and energies are refitted, and what they come to is decided."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from bayesmembrane.diagnosis.candidates import Candidate
from bayesmembrane.diagnosis.detection import detect
from bayesmembrane.diagnosis.scores import Signature, angle, signatures
from bayesmembrane.diagnosis.sudden import Step, sudden
from bayesmembrane.diagnosis.trace import (
    DECISIVE,
    EARNED_SHARE,
    EARNS,
    ENERGY_DECISIVE,
    ENERGY_SHARE,
    FOREIGN,
    FOREIGN_SHARE,
    FORM_SHARE,
    LEVEL,
    LOOKALIKES,
    Judged,
    Tell,
    Tracer,
    effective_weight,
    ranked,
)
from bayesmembrane.diagnosis.whitening import orthonormal, own_noise
from bayesmembrane.ground.parameters import Array
from bayesmembrane.physics.effects.base import Effect


@dataclass(frozen=True, eq=False)
class Verdict:
    """What the candidates come to.

    step : a sudden change that explains the curve as well as the members do, or better; beside a name, nearly as well
    better : the same effects or others with another energy, where that is decisively more probable
    form : part of the plain material's misfit that an adequate model leaves, where the tests do see it
    """

    verdict: str
    members: tuple[Judged, ...]
    step: Step | None = None
    better: Judged | None = None
    form: float | None = None


def explained(
    tracer: Tracer,
    effects: Sequence[Effect],
    singles: list[Judged],
    found: Sequence[Signature],
    rng: np.random.Generator,
    say: Tell,
) -> tuple[Tracer, Verdict, list[Judged]]:
    """(tracer with the noise of the best model, verdict, every candidate) of a model that misses something.

    singles : it with each effect
    """
    seen = visible(effects, found)
    others: list[Judged] = []
    if not singles:
        others = tracer.materials(say)
        return tracer, _without_effects(tracer, others), others
    tracer, singles = _renewed(tracer, singles)
    best, pairs = singles[0], []
    if _more_is_missing(tracer, best, effects, rng):
        pairs = tracer.pairs(singles, seen, say)
        pairs = [p for p in pairs if _earns(tracer, p, singles)]
        if pairs:
            tracer, pairs = _renewed(tracer, pairs)
            singles = tracer.again(singles)
    explaining = [j for j in pairs or singles if j.explains]
    rivals = _rivals(tracer, explaining)
    if not rivals or rivals[0].p_value <= LEVEL or tracer.single_valued(rivals[0].candidate):
        others = tracer.materials(say)
    elsewhere: list[Judged] = []
    if rivals and rivals[0].fit.p_value <= LEVEL:
        elsewhere = tracer.elsewhere(explaining, say)
    every = ranked([*pairs, *singles, *others, *elsewhere, tracer.judged(tracer.null)])
    verdict = _decide(tracer, explaining, [j for j in singles if j.explains], others)
    return tracer, _with_other_energies(verdict, elsewhere), every


def visible(effects: Sequence[Effect], found: Sequence[Signature]) -> list[Effect]:
    """Those of the effects that leave a trace in this test."""
    names = {f.effect.name for f in found}
    return [e for e in effects if e.name in names]


def _renewed(tracer: Tracer, judged: list[Judged]) -> tuple[Tracer, list[Judged]]:
    """Noise and weight from the best candidate, which misses less than the null model, and all candidates fitted anew.

    Misfit looks like noise that remembers: what the best model leaves is closer to the truth.
    """
    best = judged[0].candidate
    basis = np.column_stack([tracer.basis, best.slopes])
    if orthonormal(basis).shape[1] >= len(tracer.measurement):
        return tracer, judged  # few points: what the best model leaves is nothing at all, and says nothing of noise
    noise = own_noise(tracer.measurement, basis)
    weight = effective_weight(noise.white(best.residual))
    search = replace(tracer.search, noise=noise, weight=weight)
    null = search.fit(tracer.null.hypothesis, [tracer.null.x]) or tracer.null
    tracer = replace(tracer, search=search, null=null)
    return tracer, tracer.again(judged)


def _more_is_missing(tracer: Tracer, best: Judged, effects: Sequence[Effect], rng: np.random.Generator) -> bool:
    """True if the best single effect leaves structure behind that another one could take away."""
    if best.ripples:
        return False
    if not best.explains:
        return True
    rest = [e for e in effects if e.name not in best.candidate.names]
    found = signatures(tracer.measurement, best.candidate, rest, tracer.search.noise, tracer.search.solve)
    left = detect(tracer.measurement, best.candidate, tracer.basis, found, tracer.search.noise, rng)
    return not left.adequate


def _earns(tracer: Tracer, pair: Judged, singles: Sequence[Judged]) -> bool:
    """True if two effects are worth their parameters beside every single one, and take away misfit that matters.

    An effect whose textbook form differs a little from the machine's leaves something that a second effect could take:
    that is no second effect.
    """
    first = singles[0]
    null = tracer.judged(tracer.null).fit.chi2
    share = (first.fit.chi2 - pair.fit.chi2) / max(null - pair.fit.chi2, 1e-300)
    return pair.log_evidence > first.log_evidence + EARNS and share >= EARNED_SHARE


def _rivals(tracer: Tracer, explaining: Sequence[Judged]) -> tuple[Judged, ...]:
    """The best and those that the evidence does not put out of its reach; of look-alikes it must say more."""
    if not explaining:
        return ()
    best = explaining[0]
    out = [best]
    for j in explaining[1:]:
        if best.log_evidence - j.log_evidence < _decisive(tracer, best, j):
            out.append(j)
    return tuple(out)


def _decisive(tracer: Tracer, a: Judged, b: Judged) -> float:
    """ln of the Bayes factor that sets two candidates apart: more where their traces, as fitted, look alike, where the
    better one leaves much, or where the law of the other is known to vary.
    """
    shared = set(a.candidate.names) & set(b.candidate.names)
    # What two pairs have in common tells nothing of what sets them apart.
    common = orthonormal(tracer.search.noise.white(a.candidate.slopes_of(shared)))
    traces = (_trace(tracer, c.candidate) for c in (a, b))
    one, two = (t - common @ (common.T @ t) for t in traces)
    degrees = angle(one, two, fold=False)
    needed = next((needed for nearer, needed in LOOKALIKES if degrees < nearer), DECISIVE)
    left = a.unexplained / (1 - a.unexplained) * a.gain if a.fit.p_value < LEVEL and a.unexplained < 1 else 0.0
    varies = max((e.law_varies for e in b.candidate.hypothesis.effects if e.name not in a.candidate.names), default=0.0)
    return max(needed, FORM_SHARE * left, varies * a.gain)


def _trace(tracer: Tracer, candidate: Candidate) -> Array:
    """(N,) whitened: what the candidate takes away from the null model's residual."""
    return tracer.search.noise.white(tracer.null.residual - candidate.residual)


def _decide(tracer: Tracer, explaining: Sequence[Judged], alone: Sequence[Judged], others: Sequence[Judged]) -> Verdict:
    """The verdict from what explains the curve, the single effects that do, and the energies that may do so."""
    energies = [j for j in others if j.explains]
    if not explaining:
        return _without_effects(tracer, others)
    rivals = _rivals(tracer, explaining)
    best = rivals[0].gain
    step = sudden(tracer.search, tracer.null)
    if step is not None and not (step.gain > best - DECISIVE and tracer.explained_by(step.residual, step.slopes)):
        step = None
    if step is not None:
        if step.gain > best + max(DECISIVE, FOREIGN_SHARE * best):
            return Verdict("unknown", (), step)
        if step.gain > best + FOREIGN:
            # One moment has all of it: an effect that happens to come then is no better a guess than what is foreign.
            return Verdict("ambiguous", rivals, step)
    single_valued = tracer.single_valued(rivals[0].candidate)
    if energies and (energies[0].gain > rivals[0].gain or (single_valued and _comes_near(energies[0], rivals[0]))):
        return Verdict("material", (energies[0],))
    alike = all(tracer.single_valued(j.candidate) for j in rivals)
    if alike and all(j.candidate.x.size > tracer.null.x.size + 1 for j in rivals):
        if not alone or len(rivals[0].candidate.names) == 1:
            # Two effects that follow the deflection alone, or one whose law is free, imitate a strain energy that is
            # not among those known.
            return Verdict("unknown", rivals)
        # One of them is enough, but its form is not the machine's: neither can be told from its look-alikes.
        rivals = (*_rivals(tracer, alone), *rivals)
    return Verdict("named" if len(rivals) == 1 else "ambiguous", rivals, step if len(rivals) == 1 else None)


def _with_other_energies(verdict: Verdict, elsewhere: Sequence[Judged]) -> Verdict:
    """A name that depends on the energy is none: another effect, decisively better with another energy, is a rival; and
    one that falls behind with the better energies is none any more.
    """
    best = next((j for j in elsewhere if j.explains), None)
    if verdict.verdict not in ("named", "ambiguous") or best is None:
        return verdict
    first, *rest = verdict.members
    if best.gain < first.gain + ENERGY_DECISIVE:
        return verdict
    names = set(best.candidate.names)
    if names == set(first.candidate.names):
        kept = [m for m in rest if _profile(m, elsewhere) > best.gain - ENERGY_DECISIVE]
        alone = bool(rest) and not kept
        return replace(verdict, verdict="named" if alone else verdict.verdict, members=(first, *kept), better=best)
    if any(names == set(m.candidate.names) for m in rest):
        return replace(verdict, better=best)
    return replace(verdict, verdict="ambiguous", members=(*verdict.members, best), better=best)


def _profile(member: Judged, elsewhere: Sequence[Judged]) -> float:
    """ln K of its effects with the best of the energies that they were tried with."""
    names = set(member.candidate.names)
    return max([member.gain, *(j.gain for j in elsewhere if set(j.candidate.names) == names)])


def _comes_near(energy: Judged, effect: Judged) -> bool:
    """True if an energy explains the curve and an effect that follows the deflection alone is not far beyond it.

    The instrument is blamed only where no energy comes near, and not with an effect that is driven to its bounds.
    """
    behind = effect.gain - energy.gain
    return behind < max(ENERGY_DECISIVE, ENERGY_SHARE * effect.gain) or bool(effect.candidate.at_bound)


def _without_effects(tracer: Tracer, others: Sequence[Judged]) -> Verdict:
    energies = [j for j in others if j.explains]
    return Verdict("material", (energies[0],)) if energies else Verdict("unknown", ())
