"""What could explain the curve: a material with some effects, refitted, with its evidence."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property

import numpy as np

from bayesmembrane.calibration.descent import descend
from bayesmembrane.calibration.objective import Objective, separated
from bayesmembrane.data.measurement import Measurement
from bayesmembrane.diagnosis.whitening import OwnNoise
from bayesmembrane.ground.parameters import Array, HalfNormal, Parameter
from bayesmembrane.ground.registry import components
from bayesmembrane.physics.effects.base import Effect, EffectParameter
from bayesmembrane.physics.forward import Solve
from bayesmembrane.physics.hypothesis import Hypothesis
from bayesmembrane.physics.mechanics import api
from bayesmembrane.physics.mechanics.request import Request
from bayesmembrane.physics.mechanics.solution import Curves

ITERATIONS, SANE = 40, 3
SIZES = (0.1, 0.6)  # of the expected size of an effect: where searches for it start
BEHIND = 4.0  # times the least sum of squares: a search as far off as that is not waited for
NEAR_BOUND = 1e-3  # of the expected size, or of the width of the bounds


@dataclass(frozen=True, eq=False)
class Candidate:
    """One hypothesis at its most probable parameters, under the measurement's own noise.

    hypothesis : material and effects
    x : (k,) coordinates
    residual : (N,) N, measured less fitted
    slopes : (N, k) dF/dx there
    log_evidence : Laplace approximation of ln Z, up to a constant that all candidates share
    at_bound : names of coordinates at a bound
    """

    hypothesis: Hypothesis
    x: Array
    residual: Array
    slopes: Array
    log_evidence: float
    at_bound: tuple[str, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Its effects."""
        return tuple(e.name for e in self.hypothesis.effects)

    @property
    def label(self) -> str:
        return self.hypothesis.label()

    def slopes_of(self, names: Collection[str]) -> Array:
        """(N, m) the slopes of the coordinates of these effects."""
        sizes = [len(e.coordinates) for e in self.hypothesis.effects]
        owner = np.repeat(self.names, sizes) if sizes else np.empty(0, dtype=str)
        start = self.hypothesis.material_size
        return self.slopes[:, start : start + owner.size][:, np.isin(owner, list(names))]

    @cached_property
    def parameters(self) -> dict[str, float]:
        """Effect parameters by full name, SI."""
        n = self.hypothesis.material_size
        names = self.hypothesis.names[n : self.hypothesis.curve_size]
        return {name: float(v) for name, v in zip(names, self.x[n:], strict=True)}


@dataclass(frozen=True, eq=False)
class Search:
    """Fits hypotheses to one measurement under one noise; ``weight`` is the part of the points that count on their own
    where correlation is left over, n_eff / N = (1 - r1) / (1 + r1).
    """

    measurement: Measurement
    noise: OwnNoise
    seed: int = 0
    solve: Solve = api.solve
    weight: float = 1.0

    def sane(self, hypothesis: Hypothesis) -> list[Array]:
        """Starts (k,) from draws of the material's prior brought to their best modulus, without any effect.

        The plain model bends the material until it imitates what is missing: searches must not only start there.
        """
        plain = replace(hypothesis, effects=())
        objective = Objective(plain, self.measurement, "euclidean", self.solve)
        pool, _ = objective.pool(np.random.default_rng(self.seed))
        nothing = np.concatenate([np.empty(0), *(e.null for e in hypothesis.effects)])
        return [np.concatenate([x, nothing]) for x in separated(pool, objective.spread, SANE)]

    def fit(self, hypothesis: Hypothesis, starts: Sequence[Array]) -> Candidate | None:
        """The best of the searches from ``starts`` (k,); None if no film of this hypothesis reaches the data.

        Films that only shooting resolves cost a hundred times as much: they are left to the end of the best search.
        """

        def quick(asked: Request) -> Curves:
            return self.solve(replace(asked, solver="ritz_alone"))

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

        return descend(residuals, starts, (objective.low, objective.high), ITERATIONS, behind=BEHIND)

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
    out = []
    for i, base in enumerate(bases):
        for sign in signs:
            for share in SIZES if i == 0 else SIZES[:1]:
                for shape in [{}, *effect.starts] if share == SIZES[0] and i == 0 else [{}]:
                    theta = np.array([shape.get(p.name, p.typical) for p in effect.coordinates])
                    theta[0] = (effect.size.null or 0.0) + sign * share * effect.size.scale
                    out.append(np.concatenate([base, effect.within_bounds(theta)]))
    return out


def with_effects(hypothesis: Hypothesis, effects: Sequence[Effect]) -> Hypothesis:
    """The hypothesis with more effects."""
    return replace(hypothesis, effects=(*hypothesis.effects, *effects))


def available(measurement: Measurement, hypothesis: Hypothesis) -> list[Effect]:
    """Effects of the library that can be seen in this test, can be told from the material, and are not there yet."""
    found: list[Effect] = [cls() for cls in components("effects").values()]
    have = {e.name for e in hypothesis.effects}
    rig, path = measurement.rig, measurement.path
    thin = measurement.specimen.thickness
    told = [e for e in found if e.name not in have and not e.absorbed]
    return [e for e in told if not e.unavailable(rig, path) and not e.negligible(thin)]


def absorbed(measurement: Measurement, hypothesis: Hypothesis) -> list[Effect]:
    """Effects that the material absorbs without trace."""
    have = {e.name for e in hypothesis.effects}
    found: list[Effect] = [cls() for cls in components("effects").values()]
    rig, path = measurement.rig, measurement.path
    return [e for e in found if e.name not in have and e.absorbed and not e.unavailable(rig, path)]


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
        tolerance = NEAR_BOUND * float(by(high) - by(low))
        ends = {getattr(p, "null", None), *map(float, p.prior.distribution().support())}
        for bound in (low, high):
            if abs(float(by(x[i]) - by(bound))) <= tolerance and bound not in ends:
                out.append(p.name)
    return tuple(out)
