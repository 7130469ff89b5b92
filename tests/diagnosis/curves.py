"""Measurements of known content for the parts of the diagnosis."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from bayesmembrane.data.measurement import Measurement, Specimen
from bayesmembrane.diagnosis.reference.noise import OwnNoise
from bayesmembrane.ground.parameters import Array
from bayesmembrane.physics.noise.ar1 import gaps_of
from bayesmembrane.physics.rigs.annulus import Annulus
from bayesmembrane.physics.rigs.uniaxial import Uniaxial

SD = 0.004
RIG, SPECIMEN = Annulus(0.010, 0.035), Specimen("film", 50e-6)


def triangle(points: int, peaks: tuple[float, ...] = (0.02, 0.04)) -> Array:
    """(points,) m: up to each peak and back."""
    turns = np.concatenate([[0.0], *([p, 0.0] for p in peaks)])
    way = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(turns)))])
    return np.interp(np.linspace(0, way[-1], points + 1)[1:], way, turns)


def measured(
    force: Array,
    deflection: Array | None = None,
    time: Array | None = None,
    covariance: Array | None = None,
    force_sd: Array | None = None,
) -> Measurement:
    """``force`` (N,) N over a triangle, at a point a second."""
    d = triangle(force.size) if deflection is None else deflection
    t = np.arange(1.0, force.size + 1) if time is None else time
    return Measurement(d, force, RIG, SPECIMEN, time=t, covariance=covariance, force_sd=force_sd)


def pulled_and_held(time: Array, ramp: float, kept: Callable[[Array], Array], noise: float, seed: int) -> Measurement:
    """A strip that is pulled within ``ramp`` s and held; the convolution with what is ``kept`` after a lag is summed
    here, and ``noise`` is a part of the largest force.
    """
    stretch = 1 + 0.8 * np.minimum(time / ramp, 1)
    elastic = np.concatenate([[0.0], 60 * (stretch - 1 / stretch**2)])
    ticks = np.concatenate([[0.0], time])
    lag = time[:, None] - 0.5 * (ticks[1:] + ticks[:-1])
    kernel = np.where(lag > 0, kept(np.maximum(lag, 0)), 0.0)
    rig = Uniaxial()
    force = rig.width * (kernel @ np.diff(elastic))
    noisy = force + noise * force.max() * np.random.default_rng(seed).standard_normal(time.size)
    return Measurement(rig.length * (stretch - 1), noisy, rig, Specimen("strip", 1e-3), time=time)


def correlated(rng: np.random.Generator, time: Array, rho: float, sd: float = SD) -> Array:
    """(N,) N: noise whose correlation is rho^|t - t'|, by the root of its covariance."""
    c = rho ** np.abs(time[:, None] - time[None, :]) if rho > 0 else np.eye(time.size)
    return sd * np.linalg.cholesky(c) @ rng.standard_normal(time.size)


def white_noise(measurement: Measurement, sd: float = SD, dof: float = 1e9) -> OwnNoise:
    """Known white noise."""
    return OwnNoise(sd, 0.0, 0.0, gaps_of(measurement), None, dof)


def without(values: Array, columns: Array) -> Array:
    """(N,) ``values`` less their projection on ``columns`` (N, k)."""
    return values - columns @ np.linalg.lstsq(columns, values, rcond=None)[0]
