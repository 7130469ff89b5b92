"""What was fitted on the way to an answer: every hypothesis, and the search under whose noise it was weighed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from bayesmembrane.diagnosis.candidates.candidate import Candidate
from bayesmembrane.diagnosis.candidates.weighing import Weighing
from bayesmembrane.diagnosis.explanation.beliefs import BELIEFS
from bayesmembrane.diagnosis.explanation.case import DiagnosisCase
from bayesmembrane.diagnosis.explanation.unfitted import Key
from bayesmembrane.diagnosis.explanation.visible import all_seen
from bayesmembrane.diagnosis.thresholds import GROWTH, SEARCH
from bayesmembrane.ground.parameters import Array


@dataclass(eq=False)
class Grown:
    """Every hypothesis that was fitted, by energy and effects; the search under whose noise they were weighed.

    starts : by energy, draws of its prior brought to their best modulus
    followed : sets of effects that larger ones were grown from
    ended : hypotheses that were searched on until nothing was gained, and not found anew since
    limited : True where a load cell at its limit, beside an energy without effects, leaves nothing to be explained
    """

    case: DiagnosisCase
    search: Weighing
    found: dict[Key, Candidate] = field(default_factory=dict)
    starts: dict[str, list[Array]] = field(default_factory=dict)
    followed: set[frozenset[str]] = field(default_factory=set)
    ended: set[Key] = field(default_factory=set)
    limited: bool = False

    def add(self, candidate: Candidate | None) -> None:
        """Keep the better of two fits of one hypothesis."""
        if candidate is None:
            return
        key = key_of(candidate)
        if key not in self.found or candidate.log_evidence > self.found[key].log_evidence:
            self.found[key] = candidate
            self.ended.discard(key)

    @property
    def best(self) -> Candidate:
        """The most probable by the data alone."""
        return max(self.found.values(), key=lambda c: c.log_evidence)

    @property
    def counts(self) -> float:
        """What part of every likelihood counts, with the gain of the best so far."""
        best = max(c.log_evidence for c in self.found.values())
        return BELIEFS.counts(best - self.of_size(0)[0].log_evidence)

    def believed(self, candidate: Candidate, energy: str | None = None) -> float:
        """ln of the probability of a hypothesis before the data; with another ``energy`` if that is given."""
        own = [e.odds for e in candidate.hypothesis.effects if e.name not in self.case.null.names]
        of_set = BELIEFS.log_set(own, [e.odds for e in self.case.visible])
        of = energy or candidate.hypothesis.material.name
        return of_set + BELIEFS.log_energy(of, self.case.question.energy, len(self.case.plain))

    def log_tempered(self) -> dict[Key, float]:
        """ln Z of each as far as likelihoods count (`Weighing.log_tempered`)."""
        counts, best = self.counts, self.best
        first = self.search.log_tempered(best, counts)
        out = {key: first + counts * (c.log_evidence - best.log_evidence) for key, c in self.found.items()}
        near = {key: c for key, c in self.found.items() if first - out[key] < GROWTH.share_reach}
        return out | {key: self.search.log_tempered(c, counts) for key, c in near.items()}

    def weights(self) -> dict[Key, float]:
        """ln of the weight of each in the sum, but for what `seen` adds."""
        return {key: z + self.believed(self.found[key]) for key, z in self.log_tempered().items()}

    def seen(self) -> dict[Key, float]:
        """What the weight of each gains where effects below what can be seen count as absent."""
        return all_seen(self.search, self.found, self.weights(), self.case.null.names, self.counts)

    def of_size(self, size: int) -> list[Candidate]:
        """Those with so many effects beyond the given ones, the most probable first."""
        given = len(self.case.null.names)
        return sorted(
            (c for (_, names), c in self.found.items() if len(names) - given == size), key=lambda c: -c.log_evidence
        )

    def best_of_each_set(self, size: int) -> list[Candidate]:
        """Of every set of so many effects the most probable energy; the most probable set first."""
        best: dict[frozenset[str], Candidate] = {}
        for c in self.of_size(size):
            best.setdefault(frozenset(c.names), c)
        return list(best.values())

    def polish(self, size: int) -> None:
        """The best of each set of this size searched on with its own form error: all that may matter."""
        every = self.best_of_each_set(size)[: GROWTH.polished]
        near = [c for c in every if every[0].log_evidence - c.log_evidence < GROWTH.polish_reach]
        self.found |= {key_of(c): c for c in self.search.all_polished(near)}

    def renew(self) -> None:
        """Noise from the best candidate, and all of them weighed under it."""
        best = self.best
        self.search = self.case.renewed(self.search, best)
        self.found = {key: self.search.weighed_anew(c) for key, c in self.found.items()}

    @property
    def most(self) -> int:
        """Effects of the largest set that is asked for."""
        return 1 if self.case.question.quick else BELIEFS.most

    def own(self, c: Candidate) -> list[str]:
        """Its effects beyond the given ones."""
        return [n for n in c.names if n not in self.case.null.names]

    def shares(self, seen: Mapping[Key, float]) -> dict[Key, float]:
        """ln of the part that each hypothesis has in the sum of all that were fitted; ``seen`` as `Grown.seen` says."""
        weights = {key: w + seen[key] for key, w in self.weights().items()}
        whole = float(np.logaddexp.reduce(list(weights.values())))
        return {key: w - whole for key, w in weights.items()}

    def search_to_the_end(self, keys: Sequence[Key]) -> None:
        """These hypotheses searched on until nothing is gained, and noted as such."""
        ends = self.search.all_polished([self.found[k] for k in keys], SEARCH.iterations)
        self.found |= dict(zip(keys, ends, strict=True))
        self.ended.update(keys)


def key_of(candidate: Candidate) -> Key:
    """Its energy, and all its effects."""
    return candidate.hypothesis.material.name, frozenset(candidate.names)
