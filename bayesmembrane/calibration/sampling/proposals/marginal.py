"""Likelihoods of curves of unit modulus with modulus and noise integrated out: the kernels.

    ln p(y | f) = ln int int exp(L(t, u)) N(t) N(u) dt du,
    L(t, u) = -1/2 sum_g [(yy_g - 2 e^t ya_g + e^2t aa_g) / V_g + n_g ln(2 pi V_g)],    V_g = v_g + (scale e^u)^2,

with t = ln_gd, u = ln_sd, and sums over groups of readings that are weighed alike. Over t by Laplace's method, which is
exact where the modulus is known to some percent, with its next term; over u by the trapezoid rule, on nodes that are
laid closer until they resolve the peak. What is drawn by it is weighed by the exact density afterwards.
"""

from __future__ import annotations

import numpy as np

from bayesmembrane.ground.compiling import compiled
from bayesmembrane.ground.parameters import Array

Groups = tuple[Array, Array, Array]
"""v_g, n_g and yy_g, each (G,)."""

ROUGH_NODES, FAR = 24, 6.0
"""Of u to begin with, and prior standard deviations within which they lie."""
FALL, ZOOMS = 14.0, 6
"""How far below its largest value ln of the integrand matters, and how often nodes are laid closer at most."""
NEWTON, SHORT = 6, 1e-5
"""Steps for the largest value over t at most, and the last one: of so short a step the exponential is a polynomial."""
LEAST = 1e-300  # of a variance
LEFT, RIGHT = 8.0, 5.0
"""Standard deviations below and above the peak of t between which its nodes lie."""
MOST_LEFT_OUT = 0.5  # by Laplace's method, of the integral: beyond it the next term is no small number either


@compiled(error_model="numpy")
def peak(pull: float, stiff: float, mean: float, sd: float) -> tuple[float, float, float]:
    """t where e^t pull - e^2t stiff / 2 - ((t - mean) / sd)^2 / 2 is largest, e^t, and minus its second derivative.

    By Newton's method from where the likelihood is largest, or from the prior's mean.
    """
    own = 1.0 / (sd * sd)
    t = mean
    if pull > 0.0 and stiff > 0.0:
        t = min(max(np.log(pull / stiff), mean - 8.0 * sd), mean + 8.0 * sd)
    g, bend = np.exp(t), own
    for _ in range(NEWTON):
        bend = max(2.0 * g * g * stiff - g * pull + own, own)
        step = min(max((g * pull - g * g * stiff - (t - mean) * own) / bend, -1.0), 1.0)
        t += step
        if abs(step) < SHORT:
            g *= 1.0 + step * (1.0 + 0.5 * step)
            break
        g = np.exp(t)
    return t, g, bend


@compiled(error_model="numpy")
def of_modulus(pull: Array, stiff: Array, mean: float, sd: float, nodes: int) -> tuple[Array, Array, Array]:
    """First node (B,), step (B,) and normalised density (B, nodes) of t given u, of pull and stiff (B,).

    From `LEFT` standard deviations of the normal at the peak below it, where the density falls more slowly, to `RIGHT`
    above it.
    """
    first, step, density = np.empty(pull.size), np.empty(pull.size), np.empty((pull.size, nodes))
    for b in range(pull.size):
        t, _, bend = peak(pull[b], stiff[b], mean, sd)
        width, value = 1.0 / np.sqrt(bend), density[b]
        h = (LEFT + RIGHT) * width / (nodes - 1)
        first[b], step[b] = t - LEFT * width, h
        for j in range(nodes):
            x = first[b] + j * h
            e = np.exp(x)
            value[j] = e * pull[b] - 0.5 * e * e * stiff[b] - 0.5 * ((x - mean) / sd) ** 2
        # Not at t, for of a film that is no sensible one the peak was not found. One by one is compiled twice as fast.
        top = np.max(value)
        for j in range(nodes):
            value[j] = np.exp(value[j] - top)
        value /= h * (np.sum(value) - 0.5 * (value[0] + value[nodes - 1]))
    return first, step, density


@compiled(error_model="numpy", fastmath={"contract", "arcp", "reassoc"})
def sums(groups: Groups, ya: Array, aa: Array, tau2: float) -> tuple[float, float, float, float]:
    """sum_g of yy, ya and aa, each over V_g, and sum_g n_g ln(2 pi V_g)."""
    variance, count, yy = groups
    square, pull, stiff, log_det, product = 0.0, 0.0, 0.0, 0.0, 1.0
    for g in range(variance.size):
        v = max(variance[g] + tau2, LEAST)
        w = 1.0 / v
        square += yy[g] * w
        pull += ya[g] * w
        stiff += aa[g] * w
        # One logarithm of many variances, as far as a double holds their product.
        if count[g] == 1.0 and 1e-140 < product * v < 1e140 and v > 1e-140:
            product *= v
        else:
            log_det += count[g] * np.log(v)
    return square, pull, stiff, log_det + np.log(product) + np.sum(count) * np.log(2.0 * np.pi)


