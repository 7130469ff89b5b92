"""The joint prior: independent coordinates, cut to energies that are convex enough, and the mass this leaves."""

from __future__ import annotations

import zlib
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bayesmembrane.data.measurement import Measurement
from bayesmembrane.data.thinning import MOST
from bayesmembrane.ground.parameters import Array, Normal, Parameter
from bayesmembrane.ground.sobol import scrambled_sobol
from bayesmembrane.physics.convexity import MODES, ConvexityMode, States
from bayesmembrane.physics.forward import AT_ONCE, Forward, Margins, Solve
from bayesmembrane.physics.hypothesis import Hypothesis
from bayesmembrane.physics.mechanics import api

if TYPE_CHECKING:
    from scipy.stats import qmc

DRAWS, MOST_DRAWS = 2048, 16384
SCRAMBLES = 8  # of the points, independent of each other: their spread is the error
LOG_SD = 0.01  # standard error of ln mass that is aimed at


@dataclass(frozen=True)
class Mass:
    """The part of the untruncated prior that a convexity mode leaves, with the standard error of its quadrature."""

    value: float
    sd: float

    def divides(self, log_integral: float, sd: float) -> tuple[float, float]:
        """(ln Z, its standard error) of a ln of an integral over the untruncated prior: less ln of the mass."""
        return log_integral - float(np.log(self.value)), float(np.hypot(sd, self.sd / self.value))


