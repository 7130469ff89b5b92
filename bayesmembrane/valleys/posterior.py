"""The posterior over the parameters that users read: on a grid, as a normal distribution, or from draws."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp

from bayesmembrane.calibration.descent import descend
from bayesmembrane.calibration.objective import Objective
from bayesmembrane.calibration.prior import JointPrior
from bayesmembrane.ground.parameters import Array
from bayesmembrane.ground.symmetric import normal_draws
from bayesmembrane.physics.convexity import RESTRICTING, ConvexityMode
from bayesmembrane.physics.form_error import traces
from bayesmembrane.physics.noise.base import NoiseLikelihood, force_scale
from bayesmembrane.valleys.surface import Surface

NOISE_NODES = {1: (161,), 2: (41, 13), 3: (21, 7, 5)}
REACH = 4.0  # prior standard deviations of the noise's coordinates
ROUNDS, ITERATIONS = 4, 60


@dataclass(frozen=True, eq=False)
class Grid:
    """Films on a grid of any shape S over two parameters, or one.

    z : (*S, k), natural : (*S, k)
    loss : S, N; inf where no film reaches the data
    log_posterior : S, up to a constant: noise integrated out, prior included, without the convexity cut, per area of
        the natural parameters; -inf where there is no film
    margins : each convexity mode -> S, by how much it is met
    """

    z: Array
    natural: Array
    loss: Array
    log_posterior: Array
    margins: dict[str, Array]

    def convex(self, mode: ConvexityMode) -> NDArray[np.bool_]:
        """S, True where the convexity mode is met."""
        known = np.isfinite(self.loss)
        return known & mode.holds(self.margins[mode.name]) if mode.restricts else known


def grid(surface: Surface, z: Array) -> Grid:
    """The `Grid` of z (*S, k)."""
    shape, flat = z.shape[:-1], z.reshape(-1, z.shape[-1])
    h, y = surface.hypothesis, surface.measurement.force
    x = surface.chart.coordinates(flat)
    good = np.flatnonzero(np.all(np.isfinite(x), axis=1))
    loss, density = np.full(len(flat), np.inf), np.full(len(flat), -np.inf)
    margins = {m.name: np.full(len(flat), -np.inf) for m in RESTRICTING}
    if good.size:
        prediction = surface.objective.forward(x[good])
        loss[good] = surface.objective.many(prediction)
        for mode in RESTRICTING:
            margins[mode.name][good] = mode.margin(prediction, h.material)
        ok = np.isfinite(loss[good])
        part = good[ok]
        noise, force = h.noise.bind(surface.measurement), prediction.force[ok]
        shown = traces(surface.objective.forward, x[part], force) if noise.traced else None
        likelihood = _integrated(noise.at(force, shown), surface, y - force)
        prior = np.sum([p.prior.log_density(x[part, i]) for i, p in enumerate(surface.objective.parameters)], axis=0)
        slopes = np.linalg.slogdet(surface.coordinate_slopes(x[part], flat[part]))[1]
        stretch = np.sum(np.log(np.abs(surface.chart.stretch(flat[part]))), axis=1)
        density[part] = likelihood + prior + slopes - stretch
    folded = {m: v.reshape(shape) for m, v in margins.items()}
    return Grid(z, surface.chart.natural(z), loss.reshape(shape), density.reshape(shape), folded)


def _integrated(noise: NoiseLikelihood, surface: Surface, residual: Array) -> Array:
    """ln int p(residual | noise) p(noise) d noise, (B,), by the trapezoidal rule over the noise's coordinates."""
    nodes, weights = _noise_nodes(surface)
    if not len(nodes):
        return np.asarray(noise.log_likelihood(residual, np.empty((len(residual), 0))))
    out = np.full(len(residual), -np.inf)
    for x, w in zip(nodes, weights, strict=True):
        value = noise.log_likelihood(residual, np.broadcast_to(x, (len(residual), x.size)))
        out = np.logaddexp(out, np.where(np.isnan(value), -np.inf, value) + w)
    return out


def _noise_nodes(surface: Surface) -> tuple[Array, Array]:
    """Coordinates of the noise (M, m) and ln(prior density x cell) (M,)."""
    parameters = surface.hypothesis.parameters[surface.hypothesis.curve_size :]
    if not parameters:
        return np.empty((0, 0)), np.empty(0)
    counts = NOISE_NODES.get(len(parameters), (9,) * len(parameters))
    axes = []
    for p, count in zip(parameters, counts, strict=True):
        middle, sd = float(p.prior.quantile(0.5)), p.prior.mean_sd[1]
        axes.append(np.linspace(middle - REACH * sd, middle + REACH * sd, count))
    nodes = np.stack([m.ravel() for m in np.meshgrid(*axes, indexing="ij")], axis=1)
    cell = float(np.sum([np.log(a[1] - a[0]) for a in axes]))
    density = np.sum([p.prior.log_density(nodes[:, i]) for i, p in enumerate(parameters)], axis=0)
    return nodes, density + cell


@dataclass(frozen=True, eq=False)
class Spread:
    """A posterior in few numbers: mean (k,) and covariance (k, k) of z, and draws (B, k) of it.

    ``source`` is "draws", "grid" or "normal" (a normal distribution at the mode).
    """

    mean: Array
    covariance: Array
    draws: Array
    source: str


def spread_of_draws(surface: Surface, x: Array) -> Spread:
    """From draws x (B, k or more) of a run."""
    z = surface.chart.from_coordinates(x)
    z = z[np.all(np.isfinite(z), axis=1)]
    return Spread(np.mean(z, axis=0), np.atleast_2d(np.cov(z.T)), z, "draws")


