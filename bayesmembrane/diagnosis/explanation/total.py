"""The sum over all hypotheses: how probable effects, energies and what is foreign are, each summed over the others."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from bayesmembrane.diagnosis.candidates.candidate import Candidate
from bayesmembrane.diagnosis.explanation.beliefs import BELIEFS
from bayesmembrane.diagnosis.explanation.foreign import Foreign, foreign, kinds_of
from bayesmembrane.diagnosis.explanation.growth import Grown
from bayesmembrane.diagnosis.thresholds import FOREIGN
from bayesmembrane.ground.parameters import Array

NOTHING = "none"
"""No effect; nothing foreign."""


@dataclass(frozen=True, eq=False)
class Judged:
    """A hypothesis and how probable it is.

    probability : among all that were looked at, with nothing foreign beside it
    gain : ln of the Bayes factor over the null model
    unexplained : part of the squares beyond noise that the null model leaves, which this one leaves
    reduced_chi2 : of what it leaves, its form error not taken away
    """

    candidate: Candidate
    probability: float
    gain: float
    unexplained: float
    reduced_chi2: float

    @property
    def log_evidence(self) -> float:
        return self.candidate.log_evidence


@dataclass(frozen=True)
class Probabilities:
    """Each adds up to one.

    effects : by set of effects beyond the given ones, their names joined by "+"; `NOTHING` among them
    energies : by energy
    foreign : by kind; `NOTHING` among them
    """

    effects: Mapping[str, float]
    energies: Mapping[str, float]
    foreign: Mapping[str, float]

    def of_effect(self, name: str) -> float:
        """Of one effect, whatever else is at work."""
        return float(sum(p for key, p in self.effects.items() if name in key.split("+")))


@dataclass(frozen=True, eq=False)
class Total:
    """The sum.

    ranking : every hypothesis, the most probable first
    probabilities : summed
    foreign : what was found of each kind beside the models where it was looked for, the most probable first
    """

    ranking: tuple[Judged, ...]
    probabilities: Probabilities
    foreign: tuple[Foreign, ...]


def set_name(candidate: Candidate, given: Sequence[str]) -> str:
    """The effects of a candidate beyond those given, in alphabetical order, joined by "+"."""
    return _joined(frozenset(candidate.names) - set(given))


def summed(grown: Grown) -> Total:
    """All that was grown, and what is foreign beside the most probable of it."""
    case = grown.case
    given, visible = case.null.names, len(case.visible)
    every = list(grown.found.values())

    def weight(c: Candidate) -> float:
        size = len(c.names) - len(given)
        energy = BELIEFS.log_energy(c.hypothesis.material.name, case.question.energy, len(case.plain))
        return c.log_evidence + BELIEFS.log_set(size, visible) + energy

    every.sort(key=weight, reverse=True)
    found = _foreign(grown, every, given)
    kinds = kinds_of(found)
    nothing = BELIEFS.log_foreign(0) if kinds else 0.0
    terms = [(c, NOTHING, weight(c) + nothing) for c in every]
    terms += [(f.base, f.kind, weight(f.base) + f.gain + BELIEFS.log_foreign(kinds)) for f in found]
    p = _normalised(np.array([w for _, _, w in terms]))
    judged = [_judged(grown, c, float(q)) for (c, kind, _), q in zip(terms, p, strict=True) if kind == NOTHING]
    return Total(tuple(judged), _added_up(terms, p, given), tuple(found))


def _foreign(grown: Grown, every: Sequence[Candidate], given: Sequence[str]) -> list[Foreign]:
    """What is foreign beside the best energy of the first few sets, and beside the plain model."""
    bases: dict[str, Candidate] = {}
    for c in every:
        bases.setdefault(set_name(c, given), c)
    chosen = dict(list(bases.items())[: FOREIGN.bases])
    chosen.setdefault(NOTHING, bases[NOTHING])
    grown.case.tell("looking for what no effect describes")
    found = [f for base in chosen.values() for f in foreign(grown.search, base)]
    return sorted(found, key=lambda f: -(f.gain + f.base.log_evidence))


def _normalised(log_weights: Array) -> Array:
    p = np.exp(log_weights - np.max(log_weights))
    return np.asarray(p / np.sum(p))


def _added_up(terms: Sequence[tuple[Candidate, str, float]], p: Array, given: Sequence[str]) -> Probabilities:
    effects, energies, kinds = (defaultdict[str, float](float) for _ in range(3))
    owners = _owners([c for c, kind, _ in terms if kind == NOTHING], given)
    for (c, kind, _), q in zip(terms, p, strict=True):
        effects[owners[set_name(c, given)]] += float(q)
        energies[c.hypothesis.material.name] += float(q)
        kinds[kind] += float(q)
    return Probabilities(*(dict(sorted(d.items(), key=lambda i: -i[1])) for d in (effects, energies, kinds)))


def _owners(every: Sequence[Candidate], given: Sequence[str]) -> dict[str, str]:
    """{set of effects: the part of it that the data speak for}.

    A further effect that the data do not support is not seen to be there, nor seen to be absent: such a set says no
    more than the set without it.
    """
    support: dict[frozenset[str], float] = {}
    for c in every:
        own = frozenset(c.names) - set(given)
        support[own] = max(support.get(own, -np.inf), c.log_evidence)
    out: dict[frozenset[str], frozenset[str]] = {}
    for own in sorted(support, key=len):
        smaller = [own - {e} for e in own if own - {e} in support]
        best = max(smaller, key=lambda s: support[s], default=None)
        idle = best is not None and support[best] > support[own] - BELIEFS.supported
        out[own] = out[best] if idle and best is not None else own
    return {_joined(own): _joined(owner) for own, owner in out.items()}


def _joined(names: frozenset[str]) -> str:
    return "+".join(sorted(names)) or NOTHING


def _judged(grown: Grown, c: Candidate, probability: float) -> Judged:
    null = grown.found[(grown.case.null.hypothesis.material.name, frozenset(grown.case.null.names))]
    left, before = _excess(grown, c), _excess(grown, null)
    n = c.residual.size
    return Judged(
        c,
        probability,
        c.log_evidence - null.log_evidence,
        min(left / before, 1.0) if before > 0 else 0.0,
        (left + n - c.x.size) / max(n - c.x.size, 1),
    )


def _excess(grown: Grown, c: Candidate) -> float:
    """Squares beyond those of noise, over its variance; 0 or more."""
    white = grown.search.noise.white(grown.search.adapted(c))
    return max(float(white @ white) - (c.residual.size - c.x.size), 0.0)
