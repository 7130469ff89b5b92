"""What the evidence estimators ask of a problem, and the problem of this package seen that way."""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from bayesmembrane.calibration.posterior import Densities, Posterior, weighed
from bayesmembrane.calibration.sampling.proposals.collapsed import Collapsed, collapsed
from bayesmembrane.ground.errors import SettingsError
from bayesmembrane.ground.parameters import Array

SURE = 0.99
POINTS = 1 << 15  # of the prior from which modes are searched
FILMS, SHAPES = 1 << 11, 1 << 10  # the same for films, and for shapes, of which fewer fill the prior as densely
HOPELESS = 50_000  # draws of the prior of which none is possible


class Target(Protocol):
    """Z = integral of exp(log_likelihood(x)) exp(log_prior(x)) dx over R^k: anything with these four.

    dimension : k
    log_prior : ln p0(x) of x (B, k), shape (B,); normalised over R^k, and -inf where x is not allowed. A region that is
        cut away by -inf may be left out of the normalisation if its mass is told to the estimators
    log_likelihood : ln p(y | x) of x (B, k), shape (B,); -inf where x cannot give the data. It is asked only where the
        prior is not zero
    prior_transform : the x (B, k) of u (B, k) uniform in the unit cube; distributed as p0 before anything is cut away

    A target whose two logarithms come out of one computation may also have ``evaluate(x)``, which returns an object
    with ``log_prior`` and ``log_likelihood``, (B,) each. One that is slow may say by ``points`` from how many points of
    the prior its modes are to be searched, a power of two; `POINTS` otherwise.
    """

    @property
    def dimension(self) -> int: ...

    def log_prior(self, x: Array) -> Array: ...

    def log_likelihood(self, x: Array) -> Array: ...

    def prior_transform(self, u: Array) -> Array: ...


class _Evaluated(ABC):
    """A `Target` whose two logarithms come out of one computation."""

    @abstractmethod
    def evaluate(self, x: Array) -> Densities:
        """Both at once, from one solution of the film."""

    def log_prior(self, x: Array) -> Array:
        return np.asarray(self.evaluate(x).log_prior)

    def log_likelihood(self, x: Array) -> Array:
        return np.asarray(self.evaluate(x).log_likelihood)


@dataclass(frozen=True, eq=False)
class PosteriorTarget(_Evaluated):
    """The posterior of a hypothesis as a `Target`: the prior is untruncated times the indicator of convexity.

    Its evidence must be divided by the mass that convexity leaves (`JointPrior.masses`).
    """

    posterior: Posterior
    points: int = FILMS

    @property
    def dimension(self) -> int:
        return self.posterior.size

    def part(self, x: Array) -> Array:
        """The coordinates of this target of x (B, k): all."""
        return x

    def prior_transform(self, u: Array) -> Array:
        return self.posterior.prior.transform(u)

    def evaluate(self, x: Array) -> Densities:
        return weighed(self.posterior, x)


@dataclass(frozen=True, eq=False)
class ShapeTarget(_Evaluated):
    """The same integral over the shape of the curve alone: modulus and noise are integrated out, to 2e-4 of ln Z."""

    shape: Collapsed
    points: int = SHAPES

    @property
    def dimension(self) -> int:
        return self.shape.size

    def part(self, x: Array) -> Array:
        """The coordinates (B, k - 2) of this target of x (B, k)."""
        return self.shape.part(x)

    def prior_transform(self, u: Array) -> Array:
        half = np.full((len(u), 1), 0.5)
        return self.part(self.shape.posterior.prior.transform(np.concatenate([half, u, half], axis=1)))

    def evaluate(self, x: Array) -> Densities:
        return weighed(self.shape, x)


def of_fewest_coordinates(posterior: Posterior) -> PosteriorTarget | ShapeTarget:
    """The integral of a posterior over as few coordinates as there can be."""
    shape = collapsed(posterior)
    return PosteriorTarget(posterior) if shape is None else ShapeTarget(shape)


@dataclass(frozen=True)
class Coverage:
    """What a search has covered.

    points : that filled the prior
    ascents, modes : from how many of them the way up was followed, and how many places it led to
    volume : the smallest part of the prior that one of the points still falls into with 99 % probability: where a mode
        is higher than its surroundings on as much of it, the search has met it
    """

    points: int
    ascents: int
    modes: int
    volume: float


@dataclass(frozen=True)
class EvidenceEstimate:
    """ln Z of one estimator with its standard error, and what it cost.

    parts : ln Z of independent runs or halves, from whose scatter the standard error was checked
    coverage : what the search for modes has covered that went before it
    missed : by how much ln Z is larger at least, by modes that this search has found and the draws given have missed
    """

    log_evidence: float
    sd: float
    evaluations: int
    seconds: float
    parts: tuple[float, ...] = ()
    coverage: Coverage | None = None
    missed: float = 0.0


