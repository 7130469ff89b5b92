"""How many training deflections a range has: evidence for each number, from one range alone and from all together."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
from scipy.special import logsumexp

from bayesmembrane.reconstruction.fit import Mode, descend, find_mode, knobs_at, scan
from bayesmembrane.reconstruction.model import Knobs, LossModel

Found = dict[int, tuple[float, float]]
"""For each number of points: ln evidence, and the most probable first position in m."""
Compared = dict[tuple[int, ...], tuple[float, tuple[float, ...]]]
"""The same for the numbers of points of all ranges together."""

COUNTS = (3, 60)
# Wrong numbers of points fit so badly that only a large error explains the losses: it must be allowed to.
COARSE = (7e-2, 7e-3, 7e-4)
HOPELESS = 20.0  # log evidence below the best at which a number of points is out of the question
PATIENCE = 4  # so many of them in a row end the search
CANDIDATE = 12.0  # numbers of points within this of the best are compared on all ranges together
NEGLIGIBLE = 1e-6  # probability not worth telling


def search_counts(model: LossModel, r: int, roughness: float, nugget: float) -> Found:
    """Every number of points of range r, from its losses alone; raising it ends where nothing fits any more."""
    found: Found = {}
    hopeless = 0
    for n in range(COUNTS[0], COUNTS[1] + 1):
        found[n] = _count(model, r, n, roughness, nugget)
        best = max(found, key=lambda k: found[k][0])
        hopeless = hopeless + 1 if found[n][0] < found[best][0] - HOPELESS else 0
        if hopeless >= PATIENCE and n > best + PATIENCE:
            break
    return found


def search_again(model: LossModel, r: int, roughness: float, nugget: float, found: Found) -> Found:
    """The likely numbers of an earlier search, for a model that believes fewer rows; the others fall back as they did.

    A wrong row raises the errors that a search has to allow for, and so makes wrong numbers look possible.
    """
    likely = _likely(found)
    new = {n: _count(model, r, n, roughness, nugget) for n in likely}
    shift = max(e for e, _ in new.values()) - max(found[n][0] for n in likely)
    return {n: new[n] if n in new else (e + shift, a) for n, (e, a) in found.items()}


def _count(model: LossModel, r: int, n: int, roughness: float, nugget: float) -> tuple[float, float]:
    trial = replace(model, ranges=(r,), counts=(n,))
    modes = descend(trial, [knobs_at(roughness, nugget, s / 5, (s,)) for s in COARSE])
    return _mean_evidence(modes), _first(trial, modes)[0]


def _likely(found: Found) -> list[int]:
    top = max(e for e, _ in found.values())
    return [n for n, (e, _) in found.items() if e > top - CANDIDATE]


def compare_counts(model: LossModel, knobs: Knobs, searched: list[Found], grid: list[Knobs]) -> Compared:
    """The likely numbers of points of all ranges together.

    The ranges sample one curve, so what one says about the curve helps to count the points of the other.
    """
    compared: Compared = {}
    for counts in product(*(_likely(f) for f in searched)):
        trial = replace(model, counts=counts)
        modes = scan(trial, grid, find_mode(trial, knobs))
        compared[counts] = _mean_evidence(modes), _first(trial, modes)
    return compared


def best_counts(compared: Compared) -> tuple[int, ...]:
    """The most probable numbers of points."""
    return max(compared, key=lambda c: compared[c][0])


def tell_counts(r: int, searched: Found, compared: Compared) -> tuple[dict[int, float], Found]:
    """Probability of each number of points of range r, and ln evidence relative to the best with first positions.

    Numbers that were not compared on all ranges keep their distance, from the range alone, to the best that was.
    """
    both: dict[int, tuple[float, float]] = {}
    for counts, (evidence, first) in compared.items():
        if counts[r] not in both or evidence > both[counts[r]][0]:
            both[counts[r]] = evidence, first[r]
    top, alone = max(e for e, _ in both.values()), max(searched[n][0] for n in both)
    relative = {n: (both[n][0] - top, both[n][1]) if n in both else (e - alone, a) for n, (e, a) in searched.items()}
    share = np.exp([e for e, _ in relative.values()])
    probability = dict(zip(relative, (share / np.sum(share)).tolist(), strict=True))
    return {n: p for n, p in probability.items() if p > NEGLIGIBLE}, relative


def _mean_evidence(modes: list[Mode]) -> float:
    return float(logsumexp([m.evidence for m in modes]) - np.log(len(modes)))


def _first(model: LossModel, modes: list[Mode]) -> tuple[float, ...]:
    best = max(modes, key=lambda m: m.evidence)
    return tuple(model.evaluate(best.theta[None], best.knobs).first[0].tolist())
