"""Problems whose evidence is known in closed form or by quadrature, with what the estimators ask for."""

from __future__ import annotations

import numpy as np
from scipy import integrate, stats
from scipy.special import gammaln, logsumexp, ndtr, ndtri

Array = np.ndarray


class Box:
    """Uniform prior on [low, high]^k."""

    def __init__(self, dimension: int, low: float, high: float) -> None:
        self.dimension, self.low, self.high = dimension, low, high
        self.log_volume = dimension * np.log(high - low)

    def log_prior(self, x: Array) -> Array:
        return np.where(np.all((x >= self.low) & (x <= self.high), axis=1), -self.log_volume, -np.inf)

    def prior_transform(self, u: Array) -> Array:
        return self.low + (self.high - self.low) * u


class Linear:
    """x ~ N(0, I), y = A x + e with e ~ N(0, I): ln Z = ln N(y; 0, A A^T + I). ``scales`` are those of A^-1."""

    def __init__(self, scales: Array, seed: int = 1) -> None:
        rng = np.random.default_rng(seed)
        self.dimension = len(scales)
        q = np.linalg.qr(rng.standard_normal((self.dimension, self.dimension)))[0]
        self.a = (q / np.asarray(scales)).T
        self.y = self.a @ (0.5 * rng.standard_normal(self.dimension))
        cov = self.a @ self.a.T + np.eye(self.dimension)
        self.exact = stats.multivariate_normal.logpdf(self.y, np.zeros(self.dimension), cov)

    def log_prior(self, x: Array) -> Array:
        return np.sum(stats.norm.logpdf(x), axis=1)

    def prior_transform(self, u: Array) -> Array:
        return ndtri(u)

    def log_likelihood(self, x: Array) -> Array:
        return np.sum(stats.norm.logpdf(self.y - x @ self.a.T), axis=1)


class NormalGamma:
    """y_i ~ N(mu, 1/t), mu | t ~ N(m, 1 / (kappa t)), t ~ Gamma(a, b), in the coordinates mu and ln t.

    ln Z = ln Gamma(a_n) - ln Gamma(a) + a ln b - a_n ln b_n + ln(kappa / kappa_n) / 2 - n ln(2 pi) / 2
    (K. P. Murphy, Conjugate Bayesian analysis of the Gaussian distribution, 2007, eq. 95).
    """

    dimension, m, kappa, a, b = 2, 0.0, 0.1, 2.0, 3.0

    def __init__(self, n: int = 12, seed: int = 3) -> None:
        self.y = np.random.default_rng(seed).normal(1.5, 0.7, n)
        mean, kappa, a = self.y.mean(), self.kappa + n, self.a + n / 2
        b = self.b + 0.5 * np.sum((self.y - mean) ** 2) + self.kappa * n * (mean - self.m) ** 2 / (2 * kappa)
        self.exact = gammaln(a) - gammaln(self.a) + self.a * np.log(self.b) - a * np.log(b)
        self.exact += 0.5 * np.log(self.kappa / kappa) - 0.5 * n * np.log(2 * np.pi)

    def log_prior(self, x: Array) -> Array:
        t = np.exp(x[:, 1])
        location = stats.norm.logpdf(x[:, 0], self.m, 1 / np.sqrt(self.kappa * t))
        return location + stats.gamma.logpdf(t, self.a, scale=1 / self.b) + x[:, 1]

    def prior_transform(self, u: Array) -> Array:
        t = stats.gamma.ppf(u[:, 1], self.a, scale=1 / self.b)
        return np.stack([self.m + ndtri(u[:, 0]) / np.sqrt(self.kappa * t), np.log(t)], axis=1)

    def log_likelihood(self, x: Array) -> Array:
        return np.sum(stats.norm.logpdf(self.y, x[:, :1], np.exp(-0.5 * x[:, 1:])), axis=1)


class Modes(Box):
    """Two normal modes of unequal weight and width, far apart in a wide box: ln Z = -ln V."""

    def __init__(self, dimension: int, apart: float = 10.0) -> None:
        super().__init__(dimension, -10.0, 10.0)
        self.apart, self.exact = apart, -self.log_volume

    def log_likelihood(self, x: Array) -> Array:
        parts = [
            np.log(w) + np.sum(stats.norm.logpdf(x, m * self.apart / 2, sd), axis=1)
            for w, m, sd in ((0.3, -1, 0.3), (0.7, 1, 0.5))
        ]
        return logsumexp(parts, axis=0)


class Shells(Box):
    """Two thin spherical shells (F. Feroz, M. P. Hobson, M. Bridges, MNRAS 398 (2009) 1601)."""

    def __init__(self, dimension: int, radius: float = 2.0, width: float = 0.1) -> None:
        super().__init__(dimension, -6.0, 6.0)
        self.radius, self.width = radius, width
        surface = np.log(2) + dimension / 2 * np.log(np.pi) - gammaln(dimension / 2)
        thin = integrate.quad(
            lambda t: t ** (dimension - 1) * stats.norm.pdf(t, radius, width), radius - 9 * width, radius + 9 * width
        )[0]
        self.exact = np.log(2) + surface + np.log(thin) - self.log_volume
        self.centre = np.zeros(dimension)
        self.centre[0] = 3.5

    def log_likelihood(self, x: Array) -> Array:
        distance = [np.linalg.norm(x - s * self.centre, axis=1) for s in (-1, 1)]
        return np.logaddexp(*(stats.norm.logpdf(d, self.radius, self.width) for d in distance))


