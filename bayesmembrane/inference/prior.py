"""The joint prior: independent coordinates, cut to energies that are convex enough, and the mass this leaves."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bayesmembrane.errors import SettingsError
from bayesmembrane.forward import Forward, Prediction, Solve
from bayesmembrane.hypothesis import CONVEXITY, Hypothesis
from bayesmembrane.measurement import Measurement
from bayesmembrane.mechanics import api
from bayesmembrane.parameters import Array

DRAWS = 4096
MOST_ROUNDS = 200


@dataclass(frozen=True)
class Mass:
    """The part of the untruncated prior that a convexity mode leaves, with its Monte Carlo standard error."""

    value: float
    sd: float


@dataclass(frozen=True)
class JointPrior:
    """p0(x) = prod_i p_i(x_i), and p(x) = p0(x) 1[convex] / mass for the hypothesis' convexity mode."""

    hypothesis: Hypothesis

    def log_density(self, x: ArrayLike) -> Array:
        """ln p0(x) of x (B, k), shape (B,): untruncated and normalised."""
        x = np.atleast_2d(np.asarray(x, dtype=float))
        return np.asarray(sum(p.prior.log_density(x[:, i]) for i, p in enumerate(self.hypothesis.parameters)))

    def draw(self, rng: np.random.Generator, size: int) -> Array:
        """Draws from p0, shape (size, k)."""
        return np.stack([p.prior.draw(rng, size) for p in self.hypothesis.parameters], axis=1)

    def transform(self, u: ArrayLike) -> Array:
        """Quantiles of p0 at u in [0, 1]^k, shape (..., k): the prior transform of nested sampling, untruncated."""
        u = np.asarray(u, dtype=float)
        columns = [p.prior.quantile(u[..., i]) for i, p in enumerate(self.hypothesis.parameters)]
        return np.stack(columns, axis=-1)

    def inside(self, prediction: Prediction, mode: str | None = None) -> NDArray[np.bool_]:
        """(B,) True where the convexity prior holds; strictly above zero for ``elliptic``."""
        mode = mode or self.hypothesis.convexity
        margin = prediction.margin(mode, self.hypothesis)
        return np.asarray(margin > 0 if mode == "elliptic" else margin >= 0)

    def draw_truncated(
        self, measurement: Measurement, rng: np.random.Generator, size: int, solve: Solve = api.solve
    ) -> Array:
        """Draws from the truncated prior, shape (size, k), by rejection.

        Raises `SettingsError` if the convexity prior leaves next to nothing.
        """
        forward = Forward(self.hypothesis, measurement, measurement.deflection, solve)
        kept: list[Array] = []
        found = 0
        for _ in range(MOST_ROUNDS):
            x = self.draw(rng, max(256, size // 2))
            kept.append(x[self.inside(forward(x))])
            found += len(kept[-1])
            if found >= size:
                return np.concatenate(kept)[:size]
        raise SettingsError(
            f'the convexity prior "{self.hypothesis.convexity}" leaves less than one in a thousand draws of the prior',
            remedy='choose another one: "reached", "elliptic" or "none"',
        )

    def masses(
        self, measurement: Measurement, seed: int = 0, draws: int = DRAWS, solve: Solve = api.solve
    ) -> dict[str, Mass]:
        """The mass of every mode, m = k/n with sd sqrt(m (1 - m) / n), from the same ``draws`` of p0.

        Zero or all hits are reported as (k + 1/2)/(n + 1), whose logarithm exists.
        """
        x = self.draw(np.random.default_rng(seed), draws)
        prediction = Forward(self.hypothesis, measurement, measurement.deflection, solve)(x)
        return {mode: _mass(int(np.sum(self.inside(prediction, mode))), draws) for mode in CONVEXITY}


def _mass(hits: int, draws: int) -> Mass:
    if hits == draws:
        return Mass(1.0, 0.0)
    m = hits / draws if hits else 0.5 / (draws + 1)
    return Mass(m, float(np.sqrt(m * (1 - m) / draws)))