def averaged(a: EvidenceEstimate, b: EvidenceEstimate) -> EvidenceEstimate:
    """Mean of two independent estimates with weights 1 / sd^2; its error is inflated if they scatter by more."""
    w = np.array([a.sd, b.sd]) ** -2.0
    z = np.array([a.log_evidence, b.log_evidence])
    mean = float(w @ z / np.sum(w))
    sd = float(np.sqrt(max(1.0, float(w @ (z - mean) ** 2)) / np.sum(w)))
    return EvidenceEstimate(
        mean,
        sd,
        a.evaluations + b.evaluations,
        a.seconds + b.seconds,
        (*a.parts, *b.parts),
        covered([a.coverage, b.coverage]),
        max(a.missed, b.missed),
    )


def covered(parts: Sequence[Coverage | None]) -> Coverage | None:
    """What independent searches have covered together; None without any."""
    known = [c for c in parts if c is not None]
    if not known:
        return None
    points = sum(c.points for c in known)
    modes = max(c.modes for c in known)
    return Coverage(points, sum(c.ascents for c in known), modes, smallest(points))


def smallest(points: int) -> float:
    """The part of the prior that one of so many points falls into with 99 % probability: 1 - 0.01^(1/n)."""
    return float(-np.expm1(np.log1p(-SURE) / points))


class Problem:
    """A target with its bookkeeping: both logarithms at once, evaluations counted, answers checked."""

    def __init__(self, target: Target) -> None:
        self.target, self.evaluations = target, 0
        self._began = time.perf_counter()

    @property
    def size(self) -> int:
        """k"""
        return int(self.target.dimension)

    @property
    def points(self) -> int:
        """From how many points of the prior modes are searched."""
        return int(getattr(self.target, "points", POINTS))

    @property
    def seconds(self) -> float:
        """Since the problem was made."""
        return time.perf_counter() - self._began

    def terms(self, x: Array) -> tuple[Array, Array]:
        """(log prior, log likelihood) of x (B, k), (B,) each; both -inf where either is.

        Raises `SettingsError` if the target returns another shape, nan or +inf.
        """
        self.evaluations += len(x)
        if hasattr(self.target, "evaluate"):
            both = self.target.evaluate(x)
            log_prior, log_likelihood = _checked("log_prior", both.log_prior, x), both.log_likelihood
            log_likelihood = np.where(log_prior > -np.inf, log_likelihood, -np.inf)
        else:
            log_prior = _checked("log_prior", self.target.log_prior(x), x)
            inside = log_prior > -np.inf
            log_likelihood = np.full(len(x), -np.inf)
            if np.any(inside):
                log_likelihood[inside] = _checked("log_likelihood", self.target.log_likelihood(x[inside]), x[inside])
        log_likelihood = _checked("log_likelihood", log_likelihood, x)
        return np.where(log_likelihood > -np.inf, log_prior, -np.inf), log_likelihood

    def log_posterior(self, x: Array) -> Array:
        """The sum of the two terms, (B,)."""
        log_prior, log_likelihood = self.terms(x)
        return log_prior + log_likelihood

    def from_cube(self, u: Array) -> tuple[Array, Array]:
        """x (B, k) of u (B, k), and the log likelihood there (B,)."""
        x = np.asarray(self.target.prior_transform(u), dtype=float)
        if x.shape != u.shape:
            raise SettingsError(f"prior_transform gives the shape {x.shape}, and {u.shape} was asked for")
        return x, self.terms(x)[1]

    def prior_draws(self, rng: np.random.Generator, count: int, most: int = 2_000_000) -> PriorDraws:
        """At least ``count`` prior draws where neither prior nor likelihood is zero, and the part of the prior there.

        Raises `SettingsError` if ``most`` draws do not hold as many.
        """
        found: list[tuple[Array, Array, Array]] = []
        tried = good = 0
        while good < count:
            if tried >= most or (tried >= HOPELESS and good == 0):
                raise SettingsError(
                    f"prior and likelihood are both positive at only {good} of {tried} draws of the prior",
                    remedy="choose a prior from which the data can be reached",
                )
            u = rng.random((min(count, 2048), self.size))
            x, log_likelihood = self.from_cube(u)
            keep = log_likelihood > -np.inf
            found.append((u[keep], x[keep], log_likelihood[keep]))
            tried += len(u)
            good += int(np.sum(keep))
        u, x, log_likelihood = (np.concatenate(parts) for parts in zip(*found, strict=True))
        return PriorDraws(u, x, log_likelihood, good / tried, float(np.sqrt((1 - good / tried) / good)))


@dataclass(frozen=True, eq=False)
class PriorDraws:
    """Draws where likelihood and prior are positive: u, x (M, k), log likelihood (M,); the prior's ``part`` there, and
    the standard error of its logarithm.
    """

    u: Array
    x: Array
    log_likelihood: Array
    part: float
    log_part_sd: float


def _checked(name: str, values: Array, x: Array) -> Array:
    values = np.asarray(values, dtype=float)
    if values.shape != (len(x),):
        raise SettingsError(f"{name} gives the shape {values.shape}, and ({len(x)},) was asked for")
    bad = np.isnan(values) | (values == np.inf)
    if np.any(bad):
        where = np.array2string(x[int(np.argmax(bad))], precision=4)
        raise SettingsError(f"{name} is {values[int(np.argmax(bad))]} at x = {where}", remedy="-inf says impossible")
    return values
