"""Where the modes of a posterior are: points that fill the prior evenly, and ascents from those that stand out.

All in the coordinates v in which the prior is N(0, I), whatever it is in x: v = Phi^-1(u) of the unit cube. The density
there is L(x(v)) N(v), so that nothing but the prior transform and the likelihood is asked.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree
from scipy.special import logsumexp, ndtr, ndtri

from bayesmembrane.calibration.sampling.convergence import effective_draws
from bayesmembrane.calibration.sampling.proposals.mixture import Mixture
from bayesmembrane.comparison.evidence.target import Coverage, Problem, smallest
from bayesmembrane.ground.parameters import Array
from bayesmembrane.ground.sobol import scrambled_sobol
from bayesmembrane.ground.symmetric import eigh

NEIGHBOURS = 17  # than all of which a start is higher
FEW, LOOKED_AT = 4, 8192  # dimensions up to which all points are looked at, and how many beyond
STEPS = (1.5, 1.0, 0.3, 0.05, 5e-3, 2e-4)  # tried side by side along each direction
ITERATIONS, DIFFERENCE, LONGEST = 25, 1e-4, 1.0
FARTHEST = 7.5  # of v: Phi has digits there
ROUNDS = 3  # of importance sampling around each mode
CLOUD = 512  # draws that tell others where a mode is
DEGREES, WIDER = 4.0, 1.2
MODES, LEAST = 5, 16.0  # most modes that are kept, and how much less in ln mass than the first they may hold
SHARES = ((128, 8, 32), (16, 128, 256), (4, 256, 1024))  # points for one ascent or draw; least and most of them
SIGMAS, LEAST_GAP, LARGEST_SHARE = 4.0, 0.2, 0.05  # for a mode to count as missed: of ln Z, and of the largest weight


@dataclass(frozen=True, eq=False)
class Modes:
    """What a search has found.

    clouds : draws x (n, k) of the posterior around each mode
    log_masses : ln of the part of Z that is around each
    log_total, sd : ln of their sum by importance sampling, and its standard error: if that is small, Z is no
        smaller
    largest : share of the largest weight in that sum
    """

    clouds: tuple[Array, ...]
    log_masses: tuple[float, ...]
    log_total: float
    sd: float
    coverage: Coverage
    largest: float = 1.0

    @property
    def weights(self) -> Array:
        """Shares of the modes, (M,); none is below a tenth of an equal one."""
        if not self.log_masses:
            return np.empty(0)
        share = np.exp(np.array(self.log_masses) - logsumexp(self.log_masses))
        even = np.maximum(share, 0.1 / share.size)
        return np.asarray(even / np.sum(even))

    def beyond(self, log_evidence: float, sd: float) -> float:
        """By how much ln Z is larger at least than ``log_evidence``, which knows of fewer modes; 0 if it need not be.

        A few standard errors are no proof, and neither is a sum over weights that rest on a few draws.
        """
        gap = self.log_total - log_evidence
        sure = self.largest < LARGEST_SHARE and gap > max(SIGMAS * float(np.hypot(self.sd, sd)), LEAST_GAP)
        return gap if sure else 0.0


@dataclass(frozen=True)
class Effort:
    """What a search spends beside its points: most ``ascents``, draws at ``each`` mode in a round and in the last."""

    ascents: int
    each: int
    last: int

    @staticmethod
    def of(points: int) -> Effort:
        """In proportion to the points, within limits."""
        return Effort(*(int(np.clip(points // n, low, high)) for n, low, high in SHARES))


def search(problem: Problem, rng: np.random.Generator) -> Modes:
    """The modes that are found from as many scrambled Sobol points of the prior as the problem asks for.

    Points that are higher than their neighbours are followed up by quasi-Newton ascents; around each place where that
    ends, adapted importance sampling (O. Cappé et al., Stat. Comput. 18 (2008) 447) tells how much of Z it holds.
    """
    points = problem.points
    effort = Effort.of(points)
    v = ndtri(scrambled_sobol(problem.size, rng).random(points) + 2.0**-31)
    value = density(problem, v)
    starts = _standing_out(v[np.isfinite(value)], value[np.isfinite(value)], effort.ascents)
    volume = smallest(points)
    if not len(starts):
        return Modes((), (), -np.inf, np.inf, Coverage(points, 0, 0, volume))
    peaks = _ascend(problem, starts)
    fitted = _all_fitted(problem, peaks, effort.each, rng)
    if fitted:
        # A spike within a mode is out of sight from the prior, and not from within.
        v = joined(fitted, np.ones(len(fitted))).draw(rng, points // 4)
        value = density(problem, v)
        more = _standing_out(v[np.isfinite(value)], value[np.isfinite(value)], effort.ascents)
        starts = np.concatenate([starts, more])
        places, heights, spreads = _ascend(problem, more)
        peaks = (
            np.concatenate([peaks[0], places]),
            np.concatenate([peaks[1], heights]),
            np.concatenate([peaks[2], spreads]),
        )
        fitted = _all_fitted(problem, peaks, effort.each, rng)
    return _weighed(problem, fitted, effort.last, rng, Coverage(points, len(starts), len(fitted), volume))


def density(problem: Problem, v: Array) -> Array:
    """ln of L(x) N(v) of v (B, k), (B,); its integral over v is Z."""
    _, log_likelihood = problem.from_cube(ndtr(np.clip(v, -FARTHEST, FARTHEST)))
    within = np.all(np.abs(v) <= FARTHEST, axis=1)
    normal = -0.5 * np.sum(v * v, axis=1) - 0.5 * v.shape[1] * np.log(2 * np.pi)
    return np.where(within, log_likelihood + normal, -np.inf)


# ---- the way up ------------------------------------------------------------------------------------------------------


def _standing_out(v: Array, value: Array, most: int) -> Array:
    """Up to ``most`` of v (n, k) that are higher than their neighbours: half the highest, half from the rest."""
    if not len(v):
        return v
    order = np.argsort(-value)
    if v.shape[1] > FEW and order.size > LOOKED_AT:
        # Neighbours are dear in many dimensions: of the lower half of those looked at, only some.
        best, others = np.split(order, [LOOKED_AT // 2])
        order = np.concatenate([best, others[:: max(1, 2 * len(others) // LOOKED_AT)]])
    _, near = cKDTree(v).query(v[order], k=min(len(v), NEIGHBOURS))
    peaks = order[value[order] >= np.max(value[np.reshape(near, (len(order), -1))], axis=1)]
    first, others = np.split(peaks, [most // 2])
    if len(others) > most // 2:
        others = others[np.linspace(0, len(others) - 1, most // 2).astype(int)]
    return np.asarray(v[np.concatenate([first, others])])


def _ascend(problem: Problem, v: Array) -> tuple[Array, Array, Array]:
    """Where ascents from v (B, k) end: v (B, k), density (B,) and what the spread of the mode may be (B, k, k).

    BFGS with several steps tried at once; a direction that leads nowhere is replaced by the gradient, and one more that
    does is the end.
    """
    b, k = v.shape
    v, value = v.copy(), density(problem, v)
    slope = _slope(problem, v, value)
    inverse = np.broadcast_to(np.eye(k), (b, k, k)).copy()
    fresh, going = np.ones(b, dtype=bool), np.ones(b, dtype=bool)
    for _ in range(ITERATIONS):
        i = np.flatnonzero(going)
        if not i.size:
            break
        way = np.einsum("bij,bj->bi", inverse[i], slope[i])
        way /= np.maximum(np.linalg.norm(way, axis=1, keepdims=True) / LONGEST, 1.0)
        tried = v[i, None] + np.array(STEPS)[:, None] * way[:, None]
        heights = density(problem, tried.reshape(-1, k)).reshape(len(i), -1)
        best = np.argmax(heights, axis=1)
        height = heights[np.arange(len(i)), best]
        up = height > value[i] + 1e-9
        going[i[~up & fresh[i]]] = False
        inverse[i[~up]], fresh[i[~up]] = np.eye(k), True
        j = i[up]
        if not j.size:
            continue
        to = tried[np.arange(len(i)), best][up]
        new = _slope(problem, to, height[up])
        inverse[j] = _updated(inverse[j], to - v[j], slope[j] - new, fresh[j])
        going[j] = height[up] > value[j] + 1e-6
        v[j], value[j], slope[j], fresh[j] = to, height[up], new, False
    return v, value, _spread(problem, v, slope)


def _spread(problem: Problem, v: Array, slope: Array) -> Array:
    """Covariances (B, k, k): the inverse of |Hessian| + diag(g^2), since at an edge the density falls by the slope g.

    No direction is wider than the prior.
    """
    b, k = v.shape
    h = 3 * DIFFERENCE * np.eye(k)
    at = np.concatenate([v[:, None] + h, v[:, None] - h]).reshape(-1, k)
    up, down = _slope(problem, at, density(problem, at)).reshape(2, b, k, k)
    values, vectors = eigh(-0.25 * (up - down + (up - down).transpose(0, 2, 1)) / (3 * DIFFERENCE))
    precision = (vectors * np.maximum(np.abs(values), 1.0)[:, None, :]) @ vectors.transpose(0, 2, 1)
    return np.asarray(np.linalg.inv(precision + slope[:, :, None] ** 2 * np.eye(k)))


def _slope(problem: Problem, v: Array, value: Array) -> Array:
    """Gradient (B, k) by central differences, one-sided at an edge and none between two."""
    b, k = v.shape
    h = DIFFERENCE * np.eye(k)
    both = density(problem, np.concatenate([v[:, None] + h, v[:, None] - h]).reshape(-1, k)).reshape(2, b, k)
    here = np.where(np.isfinite(value), value, -np.inf)[:, None]
    with np.errstate(invalid="ignore"):
        rise, fall = both[0] - here, here - both[1]
    up, down = (np.where(np.isfinite(side), side, 0.0) for side in (rise, fall))
    sides = np.maximum(np.sum(np.isfinite(both), axis=0), 1)
    return np.asarray(np.where(np.isfinite(here), (up + down) / sides / DIFFERENCE, 0.0))


def _updated(inverse: Array, s: Array, y: Array, fresh: Array) -> Array:
    """BFGS with steps s and falls y of the slope, (B, k): B' = (1 - r s y^T) B (1 - r y s^T) + r s s^T."""
    sy = np.sum(s * y, axis=1)
    good = sy > 1e-12 * np.linalg.norm(s, axis=1) * np.linalg.norm(y, axis=1)
    size = np.where(good, sy, 1.0) / np.maximum(np.sum(y * y, axis=1), 1e-300)
    inverse = np.where((good & fresh)[:, None, None], size[:, None, None] * np.eye(s.shape[1]), inverse)
    r = np.where(good, 1.0 / np.where(good, sy, 1.0), 0.0)[:, None, None]
    left = np.eye(s.shape[1]) - r * s[:, :, None] * y[:, None, :]
    return np.asarray(left @ inverse @ left.transpose(0, 2, 1) + r * s[:, :, None] * s[:, None, :])