def spread_of_grid(found: Grid, cells: Array, mode: ConvexityMode, seed: int = 0, size: int = 2000) -> Spread:
    """From a grid (*S, k) whose cells have the volumes ``cells`` S in natural parameters, under a convexity mode."""
    keep = found.convex(mode)
    with np.errstate(divide="ignore"):
        weight = np.where(keep, found.log_posterior + np.log(cells), -np.inf).ravel()
    total = logsumexp(weight)
    if not np.isfinite(total):
        k = found.z.shape[-1]
        return Spread(np.full(k, np.nan), np.full((k, k), np.nan), np.empty((0, k)), "grid")
    w = np.exp(weight - total)
    z = found.z.reshape(-1, found.z.shape[-1])
    mean = w @ z
    centred = z - mean
    rng = np.random.default_rng(seed)
    cell = rng.choice(len(z), size=size, p=w / w.sum())
    # Anywhere in its cell: draws at the middles only would stand in lines.
    steps = [np.gradient(found.z, axis=i).reshape(z.shape)[cell] for i in range(z.shape[1])]
    within = np.sum(rng.uniform(-0.5, 0.5, (z.shape[1], size, 1)) * np.array(steps), axis=0)
    return Spread(mean, (centred * w[:, None]).T @ centred, z[cell] + within, "grid")


class NormalPosterior:
    """The posterior as a normal distribution: covariance (J^T Sigma^-1 J + prior precision)^-1 at its mode.

    Sigma is the noise with its own coordinates at their most probable values, given the residual at the mode; both
    are found in turn. A normal with the prior's median and spread stands for the prior; the convexity cut plays no
    part.
    """

    def __init__(self, surface: Surface, start: Array) -> None:
        self.surface = surface
        o = surface.objective
        self.objective = (
            o if o.loss == "euclidean" else Objective(o.hypothesis, o.measurement, "euclidean", o.forward.solve)
        )
        x = np.clip(surface.chart.coordinates(start[None, :]), self.objective.low, self.objective.high)
        for _ in range(ROUNDS):
            self.noise_covariance = self._noise(x)
            self.whitening = np.linalg.inv(np.linalg.cholesky(self.noise_covariance))
            x, _ = descend(self._residuals, x, (self.objective.low, self.objective.high), ITERATIONS)
        self.x = x[0]

    def _noise(self, x: Array) -> Array:
        """Sigma (N, N) at the most probable noise for the residual of x (1, k)."""
        h, m = self.surface.hypothesis, self.surface.measurement
        residual = self.objective.batch(x)[0][0]
        bound, force = h.noise.bind(m), (m.force + residual)[None, :]
        bound = bound.at(force, traces(self.objective.forward, x, force) if bound.traced else None)
        nodes, weights = _noise_nodes(self.surface)
        if not len(nodes):
            return bound.covariance(np.empty(0))
        value = bound.log_likelihood(np.broadcast_to(residual, (len(nodes), residual.size)), nodes) + weights
        return bound.covariance(nodes[int(np.argmax(value))])

    def _residuals(self, x: Array) -> tuple[Array, Array]:
        o = self.objective
        r, j = o.batch(x)
        pull = np.broadcast_to(np.diag(1 / o.spread), (len(x), o.spread.size, o.spread.size))
        return (
            np.concatenate([r @ self.whitening.T, (x - o.centre) / o.spread], axis=1),
            np.concatenate([np.einsum("mn,bnk->bmk", self.whitening, j), pull], axis=1),
        )

    @cached_property
    def z(self) -> Array:
        """The mode (k,)."""
        return np.asarray(self.surface.chart.from_coordinates(self.x)[0])

    def prior_precision(self, x: Array) -> Array:
        """Prior precision (B, k, k) in z at coordinates x (B, k)."""
        slopes = self.surface.coordinate_slopes(x, self.surface.chart.from_coordinates(x))
        scaled = slopes / self.objective.spread[:, None]
        return np.asarray(np.einsum("bij,bik->bjk", scaled, scaled))

    def information(self, z: Array) -> Array:
        """J^T Sigma^-1 J (B, k, k) of the data in z (B, k)."""
        j = np.einsum("mn,bnk->bmk", self.whitening, self.surface.batch(z)[1])
        return np.asarray(np.einsum("bmk,bml->bkl", j, j))

    def precision(self, z: Array) -> Array:
        """Posterior precision (B, k, k) at z (B, k)."""
        return self.information(z) + self.prior_precision(self.surface.chart.coordinates(z))

    @property
    def noise_sd(self) -> float:
        """Root mean square of the noise's standard deviations, N."""
        return float(np.sqrt(np.mean(np.diag(self.noise_covariance))))

    @property
    def noise_share(self) -> float:
        """`noise_sd` over the largest force."""
        return self.noise_sd / force_scale(self.surface.measurement)

    def spread(self, seed: int = 0, size: int = 2000) -> Spread:
        """Mean, covariance and draws of the normal distribution."""
        covariance = np.linalg.inv(self.precision(self.z[None, :])[0])
        covariance = 0.5 * (covariance + covariance.T)
        draws = self.z + normal_draws(covariance, size, np.random.default_rng(seed))
        return Spread(self.z, covariance, draws, "normal")


def posterior_margin(surface: Surface, z: Array, mode: ConvexityMode) -> NDArray[np.bool_]:
    """(B,) True where the films z (B, k) meet the convexity mode and reach the data."""
    out = np.zeros(len(z), dtype=bool)
    x = surface.chart.coordinates(z)
    good = np.flatnonzero(np.all(np.isfinite(x), axis=1))
    if good.size:
        prediction = surface.objective.forward(x[good])
        out[good] = JointPrior(surface.hypothesis).inside(prediction, mode) & prediction.ok
    return out
