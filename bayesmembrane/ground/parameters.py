"""Parameters (name, unit, meaning) and the proper priors that stand on them."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import erf, erfinv, log_ndtr, ndtr, ndtri

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Prior(ABC):
    """A proper, normalised density of one real coordinate.

    Its distribution is one of SciPy's. What is asked for all the time is written out, by the same formulas and from the
    same random numbers: `scipy.stats` takes a second to import, 3 ms to make a distribution and 50 us a call.
    """

    TOLD: ClassVar[tuple[float, float]] = (-35.0, 35.0)
    """Scores between which a double tells values apart: at an end of the support they are one beyond 7.5."""

    @abstractmethod
    def distribution(self) -> Any:
        """The frozen ``scipy.stats`` distribution."""

    @abstractmethod
    def log_density(self, x: ArrayLike) -> Array:
        """ln p(x), shape of ``x``; -inf outside the support."""

    @abstractmethod
    def quantile(self, u: ArrayLike) -> Array:
        """The x with P(X <= x) = u, for u in [0, 1]; shape of ``u``."""

    @abstractmethod
    def cdf(self, x: ArrayLike) -> Array:
        """P(X <= x), shape of ``x``."""

    def draw(self, rng: np.random.Generator, size: int | tuple[int, ...]) -> Array:
        """Independent draws, shape ``size``."""
        return self.quantile(rng.uniform(size=size))

    @abstractmethod
    def scores(self, x: ArrayLike) -> Array:
        """z with P(Z <= z) = P(X <= x), Z ~ N(0, 1); shape of ``x``. Infinite at the ends of the support."""

    @abstractmethod
    def from_scores(self, z: ArrayLike) -> Array:
        """x, the inverse of `scores`; shape of ``z``."""

    @property
    @abstractmethod
    def mean_sd(self) -> tuple[float, float]:
        """Mean and standard deviation."""

    @abstractmethod
    def times(self, factor: float) -> Self:
        """That of ``factor`` X, with ``factor`` > 0."""

    @property
    def support(self) -> tuple[float, float]:
        """The ends of where the density is positive."""
        low, high = self.quantile([0.0, 1.0])
        return float(low), float(high)


def _stats() -> Any:
    """``scipy.stats``, on demand."""
    from scipy import stats

    return stats


@dataclass(frozen=True)
class Normal(Prior):
    """N(mean, sd^2)."""

    mean: float
    sd: float

    def distribution(self) -> Any:
        return _stats().norm(self.mean, self.sd)

    def log_density(self, x: ArrayLike) -> Array:
        z = (np.asarray(x, dtype=float) - self.mean) / self.sd
        return np.asarray(-0.5 * z * z - np.log(self.sd * np.sqrt(2 * np.pi)))

    def quantile(self, u: ArrayLike) -> Array:
        return np.asarray(self.mean + self.sd * ndtri(np.asarray(u, dtype=float)))

    def cdf(self, x: ArrayLike) -> Array:
        return np.asarray(ndtr((np.asarray(x, dtype=float) - self.mean) / self.sd))

    def scores(self, x: ArrayLike) -> Array:
        return np.asarray((np.asarray(x, dtype=float) - self.mean) / self.sd)

    def from_scores(self, z: ArrayLike) -> Array:
        return np.asarray(self.mean + self.sd * np.asarray(z, dtype=float))

    def draw(self, rng: np.random.Generator, size: int | tuple[int, ...]) -> Array:
        return self.mean + self.sd * rng.standard_normal(size)

    @property
    def mean_sd(self) -> tuple[float, float]:
        return self.mean, self.sd

    def times(self, factor: float) -> Self:
        return replace(self, mean=factor * self.mean, sd=factor * self.sd)

    def __str__(self) -> str:
        return f"normal, mean {self.mean:g}, sd {self.sd:g}"


@dataclass(frozen=True)
class Uniform(Prior):
    """Constant on [low, high], zero elsewhere."""

    TOLD = (-7.5, 7.5)

    low: float
    high: float

    def distribution(self) -> Any:
        return _stats().uniform(self.low, self.high - self.low)

    def log_density(self, x: ArrayLike) -> Array:
        x = np.asarray(x, dtype=float)
        inside = (x >= self.low) & (x <= self.high)
        return np.where(inside, -np.log(self.high - self.low), -np.inf)

    def quantile(self, u: ArrayLike) -> Array:
        return np.asarray(self.low + (self.high - self.low) * np.asarray(u, dtype=float))

    def cdf(self, x: ArrayLike) -> Array:
        return np.clip((np.asarray(x, dtype=float) - self.low) / (self.high - self.low), 0.0, 1.0)

    def scores(self, x: ArrayLike) -> Array:
        above = (self.high - np.asarray(x, dtype=float)) / (self.high - self.low)
        return _scores(self.cdf(x), np.clip(above, 0.0, 1.0))

    def from_scores(self, z: ArrayLike) -> Array:
        z, width = np.asarray(z, dtype=float), self.high - self.low
        return np.where(z < 0, self.low + width * ndtr(z), self.high - width * ndtr(-z))

    @property
    def mean_sd(self) -> tuple[float, float]:
        return (self.low + self.high) / 2, (self.high - self.low) / math.sqrt(12)

    def times(self, factor: float) -> Self:
        return replace(self, low=factor * self.low, high=factor * self.high)

    def __str__(self) -> str:
        return f"uniform on [{self.low:g}, {self.high:g}]"


@dataclass(frozen=True)
class HalfNormal(Prior):
    """|z| scale + origin with z ~ N(0, 1): of what can only lie above ``origin``."""

    scale: float
    origin: float = 0.0

    TOLD = (-7.5, 35.0)

    def distribution(self) -> Any:
        return _stats().halfnorm(self.origin, self.scale)

    def log_density(self, x: ArrayLike) -> Array:
        z = (np.asarray(x, dtype=float) - self.origin) / self.scale
        return np.where(z >= 0, -0.5 * z * z - np.log(self.scale * np.sqrt(np.pi / 2)), -np.inf)

    def quantile(self, u: ArrayLike) -> Array:
        return np.asarray(self.origin + self.scale * ndtri((1 + np.asarray(u, dtype=float)) / 2))

    def cdf(self, x: ArrayLike) -> Array:
        return np.asarray(erf(np.maximum(np.asarray(x, dtype=float) - self.origin, 0.0) / self.scale / math.sqrt(2)))

    def scores(self, x: ArrayLike) -> Array:
        above = 2 * ndtr((self.origin - np.asarray(x, dtype=float)) / self.scale)
        return _scores(self.cdf(x), np.minimum(above, 1.0))

    def from_scores(self, z: ArrayLike) -> Array:
        z = np.asarray(z, dtype=float)
        low = math.sqrt(2) * erfinv(ndtr(np.minimum(z, 0.0)))
        return np.asarray(self.origin + self.scale * np.where(z < 0, low, -ndtri(ndtr(-np.maximum(z, 0.0)) / 2)))

    def draw(self, rng: np.random.Generator, size: int | tuple[int, ...]) -> Array:
        return np.asarray(self.origin + self.scale * np.abs(rng.standard_normal(size)))

    @property
    def mean_sd(self) -> tuple[float, float]:
        return self.origin + self.scale * math.sqrt(2 / math.pi), self.scale * math.sqrt(1 - 2 / math.pi)

    def times(self, factor: float) -> Self:
        return replace(self, scale=factor * self.scale, origin=factor * self.origin)

    def __str__(self) -> str:
        start = f", from {self.origin:g} on" if self.origin else ""
        return f"half-normal, scale {self.scale:g}{start}"


@dataclass(frozen=True)
class Lomax(Prior):
    """3 / scale (1 + x / scale)^-4 for x >= 0: of what can only be positive, and may be many times what is expected.

    Its mean is half of ``scale``, its root mean square ``scale`` itself. K. S. Lomax, J. Am. Stat. Assoc. 49 (1954)
    847.
    """

    scale: float

    TOLD = (-7.5, 35.0)

    def distribution(self) -> Any:
        return _stats().lomax(3.0, scale=self.scale)

    def log_density(self, x: ArrayLike) -> Array:
        z = np.asarray(x, dtype=float) / self.scale
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.where(z >= 0, -4 * np.log1p(z) + np.log(3.0 / self.scale), -np.inf)

    def quantile(self, u: ArrayLike) -> Array:
        with np.errstate(divide="ignore"):  # there is no largest value
            return np.asarray(self.scale * np.expm1(-np.log1p(-np.asarray(u, dtype=float)) / 3))

    def cdf(self, x: ArrayLike) -> Array:
        return np.asarray(-np.expm1(-3 * np.log1p(np.maximum(np.asarray(x, dtype=float), 0.0) / self.scale)))

    def scores(self, x: ArrayLike) -> Array:
        above = (1 + np.maximum(np.asarray(x, dtype=float), 0.0) / self.scale) ** -3.0
        return _scores(self.cdf(x), above)

    def from_scores(self, z: ArrayLike) -> Array:
        return np.asarray(self.scale * np.expm1(-log_ndtr(-np.asarray(z, dtype=float)) / 3))

    @property
    def mean_sd(self) -> tuple[float, float]:
        return self.scale / 2, self.scale * math.sqrt(3) / 2

    def times(self, factor: float) -> Self:
        return replace(self, scale=factor * self.scale)

    def __str__(self) -> str:
        return f"Lomax of index 3, scale {self.scale:g}"


@dataclass(frozen=True)
class LogNormal(Prior):
    """median exp(spread z) with z ~ N(0, 1): of what is positive and known to a factor exp(spread)."""

    median: float
    spread: float

    def distribution(self) -> Any:
        return _stats().lognorm(self.spread, scale=self.median)

    def log_density(self, x: ArrayLike) -> Array:
        x = np.asarray(x, dtype=float)
        with np.errstate(divide="ignore", invalid="ignore"):
            z = np.log(x / self.median) / self.spread
            value = -0.5 * z * z - np.log(x * self.spread * np.sqrt(2 * np.pi))
        return np.where(x > 0, value, -np.inf)

    def quantile(self, u: ArrayLike) -> Array:
        return np.asarray(self.median * np.exp(self.spread * ndtri(np.asarray(u, dtype=float))))

    def cdf(self, x: ArrayLike) -> Array:
        with np.errstate(divide="ignore"):  # nothing lies below zero
            return np.asarray(ndtr(np.log(np.maximum(np.asarray(x, dtype=float), 0.0) / self.median) / self.spread))

    def scores(self, x: ArrayLike) -> Array:
        with np.errstate(divide="ignore"):
            return np.asarray(np.log(np.maximum(np.asarray(x, dtype=float), 0.0) / self.median) / self.spread)

    def from_scores(self, z: ArrayLike) -> Array:
        return np.asarray(self.median * np.exp(self.spread * np.asarray(z, dtype=float)))

    def draw(self, rng: np.random.Generator, size: int | tuple[int, ...]) -> Array:
        return np.asarray(self.median * np.exp(self.spread * rng.standard_normal(size)))

    @property
    def mean_sd(self) -> tuple[float, float]:
        mean = self.median * math.exp(self.spread**2 / 2)
        return mean, mean * math.sqrt(math.expm1(self.spread**2))

    def times(self, factor: float) -> Self:
        return replace(self, median=factor * self.median)

    def __str__(self) -> str:
        return f"log-normal, median {self.median:g}, within a factor {np.exp(self.spread):.3g}"


def _scores(below: Array, above: Array) -> Array:
    """Of the probabilities on both sides, from the smaller one: it has all digits."""
    return np.where(below < above, ndtri(below), -ndtri(above))


@dataclass(frozen=True)
class Parameter:
    """One coordinate: what it is called, its unit, what it means, and its prior.

    ``bounds`` are what an optimiser searches: wide, physical, and not a statement of belief; the prior is that.
    """

    name: str
    unit: str
    meaning: str
    prior: Prior
    bounds: tuple[float, float] = field(default=(-np.inf, np.inf))


@dataclass(frozen=True)
class Natural:
    """A parameter as users read it: name, unit ("-" for a pure number), and what it means in a few words."""

    name: str
    unit: str
    meaning: str