def _distinct(v: Array, value: Array, covariance: Array) -> list[tuple[Array, Array]]:
    """(place (k,), covariance (k, k)) of the highest peaks that are not one and the same."""
    found: list[tuple[Array, Array]] = []
    k = v.shape[1]
    mass = value + 0.5 * np.linalg.slogdet(covariance)[1]
    for i in np.argsort(-value):
        if not np.isfinite(mass[i]) or mass[i] < np.max(mass[np.isfinite(mass)]) - 2 * LEAST:
            continue
        away = [np.einsum("i,ij,j", v[i] - m, np.linalg.inv(c), v[i] - m) for m, c in found]
        if min(away, default=np.inf) > k + 9.0:
            found.append((v[i], covariance[i]))
        if len(found) == MODES:
            break
    return found


# ---- how much of Z is there ------------------------------------------------------------------------------------------


def _fitted(problem: Problem, peak: tuple[Array, Array], each: int, rng: np.random.Generator) -> Mixture | None:
    """A t-distribution fitted to the mode around a ``peak``; None if next to nothing is found there."""
    g = _single(*peak)
    for _ in range(ROUNDS):
        v = g.draw(rng, each)
        log_weight = density(problem, v) - g.log_density(v)
        if not np.any(np.isfinite(log_weight)):
            return None
        w = np.exp(log_weight - np.max(log_weight))
        w = np.minimum(w, np.sqrt(each) * np.mean(w))
        w /= np.sum(w)
        mean = w @ v
        spread = (w[:, None] * (v - mean)).T @ (v - mean)
        # What few draws say of the spread is not taken at its word.
        trust = min(1.0, effective_draws(w) / (4 * v.shape[1]))
        old = g.roots[0] @ g.roots[0].T / WIDER**2
        g = _single(trust * mean + (1 - trust) * g.means[0], trust * spread + (1 - trust) * old)
    return g


