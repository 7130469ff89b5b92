"""The joint prior: independent coordinates, cut to energies that are convex enough, and the mass this leaves."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bayesmembrane.data.measurement import Measurement
from bayesmembrane.ground.parameters import Array
from bayesmembrane.physics.convexity import MODES, ConvexityMode
from bayesmembrane.physics.forward import Forward, Prediction, Solve
from bayesmembrane.physics.hypothesis import Hypothesis
from bayesmembrane.physics.mechanics import api

DRAWS = 2048


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

    def inside(self, prediction: Prediction, mode: ConvexityMode | None = None) -> NDArray[np.bool_]:
        """(B,) True where the convexity prior holds, or another mode."""
        mode = mode or self.hypothesis.convexity
        return mode.holds(mode.margin(prediction, self.hypothesis.material))

    def survey(
        self, measurement: Measurement, seed: int = 0, draws: int = DRAWS, solve: Solve = api.solve
    ) -> tuple[dict[str, Mass], Array]:
        """The mass of every convexity mode, and the draws that the hypothesis' own mode leaves, shape (M, k).

        From ``draws`` draws of p0, of which k are inside, the mass is m = k/n with sd sqrt(m (1 - m) / n); none inside
        is reported as half a hit, whose logarithm exists, and all of them as 1.
        """
        x = self.draw(np.random.default_rng(seed), draws)
        prediction = Forward(self.hypothesis, measurement, measurement.deflection, solve)(x)
        masses = {n: _mass(int(np.sum(self.inside(prediction, m))), draws) for n, m in MODES.items()}
        return masses, x[self.inside(prediction)]

    def masses(
        self, measurement: Measurement, seed: int = 0, draws: int = DRAWS, solve: Solve = api.solve
    ) -> dict[str, Mass]:
        """The first part of `survey`."""
        return self.survey(measurement, seed, draws, solve)[0]


def _mass(hits: int, draws: int) -> Mass:
    if hits == draws:
        return Mass(1.0, 0.0)
    m = hits / draws if hits else 0.5 / (draws + 1)
    return Mass(m, float(np.sqrt(m * (1 - m) / draws)))
