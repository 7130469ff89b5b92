"""In place of fits: candidates with the ln Z that a test gives them, and a search that only looks them up."""

import numpy as np

from bayesmembrane.diagnosis.candidates.candidate import Candidate, with_effects
from bayesmembrane.ground.registry import components
from bayesmembrane.physics.hypothesis import Hypothesis, hypothesis


def claim(*effects: str) -> Hypothesis:
    return with_effects(hypothesis("gent"), [components("effects")[n]() for n in effects])


def candidate(h: Hypothesis, log_evidence: float) -> Candidate:
    nothing = np.zeros(3)
    x = np.arange(h.curve_size, dtype=float)
    return Candidate(h, x, nothing, nothing[:, None], log_evidence, (), nothing[None], np.zeros(2), nothing)


class Shelf:
    """In place of a search: ln Z by set of effects, before and after it is searched on."""

    def __init__(self, start: dict[frozenset[str], float], end: dict[frozenset[str], float]) -> None:
        self.start, self.end = start, end
        self.asked: list[frozenset[str]] = []
        self.coordinates: list[np.ndarray] = []

    def placed(self, every: list[tuple[Hypothesis, np.ndarray]]) -> list[Candidate | None]:
        self.coordinates += [x for _, x in every]
        named = [(h, frozenset(e.name for e in h.effects)) for h, _ in every]
        return [candidate(h, self.start[names]) if names in self.start else None for h, names in named]

    def log_tempered(self, c: Candidate, counts: float) -> float:
        return counts * c.log_evidence

    def all_polished(self, every: list[Candidate]) -> list[Candidate]:
        self.asked += [frozenset(c.names) for c in every]
        return [candidate(c.hypothesis, self.end[frozenset(c.names)]) for c in every]


FRICTION, MULLINS = frozenset({"friction"}), frozenset({"mullins"})
