"""Coordinates in which every prior is about standard normal: what searches step in, and evidence is computed in."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.special import ndtr, ndtri

from bayesmembrane.data.measurement import Measurement
from bayesmembrane.diagnosis.thresholds import SIZES
from bayesmembrane.ground.parameters import Array, HalfNormal, LogNormal, Normal, Parameter, Prior, Uniform
from bayesmembrane.physics.effects.base import Effect, EffectParameter
from bayesmembrane.physics.hypothesis import Hypothesis
from bayesmembrane.physics.reach import SHORTEST, reach_of

FAR = 1e4
"""Times the expected size: what a Cauchy prior has beyond is nothing."""
EDGE = 1e-9
"""Of a probability: as near to 0 or 1 a quantile is taken, so that it is a number."""


@dataclass(frozen=True)
class Size:
    """The size of an effect: z = (x - null) / scale with a Cauchy prior, cut to one side where physics allows one.

    The expected size is a rough guess: one several times larger that fits must not lose to a smaller one that does not.
    """

    null: float
    scale: float
    one_sided: bool
    bounds: tuple[float, float]
    heavy = True

    def to_x(self, u: Array) -> Array:
        return self.null + self.scale * u

    def to_u(self, x: Array) -> Array:
        return np.asarray((x - self.null) / self.scale)

    def slope(self, u: Array) -> Array:
        return np.full_like(u, self.scale)


@dataclass(frozen=True)
class Shape:
    """Any other coordinate: u with a standard normal prior, cut at zero for a half-normal one.

    A log-normal one in its logarithm; one of another prior by its probability, u = Phi^-1(P(x)).
    """

    prior: Prior
    bounds: tuple[float, float]
    heavy = False

    @property
    def one_sided(self) -> bool:
        return isinstance(self.prior, HalfNormal)

    def to_x(self, u: Array) -> Array:
        match self.prior:
            case Normal(mean, sd):
                return mean + sd * u
            case LogNormal(median, spread):
                return np.asarray(median * np.exp(spread * u))
            case HalfNormal(scale, origin):
                return origin + scale * u
            case Uniform(low, high):
                return np.asarray(low + (high - low) * ndtr(u))
        return self.prior.quantile(ndtr(u))

    def to_u(self, x: Array) -> Array:
        match self.prior:
            case Normal(mean, sd):
                return np.asarray((x - mean) / sd)
            case LogNormal(median, spread):
                with np.errstate(divide="ignore"):  # a bound at zero is far away
                    return np.asarray(np.log(x / median) / spread)
            case HalfNormal(scale, origin):
                return np.asarray((x - origin) / scale)
            case Uniform(low, high):
                return np.asarray(ndtri(np.clip((x - low) / (high - low), EDGE, 1 - EDGE)))
        return np.asarray(ndtri(np.clip(self.prior.cdf(x), EDGE, 1 - EDGE)))

    def slope(self, u: Array) -> Array:
        """dx / du."""
        match self.prior:
            case Normal(_, sd):
                return np.full_like(u, sd)
            case LogNormal(_, spread):
                return np.asarray(spread * self.to_x(u))
            case HalfNormal(scale, _):
                return np.full_like(u, scale)
            case Uniform(low, high):
                return np.asarray((high - low) * np.exp(-0.5 * u * u) / np.sqrt(2 * np.pi))
        h = 1e-4
        return np.asarray((self.to_x(u + h) - self.to_x(u - h)) / (2 * h))


@dataclass(frozen=True)
class Standard:
    """The coordinates of one hypothesis (k,), for one measurement: x, as parameters declare them, and u.

    Sizes that are lengths or forces count in parts of what the test reached: 20 mm of travel and 200 have other slips.
    """

    axes: tuple[Size | Shape, ...]

    @cached_property
    def bounds(self) -> tuple[Array, Array]:
        """(k,), (k,) of u."""
        with np.errstate(divide="ignore"):
            ends = [[float(a.to_u(np.asarray(b, dtype=float))) for b in a.bounds] for a in self.axes]
        low, high = np.array(ends).T
        most = np.where(self.heavy, np.inf, 8.0)
        return np.maximum(low, -most), np.minimum(high, most)

    @cached_property
    def ends(self) -> tuple[Array, Array]:
        """(k,), (k,) of u: its bounds, and no less than zero where the prior has one side."""
        low, high = self.bounds
        return np.where(self.one_sided, 0.0, low), high

    @cached_property
    def heavy(self) -> Array:
        """(k,) True for sizes, whose prior is Cauchy's."""
        return np.array([a.heavy for a in self.axes])

    @cached_property
    def one_sided(self) -> Array:
        """(k,) True where u may not be negative."""
        return np.array([a.one_sided for a in self.axes])

    def to_x(self, u: Array) -> Array:
        return np.stack([a.to_x(u[..., i]) for i, a in enumerate(self.axes)], axis=-1)

    def to_u(self, x: Array) -> Array:
        with np.errstate(divide="ignore"):
            u = np.stack([a.to_u(x[..., i]) for i, a in enumerate(self.axes)], axis=-1)
        return np.clip(u, *self.bounds)

    def slope(self, u: Array) -> Array:
        """dx / du, the shape of u."""
        return np.stack([a.slope(u[..., i]) for i, a in enumerate(self.axes)], axis=-1)

    def pull(self, u: Array) -> tuple[Array, Array]:
        """(p, dp/du) with p^2 / 2 = -ln prior density + const, for u (..., k)."""
        square = np.log1p(u * u)
        root = np.sign(u) * np.sqrt(2 * square)
        with np.errstate(invalid="ignore", divide="ignore"):
            steep = np.where(np.abs(u) > 1e-6, 2 * u / ((1 + u * u) * root), np.sqrt(2.0))
        return np.where(self.heavy, root, u), np.where(self.heavy, steep, 1.0)

    def local(self, u: Array) -> Array:
        """(k,) standard deviations s of normal priors about 0 that stand for the priors near u (k,).

        For a Cauchy density s^2 = (1 + u^2) / 2, which has its slope at u.
        """
        return np.where(self.heavy, np.sqrt(0.5 * (1 + u * u)), 1.0)

    def log_prior(self, u: Array) -> Array:
        """ln p of u (..., k) within the bounds: Cauchy's of sizes, normal of others, doubled where it has one side."""
        low, high = self.ends
        within = np.where(self.heavy, np.arctan(np.minimum(high, FAR)) - np.arctan(np.maximum(low, -FAR)), np.pi)
        normal = 0.5 * np.log(2 * np.pi) - np.log(2.0) * np.where(self.heavy, 0.0, self.one_sided)
        each = np.where(self.heavy, -np.log1p(u * u) - np.log(within), -0.5 * u * u - normal)
        return np.asarray(np.sum(each, axis=-1))

    def log_replaced(self, u: Array, mean: Array, variance: Array) -> float:
        """ln Z with the priors less ln Z with the normal ones of `local`, posterior ``mean`` and ``variance`` (k,).

        Of a Cauchy prior p, the integral of p L over that of N(0, s^2) L along its coordinate, with the likelihood
        L ~ N(mean, variance) / N(0, s^2), and p normalised within its bounds; of a half-normal one 2, for it is normal
        on its side.
        """
        s = self.local(u)
        out = np.log(2.0) * float(np.sum(self.one_sided))
        for i in np.flatnonzero(self.heavy):
            low = 0.0 if self.one_sided[i] else max(float(self.bounds[0][i]), -FAR)
            grid = _grid(float(mean[i]), float(np.sqrt(variance[i])), low, min(float(self.bounds[1][i]), FAR))
            precision = max(1 / float(variance[i]) - 1 / float(s[i]) ** 2, 0.0)
            middle = float(mean[i] / variance[i]) / precision if precision > 0 else 0.0
            log_likelihood = -0.5 * precision * (grid - middle) ** 2
            log_likelihood -= np.max(log_likelihood)
            within = float(np.arctan(grid[-1]) - np.arctan(grid[0])) * (2 if self.one_sided[i] else 1)
            cauchy = 1 / (within * (1 + grid**2))
            normal = np.exp(-0.5 * (grid / s[i]) ** 2) / (s[i] * np.sqrt(2 * np.pi))
            top, bottom = (float(np.trapezoid(p * np.exp(log_likelihood), grid)) for p in (cauchy, normal))
            if top > 0 and bottom > 0:
                out += float(np.log(top / bottom))
        return float(out)


