"""What the candidates come to: a name, several, another energy, or nothing that is known."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from bayesmembrane.diagnosis.candidates.candidate import Candidate
from bayesmembrane.diagnosis.candidates.sudden import SuddenChange, sudden_change
from bayesmembrane.diagnosis.detection.scores import angle
from bayesmembrane.diagnosis.explanation.case import Judged, OpenCase, judged, leaves_little, reopened
from bayesmembrane.diagnosis.explanation.refits import (
    again,
    better_null,
    energies,
    energies_with_effects,
    pairs,
    ranked,
    renewed,
    singles,
)
from bayesmembrane.diagnosis.reference.noise import orthonormal
from bayesmembrane.diagnosis.reference.smooth import curve_in_deflection
from bayesmembrane.diagnosis.thresholds import EXPLANATION, TINY


@dataclass(frozen=True, eq=False)
class Verdict:
    """What the candidates come to.

    verdict : "adequate", "named", "ambiguous", "material" or "unknown"
    members : the candidates that it rests on
    ranking : every candidate that was refitted, the most probable first
    sudden : a sudden change that explains the curve as well as the members do, or better; beside a name, nearly as well
    better : the same effects or others with another energy, where that is decisively more probable
    form : part of the plain material's misfit that an adequate model leaves, where the tests do see it
    """

    verdict: str
    members: tuple[Judged, ...]
    ranking: tuple[Judged, ...] = ()
    sudden: SuddenChange | None = None
    better: Judged | None = None
    form: float | None = None


def adequate(case: OpenCase, form: float | None = None) -> Verdict:
    """Nothing is seen to be missing, or no more than the ``form`` of its effects."""
    null = judged(case, case.null)
    return Verdict("adequate", (null,), (null,), form=form)


def explained(case: OpenCase) -> tuple[OpenCase, Verdict]:
    """(case with the noise of the best model, verdict) of a model that misses something."""
    alone = singles(case)
    if (better := better_null(case, alone)) is not None:
        case = reopened(case, better)
    if case.detection.adequate:
        return case, adequate(case)
    if not alone:
        others = energies(case)
        return case, replace(_without_effects(others), ranking=tuple(others))
    case, alone = renewed(case, alone)
    both: list[Judged] = []
    if _more_is_missing(case, alone[0]):
        both = [p for p in pairs(case, alone) if _earns_its_place(case, p, alone[0])]
        if both:
            case, both = renewed(case, both)
            alone = again(case, alone)
    explaining = [j for j in both or alone if j.explains]
    rivals = _rivals(case, explaining)
    others, elsewhere = [], []
    if not rivals or rivals[0].p_value <= EXPLANATION.level or _follows_deflection(case, rivals[0].candidate):
        others = energies(case)
    if rivals and rivals[0].fit.p_value <= EXPLANATION.level:
        elsewhere = energies_with_effects(case, explaining)
    every = ranked([*both, *alone, *others, *elsewhere, judged(case, case.null)])
    verdict = _decided(case, explaining, [j for j in alone if j.explains], others)
    return case, replace(_with_other_energies(verdict, elsewhere), ranking=tuple(every))


def _more_is_missing(case: OpenCase, best: Judged) -> bool:
    """True if the best single effect leaves structure behind that another one could take away."""
    if best.ripples:
        return False
    return not best.explains or not reopened(case, best.candidate).detection.adequate


def _earns_its_place(case: OpenCase, pair: Judged, first: Judged) -> bool:
    """True if two effects are worth their parameters beside the best single one, and take away misfit that matters.

    An effect whose textbook form differs a little from the machine's leaves something that a second effect could take:
    that is no second effect.
    """
    share = (first.fit.chi2 - pair.fit.chi2) / max(case.before.chi2 - pair.fit.chi2, TINY)
    return pair.log_evidence > first.log_evidence + EXPLANATION.pair_gain and share >= EXPLANATION.pair_share


# ---- rivals ----------------------------------------------------------------------------------------------------------


def _rivals(case: OpenCase, explaining: Sequence[Judged]) -> tuple[Judged, ...]:
    """The best and those that the evidence does not put out of its reach; of look-alikes it must say more."""
    if not explaining:
        return ()
    best = explaining[0]
    near = [j for j in explaining[1:] if best.log_evidence - j.log_evidence < _needed(case, best, j)]
    return (best, *near)


def _needed(case: OpenCase, best: Judged, other: Judged) -> float:
    """ln of the Bayes factor that sets two candidates apart: more where their traces, as fitted, look alike, where the
    better one leaves much, or where the law of the other is known to vary.
    """
    limits = EXPLANATION
    degrees = _degrees_apart(case, best.candidate, other.candidate)
    needed = limits.decisive
    if degrees < limits.alike_degrees:
        needed = limits.very_alike_decisive if degrees < limits.very_alike_degrees else limits.alike_decisive
    leaves = best.fit.p_value < limits.level and best.unexplained < 1
    left = best.unexplained / (1 - best.unexplained) * best.gain if leaves else 0.0
    own = [e for e in other.candidate.hypothesis.effects if e.name not in best.candidate.names]
    varies = max((e.law_varies for e in own), default=0.0)
    return max(needed, limits.form_share * left, varies * best.gain)


def _degrees_apart(case: OpenCase, a: Candidate, b: Candidate) -> float:
    """Between what two candidates take away from the null model's residual, freed of noise.

    What two pairs have in common tells nothing of what sets them apart.
    """
    shared = a.slopes_of(set(a.names) & set(b.names))
    taken = [case.null.residual - c.residual for c in (a, b)]
    white = case.search.noise.white(np.column_stack([shared, *taken]))
    common = orthonormal(white[:, :-2])
    one, two = (white[:, i] - common @ (common.T @ white[:, i]) for i in (-2, -1))
    return angle(one, two, fold=False)


def _follows_deflection(case: OpenCase, candidate: Candidate) -> bool:
    """True if its effects change the curve by a function of deflection alone, on this path."""
    measurement = case.measurement
    if np.all(np.diff(measurement.path.deflection) >= 0) and not measurement.holds:
        return True
    smooth = orthonormal(curve_in_deflection(measurement.deflection))
    for slope in candidate.slopes[:, candidate.hypothesis.material_size :].T:
        size = float(np.linalg.norm(slope))
        rest = slope - smooth @ (smooth.T @ slope)
        if size > 0 and float(np.linalg.norm(rest)) > EXPLANATION.single_valued**0.5 * size:
            return False
    return True


# ---- the verdict -----------------------------------------------------------------------------------------------------


def _decided(
    case: OpenCase, explaining: Sequence[Judged], alone: Sequence[Judged], others: Sequence[Judged]
) -> Verdict:
    """The verdict from what explains the curve, the single effects that do, and the energies that may do so."""
    if not explaining:
        return _without_effects(others)
    rivals = _rivals(case, explaining)
    best = rivals[0].gain
    change = _sudden_rival(case, best)
    if change is not None:
        if change.gain > best + max(EXPLANATION.decisive, EXPLANATION.foreign_share * best):
            return Verdict("unknown", (), sudden=change)
        if change.gain > best + EXPLANATION.foreign:
            # One moment has all of it: an effect that happens to come then is no better a guess than what is foreign.
            return Verdict("ambiguous", rivals, sudden=change)
    energy = next((j for j in others if j.explains), None)
    alike = _follows_deflection(case, rivals[0].candidate)
    if energy is not None and (energy.gain > best or (alike and _comes_near(energy, rivals[0]))):
        return Verdict("material", (energy,))
    alike = all(_follows_deflection(case, j.candidate) for j in rivals)
    if alike and all(j.candidate.x.size > case.null.x.size + 1 for j in rivals):
        if not alone or len(rivals[0].candidate.names) == 1:
            # Two effects that follow the deflection alone, or one whose law is free, imitate a strain energy that is
            # not among those known.
            return Verdict("unknown", rivals)
        # One of them is enough, but its form is not the machine's: neither can be told from its look-alikes.
        rivals = (*_rivals(case, alone), *rivals)
    single = len(rivals) == 1
    return Verdict("named" if single else "ambiguous", rivals, sudden=change if single else None)


def _sudden_rival(case: OpenCase, best: float) -> SuddenChange | None:
    """A sudden change that explains the curve and that the best effect's ln K does not put out."""
    change = sudden_change(case.search, case.null)
    if change is None or change.gain <= best - EXPLANATION.decisive:
        return None
    return change if leaves_little(case, change.residual, change.slopes) else None