def _all_fitted(
    problem: Problem, peaks: tuple[Array, Array, Array], each: int, rng: np.random.Generator
) -> list[Mixture]:
    fitted = [_fitted(problem, peak, each, rng) for peak in _distinct(*peaks)]
    return [g for g in fitted if g is not None]


def joined(fitted: Sequence[Mixture], share: Array) -> Mixture:
    """One mixture of several, each with its ``share`` (M,); the least of their degrees of freedom for all."""
    weights = [g.log_weights + np.log(s / np.sum(share)) for g, s in zip(fitted, share, strict=True)]
    means, roots = (np.concatenate([getattr(g, n) for g in fitted]) for n in ("means", "roots"))
    return Mixture(np.concatenate(weights), means, roots, min(g.degrees for g in fitted))


def _single(centre: Array, covariance: Array) -> Mixture:
    values, vectors = eigh(covariance)
    values = np.clip(values, 1e-14, 4.0)  # the posterior is no wider than the prior, but where the likelihood says so
    root = np.asarray(np.linalg.cholesky((vectors * values) @ vectors.T), dtype=float)
    return Mixture(np.zeros(1), centre[None], WIDER * root[None], DEGREES)


def _weighed(problem: Problem, fitted: list[Mixture], each: int, rng: np.random.Generator, coverage: Coverage) -> Modes:
    """Masses and draws of all modes, from one mixture of them."""
    if not fitted:
        return Modes((), (), -np.inf, np.inf, coverage)
    count, g = len(fitted), joined(fitted, np.ones(len(fitted)))
    v = g.draw(rng, each * count)
    log_weight = density(problem, v) - g.log_density(v)
    if not np.any(np.isfinite(log_weight)):
        return Modes((), (), -np.inf, np.inf, coverage)
    w = np.exp(log_weight - np.max(log_weight))
    inside = g.parts(v)
    share = np.exp(inside - logsumexp(inside, axis=1)[:, None])
    clouds, masses = [], []
    for j in range(count):
        own = w * share[:, j]
        if np.sum(own) > np.exp(-LEAST) * np.sum(w):
            p = np.minimum(own, np.sqrt(len(own)) * np.mean(own))
            clouds.append(_in_x(problem, v[rng.choice(len(v), CLOUD, p=p / np.sum(p))]))
            masses.append(float(np.log(np.mean(own)) + np.max(log_weight)))
    total = float(np.log(np.mean(w)) + np.max(log_weight))
    sd = float(np.std(w) / np.mean(w) / np.sqrt(len(w)))
    return Modes(tuple(clouds), tuple(masses), total, sd, coverage, float(np.max(w) / np.sum(w)))


def _in_x(problem: Problem, v: Array) -> Array:
    return np.asarray(problem.target.prior_transform(ndtr(np.clip(v, -FARTHEST, FARTHEST))), dtype=float)
