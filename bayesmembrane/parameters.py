"""Parameters (name, unit, meaning) and the proper priors that stand on them."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import stats

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
        return np.asarray(self.distribution().ppf(u), dtype=float)

    def draw(self, rng: np.random.Generator, size: int | tuple[int, ...]) -> Array:
        """Independent draws, shape ``size``."""
        return np.asarray(self.distribution().rvs(size=size, random_state=rng), dtype=float)


@dataclass(frozen=True)
class Normal(Prior):
    """N(mean, sd^2)."""

    mean: float
    sd: float

    def distribution(self) -> Any:
        return stats.norm(self.mean, self.sd)

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
        return stats.uniform(self.low, self.high - self.low)

    def log_density(self, x: ArrayLike) -> Array:
        x = np.asarray(x, dtype=float)
        inside = (x >= self.low) & (x <= self.high)
        return np.where(inside, -np.log(self.high - self.low), -np.inf)

    def __str__(self) -> str:
        return f"uniform on [{self.low:g}, {self.high:g}]"


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
