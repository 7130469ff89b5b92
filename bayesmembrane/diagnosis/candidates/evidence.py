"""ln Z of a linearised hypothesis under noise and form error, with how large these are integrated out.

Near its most probable coordinates a hypothesis is linear: y - F(u*) = J (u - u*) + form error + noise. All but the
noise is a sum of columns B with normal coefficients (coordinates, the error of the energy, that of each law), so that

    ln Z(theta) = ln N(d; 0, s^2 S + B V(theta) B^T),    d = y - F(u*) + J u*,

is exact for given theta = (ln s, ln eta_a, ln eta_e ...), and costs little: B has a hundred columns or so. Over theta
it is integrated by Laplace's approximation, s being what the noise is larger than its reference says. C. E. Rasmussen,
C. K. I. Williams, Gaussian Processes for Machine Learning (2006), 2.7 and 5.4.1.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cholesky, lapack, solve_triangular
from scipy.optimize import minimize
from scipy.special import log_ndtr, logsumexp, ndtr, ndtri

from bayesmembrane.diagnosis.thresholds import FORM
from bayesmembrane.ground.parameters import Array

LATTICE = np.abs(2 * np.modf(np.arange(1, 402)[:, None] * np.sqrt([2.0, 3.0, 5.0, 7.0, 11.0, 13.0]))[0] - 1)
"""(M, 6) points that fill the unit cube evenly (R. D. Richtmyer's, folded)."""


@dataclass(frozen=True, eq=False)
class Block:
    """Columns (N, m), freed of noise, whose coefficients are N(0, eta^2).

    ln_eta : (mean, sd) of the normal prior of ln eta; None: eta is 1
    most : of ln eta: what is further off is something else
    """

    columns: Array
    ln_eta: tuple[float, float] | None = None
    most: float = np.inf


@dataclass(frozen=True, eq=False)
class Linear:
    """d (N,) ~ N(0, s^2 1 + sum_b eta_b^2 B_b B_b^T), freed of noise.

    ln_scale_sd : sd of the prior of ln s about 0
    """

    data: Array
    blocks: tuple[Block, ...]
    ln_scale_sd: float

    def __post_init__(self) -> None:
        self._reduced  # noqa: B018 - what cannot be decomposed is said here

    @cached_property
    def _reduced(self) -> tuple[Array, Array, Array, float]:
        """(Q, R, Q^T d, squares of d beside Q) of all columns."""
        q, r = np.linalg.qr(np.column_stack([b.columns for b in self.blocks]))
        along = q.T @ self.data
        return q, r, along, max(float(self.data @ self.data - along @ along), 0.0)

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

    def variances(self, theta: Array) -> Array:
        """(m,) of the coefficients."""
        return np.where(self.owner > 0, np.exp(2 * theta[self.owner]), 1.0)

    def log_density(self, theta: Array) -> tuple[float, Array]:
        """(ln p(d, theta), its slopes (h,)), without the noise's own determinant, which all hypotheses share."""
        q, r, along, rest = self._reduced
        n, p = q.shape
        square, v = float(np.exp(2 * theta[0])), self.variances(theta)
        m = (r * v) @ r.T
        m[np.diag_indices(p)] += square
        if not np.all(np.isfinite(m)):  # larger than doubles hold: no size of noise or form error is like that
            return -1e300, np.zeros(len(theta))
        inverse, log_det = _inverse(m)
        a = inverse @ along
        value = -0.5 * (float(along @ a) + rest / square + log_det + 2 * (n - p) * float(theta[0]))
        value -= 0.5 * n * float(np.log(2 * np.pi))
        pulls = v * ((r.T @ a) ** 2 - np.einsum("ij,ij->j", r, inverse @ r))
        slope = np.bincount(self.owner, pulls, len(theta))
        # What scales no column belongs to none of theta: the first is the noise's.
        slope[0] = square * (float(a @ a) - float(np.trace(inverse))) + rest / square - (n - p)
        z = (theta - self.priors[:, 0]) / self.priors[:, 1]
        value -= 0.5 * float(z @ z) + float(np.sum(np.log(self.priors[:, 1] * np.sqrt(2 * np.pi))))
        return value, slope - z / self.priors[:, 1]

    def coefficients(self, theta: Array) -> tuple[Array, Array]:
        """(mean (m,), covariance (m, m)) of all coefficients given d and theta."""
        _, r, along, _ = self._reduced
        root = np.sqrt(self.variances(theta))
        square = float(np.exp(2 * theta[0]))
        scaled = r * root
        precision = np.eye(root.size) + scaled.T @ scaled / square
        factor = cholesky(precision, lower=True, check_finite=False)
        half = solve_triangular(factor, np.diag(root), lower=True, check_finite=False)
        covariance = half.T @ half
        return covariance @ (r.T @ along) / square, covariance

    def freed(self, theta: Array, values: Array) -> Array:
        """(s^2 1 + B V B^T)^-1 v of values (N, c)."""
        q, r, _, _ = self._reduced
        square = float(np.exp(2 * theta[0]))
        m = (r * self.variances(theta)) @ r.T
        m[np.diag_indices(len(m))] += square
        along = q.T @ values
        return np.asarray((values - q @ along) / square + q @ np.linalg.solve(m, along))


@dataclass(frozen=True, eq=False)
class Weighed:
    """ln Z of a linear model, and the most probable theta.

    theta : (h,) ln s, then ln eta of every block that has one
    """

    log_evidence: float
    theta: Array


def weighed(model: Linear, start: Array | None = None) -> Weighed:
    """ln Z by Laplace's approximation over theta, from the better of the prior's centre and ``start``."""
    starts = [model.priors[:, 0]]
    if start is not None and start.size == len(model.priors):
        starts.append(start)
    begin = max(starts, key=lambda t: model.log_density(t)[0])
    low, high = model.ends

    def cost(theta: Array) -> tuple[float, Array]:
        value, slope = model.log_density(theta)
        return -value, -slope

    done = minimize(
        cost, np.clip(begin, low, high), jac=True, method="L-BFGS-B", bounds=list(zip(low, high, strict=True)),
        options={"maxiter": FORM.iterations, "ftol": FORM.tolerance},
    )  # fmt: skip
    theta = np.asarray(done.x)
    bend = _curvature(model, theta)
    log_det = float(np.linalg.slogdet(bend)[1])
    value = float(-done.fun) + 0.5 * theta.size * float(np.log(2 * np.pi)) - 0.5 * log_det
    return Weighed(value, theta)


def _inverse(m: Array) -> tuple[Array, float]:
    """(M^-1, ln det M) of a positive definite matrix, by LAPACK alone: it is needed thousands of times."""
    factor, fault = lapack.dpotrf(m, lower=1, overwrite_a=1)
    if fault:
        raise np.linalg.LinAlgError("the covariance of a linear model is not positive definite")
    log_det = 2 * float(np.sum(np.log(np.diag(factor))))
    half, _ = lapack.dpotri(factor, lower=1, overwrite_c=1)
    lower = np.tril(half)
    return np.asarray(lower + np.tril(half, -1).T), log_det


def _curvature(model: Linear, theta: Array) -> Array:
    """(h, h) of -ln p(d, theta), by differences of its slopes; nowhere flatter than half of the prior's."""
    h = FORM.step
    rows = []
    for i in range(theta.size):
        step = np.zeros(theta.size)
        step[i] = h
        rows.append((model.log_density(theta - step)[1] - model.log_density(theta + step)[1]) / (2 * h))
    bend = 0.5 * (np.array(rows) + np.array(rows).T)
    value, vector = np.linalg.eigh(bend * np.outer(model.priors[:, 1], model.priors[:, 1]))
    bent = (vector * np.maximum(value, FORM.least_curvature)) @ vector.T
    return np.asarray(bent / np.outer(model.priors[:, 1], model.priors[:, 1]))


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
