"""Which further measurement would tell rival explanations apart, found by simulating it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from bayesmembrane.diagnosis.candidates.candidate import Candidate
from bayesmembrane.diagnosis.candidates.search import Search
from bayesmembrane.diagnosis.reference.noise import OwnNoise
from bayesmembrane.diagnosis.thresholds import NEXT_TEST
from bayesmembrane.ground.errors import BayesmembraneError
from bayesmembrane.ground.parameters import Array
from bayesmembrane.ground.symmetric import eigh
from bayesmembrane.next_test.further import FurtherTest, Kind, OnFilm, other_motions
from bayesmembrane.next_test.gain import confused
from bayesmembrane.physics.effects.base import Compliance
from bayesmembrane.physics.form_error import FormFactors, form_columns, form_factors, traces
from bayesmembrane.physics.forward import Forward
from bayesmembrane.physics.noise.ar1 import gaps_of

Rival = tuple[Candidate, float]
"""An explanation and its probability."""
SMALLEST = -600.0
"""ln of the smallest BC: a simulated test leaves some doubt, however little."""


@dataclass(frozen=True)
class Experiment:
    """A further measurement and how far apart it would put the rivals.

    separation : in standard deviations of what two rivals leave open: two that lie so far apart would be taken for each
        other as often as these are on average, weighed by their probabilities; inf: no doubt is left
    """

    test: FurtherTest
    separation: float


def experiments(search: Search, rivals: Sequence[Rival]) -> list[Experiment]:
    """Further measurements, first the one that leaves least doubt which of the rivals it is.

    With p_a the probability of a rival, and what it foretells of the readings, N(m_a, S_a), from noise, the form errors
    that it has shown, and what the measurement leaves open of its parameters, the probability of a wrong choice is at
    most

        E = sum_(a < b) (p_a p_b)^(1/2) BC_ab,    BC_ab = int (N_a N_b)^(1/2),

    and ``separation`` s is that of two sharp rivals as often confused, exp(-s^2 / 8) = E / sum (p_a p_b)^(1/2).
    A. Bhattacharyya, Bull. Calcutta Math. Soc. 35 (1943) 99; T. Kailath, IEEE Trans. Commun. Tech. 15 (1967) 52. A test
    that cannot be simulated for some rival is left out. A blank run has BC = 0 where one of two
    lets the frame yield, else 1; one that helps comes first, for it takes minutes and no film.
    """
    out = []
    weight = np.sqrt([a[1] * b[1] for a, b in combinations(rivals, 2)])
    for trial in other_motions(search.measurement):
        try:
            log_confused = confused(_foretold(trial, search, [c for c, _ in rivals]))
        except (BayesmembraneError, np.linalg.LinAlgError):
            continue
        out.append(Experiment(trial.test, apart(weight, np.exp(np.maximum(log_confused, SMALLEST)))))
    frame = [any(isinstance(e, Compliance) for e in c.hypothesis.effects) for c, _ in rivals]
    if any(frame) and not all(frame):  # it tells those that yield from those that do not, and leaves the rest
        alike = np.array([a == b for a, b in combinations(frame, 2)], dtype=float)
        out.append(Experiment(FurtherTest(Kind.BLANK), apart(weight, alike)))
    return in_order(out)


def in_order(found: Sequence[Experiment]) -> list[Experiment]:
    """First what costs no film and helps, then what leaves least doubt."""

    def for_nothing(e: Experiment) -> bool:
        return e.test.kind is Kind.BLANK and e.separation >= NEXT_TEST.helps

    return sorted(found, key=lambda e: (not for_nothing(e), -e.separation))


def apart(weight: Array, confused_still: Array) -> float:
    """s with exp(-s^2 / 8) = the mean of BC (P,), ``confused_still``, of all pairs, by their ``weight`` (P,).

    inf where no pair is confused at all.
    """
    doubt = min(float(weight @ confused_still / np.sum(weight)), 1.0)
    return float(np.sqrt(-8 * np.log(doubt))) if doubt > 0 else float("inf")


def _foretold(trial: OnFilm, search: Search, rivals: Sequence[Candidate]) -> list[tuple[Array, Array]]:
    """Of each rival (m (M,), G (M, r)): it says that the readings, freed of noise, are N(m, 1 + G G^T).

    Raises `LinAlgError` where a rival has no film for the whole test.
    """
    noise = replace(search.noise, gaps=gaps_of(trial.measurement, search.noise.clock), root=None, profile=np.ones(1))
    factors: FormFactors | None = None
    out = []
    for c in rivals:
        shown = trial.signals(c.hypothesis, c.x[None, :], search.quick)
        force, slopes = shown.force[0], shown.slopes[0]
        if not (np.all(np.isfinite(force)) and np.all(np.isfinite(slopes))):
            raise np.linalg.LinAlgError("a rival has no film for the whole of a further test")
        if factors is None:  # the most probable rival says where the film goes slack
            factors = form_factors(replace(trial.measurement, force=force))
        out.append(_one(c, search, noise, (force, slopes, _forms(trial, c, search, factors, force))))
    return out


def _one(c: Candidate, search: Search, noise: OwnNoise, shown: tuple[Array, Array, Array]) -> tuple[Array, Array]:
    """Mean and spread of one rival whose film has these force (M,), slopes (M, k) and form errors (M, q) N."""
    force, slopes, forms = shown
    k = c.x.size
    mean, covariance = search.linear(c).first(c.theta, k)
    own = slopes * search.steepness(c)
    value, vector = eigh(covariance)
    open_yet = own @ (vector * np.sqrt(np.maximum(value, 0.0)))
    moved = force + own @ (mean - search.coefficients_at(c))
    white = noise.white(np.column_stack([moved, open_yet, forms]))
    return white[:, 0], white[:, 1:]


def _forms(trial: OnFilm, c: Candidate, search: Search, factors: FormFactors, force: Array) -> Array:
    """(M, q) N: what the form errors of a rival, as large as it has shown them, could make of the further test."""
    forward = Forward(c.hypothesis, trial.measurement, trial.deflection, search.quick)
    trace = traces(forward, c.x, force[None, :], changing=True)[0]
    sizes = iter(np.exp(c.theta[1:]).tolist())
    columns = form_columns(factors, force, c.hypothesis.effects, trace)
    return np.column_stack([(1.0 if size is None else next(sizes)) * part for size, part in columns])
