"""The posterior of a measured curve given distances to simulated ones: prior, residuals.

    L_kr = | y_r - F_k(x_r) (1 + error_k) | + error_kr,   y = g(x) + nugget,   x_r evenly spaced

k counts the rows of the published table, r its ranges. g is one curve for all ranges, of a family that says what is
believed of it before the losses are seen (`families`). error_k is the numerical error of the published simulations:
shared by rows whose curves are equal up to a factor (neo-Hookean rows), since it does not depend on the factor.
error_kr, what else is wrong with a simulation or a print, has heavy tails: a Student t vector for each material and
range, since what makes a material hard to simulate is common to its rows. Everything unknown is one vector of numbers
with independent standard normal priors: the mode is that of a robust least-squares problem. Only the first positions
a_r differ: they follow one recipe, uniform between zero and a largest one that is common to the ranges and unknown (ln
uniform, not below the recording step s), in the smooth form p(a) ~ (s^4 + sum_r a_r^4)^(-R/4), and at most one spacing.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit, gammaln

from bayesmembrane.ground.parameters import Array
from bayesmembrane.reconstruction.families.base import CurveFamily
from bayesmembrane.reconstruction.simulations import Simulations

POWER = 4  # of the smooth maximum in the prior of the first positions
TAIL = 2.0  # degrees of freedom of the Student t that the losses of one material over one range follow


class Knobs(NamedTuple):
    """Scales that the unknowns are measured in; arrays of shape (B,) or scalars, ``solver`` with one more axis.

    Attributes
    ----------
    roughness : size of what is smooth and unknown in the curve; its family says in which unit
    nugget : load-cell noise of a single measured force, N
    solver : (..., n_ranges) error of a simulated force relative to the typical largest one of the range
    rounding : what is left of that error between rows whose simulations are one curve up to a factor
    """

    roughness: float | Array
    nugget: float | Array
    solver: Array
    rounding: float | Array

    def take(self, index: NDArray[np.intp] | list[int]) -> Knobs:
        """The settings at ``index``."""
        return Knobs(*(np.asarray(v)[index] for v in self))


class CurveState(NamedTuple):
    """What B vectors of unknowns mean.

    Attributes
    ----------
    x, force, smooth, slope : (B, N) deflections in m; measured force; its smooth part; its slope in N/m
    first : (B, R) first positions, m
    residual : (B, R K) model minus printed loss, N
    jacobian : (B, R K, P) its derivatives
    force_jacobian : (B, N, P) derivatives of the measured forces
    """

    x: Array
    force: Array
    smooth: Array
    slope: Array
    first: Array
    residual: Array
    jacobian: Array
    force_jacobian: Array


class _Curve(NamedTuple):
    """x, force (B, N), derivatives of the forces (B, N, P), and how x moves with the first position (B, N)."""

    x: Array
    force: Array
    dforce: Array
    moving: Array


@dataclass(frozen=True)
class LossModel:
    """The posterior at given numbers of points.

    Attributes
    ----------
    simulations : the simulated curves
    curve : the family of the measured curve
    losses : (R, K) printed losses, N
    use : (K,) rows that are believed
    ranges : indices of the ranges looked at
    counts : number of points of each of them
    step : m, the recording step of the measurement
    recipe : False for first positions that are uniform and independent
    widest : largest first position, in spacings
    tail : degrees of freedom of the Student t vectors
    """

    simulations: Simulations
    curve: CurveFamily
    losses: Array
    use: NDArray[np.bool_]
    ranges: tuple[int, ...]
    counts: tuple[int, ...]
    step: float
    recipe: bool = True
    widest: float = 1.0
    tail: float = TAIL

    def without(self, row: int) -> LossModel:
        """The model that does not believe a row."""
        use = self.use.copy()
        use[row] = False
        return replace(self, use=use)

    # ---- layout of the unknowns: curve | nugget | family errors | first positions ------------------------------------

    @property
    def points(self) -> int:
        """Number of points of all ranges together."""
        return sum(self.counts)

    @property
    def families(self) -> int:
        """Number of families of curves equal up to a factor."""
        return int(self.simulations.family.max()) + 1

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return self.curve.size + self.points * (1 + self.families) + len(self.ranges)

    def blocks(self) -> list[slice]:
        """Where the points of each range stand."""
        stops = np.cumsum(self.counts)
        return [slice(int(b - n), int(b)) for b, n in zip(stops, self.counts, strict=True)]

    @property
    def reach(self) -> Array:
        """(R,) the largest first position: ``widest`` spacings, m."""
        counts = np.array(self.counts)
        return self.widest * self.simulations.ends[list(self.ranges)] / (counts - 1 + self.widest)

    def positions(self, logit: Array) -> tuple[Array, Array, Array, Array]:
        """x (B, N), first (B, R), d first / d logit (B, R), and dx / d first (N,) from the logits (B, R)."""
        share = expit(logit)
        first = self.reach * share
        ends = self.simulations.ends[list(self.ranges)]
        weight = [1.0 - np.arange(n) / (n - 1) for n in self.counts]
        x = [end - (end - first[:, [i]]) * w for i, (end, w) in enumerate(zip(ends, weight, strict=True))]
        return np.concatenate(x, axis=1), first, first * (1 - share), np.concatenate(weight)

    # ---- the posterior -----------------------------------------------------------------------------------------------

    def smooth(self, theta: Array, knobs: Knobs, x: Array) -> tuple[Array, Array, Array]:
        """Smooth force (B, N) at x (B, N), its slope in N/m, and its derivatives (B, N, J) in the first unknowns."""
        size = np.broadcast_to(np.asarray(knobs.roughness, dtype=float), theta.shape[:1])
        return self.curve.force(theta[:, : self.curve.size], size, x)

    def evaluate(self, theta: Array, knobs: Knobs) -> CurveState:
        """Positions, forces, residuals and derivatives for unknowns (B, P)."""
        nb, n, ranges = self.curve.size, self.points, len(self.ranges)
        x, first, dfirst, weight = self.positions(theta[:, -ranges:])
        smooth, slope, shape = self.smooth(theta, knobs, x)
        nugget = np.broadcast_to(np.asarray(knobs.nugget, dtype=float), theta.shape[:1])
        force = smooth + nugget[:, None] * theta[:, nb : nb + n]
        dforce = np.zeros((*x.shape, self.size))
        dforce[:, :, :nb] = shape
        dforce[:, np.arange(n), nb + np.arange(n)] = nugget[:, None]
        moving = weight * np.repeat(dfirst, self.counts, axis=1)
        for i, block in enumerate(self.blocks()):
            dforce[:, block, self.size - ranges + i] = (slope * moving)[:, block]
        curve = _Curve(x, force, dforce, moving)
        parts = [self._range(i, theta, knobs, curve) for i in range(ranges)]
        residual, jacobian = (np.concatenate(v, axis=1) for v in zip(*parts, strict=True))
        return CurveState(x, force, smooth, slope, first, residual, jacobian, dforce)

    def _range(self, i: int, theta: Array, knobs: Knobs, curve: _Curve) -> tuple[Array, Array]:
        """Residuals (B, K) of range i and their derivatives (B, K, P)."""
        x, force, dforce, moving = curve
        block = self.blocks()[i]
        simulated, slope = self.simulations.forces(x[:, block])
        scale = np.broadcast_to(knobs.solver, (theta.shape[0], len(self.ranges)))[:, i]
        relative = np.zeros_like(simulated)
        columns = [self._error_columns(f)[block] for f in range(self.families)]
        for f, at in enumerate(columns):
            relative[:, :, self.simulations.family == f] = (scale[:, None] * theta[:, at])[:, :, None]
        gap = force[:, block, None] - simulated * (1 + relative)
        distance = np.sqrt(np.sum(gap**2, axis=1))
        unit = np.swapaxes(gap / distance[:, None, :], 1, 2)
        jacobian = unit @ dforce[:, block]
        shift = slope * (1 + relative) * moving[:, block, None]
        jacobian[:, :, self.size - len(self.ranges) + i] -= np.einsum("bkn,bnk->bk", unit, shift)
        for f, at in enumerate(columns):
            rows = np.flatnonzero(self.simulations.family == f)
            change = unit[:, rows] * np.swapaxes(simulated[:, :, rows], 1, 2) * scale[:, None, None]
            jacobian[:, rows[:, None], at] -= change
        return distance - self.losses[self.ranges[i]], jacobian

    def _error_columns(self, family: int) -> NDArray[np.intp]:
        return self.curve.size + self.points * (1 + family) + np.arange(self.points)

    def log_posterior(self, theta: Array, knobs: Knobs, loosen: float = 1.0) -> tuple[Array, Array]:
        """ln p(losses, theta) (B,) and its gradient (B, P); normalised in the losses."""
        return self.log_density(theta, self.evaluate(theta, knobs), knobs, loosen)

    def log_density(self, theta: Array, state: CurveState, knobs: Knobs, loosen: float) -> tuple[Array, Array]:
        """As `log_posterior`, from what the unknowns mean; ``loosen`` multiplies the errors."""
        scale = self.error_scale(knobs, theta.shape[0]) * loosen
        z = state.residual / scale
        value, gradient = self.log_prior(theta)
        slope = np.einsum("bm,bmp->bp", self.weights(z)[0] * z / scale, state.jacobian)
        return value + self.log_likelihood(state.residual, knobs, loosen), gradient - slope

    def log_likelihood(self, residual: Array, knobs: Knobs, loosen: float) -> Array:
        """ln p(losses | theta) (B,) from residuals (B, R K); ``loosen`` multiplies the errors."""
        scale = self.error_scale(knobs, residual.shape[0]) * loosen
        _, size, total = self.weights(residual / scale)
        constant = gammaln((self.tail + size) / 2) - gammaln(self.tail / 2) - 0.5 * size * np.log(self.tail * np.pi)
        value = np.sum(constant - 0.5 * (self.tail + size) * np.log1p(total / self.tail), axis=1)
        return np.asarray(value - np.sum(np.where(self.believed, np.log(scale), 0.0), axis=1))

    @property
    def believed(self) -> NDArray[np.bool_]:
        """(R K,) which losses count."""
        return np.tile(self.use, len(self.ranges))

    def weights(self, z: Array) -> tuple[Array, Array, Array]:
        """Weights (B, R K) of scaled residuals z (B, R K); number (G,) and sum of squares (B, G) of each vector.

        A vector of n residuals has the weight (tail + n) / (tail + sum z^2): 1 or so where they are as expected.
        """
        members = self.members
        size = np.sum(members, axis=1)
        total = z**2 @ members.T
        return ((self.tail + size) / (self.tail + total)) @ members, size, total

    @property
    def members(self) -> Array:
        """(G, R K) 1 where a believed loss belongs to a material and range."""
        material = np.concatenate(
            [self.simulations.material + r * (1 + self.simulations.material.max()) for r in range(len(self.ranges))]
        )
        return np.where(np.unique(material)[:, None] == material, self.believed, False).astype(float)

    def log_prior(self, theta: Array) -> tuple[Array, Array]:
        """ln p(theta) (B,) and its gradient (B, P); up to a constant that all numbers of points share."""
        ranges = len(self.ranges)
        inner, share = theta[:, :-ranges], expit(theta[:, -ranges:])
        value = -0.5 * np.sum(inner**2, axis=1) - 0.5 * inner.shape[1] * np.log(2 * np.pi)
        gradient = np.concatenate([-inner, 1 - 2 * share], axis=1)
        first, reach = self.reach * share / self.step, self.reach / self.step
        value += np.sum(np.log(reach * share * (1 - share)), axis=1)
        if not self.recipe:
            return value - np.sum(np.log(reach)), gradient
        total = 1 + np.sum(first**POWER, axis=1)
        gradient[:, -ranges:] -= ranges * first**POWER * (1 - share) / total[:, None]
        return value - ranges / POWER * np.log(total), gradient

    def error_scale(self, knobs: Knobs, batch: int) -> Array:
        """(B, R K) scale of the difference between model and printed loss, N."""
        typical = self.simulations.typical[list(self.ranges)]
        single = np.broadcast_to(knobs.solver, (batch, len(self.ranges))) * typical
        rounding = np.broadcast_to(np.asarray(knobs.rounding, dtype=float), (batch,))
        shared = np.minimum(rounding[:, None] * typical, single)
        alone = self.simulations.family < 0
        return np.concatenate(
            [np.where(alone, single[:, [i]], shared[:, [i]]) for i in range(len(self.ranges))], axis=1
        )
