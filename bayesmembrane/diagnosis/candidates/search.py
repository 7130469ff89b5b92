"""Fits hypotheses to one measurement, with their evidence."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from bayesmembrane.calibration.descent import descend
from bayesmembrane.calibration.objective import Objective, separated
from bayesmembrane.data.measurement import Measurement
from bayesmembrane.diagnosis.candidates.candidate import Candidate
from bayesmembrane.diagnosis.reference.noise import OwnNoise
from bayesmembrane.diagnosis.thresholds import SEARCH
from bayesmembrane.ground.parameters import Array, HalfNormal, Parameter
from bayesmembrane.physics.effects.base import Effect, EffectParameter
from bayesmembrane.physics.forward import Solve
from bayesmembrane.physics.hypothesis import Hypothesis
from bayesmembrane.physics.mechanics import api
from bayesmembrane.physics.mechanics.request import Request
from bayesmembrane.physics.mechanics.solution import Curves


@dataclass(frozen=True, eq=False)
class Search:
    """Fits hypotheses to one measurement under one noise.

    weight : part of the points that count on their own where correlation is left over, `effective_weight`
    """

    measurement: Measurement
    noise: OwnNoise
    seed: int = 0
    solve: Solve = api.solve
    weight: float = 1.0

    def material_starts(self, hypothesis: Hypothesis) -> list[Array]:
        """Starts (k,) from draws of the material's prior brought to their best modulus, without any effect.

        The plain model bends the material until it imitates what is missing: searches must not only start there.
        """
        plain = replace(hypothesis, effects=())
        objective = Objective(plain, self.measurement, "euclidean", self.solve)
        pool, _ = objective.pool(np.random.default_rng(self.seed))
        nothing = np.concatenate([np.empty(0), *(e.null for e in hypothesis.effects)])
        return [np.concatenate([x, nothing]) for x in separated(pool, objective.spread, SEARCH.material_starts)]

    def fit(self, hypothesis: Hypothesis, starts: Sequence[Array]) -> Candidate | None:
        """The best of the searches from ``starts`` (k,); None if no film of this hypothesis reaches the data.

        Films that only shooting resolves cost a hundred times as much: they are left to the end of the best search.
        """

        def quick(asked: Request) -> Curves:
            return api.unaided(asked, self.solve)

        exact = Objective(hypothesis, self.measurement, "euclidean", self.solve)
        x, size = self._descended(Objective(hypothesis, self.measurement, "euclidean", quick), np.array(starts))
        if np.any(np.isfinite(size)):
            x = x[[int(np.argmin(size))]]
        x, size = self._descended(exact, x)
        if not np.any(np.isfinite(size)):
            return None
        return self._candidate(exact, x[int(np.argmin(size))], float(np.min(size)))

    def _descended(self, objective: Objective, starts: Array) -> tuple[Array, Array]:
        """Where searches from starts (B, k) end, and the roots of their sums of squares (B,), the prior's included."""
        centre, spread = prior_moments(objective.hypothesis)
        root = np.sqrt(self.weight)

        def residuals(x: Array) -> tuple[Array, Array]:
            r, j = self._white(objective, x)
            pull = np.broadcast_to(np.diag(1 / spread), (len(x), *(2 * [spread.size])))
            return (
                np.concatenate([root * r, (x - centre) / spread], axis=1),
                np.concatenate([root * j, pull], axis=1),
            )

        bounds = (objective.low, objective.high)
        return descend(residuals, starts, bounds, SEARCH.iterations, behind=SEARCH.given_up)

    def _white(self, objective: Objective, x: Array) -> tuple[Array, Array]:
        """Whitened residuals (B, N) and slopes (B, N, k); a start without a curve is nan, and only that one."""
        r, j = objective.batch(x)
        wide = np.moveaxis(np.concatenate([r[:, :, None], j], axis=2), 1, 0)
        white = np.full(wide.shape, np.nan)
        good = np.all(np.isfinite(wide), axis=(0, 2))
        white[:, good] = self.noise.white(wide[:, good])
        white = np.moveaxis(white, 0, 1)
        return white[:, :, 0], white[:, :, 1:]

    def covariance(self, candidate: Candidate) -> Array:
        """(k, k) of the coordinates about a fit of this search, by Laplace's approximation."""
        _, spread = prior_moments(candidate.hypothesis)
        white = np.sqrt(self.weight) * self.noise.white(candidate.slopes)
        scaled = np.eye(spread.size) + spread[:, None] * (white.T @ white) * spread
        return np.asarray(spread[:, None] * np.linalg.inv(scaled) * spread)

    def _candidate(self, objective: Objective, x: Array, size: float) -> Candidate:
        hypothesis = objective.hypothesis
        r, j = objective.batch(x[None, :])
        slopes = np.where(np.isfinite(j[0]), j[0], 0.0)
        _, spread = prior_moments(hypothesis)
        white = np.sqrt(self.weight) * self.noise.white(slopes)
        _, log_det = np.linalg.slogdet(np.eye(x.size) + spread * (white.T @ white) * spread[:, None])
        # A half-normal prior is twice as dense on the side that is allowed.
        halves = sum(isinstance(p.prior, HalfNormal) for p in objective.parameters)
        log_evidence = -0.5 * size**2 - 0.5 * log_det + halves * np.log(2.0) + _heavy_tails(hypothesis, x)
        return Candidate(hypothesis, x, -r[0], slopes, float(log_evidence), _at_bound(objective, x))


