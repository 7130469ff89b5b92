"""Candidates beside the null model, refitted and judged: each effect, each pair, each other energy."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from bayesmembrane.diagnosis.candidates.candidate import Candidate, with_effects
from bayesmembrane.diagnosis.candidates.search import effective_weight, starts_with
from bayesmembrane.diagnosis.explanation.case import Judged, OpenCase, judged
from bayesmembrane.diagnosis.reference.inferred import own_noise
from bayesmembrane.diagnosis.reference.noise import orthonormal
from bayesmembrane.diagnosis.thresholds import EXPLANATION, SEARCH
from bayesmembrane.ground.parameters import Array
from bayesmembrane.ground.registry import materials
from bayesmembrane.physics.effects.base import Effect
from bayesmembrane.physics.hypothesis import Hypothesis
from bayesmembrane.physics.materials.base import Material


def singles(case: OpenCase) -> list[Judged]:
    """The null model with each visible effect; the most probable first."""
    bases = [case.null.x, *case.search.material_starts(case.null.hypothesis)]
    return ranked(_added(case, case.null, effect, bases) for effect in case.visible)


def pairs(case: OpenCase, alone: Sequence[Judged]) -> list[Judged]:
    """The best few single effects, each with every other visible effect; the most probable pair first.

    The first effect of a pair is often not the best single one: hence several are followed.
    """
    out: dict[frozenset[str], Judged] = {}
    for first in alone[: EXPLANATION.pair_singles]:
        for effect in case.visible:
            key = frozenset((*first.candidate.names, effect.name))
            if effect.name in first.candidate.names:
                continue
            found = _added(case, first.candidate, effect, [first.candidate.x])
            if found is not None and (key not in out or found.log_evidence > out[key].log_evidence):
                out[key] = found
    return ranked(out.values())


def energies(case: OpenCase) -> list[Judged]:
    """The other strain energies, with the effects of the null model; the most probable first."""
    return ranked(_with_energy(case, case.null.hypothesis, kind, np.empty(0)) for kind in _others(case))


def energies_with_effects(case: OpenCase, found: Sequence[Judged]) -> list[Judged]:
    """The effects of the first few of ``found`` with every other energy; the most probable first.

    A wrong energy leaves structure, and an effect whose law is free may follow that instead of the true one's.
    """
    first = [j.candidate for j in found[: EXPLANATION.with_other_energies]]
    return ranked(
        _with_energy(case, c.hypothesis, kind, c.x[c.hypothesis.material_size :])
        for kind in _others(case)
        for c in first
    )


def again(case: OpenCase, found: Iterable[Judged]) -> list[Judged]:
    """The same candidates fitted anew from where they are, with the case's present noise and weight."""
    return ranked(_refitted(case, j.candidate.hypothesis, [j.candidate.x]) or j for j in found)


def renewed(case: OpenCase, found: Sequence[Judged]) -> tuple[OpenCase, list[Judged]]:
    """Noise and weight from the best candidate, which misses less than the null model, and all candidates fitted anew.

    Misfit looks like noise that remembers: what the best model leaves is closer to the truth.
    """
    best = found[0].candidate
    basis = np.column_stack([case.smooth, best.slopes])
    if orthonormal(basis).shape[1] >= len(case.measurement):
        return case, list(found)  # few points: what the best model leaves is nothing at all, and says nothing of noise
    noise = own_noise(case.measurement, basis)
    search = replace(case.search, noise=noise, weight=effective_weight(noise.white(best.residual)))
    null = search.fit(case.null.hypothesis, [case.null.x]) or case.null
    case = replace(case, search=search, null=null)
    return case, again(case, found)


def better_null(case: OpenCase, alone: Sequence[Judged]) -> Candidate | None:
    """The plain model from where effects have led its material, if that is a better fit than the first search found.

    Else effects of no size would seem to explain the curve.
    """
    null = case.null
    starts = [j.candidate.x[: null.x.size] for j in alone]
    found = case.search.fit(null.hypothesis, [null.x, *starts]) if starts else None
    return found if found is not None and found.log_evidence > null.log_evidence + SEARCH.better_null else None


def left_by_form(case: OpenCase) -> float | None:
    """Part of the plain material's misfit that the given effects leave, if a machine that differs a little from the
    textbook leaves as much; else, or without effects, None.

    What a form leaves is no further effect: another one that takes it predicts worse.
    """
    given = case.null
    plain = replace(given.hypothesis, effects=())
    if not given.names or (alone := case.search.fit(plain, case.search.material_starts(plain))) is None:
        return None
    found = judged(replace(case, null=alone), given)
    little = found.p_value > EXPLANATION.level or found.unexplained <= EXPLANATION.pair_share
    return found.unexplained if found.explains and little else None


def ranked(found: Iterable[Judged | None]) -> list[Judged]:
    """Those that could be fitted, the most probable first."""
    return sorted((j for j in found if j is not None), key=lambda j: -j.log_evidence)


def _added(case: OpenCase, base: Candidate, effect: Effect, bases: Sequence[Array]) -> Judged | None:
    """``base`` with one more effect, from starts at its own coordinates ``bases`` (k,)."""
    names = [e.title for e in base.hypothesis.effects if e.name not in case.null.names]
    case.tell(f"refitting with {' and '.join([*names, effect.title])}")
    return _refitted(case, with_effects(base.hypothesis, [effect]), starts_with(bases, effect))


def _with_energy(case: OpenCase, base: Hypothesis, energy: type[Material], effects: Array) -> Judged | None:
    """``base`` with another strain energy, from the coordinates of its ``effects``, or from none if they are empty."""
    case.tell(f"trying the energy {energy.title}")
    other = replace(base, material=energy)
    starts = case.search.material_starts(other)
    if effects.size:
        starts = [np.concatenate([x[: other.material_size], effects]) for x in starts]
    return _refitted(case, other, starts)


def _refitted(case: OpenCase, hypothesis: Hypothesis, starts: Sequence[Array]) -> Judged | None:
    found = case.search.fit(hypothesis, starts)
    return None if found is None else judged(case, found)


def _others(case: OpenCase) -> list[type[Material]]:
    """The strain energies that the null model does not have."""
    return [kind for name, kind in materials().items() if name != case.null.hypothesis.material.name]
