"""ln Z of one nested run from its likelihoods, layer by layer, without the bias that the usual sums have."""

from __future__ import annotations

import numpy as np
from scipy.special import logsumexp

from bayesmembrane.ground.parameters import Array


def log_integral(log_likelihood: Array, log_volume: Array, live: int) -> tuple[float, float]:
    """(ln Z, its standard error) of a run with N = ``live`` points: Z = sum_i X_i (L_i+1 - L_i) + X_n mean(L - L_n).

    log_likelihood : of the n dead points and then of the N last ones, increasing, (n + N,)
    log_volume : ln X of the dead points (n,) as the run has counted it; only steps that are not the usual
        ln(N / (N + 1)), of points that are equally likely, are taken from it

    X_i = (1 - 1/N)^i makes Z unbiased whatever the likelihood (C. Walter, Stat. Comput. 27 (2017) 219). The usual sum
    over ln(N / (N + 1)) with trapezoids is not: it gains X ln(1/X) / N everywhere, and leaves out what lies within
    the innermost point. The relative variance is that of a Poisson process,
    V = 2/N sum_(i<j) T_i T_j h_i with h = ln(1/X) and T_i the share of the i-th layer in Z, and that of the mean over
    the last points; ln Z is raised by V/2, since the logarithm of an unbiased estimate is not.
    """
    n = len(log_likelihood) - live
    dead, last = log_likelihood[:n], log_likelihood[n:]
    steps = np.diff(log_volume, prepend=0.0)
    usual = np.abs(steps + np.log((live + 1) / live)) < 1e-9
    log_x = np.concatenate([[0.0], np.cumsum(np.where(usual, np.log1p(-1 / live), steps))])
    edges = np.concatenate([[-np.inf], dead])
    layers = _log_difference(edges[1:], edges[:-1]) + log_x[:-1]
    above = _log_difference(last, np.full(live, edges[-1]))
    inner = float(logsumexp(above) - np.log(live)) + log_x[-1]
    terms = np.append(layers, inner)
    total = float(logsumexp(terms))
    share, h = np.exp(terms - total), -log_x
    beyond = np.cumsum(share[::-1])[::-1] - share
    variance = float(np.sum(share * h * (share + 2 * beyond))) / live
    if np.isfinite(inner):
        spread = np.exp(above - np.max(above))
        variance += float((share[-1] * np.std(spread) / np.mean(spread)) ** 2) / live
    return total + 0.5 * variance, float(np.sqrt(variance))


def _log_difference(above: Array, below: Array) -> Array:
    """ln(e^above - e^below), -inf where both are the same."""
    with np.errstate(divide="ignore", invalid="ignore"):
        found = above + np.log1p(-np.exp(np.minimum(below - above, 0.0)))
    return np.where(above > below, found, -np.inf)