class Banana(Box):
    """x1 ~ N(0, 1), x2 ~ N(x1^2, 0.1^2), others N(0, 1): ln Z = -ln V."""

    def __init__(self, dimension: int) -> None:
        super().__init__(dimension, -12.0, 30.0)
        self.exact = -self.log_volume

    def log_likelihood(self, x: Array) -> Array:
        bent = stats.norm.logpdf(x[:, 0]) + stats.norm.logpdf(x[:, 1], x[:, 0] ** 2, 0.1)
        return bent + np.sum(stats.norm.logpdf(x[:, 2:]), axis=1)


class Tails(Box):
    """Independent t-distributions with two degrees of freedom."""

    def __init__(self, dimension: int) -> None:
        super().__init__(dimension, -20.0, 20.0)
        t = stats.t(2, loc=1, scale=0.2)
        self.exact = dimension * np.log(t.cdf(20) - t.cdf(-20)) - self.log_volume

    def log_likelihood(self, x: Array) -> Array:
        return np.sum(stats.t.logpdf(x, 2, loc=1, scale=0.2), axis=1)


class Funnel(Box):
    """v ~ N(0, 1.5^2), others N(0, e^v) (R. M. Neal, Ann. Stat. 31 (2003) 705), cut by the box."""

    def __init__(self, dimension: int) -> None:
        super().__init__(dimension, -20.0, 20.0)

        def inside(v: float) -> float:
            return float(stats.norm.pdf(v, 0, 1.5) * (2 * ndtr(20 * np.exp(-v / 2)) - 1) ** (dimension - 1))

        self.exact = np.log(integrate.quad(inside, -12, 12, epsabs=1e-12, limit=400)[0]) - self.log_volume

    def log_likelihood(self, x: Array) -> Array:
        wide = np.exp(0.5 * x[:, :1])
        return stats.norm.logpdf(x[:, 0], 0, 1.5) + np.sum(stats.norm.logpdf(x[:, 1:], 0, wide), axis=1)


class Cut:
    """x_i ~ N(0, 1) cut to x_i > 0 and not renormalised, pulled across the edge: y_i = -0.5 = x_i + e, e ~ N(0, 0.4^2).

    The mass that the cut leaves is 2^-k.
    """

    def __init__(self, dimension: int) -> None:
        self.dimension, self.mass = dimension, 0.5**dimension
        variance = 1 / (1 + 1 / 0.4**2)
        mean = variance * -0.5 / 0.4**2
        one = stats.norm.logpdf(-0.5, 0, np.sqrt(1 + 0.4**2)) + np.log(ndtr(mean / np.sqrt(variance)))
        self.exact = dimension * one

    def log_prior(self, x: Array) -> Array:
        return np.where(np.all(x > 0, axis=1), np.sum(stats.norm.logpdf(x), axis=1), -np.inf)

    def prior_transform(self, u: Array) -> Array:
        return ndtri(u)

    def log_likelihood(self, x: Array) -> Array:
        assert np.all(x > 0), "the likelihood is asked only where the prior is not zero"
        return np.sum(stats.norm.logpdf(-0.5, x, 0.4), axis=1)


class Uneven(Box):
    """Two normal modes far apart, the main one in a tiny part of the prior: ln Z = -ln V.

    sd, weight : of the main mode; the other has the rest of the weight and the sd 1
    """

    def __init__(self, dimension: int, sd: float, weight: float = 0.9) -> None:
        super().__init__(dimension, -10.0, 10.0)
        self.sd, self.weight, self.exact = sd, weight, -self.log_volume

    def log_likelihood(self, x: Array) -> Array:
        main = np.log(self.weight) + np.sum(stats.norm.logpdf(x, 4.0, self.sd), axis=1)
        other = np.log1p(-self.weight) + np.sum(stats.norm.logpdf(x, -4.0, 1.0), axis=1)
        return np.logaddexp(main, other)


class SpikeAndSlab(Box):
    """A narrow normal within a wide one, with nearly all of the weight: ln Z = -ln V."""

    def __init__(self, dimension: int, sd: float = 0.1, weight: float = 0.99, beside: float = 0.0) -> None:
        super().__init__(dimension, -10.0, 10.0)
        self.sd, self.weight, self.beside, self.exact = sd, weight, beside, -self.log_volume

    def log_likelihood(self, x: Array) -> Array:
        spike = np.log(self.weight) + np.sum(stats.norm.logpdf(x, self.beside, self.sd), axis=1)
        slab = np.log1p(-self.weight) + np.sum(stats.norm.logpdf(x, 0.0, 1.0), axis=1)
        return np.logaddexp(spike, slab)
