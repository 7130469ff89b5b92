"""ln Z of a linearised hypothesis under noise and form error, with how large these are integrated out.

Near its most probable coordinates a hypothesis is linear: y - F(u*) = J (u - u*) + form error + noise. All but the
noise is a sum of columns B with normal coefficients (coordinates, the error of the energy, that of each law), so that

    ln Z(theta) = ln N(d; 0, s^2 S + B V(theta) B^T),    d = y - F(u*) + J u*,

is exact for given theta = (ln s, ln eta_a, ln eta_e ...), and costs little: B has a hundred columns or so. Over theta
it is integrated by Laplace's approximation, s being what the noise is larger than its reference says. C. E. Rasmussen,
C. K. I. Williams, Gaussian Processes for Machine Learning (2006), 2.7 and 5.4.1.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np
from numpy.typing import NDArray
from scipy.special import log_ndtr, logsumexp, ndtr, ndtri

from bayesmembrane.diagnosis.candidates.gram import Gram, Inverse
from bayesmembrane.diagnosis.thresholds import FORM
from bayesmembrane.ground.lately import Lately
from bayesmembrane.ground.parameters import Array
from bayesmembrane.ground.symmetric import eigh

LATTICE = np.abs(2 * np.modf(np.arange(1, 402)[:, None] * np.sqrt([2.0, 3.0, 5.0, 7.0, 11.0, 13.0]))[0] - 1)
"""(M, 6) points that fill the unit cube evenly (R. D. Richtmyer's, folded)."""
REMEMBERED = 5
"""Sizes theta at which a linear model remembers what it found: the fit's, the usual ones, those of an energy that is
far off, and the last trials."""


@dataclass(frozen=True, eq=False)
class Block:
    """Columns (N, m), freed of noise, whose coefficients are N(0, eta^2).

    ln_eta : (mean, sd) of the normal prior of ln eta; None: eta is 1
    most : of ln eta: what is further off is something else
    turn : (m, m) orthogonal T, if the columns are orthogonal to each other, and other ones times T; those have the
        coefficients T c
    """

    columns: Array
    ln_eta: tuple[float, float] | None = None
    most: float = np.inf
    turn: Array | None = None


@dataclass(frozen=True, eq=False)
class _Solved:
    """A linear model at one theta: V^(1/2) (m,), coefficients (m,) in units of their eta, and C^-1."""

    root: Array
    own: Array
    inverse: Inverse


@dataclass(frozen=True, eq=False)
class Density:
    """ln p(d, theta), and, where they are asked for, its slopes (h,) and second derivatives (h, h) in theta."""

    value: float
    derivatives: Callable[[], tuple[Array, Array]]

    @cached_property
    def _both(self) -> tuple[Array, Array]:
        return self.derivatives()

    @property
    def slope(self) -> Array:
        return self._both[0]

    @property
    def bend(self) -> Array:
        return self._both[1]


@dataclass(frozen=True, eq=False)
class Linear:
    """d (N,) ~ N(0, s^2 1 + sum_b eta_b^2 B_b B_b^T), freed of noise.

    Everything follows from C = 1 + V^(1/2) B^T B V^(1/2) / s^2, which is as small as there are columns: its inverse is
    the covariance of the coefficients in units of their own eta.

    ln_scale_sd : sd of the prior of ln s about 0
    counts : part of the likelihood that counts, a
    """

    data: Array
    blocks: tuple[Block, ...]
    ln_scale_sd: float
    counts: float = 1.0

    def __post_init__(self) -> None:
        if not (self._gram.finite and np.all(np.isfinite(self._along))):
            raise np.linalg.LinAlgError("the data or the columns of a linear model are not all numbers")

    @cached_property
    def _columns(self) -> Array:
        return np.column_stack([b.columns for b in self.blocks])

    @cached_property
    def _gram(self) -> Gram:
        apart = [np.full(b.columns.shape[1], b.turn is not None) for b in self.blocks]
        return Gram.of(self._columns, np.concatenate(apart))

    @cached_property
    def _along(self) -> Array:
        """(m,) B^T d."""
        return self._columns.T @ self.data

    @property
    def far_off(self) -> Array:
        """(h,) theta at the prior's centre, but for the first form, the energy's, which is far off (`FORM.far_off`).

        From the centre the slope of ln p by an energy's error is next to nothing, for half of its prior lies below what
        can be seen.
        """
        out = np.array(self.priors[:, 0])
        out[1:2] += FORM.far_off * self.priors[1:2, 1]
        return np.clip(out, *self.ends)

    @cached_property
    def priors(self) -> Array:
        """(h, 2) mean and sd of theta."""
        own = [b.ln_eta for b in self.blocks if b.ln_eta is not None]
        return np.array([(0.0, self.ln_scale_sd), *own])

    @cached_property
    def ends(self) -> tuple[Array, Array]:
        """(h,), (h,) between which theta is looked for."""
        low, high = (self.priors[:, 0] + s * FORM.reach * self.priors[:, 1] for s in (-1, 1))
        return low, np.minimum(high, [np.inf, *(b.most for b in self.blocks if b.ln_eta is not None)])

    @cached_property
    def owner(self) -> Array:
        """(m,) which theta scales a column; 0 where none does."""
        out, number = [], 0
        for b in self.blocks:
            number += b.ln_eta is not None
            out.append(np.full(b.columns.shape[1], number if b.ln_eta is not None else 0))
        return np.concatenate(out)

    @cached_property
    def _members(self) -> Array:
        """(h, m) 1 where a theta scales a column; the first row has those that none scales."""
        return np.asarray(self.owner == np.arange(len(self.priors))[:, None], dtype=float)

    def variances(self, theta: Array) -> Array:
        """(m,) of the coefficients."""
        return np.where(self.owner > 0, np.exp(2 * theta[self.owner]), 1.0)

    @cached_property
    def _lately(self) -> Lately[bytes, _Solved | None]:
        return Lately(REMEMBERED)

    def _solved(self, theta: Array) -> _Solved | None:
        """C at theta; None where doubles do not hold it."""
        return self._lately.of(theta.tobytes(), partial(self._solve, theta))

    def _solve(self, theta: Array) -> _Solved | None:
        root = np.sqrt(self.variances(theta))
        scale = root * np.exp(-theta[0])
        inverse = self._gram.plus_one(scale)
        if inverse is None:
            return None
        return _Solved(root, inverse.times(scale * np.exp(-theta[0]) * self._along), inverse)

    def log_density(self, theta: Array) -> Density:
        """ln p(d, theta), without the noise's own determinant, which all hypotheses share."""
        h, n = theta.size, self.counts * self.data.size
        found = self._solved(theta)
        if found is None:  # larger than doubles hold: no size of noise or form error is like that
            return Density(-1e300, lambda: (np.zeros(h), -np.eye(h)))
        left = self.data - self._columns @ (found.root * found.own)
        squares = float(left @ left) * float(np.exp(-2 * theta[0])) + float(found.own @ found.own)
        mean, sd = self.priors.T
        z = (theta - mean) / sd
        value = -0.5 * (squares + found.inverse.log_det + n * (2 * theta[0] + float(np.log(2 * np.pi))))
        value -= 0.5 * float(z @ z) + float(np.sum(np.log(sd * np.sqrt(2 * np.pi))))
        return Density(value, partial(self._derivatives, theta, found, squares))

    def _derivatives(self, theta: Array, found: _Solved, squares: float) -> tuple[Array, Array]:
        """Slopes (h,) and second derivatives (h, h) of ln p(d, theta), whose ``squares`` are d^T S^-1 d.

        With phi = theta - theta_0 for the blocks, and -theta_0 for those of fixed size, ln det C and s^2 times the
        squares depend on phi alone; with K = 1 - C^-1 and coefficients c in units of their own eta

            d ln det C = 2 tr K,   d^2 ln det C = 4 tr K - 4 |K|^2,   d q = -2 c^2,   d^2 q = -4 c^2 + 8 c K c,

        block by block.
        """
        h, n = theta.size, self.counts * self.data.size
        k = -found.inverse.whole
        k[np.diag_indices(found.own.size)] += 1.0
        inside, wide = self._members, self._members * found.own
        trace, pull = inside @ np.diag(k), wide @ found.own
        by_phi = trace - pull
        # Half of the second derivatives of ln det C + q in phi.
        bend_phi = np.diag(2 * by_phi) - 2 * (inside @ (k * k) @ inside.T) + 4 * (wide @ k @ wide.T)
        # From phi to theta: every phi falls with theta_0, and the first, of fixed blocks, does nothing else.
        to = np.eye(h)
        to[0, 0] = 0.0
        to[:, 0] -= 1.0
        slope = -(to.T @ by_phi)
        slope[0] += squares - n
        mixed = np.zeros((h, h))
        mixed[0] = 2 * (to.T @ pull)
        bend = -(to.T @ bend_phi @ to) - mixed - mixed.T
        bend[0, 0] -= 2 * squares
        mean, sd = self.priors.T
        return slope - (theta - mean) / sd**2, bend - np.diag(1 / sd**2)

    def coefficients(self, theta: Array) -> tuple[Array, Array]:
        """(mean (m,), covariance (m, m)) of all coefficients given d and theta."""
        _, covariance = self.first(theta, self.owner.size)
        for rows, turn in self._turns:
            covariance[rows] = turn @ covariance[rows]
            covariance[:, rows] = covariance[:, rows] @ turn.T
        return self.mean(theta), covariance

    def mean(self, theta: Array) -> Array:
        """(m,) of all coefficients given d and theta."""
        found = self._certain(theta)
        mean = found.root * found.own
        for rows, turn in self._turns:
            mean[rows] = turn @ mean[rows]
        return mean

    @property
    def _turns(self) -> list[tuple[slice, Array]]:
        """Where the columns of each block stand that was turned, and its turn."""
        ends = np.cumsum([0, *(b.columns.shape[1] for b in self.blocks)]).tolist()
        return [(slice(*ends[i : i + 2]), b.turn) for i, b in enumerate(self.blocks) if b.turn is not None]

    def first(self, theta: Array, count: int) -> tuple[Array, Array]:
        """`coefficients` of the first ``count`` columns, none of them of a block that was turned."""
        found = self._certain(theta)
        root = found.root[:count]
        return root * found.own[:count], found.inverse.whole[:count, :count] * root * root[:, None]

    def freed(self, theta: Array, values: Array) -> Array:
        """(s^2 1 + B V B^T)^-1 v of values (N, c)."""
        square = float(np.exp(2 * theta[0]))
        found = self._certain(theta)
        scaled = self._columns * found.root
        return np.asarray((values - scaled @ (found.inverse.whole @ (scaled.T @ values)) / square) / square)

    def _certain(self, theta: Array) -> _Solved:
        found = self._solved(theta)
        if found is None:
            raise np.linalg.LinAlgError("a linear model is asked for sizes larger than numbers hold")
        return found


@dataclass(frozen=True, eq=False)
class Weighed:
    """ln Z of a linear model, and the most probable theta.

    theta : (h,) ln s, then ln eta of every block that has one
    """

    log_evidence: float
    theta: Array


def weighed(model: Linear, start: Array | None = None) -> Weighed:
    """ln Z by Laplace's approximation over theta, about the highest top that is found from the prior's centre, from
    `Linear.far_off` and from ``start``, as far as these are near it already.
    """
    starts = [model.priors[:, 0], model.far_off]
    if start is not None and start.size == len(model.priors):
        starts.append(np.clip(start, *model.ends))
    theta, top = _climbed(model, starts)
    curvature, _ = _bent(model, top)
    sizes = np.log(np.maximum(curvature, FORM.least_curvature)) - 2 * np.log(model.priors[:, 1])
    log_det = float(np.sum(sizes))
    return Weighed(top.value + 0.5 * theta.size * float(np.log(2 * np.pi)) - 0.5 * log_det, theta)


def _climbed(model: Linear, starts: Sequence[Array]) -> tuple[Array, Density]:
    """The most probable theta between its ends, from the best of ``starts``, and from others that are as good already.

    ln p has more than one top where noise may take what an energy does that is far off.
    """
    first, *rest = sorted(((t, model.log_density(t)) for t in starts), key=lambda pair: -pair[1].value)
    best = _climbed_from(model, *first)
    for start in rest:
        if start[1].value > best[1].value - FORM.rival:
            best = max(best, _climbed_from(model, *start), key=lambda pair: pair[1].value)
    return best


def _climbed_from(model: Linear, theta: Array, now: Density) -> tuple[Array, Density]:
    """A top of ln p, by Newton's steps that bounds cut off.

    A direction in which ln p bends up is taken as one in which it bends down as much; a step that gains nothing is
    halved (J. Nocedal, S. J. Wright, Numerical Optimization (2006), 3.4 and 16.7).
    """
    low, high = model.ends
    for _ in range(FORM.iterations):
        free = ~(((theta <= low) & (now.slope < 0)) | ((theta >= high) & (now.slope > 0)))
        curvature, axes = _bent(model, now)
        precision = (axes * np.maximum(np.abs(curvature), FORM.least_curvature)) @ axes.T
        step = np.zeros(theta.size)
        step[free] = np.linalg.solve(precision[np.ix_(free, free)], now.slope[free])
        step *= min(1.0, FORM.largest_step / max(float(np.max(np.abs(step))), 1e-300))
        if float(step @ now.slope) < FORM.tolerance:
            break
        for _ in range(FORM.halvings):
            trial = np.clip(theta + step, low, high)
            there = model.log_density(trial)
            if there.value > now.value:
                break
            step *= 0.5
        else:
            break
        theta, now = trial, there
    return theta, now


def _bent(model: Linear, at: Density) -> tuple[Array, Array]:
    """(curvatures (h,) of -ln p in those of the prior, axes (h, h)): -bend = axes diag(curvatures) axes^T."""
    sd = model.priors[:, 1]
    value, vector = eigh(-at.bend * np.outer(sd, sd))
    return value, vector / sd[:, None]


def log_inside(mean: Array, covariance: Array, low: Array, high: Array) -> float:
    """ln P(low <= u <= high) of u ~ N(mean, covariance): what bounds leave of a normal approximation.

    Only bounds nearer than `FORM.far_bound` standard deviations count; up to `FORM.joint_bounds` of them together by
    A. Genz's integration (J. Comput. Graph. Stat. 1 (1992) 141), the others one by one.
    """
    sd = np.sqrt(np.diag(covariance))
    with np.errstate(invalid="ignore"):
        near = np.flatnonzero(((mean - low) / sd < FORM.far_bound) | ((high - mean) / sd < FORM.far_bound))
    if near.size == 0:
        return 0.0
    single = _log_between(mean, sd, low, high)
    order = near[np.argsort(single[near])]
    joint, rest = order[: FORM.joint_bounds], order[FORM.joint_bounds :]
    total = float(np.sum(single[rest]))
    if joint.size == 1 or float(single[joint[0]]) < FORM.deep_tail:
        return total + float(np.sum(single[joint]))
    scale = sd[joint]
    correlation = covariance[np.ix_(joint, joint)] / np.outer(scale, scale)
    together = _log_joint((low[joint] - mean[joint]) / scale, (high[joint] - mean[joint]) / scale, correlation)
    return total + (together if np.isfinite(together) else float(np.sum(single[joint])))


def _log_joint(low: Array, high: Array, correlation: Array) -> float:
    """ln P(low <= z <= high) of z ~ N(0, correlation), bound after bound given those before, on a lattice of points.

    SciPy's own takes a hundred times as long, for digits that nothing here needs.
    """
    k = low.size
    root = np.linalg.cholesky(correlation + 1e-10 * np.eye(k))
    z, log_p = np.zeros((k, len(LATTICE))), np.zeros(len(LATTICE))
    for i in range(k):
        middle = root[i, :i] @ z[:i]
        a, b, flip = _nearer_tail((low[i] - middle) / root[i, i], (high[i] - middle) / root[i, i])
        below, share = ndtr(a), ndtr(b) - ndtr(a)
        with np.errstate(divide="ignore"):
            log_p += np.log(share)
        inside = np.clip(ndtri(below + LATTICE[:, i] * share), -38.0, 38.0)
        z[i] = np.where(flip, -inside, inside)
    return float(logsumexp(log_p) - np.log(len(LATTICE)))


def _nearer_tail(a: Array, b: Array) -> tuple[Array, Array, NDArray[np.bool_]]:
    """(a, b, flipped): intervals above zero are mirrored, for P is exact only in the lower tail."""
    flip = a > 0
    return np.where(flip, -b, a), np.where(flip, -a, b), flip


def _log_between(mean: Array, sd: Array, low: Array, high: Array) -> Array:
    """(k,) ln P(low <= u <= high) of each coordinate on its own."""
    a, b, _ = _nearer_tail((low - mean) / sd, (high - mean) / sd)
    upper, lower = log_ndtr(b), log_ndtr(a)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(upper + np.log1p(-np.exp(np.minimum(lower - upper, -1e-300))))


def extended(model: Linear, blocks: Sequence[Block]) -> Linear:
    """The same with further columns."""
    return replace(model, blocks=(*model.blocks, *blocks))


def tempered(model: Linear, counts: float) -> Linear:
    """The same with its likelihood to the power of a = ``counts``, and its priors as they are.

    N(d; B c, s^2)^a ~ s^(-a N) exp(-|a^(1/2) d - a^(1/2) B c|^2 / (2 s^2)), as if there were so many fewer readings.
    """
    root = float(np.sqrt(counts))
    blocks = tuple(replace(b, columns=root * b.columns) for b in model.blocks)
    return replace(model, data=root * model.data, blocks=blocks, counts=counts * model.counts)