def _with_other_energies(verdict: Verdict, elsewhere: Sequence[Judged]) -> Verdict:
    """A name that depends on the energy is none: another effect, decisively better with another energy, is a rival; and
    one that falls behind with the better energies is none any more.
    """
    best = next((j for j in elsewhere if j.explains), None)
    if verdict.verdict not in ("named", "ambiguous") or best is None:
        return verdict
    first, *rest = verdict.members
    if best.gain < first.gain + EXPLANATION.energy_decisive:
        return verdict
    names = set(best.candidate.names)
    if names == set(first.candidate.names):
        kept = [m for m in rest if _best_gain(m, elsewhere) > best.gain - EXPLANATION.energy_decisive]
        alone = bool(rest) and not kept
        return replace(verdict, verdict="named" if alone else verdict.verdict, members=(first, *kept), better=best)
    if any(names == set(m.candidate.names) for m in rest):
        return replace(verdict, better=best)
    return replace(verdict, verdict="ambiguous", members=(*verdict.members, best), better=best)


def _best_gain(member: Judged, elsewhere: Sequence[Judged]) -> float:
    """ln K of its effects with the best of the energies that they were tried with."""
    names = set(member.candidate.names)
    return max([member.gain, *(j.gain for j in elsewhere if set(j.candidate.names) == names)])


def _comes_near(energy: Judged, effect: Judged) -> bool:
    """True if an energy explains the curve and an effect that follows the deflection alone is not far beyond it.

    The instrument is blamed only where no energy comes near, and not with an effect that is driven to its bounds.
    """
    far = max(EXPLANATION.energy_decisive, EXPLANATION.energy_share * effect.gain)
    return effect.gain - energy.gain < far or bool(effect.candidate.at_bound)


def _without_effects(others: Sequence[Judged]) -> Verdict:
    energy = next((j for j in others if j.explains), None)
    return Verdict("unknown", ()) if energy is None else Verdict("material", (energy,))
