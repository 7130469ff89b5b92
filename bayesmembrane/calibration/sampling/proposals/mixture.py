"""A mixture of t-distributions fitted to draws: the normalised density that a posterior is bridged to."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.cluster.vq import kmeans2
from scipy.special import gammaln

from bayesmembrane.calibration.sampling.proposals.bend import Bend
from bayesmembrane.calibration.sampling.proposals.maximising import maximised
from bayesmembrane.ground.parameters import Array
from bayesmembrane.ground.symmetric import eigh

COUNTS = (1, 2, 4, 7, 11, 16, 24)
DEGREES = (4, 10, 50)
ROUNDS, ENOUGH = 60, 1e-4  # of expectation maximisation: a round that gains less ln density a draw is the last
ROUGH = 1e-3  # the same of a fit that is only to be judged, by gains ten times as large
SAME = 1e-14  # of a coordinate: what differs by less is the same but for round-off
PER_COMPONENT = 6  # draws for each free number
GAIN = 0.01  # of held-out ln density a draw, for which twice the components are worth it


@dataclass(frozen=True, eq=False)
class Mixture:
    """g(x) = sum_j w_j t(x; m_j, R_j R_j^T, nu).

    log_weights (K,), means (K, k), roots (K, k, k) lower triangular, degrees nu of freedom
    bend : x are coordinates u of this one; None if they are none such. Nothing else is done with it here
    """

    log_weights: Array
    means: Array
    roots: Array
    degrees: float
    bend: Bend | None = None

    def log_density(self, x: Array) -> Array:
        """ln g of x (B, k), shape (B,)."""
        return _summed(self.parts(x).T)[1]

    def parts(self, x: Array) -> Array:
        """ln w_j t_j of x (B, k), shape (B, K)."""
        return (self._log_t(self.distance(x)) + self.log_weights[:, None]).T

    def distance(self, x: Array) -> Array:
        """Squared Mahalanobis distances (K, B) of x (B, k)."""
        z = np.linalg.inv(self.roots) @ (x.T - self.means[:, :, None])
        return np.asarray(np.einsum("jib,jib->jb", z, z))

    def broader(self, times: float, degrees: float) -> Mixture:
        """The same about the same places, so many times as wide, with other degrees of freedom, and without a bend."""
        return Mixture(self.log_weights, self.means, times * self.roots, degrees)

    def draw(self, rng: np.random.Generator, count: int) -> Array:
        """Independent draws (count, k)."""
        w = np.exp(self.log_weights)
        which = rng.choice(len(w), size=count, p=w / np.sum(w))
        z = rng.standard_normal((count, self.means.shape[1]))
        z *= np.sqrt(self.degrees / rng.chisquare(self.degrees, (count, 1)))
        return np.asarray(self.means[which] + np.einsum("bij,bj->bi", self.roots[which], z))

    def _log_t(self, distance: Array) -> Array:
        nu, k = self.degrees, self.means.shape[1]
        log_det = np.sum(np.log(np.diagonal(self.roots, axis1=1, axis2=2)), axis=1)
        norm = gammaln(0.5 * (nu + k)) - gammaln(0.5 * nu) - 0.5 * k * np.log(np.pi * nu)
        # Not log1p, which takes ten times as long: nothing hangs on the digits that are lost close to a centre.
        return np.asarray((norm - log_det)[:, None] - 0.5 * (nu + k) * np.log(1 + distance / nu))


def fit_mixture(x: Array, rng: np.random.Generator) -> Mixture:
    """The mixture for draws x (n, k), with as many components and degrees of freedom as held-out draws ask for.

    Expectation maximisation in whitened coordinates (`maximised`); a third of the draws judges, then all of them are
    used.
    """
    centre, root = _whitening(x)
    z = np.asarray(np.linalg.solve(root, (x - centre).T).T, dtype=float)
    test = np.arange(len(z)) % 3 == 2
    best = (-np.inf, 1, DEGREES[1])
    free = z.shape[1] * (z.shape[1] + 3) // 2
    for count in COUNTS:
        if count > 1 and count * free * PER_COMPONENT > len(z):
            break
        score = _score(z, test, count, DEGREES[1], rng)
        if score > best[0] + GAIN:
            best = (score, count, DEGREES[1])
        elif count >= 4 * best[1]:
            break
    scores = [(best[0] if nu == best[2] else _score(z, test, best[1], nu, rng), nu) for nu in DEGREES]
    fitted = _maximise(z, best[1], max(scores)[1], rng)
    return Mixture(
        fitted.log_weights,
        centre + fitted.means @ root.T,
        np.linalg.cholesky(np.einsum("ij,kjl,knl,mn->kim", root, fitted.roots, fitted.roots, root)),
        fitted.degrees,
    )


def reweighted(g: Mixture, x: Array, weights: Array) -> Mixture:
    """The mixture with component weights w_j = sum_b weights_b P(j | x_b), for weighted draws x (B, k).

    O. Cappé et al., Stat. Comput. 18 (2008) 447. No component falls below a hundredth of its weight.
    """
    share, _ = _summed(g.parts(x).T)
    w = share @ weights / np.sum(weights)
    w = np.maximum(w, 0.01 * np.exp(g.log_weights))
    return replace(g, log_weights=np.log(w / np.sum(w)))


def widened(g: Mixture, x: Array, share: float = 0.1, factor: float = 2.0) -> Mixture:
    """(1 - share) g + share t(mean, factor^2 covariance) of draws x (n, k): tails where few draws have been."""
    centre, root = _whitening(x)
    scatter = np.linalg.cholesky(root @ root.T)
    weights = np.append(g.log_weights + np.log1p(-share), np.log(share))
    roots = np.concatenate([g.roots, factor * scatter[None]])
    return Mixture(weights, np.vstack([g.means, centre]), roots, min(g.degrees, 10.0), g.bend)


def around(x: Array, rng: np.random.Generator) -> Mixture:
    """`widened` mixture for draws x (n, k) some of which may be the same."""
    return widened(fit_mixture(x + 1e-3 * np.std(x, axis=0) * rng.standard_normal(x.shape), rng), x)


def _summed(parts: Array) -> tuple[Array, Array]:
    """Shares (K, B) and ln of the sum (B,) of what has the logarithms ``parts`` (K, B)."""
    top = np.max(parts, axis=0)
    share = np.exp(parts - top)
    total = np.sum(share, axis=0)
    share /= total
    return share, np.asarray(top + np.log(total))


def _whitening(x: Array) -> tuple[Array, Array]:
    """(mean (k,), root R (k, k)) with R R^T the covariance of x (n, k); raises `LinAlgError` where all are the same."""
    scale = np.std(x, axis=0)
    if not np.all(scale > SAME * np.max(np.abs(x), axis=0)):
        raise np.linalg.LinAlgError("the draws do not differ")
    values, vectors = eigh(np.atleast_2d(np.cov((x / scale).T)))
    root = scale[:, None] * vectors * np.sqrt(np.maximum(values, 1e-14))
    return np.mean(x, axis=0), root


def _score(z: Array, test: NDArray[np.bool_], count: int, degrees: int, rng: np.random.Generator) -> float:
    """Mean held-out ln density of a fit to the others."""
    return float(np.mean(_maximise(z[~test], count, degrees, rng, ROUGH).log_density(z[test])))


def _maximise(z: Array, count: int, degrees: int, rng: np.random.Generator, enough: float = ENOUGH) -> Mixture:
    """Expectation maximisation from k-means."""
    _, label = kmeans2(z, count, minit="++", rng=rng) if count > 1 else (z, np.zeros(len(z), dtype=int))
    share = np.full((count, len(z)), 0.1 / count)
    share[label, np.arange(len(z))] += 0.9
    weights, means, roots = maximised(np.ascontiguousarray(z.T), share, degrees, ROUNDS, enough)
    return Mixture(np.log(weights), means, roots, float(degrees))