@compiled(error_model="numpy")
def _matters(value: Array, top: float) -> tuple[int, int]:
    """The node before the first and the one behind the last whose ``value`` is near the ``top``."""
    begin, end = value.size - 1, 0
    for j in range(value.size):
        if value[j] > top - FALL:
            begin, end = min(begin, j), max(end, j)
    return max(begin - 1, 0), min(end + 1, value.size - 1)


@compiled(error_model="numpy")
def _roughly(nodes: tuple[Array, Array, Array], ya: Array, aa: Array) -> tuple[float, float]:
    """Between which u the integrand matters, by its largest value over t without a prior of that.

    ``nodes``: u (R,), what does not hang on the curve (R,), and 1 / V_g (R, G).
    """
    u, alone, weight = nodes
    value, top = np.empty(u.size), -np.inf
    for j in range(u.size):
        pull, stiff = 0.0, 0.0
        for g in range(ya.size):
            pull += ya[g] * weight[j, g]
            stiff += aa[g] * weight[j, g]
        value[j] = alone[j] + (0.5 * pull * pull / stiff if pull > 0.0 and stiff > 0.0 else 0.0)
        top = max(top, value[j])
    begin, end = _matters(value, top)
    return u[begin], u[end]


@compiled(error_model="numpy")
def _rough_nodes(groups: Groups, priors: Array) -> tuple[Array, Array, Array]:
    """What `_roughly` takes."""
    mean, sd, scale = priors[2], priors[3], priors[4]
    u = np.linspace(mean - FAR * sd, mean + FAR * sd, ROUGH_NODES)
    alone, weight = np.empty(u.size), np.empty((u.size, groups[0].size))
    for j in range(u.size):
        tau2 = (scale * np.exp(u[j])) ** 2
        square, _, _, log_det = sums(groups, groups[2], groups[2], tau2)
        alone[j] = -0.5 * (square + log_det + ((u[j] - mean) / sd) ** 2)
        for g in range(groups[0].size):
            weight[j, g] = 1.0 / max(groups[0][g] + tau2, LEAST)
    return u, alone, weight


@compiled(error_model="numpy")
def _next_term(pull: float, stiff: float, bend: float) -> float:
    """What Laplace's method leaves out of ln of the integral, to the next order; cut where that is no small number."""
    third, fourth = pull - 4.0 * stiff, pull - 8.0 * stiff
    found = fourth / (8.0 * bend * bend) + 5.0 * third * third / (24.0 * bend * bend * bend)
    left_out: float = np.log1p(min(max(found, -MOST_LEFT_OUT), MOST_LEFT_OUT))
    return left_out


@compiled(error_model="numpy")
def _on_nodes(groups: Groups, ya: Array, aa: Array, priors: Array, ends: Array, value: Array) -> float:
    """Fill ``value`` (nodes,) with ln of the integral over t at nodes between ``ends`` (2,); returns the largest."""
    mean, sd, noise_mean, noise_sd, scale = priors[0], priors[1], priors[2], priors[3], priors[4]
    h, top = (ends[1] - ends[0]) / (value.size - 1), -np.inf
    for j in range(value.size):
        u = ends[0] + j * h
        square, pull, stiff, log_det = sums(groups, ya, aa, (scale * np.exp(u)) ** 2)
        t, g, bend = peak(pull, stiff, mean, sd)
        z, zu = (t - mean) / sd, (u - noise_mean) / noise_sd
        value[j] = g * pull - 0.5 * (square + g * g * stiff + log_det + z * z + zu * zu + np.log(bend))
        value[j] += _next_term(g * pull, g * g * stiff, bend)
        top = max(top, value[j])
    return top


@compiled(error_model="numpy")
def integrated(groups: Groups, ya: Array, aa: Array, priors: Array, nodes: int) -> tuple[Array, Array, Array, Array]:
    """ln p(y | f) (B,), and first node (B,), step (B,) and normalised density (B, nodes) of u, of ya and aa (B, G).

    ``priors``: mean and sd of t, mean and sd of u, scale.
    """
    curves, level = len(ya), -np.log(priors[1]) - np.log(priors[3]) - 0.5 * np.log(2.0 * np.pi)
    total, first, step, ends = np.empty(curves), np.empty(curves), np.empty(curves), np.empty(2)
    density, rough = np.empty((curves, nodes)), _rough_nodes(groups, priors)
    for b in range(curves):
        value = density[b]
        ends[0], ends[1] = _roughly(rough, ya[b], aa[b])
        for zoom in range(ZOOMS):
            top = _on_nodes(groups, ya[b], aa[b], priors, ends, value)
            h = (ends[1] - ends[0]) / (nodes - 1)
            begin, end = _matters(value, top)
            if not (0 < end - begin < nodes // 2) or zoom == ZOOMS - 1:
                break
            ends[0], ends[1] = ends[0] + begin * h, ends[0] + end * h
        for j in range(nodes):
            value[j] = np.exp(value[j] - top)
        mass = h * (np.sum(value) - 0.5 * (value[0] + value[nodes - 1]))
        total[b], first[b], step[b] = top + np.log(mass) + level, ends[0], h
        for j in range(nodes):
            value[j] /= mass
    return total, first, step, density