def _grid(mean: float, sd: float, low: float, high: float) -> Array:
    """Points from ``low`` to ``high``, close about the mean of what is integrated and about zero, where priors peak."""
    near = mean + sd * np.linspace(-9.0, 9.0, 181)
    wide = np.sinh(np.linspace(np.arcsinh(low), np.arcsinh(high), 181))
    return np.unique(np.clip(np.concatenate([near, wide, [low, high]]), low, high))


def standard(hypothesis: Hypothesis, measurement: Measurement) -> Standard:
    """Of the coordinates of ``hypothesis`` that shape the curve."""
    sizes = size_scales(measurement)
    return Standard(tuple(_axis(p, sizes) for p in hypothesis.parameters[: hypothesis.curve_size]))


def expected_size(effect: Effect, measurement: Measurement) -> float:
    """The size of an effect that is expected before the data, in the unit of that parameter."""
    return float(_axis(effect.size, size_scales(measurement)).slope(np.zeros(1))[0])


def size_scales(measurement: Measurement) -> dict[str, tuple[float, float]]:
    """{SI unit: (size that is expected before the data, largest that is looked for)} of sizes that are no pure numbers.

    What grows with time is counted until the first leg ends, and may have slowed down a lot by the end of the test.
    """
    reach = reach_of(measurement)
    scales = {unit: SIZES.part * size for unit, size in reach.by_unit.items()}
    sooner = min(reach.duration / max(measurement.path.first_turn, SHORTEST), SIZES.first_legs)
    most = {"N": SIZES.largest_force, "N/s": SIZES.largest_force * sooner}
    return {unit: (scale, most.get(unit, SIZES.largest) * scale) for unit, scale in scales.items()}


def _axis(p: Parameter, sizes: dict[str, tuple[float, float]]) -> Size | Shape:
    if not isinstance(p, EffectParameter) or p.null is None:
        return Shape(p.prior, p.bounds)
    if p.unit not in sizes:
        return Size(p.null, p.scale, p.one_sided, p.bounds)
    scale, largest = sizes[p.unit]
    low = p.null if p.one_sided and p.bounds[0] == p.null else p.null - largest
    high = p.null if p.one_sided and p.bounds[1] == p.null else p.null + largest
    return Size(p.null, scale, p.one_sided, (low, high))