def starts_with(bases: Sequence[Array], effect: Effect) -> list[Array]:
    """Starts for ``bases`` (k,) with one more effect: from the first a small and a middling one, from the others a
    small one, and both signs where both are allowed.
    """
    signs = (1.0,) if effect.size.one_sided else (1.0, -1.0)
    small, middling = SEARCH.small_share, SEARCH.middling_share
    out = []
    for i, base in enumerate(bases):
        for sign in signs:
            for share in (small, middling) if i == 0 else (small,):
                for shape in [{}, *effect.starts] if share == small and i == 0 else [{}]:
                    theta = np.array([shape.get(p.name, p.typical) for p in effect.coordinates])
                    theta[0] = (effect.size.null or 0.0) + sign * share * effect.size.scale
                    out.append(np.concatenate([base, effect.within_bounds(theta)]))
    return out


def prior_moments(hypothesis: Hypothesis) -> tuple[Array, Array]:
    """Centre and spread (k,) of the normal prior that stands for the proper one: a size is centred at its null."""
    found = [_moments(p) for p in hypothesis.parameters[: hypothesis.curve_size]]
    centre, spread = np.array(found).T
    return centre, spread


def _heavy_tails(hypothesis: Hypothesis, x: Array) -> float:
    """ln of Cauchy over normal density, summed over the sizes of effects at x (k,).

    The expected size is a rough guess: an effect several times larger that fits must not lose to a smaller one that
    does not. Searches keep the normal, which makes them sums of squares.
    """
    out = 0.0
    for p, value in zip(hypothesis.parameters[: hypothesis.curve_size], x, strict=True):
        if isinstance(p, EffectParameter) and p.null is not None:
            z = (float(value) - p.null) / p.scale
            out += 0.5 * z**2 - float(np.log1p(z**2)) + 0.5 * float(np.log(2 / np.pi))
    return out


@cache
def _moments(p: Parameter) -> tuple[float, float]:
    if isinstance(p, EffectParameter) and p.null is not None:
        return p.null, p.scale
    return float(p.prior.quantile(0.5)), float(p.prior.distribution().std())


def _at_bound(objective: Objective, x: Array) -> tuple[str, ...]:
    """Coordinates at a bound that stops them: not at the absence of an effect, nor where its law ends of itself."""
    out = []
    for i, p in enumerate(objective.parameters):
        low, high = p.bounds
        # Bounds that are decades apart are near in the logarithm.
        by = np.log if low > 0 else np.asarray
        tolerance = SEARCH.at_bound * float(by(high) - by(low))
        ends = {getattr(p, "null", None), *map(float, p.prior.distribution().support())}
        for bound in (low, high):
            if abs(float(by(x[i]) - by(bound))) <= tolerance and bound not in ends:
                out.append(p.name)
    return tuple(out)


def effective_weight(residual_white: Array) -> float:
    """n_eff / N = (1 - r1) / (1 + r1) of whitened residuals (N,), at most 1: what correlation is left."""
    if residual_white.size < 3:
        return 1.0
    r = residual_white - residual_white.mean()
    scale = float(r @ r)
    r1 = float(r[1:] @ r[:-1]) / scale if scale > 0 else 0.0
    return float(np.clip((1 - r1) / (1 + r1), SEARCH.least_weight, 1.0))
