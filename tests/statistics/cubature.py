"""ln Z of a posterior with one or two curve coordinates and white noise, on a grid that is refined where it matters."""

import numpy as np
from scipy.special import logsumexp

from bayesmembrane.calibration.posterior import Posterior

DEEP = 18.0  # what lies this much below the largest term, in ln, is left out
NOISE = 240


def log_evidence(posterior: Posterior, cells: int = 120) -> float:
    """ln of the integral of p0 1[convex] L over all coordinates, with ``cells`` midpoints a curve coordinate.

    The curve does not depend on the noise, so that each curve is solved once and the noise is integrated by Simpson.
    """
    k = posterior.hypothesis.curve_size
    box = _first_box(posterior)
    for count in (40, cells, cells):
        axes = [np.linspace(low, high, count + 1) for low, high in box]
        middles = [0.5 * (a[1:] + a[:-1]) for a in axes]
        x = np.stack([m.ravel() for m in np.meshgrid(*middles, indexing="ij")], axis=1)
        terms = _over_noise(posterior, x).reshape([count] * k)
        volume = sum(np.log(a[1] - a[0]) for a in axes)
        value = float(logsumexp(terms) + volume)
        box = [_trimmed(terms, i, axes[i]) for i in range(k)]
    return value


def _first_box(posterior: Posterior) -> list[tuple[float, float]]:
    """The prior's bulk: what is left out has less than 1e-9 of it."""
    priors = [p.prior.distribution() for p in posterior.hypothesis.parameters[: posterior.hypothesis.curve_size]]
    rng = np.random.default_rng(0)
    box = [(p.ppf(1e-9), p.ppf(1 - 1e-9)) for p in priors]
    k = posterior.hypothesis.curve_size
    for i in range(6):
        # A random search that closes in: a grid over the whole prior would miss a narrow posterior. The first draws
        # are those of the prior, of which a strict convexity mode leaves few.
        uniform = np.stack([rng.uniform(low, high, 600) for low, high in box], axis=1)
        x = np.concatenate([uniform, posterior.prior.draw(rng, 4000)[:, :k]]) if i == 0 else uniform
        value = _over_noise(posterior, x)
        good = x[value > np.max(value) - 4 * DEEP]
        grown = []
        for i, (low, high) in enumerate(box):
            reach = np.ptp(good[:, i]) * 0.3 + 0.02 * (high - low)
            grown.append((max(low, good[:, i].min() - reach), min(high, good[:, i].max() + reach)))
        box = grown
    return box


def _trimmed(terms, axis, edges):
    """The part of an axis on which the terms are not negligible, with a cell on either side."""
    others = tuple(i for i in range(terms.ndim) if i != axis)
    profile = np.max(terms, axis=others) if others else terms
    keep = np.flatnonzero(profile > np.max(terms) - DEEP)
    return edges[max(keep[0] - 1, 0)], edges[min(keep[-1] + 2, len(edges) - 1)]


def _over_noise(posterior: Posterior, curves: np.ndarray) -> np.ndarray:
    """ln of the integral over ln_sd, (B,), -inf where the curve does not exist or is not convex."""
    h, m = posterior.hypothesis, posterior.measurement
    out = np.full(len(curves), -np.inf)
    for part in np.array_split(np.arange(len(curves)), max(1, len(curves) // 2000)):
        prediction = posterior.forward(curves[part])
        good = part[prediction.ok & posterior.prior.inside(prediction)]
        force = prediction.force[np.isin(part, good)]
        prior = sum(p.prior.log_density(curves[good, i]) for i, p in enumerate(h.parameters[: h.curve_size]))
        out[good] = prior + _noise_integral(posterior, m.force - force)
    return out


def _noise_integral(posterior: Posterior, residual: np.ndarray) -> np.ndarray:
    (noise,) = posterior.hypothesis.noise.coordinates
    centre, reach = noise.prior.mean, 8 * noise.prior.sd
    t = np.linspace(centre - reach, centre + reach, NOISE + 1)
    weight = np.ones(NOISE + 1)
    weight[1:-1:2], weight[2:-1:2] = 4, 2
    log_weight = np.log(weight * (t[1] - t[0]) / 3) + noise.prior.log_density(t)
    terms = np.empty((len(residual), t.size))
    for i, value in enumerate(t):
        terms[:, i] = posterior.noise.log_likelihood(residual, np.full((len(residual), 1), value))
    return logsumexp(terms + log_weight, axis=1)