@dataclass(frozen=True)
class JointPrior:
    """p0(x) = prod_i p_i(x_i), and p(x) = p0(x) 1[convex] / mass for the hypothesis' convexity mode."""

    hypothesis: Hypothesis

    def log_density(self, x: ArrayLike) -> Array:
        """ln p0(x) of x (B, k), shape (B,): untruncated and normalised."""
        x = np.atleast_2d(np.asarray(x, dtype=float))
        normal, mean, sd, level = self._normals
        z = (x[:, normal] - mean) / sd
        total: Array = level - 0.5 * np.einsum("bi,bi->b", z, z)
        for i, p in self._others:
            total = total + p.prior.log_density(x[:, i])
        return total

    @cached_property
    def _normals(self) -> tuple[NDArray[np.intp], Array, Array, float]:
        """Of normal priors, taken together: a walk asks for the density more often than for anything else."""
        which = [(i, p.prior) for i, p in enumerate(self.hypothesis.parameters) if type(p.prior) is Normal]
        mean, sd = np.array([p.mean for _, p in which]), np.array([p.sd for _, p in which])
        level = -float(np.sum(np.log(sd * np.sqrt(2 * np.pi))))
        return np.array([i for i, _ in which], dtype=np.intp), mean, sd, level

    @cached_property
    def _others(self) -> list[tuple[int, Parameter]]:
        return [(i, p) for i, p in enumerate(self.hypothesis.parameters) if type(p.prior) is not Normal]

    def draw(self, rng: np.random.Generator, size: int) -> Array:
        """Draws from p0, shape (size, k)."""
        return np.stack([p.prior.draw(rng, size) for p in self.hypothesis.parameters], axis=1)

    def transform(self, u: ArrayLike) -> Array:
        """Quantiles of p0 at u in [0, 1]^k, shape (..., k): the prior transform of nested sampling, untruncated."""
        u = np.asarray(u, dtype=float)
        columns = [p.prior.quantile(u[..., i]) for i, p in enumerate(self.hypothesis.parameters)]
        return np.stack(columns, axis=-1)

    def inside(self, states: States, mode: ConvexityMode | None = None) -> NDArray[np.bool_]:
        """(B,) True where the convexity prior holds, or another mode."""
        mode = mode or self.hypothesis.convexity
        return mode.met(states, self.hypothesis.material)

    def surely_inside(self, x: Array) -> NDArray[np.bool_]:
        """(B,) True where x (B, k) are convex in whatever state, and the prior asks for nothing else."""
        if not self.hypothesis.convexity.looks_beyond:
            return np.zeros(len(x), dtype=bool)
        return self.convex_everywhere(x)

    def convex_everywhere(self, x: Array) -> NDArray[np.bool_]:
        """(B,) True where the films of x (B, k) are known to be convex in every state."""
        return np.asarray(self.hypothesis.material.convex_everywhere(self.hypothesis.films(x).T), dtype=bool)

    def met(self, x: Array, forward: Forward, reached: bool = True) -> NDArray[np.bool_]:
        """(B,) whether x (B, k) meet the convexity prior; ``forward`` solves only films that may not."""
        found = self.convex_everywhere(x)
        if not np.all(found):
            rest = ~found
            found[rest] = self.inside(forward(x[rest], reached=reached, spare=self.hypothesis.convexity.spare))
        return found

    def scrambled(self, seed: int) -> list[Scrambled]:
        """`SCRAMBLES` independent sequences of points that fill p0 evenly; others for another hypothesis."""
        h = self.hypothesis
        own = zlib.crc32(f"{h.label()} {h.noise.name} {h.convexity}".encode())
        rngs = np.random.default_rng([seed, own]).spawn(SCRAMBLES)
        return [Scrambled(self, scrambled_sobol(len(h.parameters), rng)) for rng in rngs]

    def mass(self, inside: Callable[[Array], NDArray[np.bool_]], seed: int = 0) -> Mass:
        """The mass of the x (B, k) that are ``inside``: by so many points that ln of it is known to `LOG_SD`.

        That is the mean over scrambled Sobol points (A. B. Owen, J. Complexity 14 (1998) 466), and its error comes from
        the spread of `SCRAMBLES` independent scrambles. Twice as many points are taken until it is small enough, or
        `MOST_DRAWS` have been. None inside is a mass of zero with the error of one point.
        """
        sequences, counted = self.scrambled(seed), DRAWS // SCRAMBLES
        hits = np.array([int(np.sum(inside(s.draw(counted)))) for s in sequences])
        while (found := _mass(hits, counted)).sd > LOG_SD * found.value and 2 * counted * SCRAMBLES <= MOST_DRAWS:
            hits += [int(np.sum(inside(s.draw(counted)))) for s in sequences]
            counted *= 2
        return found if np.any(hits) else Mass(0.0, 1 / (counted * SCRAMBLES))

    def survey(
        self, measurement: Measurement, seed: int = 0, draws: int = DRAWS, solve: Solve = api.solve
    ) -> tuple[dict[str, Mass], Array]:
        """The mass of every convexity mode, and the draws that the hypothesis' own mode leaves, shape (M, k).

        From ``draws`` points at least, those of `mass`; none inside is reported as half a hit, whose logarithm exists,
        and all of them as 1.
        """
        each = 1 << int(np.ceil(np.log2(max(1, draws / SCRAMBLES))))
        x = np.concatenate([s.draw(each) for s in self.scrambled(seed)])
        forward = Forward(self.hypothesis, measurement, measurement.deflection, solve)
        rows = max(1, AT_ONCE // min(len(measurement), MOST))
        inside = {n: np.empty(len(x), bool) for n in MODES}
        for part in [slice(i, i + rows) for i in range(0, len(x), rows)]:
            found = self.inside_each(forward, x[part])  # of some curves at every reading: not for all films at once
            for n in MODES:
                inside[n][part] = found[n]
        masses = {n: _mass(np.sum(i.reshape(SCRAMBLES, each), axis=1), each) for n, i in inside.items()}
        order = np.random.default_rng([seed, 2]).permutation(len(x))
        return masses, x[order][inside[self.hypothesis.convexity.name][order]]

    def inside_each(self, forward: Forward, x: Array) -> dict[str, NDArray[np.bool_]]:
        """{mode: (B,) whether it holds} of x (B, k); only films that may miss one are followed."""
        films = self.hypothesis.films(x)
        sure, unknown = self.convex_everywhere(x), np.full(len(x), np.nan)
        found = {
            n: self.inside(Margins(films, unknown, unknown, unknown[:, None], unknown[:, None]), mode)
            for n, mode in MODES.items()
        }
        if not np.all(sure):
            states = forward.margins(x[~sure])
            for n, mode in MODES.items():
                found[n][~sure] = self.inside(states, mode)
        return found

    def masses(
        self, measurement: Measurement, seed: int = 0, draws: int = DRAWS, solve: Solve = api.solve
    ) -> dict[str, Mass]:
        """The first part of `survey`."""
        return self.survey(measurement, seed, draws, solve)[0]


@dataclass(frozen=True, eq=False)
class Scrambled:
    """Points of one scrambled sequence, in the coordinates of a prior."""

    prior: JointPrior
    sequence: qmc.Sobol

    def draw(self, count: int) -> Array:
        """The next ``count`` points, (count, k); powers of two keep them even."""
        # The sequence lies on a grid of 2^-30 that has 0 in it.
        return self.prior.transform(self.sequence.random(count) + 2.0**-31)


def _mass(hits: NDArray[np.integer], counted: int) -> Mass:
    """From the ``hits`` (R,) of R independent scrambles of ``counted`` points each.

    The error is no less than that of a whole number of hits: a grid in one dimension misses by up to one each time.
    """
    n = hits.size * counted
    if np.all(hits == counted):
        return Mass(1.0, 0.0)
    if not np.any(hits):
        return Mass(0.5 / (n + 1), float(np.sqrt(0.5) / n))
    least = 1 / (np.sqrt(12 * hits.size) * counted)
    return Mass(float(np.sum(hits) / n), max(float(np.std(hits, ddof=1) / np.sqrt(hits.size) / counted), float(least)))
