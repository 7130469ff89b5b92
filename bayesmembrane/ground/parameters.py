"""Parameters (name, unit, meaning) and the proper priors that stand on them."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Prior(ABC):
    """A proper, normalised density of one real coordinate.

    Everything a prior is asked for comes from one frozen SciPy distribution: log density for the posterior,
    quantile for nested sampling, draws for prior predictive checks.
    """

    @abstractmethod
    def distribution(self) -> Any:
        """The frozen ``scipy.stats`` distribution."""

    @abstractmethod
    def log_density(self, x: ArrayLike) -> Array:
        """ln p(x), shape of ``x``; -inf outside the support. Written out: SciPy's takes 50 us a call."""

    def quantile(self, u: ArrayLike) -> Array:
        """The x with P(X <= x) = u, for u in [0, 1]; shape of ``u``."""
        return np.asarray(frozen(self).ppf(u), dtype=float)

    def draw(self, rng: np.random.Generator, size: int | tuple[int, ...]) -> Array:
        """Independent draws, shape ``size``."""
        return np.asarray(frozen(self).rvs(size=size, random_state=rng), dtype=float)


def _stats() -> Any:
    """``scipy.stats``, on demand: importing it takes half a second, and a force needs no prior's quantiles."""
    from scipy import stats

    return stats


@lru_cache(maxsize=1024)
def frozen(prior: Prior) -> Any:
    """The distribution of a prior, made once: SciPy takes 3 ms to make one."""
    return prior.distribution()


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

    def __str__(self) -> str:
        return f"normal, mean {self.mean:g}, sd {self.sd:g}"


@dataclass(frozen=True)
class Uniform(Prior):
    """Constant on [low, high], zero elsewhere."""

    low: float
    high: float

    def distribution(self) -> Any:
        return _stats().uniform(self.low, self.high - self.low)

    def log_density(self, x: ArrayLike) -> Array:
        x = np.asarray(x, dtype=float)
        inside = (x >= self.low) & (x <= self.high)
        return np.where(inside, -np.log(self.high - self.low), -np.inf)

    def __str__(self) -> str:
        return f"uniform on [{self.low:g}, {self.high:g}]"


@dataclass(frozen=True)
class HalfNormal(Prior):
    """|z| scale + origin with z ~ N(0, 1): of what can only lie above ``origin``."""

    scale: float
    origin: float = 0.0

    def distribution(self) -> Any:
        return _stats().halfnorm(self.origin, self.scale)

    def log_density(self, x: ArrayLike) -> Array:
        z = (np.asarray(x, dtype=float) - self.origin) / self.scale
        return np.where(z >= 0, -0.5 * z * z - np.log(self.scale * np.sqrt(np.pi / 2)), -np.inf)

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

    def distribution(self) -> Any:
        return _stats().lomax(3.0, scale=self.scale)

    def log_density(self, x: ArrayLike) -> Array:
        z = np.asarray(x, dtype=float) / self.scale
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.where(z >= 0, -4 * np.log1p(z) + np.log(3.0 / self.scale), -np.inf)

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

    def __str__(self) -> str:
        return f"log-normal, median {self.median:g}, within a factor {np.exp(self.spread):.3g}"


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
