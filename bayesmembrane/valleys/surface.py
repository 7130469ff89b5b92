"""The loss over the parameters that users read, and its minima with some of them held."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import product

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bayesmembrane.calibration.descent import descend
from bayesmembrane.calibration.objective import Objective
from bayesmembrane.data.measurement import Measurement
from bayesmembrane.ground.errors import SettingsError
from bayesmembrane.ground.parameters import Array
from bayesmembrane.physics.forward import Solve
from bayesmembrane.physics.hypothesis import Hypothesis
from bayesmembrane.physics.mechanics.api import unaided

DRAWS, CENTRAL = 4096, (0.001, 0.999)
WIDE = 2.0  # a parameter is followed over this many times the central range of its prior
ITERATIONS = 60
ROUND_OFF = 1e-12  # relative change of a parameter at which its root is found
SECANTS = 12
PROBE, NOT_HIGHER = 1e-4, 1e-7  # first step of the secant method, and how much higher a root's loss may be, relative


@dataclass(frozen=True, eq=False)
class Chart:
    """z (k,): the membrane parameters p, as ln|p| where the sign cannot change, then the coordinates of effects.

    ``log`` (k,) says which are logarithms: those whose sign all draws of the prior share, and whose ratio to the
    modulus is not a mere number (Gent's c2, all of Ogden's). The others, which may pass zero, stay as they are.
    """

    hypothesis: Hypothesis

    def __post_init__(self) -> None:
        material = self.hypothesis.material
        if len(material.field_names()) != len(material.coordinates):
            raise SettingsError(f"{material.name} has more parameters than coordinates, so that its loss has no map")

    @property
    def size(self) -> int:
        """k, without the noise."""
        return self.hypothesis.curve_size

    @property
    def names(self) -> tuple[str, ...]:
        """Full names of the parameters."""
        return self.hypothesis.natural_names[: self.size]

    @property
    def units(self) -> tuple[str, ...]:
        """Their units."""
        return self.hypothesis.natural_units[: self.size]

    @cached_property
    def _prior(self) -> Array:
        """Natural parameters (DRAWS, k) of draws of the prior without the convexity cut."""
        rng = np.random.default_rng(0)
        x = np.stack([p.prior.draw(rng, DRAWS) for p in self.hypothesis.parameters[: self.size]], axis=1)
        low, high = np.array([p.bounds for p in self.hypothesis.parameters[: self.size]], dtype=float).T
        x = np.clip(x, low, high)
        return np.concatenate([self.hypothesis.films(x), x[:, self.hypothesis.material_size :]], axis=1)

    @cached_property
    def sign(self) -> Array:
        """(k,) the common sign of all prior draws, 0 where they differ."""
        low, high = np.quantile(self._prior, CENTRAL, axis=0)
        return np.where(low * high > 0, np.sign(low), 0.0)

    @cached_property
    def log(self) -> NDArray[np.bool_]:
        """(k,) True where z is a logarithm."""
        material = self.hypothesis.material
        n = self.hypothesis.material_size
        modulus = np.asarray(material.shear_modulus(self._prior[:, :n].T))[:, None]
        ratio = np.abs(self._prior[:, :n]) / np.where(np.asarray(material.scales) == 1, modulus, 1.0)
        low, high = np.quantile(ratio, CENTRAL, axis=0)
        out = np.zeros(self.size, dtype=bool)
        out[:n] = (self.sign[:n] != 0) & (high > 2 * low)
        return out

    @cached_property
    def limits(self) -> tuple[Array, Array]:
        """Lowest and highest z (k,) that the bounds of the coordinates reach at their corners."""
        bounds = [p.bounds for p in self.hypothesis.parameters[: self.size]]
        corners = np.array(list(product(*bounds)), dtype=float)
        p = np.concatenate([self.hypothesis.films(corners), corners[:, self.hypothesis.material_size :]], axis=1)
        z = self.from_natural(p)
        return np.nanmin(z, axis=0), np.nanmax(z, axis=0)

    @cached_property
    def followed(self) -> tuple[Array, Array]:
        """Lowest and highest z (k,) to which a valley is followed: `WIDE` times the central part of the prior."""
        z = self.from_natural(self._prior)
        low, middle, high = np.quantile(z, (CENTRAL[0], 0.5, CENTRAL[1]), axis=0)
        least, most = self.limits
        return np.maximum(middle + WIDE * (low - middle), least), np.minimum(middle + WIDE * (high - middle), most)

    def natural(self, z: ArrayLike) -> Array:
        """p (..., k) of z (..., k)."""
        z = np.asarray(z, dtype=float)
        with np.errstate(over="ignore"):
            return np.where(self.log, self.sign * np.exp(np.where(self.log, z, 0.0)), z)

    def from_natural(self, p: ArrayLike) -> Array:
        """z (..., k) of p (..., k); nan where a parameter has the wrong sign."""
        p = np.asarray(p, dtype=float)
        with np.errstate(all="ignore"):
            return np.where(self.log, np.log(p * np.where(self.log, self.sign, np.nan)), p)

    def coordinates(self, z: ArrayLike) -> Array:
        """Sampling coordinates (B, k) of z (B, k); nan where there are none."""
        p = self.natural(np.atleast_2d(z))
        n = self.hypothesis.material_size
        with np.errstate(all="ignore"):
            x = self.hypothesis.material.to_coordinates(p[:, :n].T).T
        return np.concatenate([x, p[:, n:]], axis=1)

    def from_coordinates(self, x: ArrayLike) -> Array:
        """z (B, k) of coordinates x (B, k or more)."""
        x = np.atleast_2d(np.asarray(x, dtype=float))
        n = self.hypothesis.material_size
        return self.from_natural(np.concatenate([self.hypothesis.films(x), x[:, n : self.size]], axis=1))

    def stretch(self, z: Array) -> Array:
        """dp/dz (..., k), elementwise."""
        return np.where(self.log, self.natural(z), 1.0)


class Surface:
    """L(z) = |F(z) - y|_2 of one measurement (N points) over a `Chart`, with residuals and slopes for many z at once.

    The convexity prior plays no part, and what is known of the rig is held.
    """

    def __init__(
        self, hypothesis: Hypothesis, measurement: Measurement, solve: Solve = unaided, loss: str = "euclidean"
    ) -> None:
        self.objective = Objective(hypothesis.with_frame(measurement).held, measurement, loss, solve)
        self.hypothesis, self.measurement = self.objective.hypothesis, measurement
        self.chart = Chart(self.hypothesis)

    def batch(self, z: Array) -> tuple[Array, Array]:
        """r (B, N) and dr/dz (B, N, k) of z (B, k); nan where there is no film, or no coordinates."""
        x = self.chart.coordinates(z)
        good = np.flatnonzero(np.all(np.isfinite(x), axis=1))
        r = np.full((len(z), len(self.measurement)), np.nan)
        j = np.full((*r.shape, z.shape[1]), np.nan)
        if good.size:
            r[good], slopes = self.objective.batch(x[good])
            j[good] = np.einsum("bni,bij->bnj", slopes, self.coordinate_slopes(x[good], z[good]))
        return r, j

    def coordinate_slopes(self, x: Array, z: Array) -> Array:
        """dx/dz (B, k, k) at x (B, k), the coordinates of z (B, k)."""
        n, k = self.hypothesis.material_size, self.chart.size
        out = np.broadcast_to(np.eye(k), (len(x), k, k)).copy()
        inner = self.objective.forward.jacobian(x)[:, :, :n]
        out[:, :n, :n] = np.linalg.inv(inner) * self.chart.stretch(z)[:, None, :n]
        return out

    def loss(self, z: Array) -> Array:
        """L (B,) of z (B, k), N; inf where there is no curve."""
        size = np.linalg.norm(self.batch(z)[0], axis=1)
        return np.where(np.isfinite(size), size, np.inf)

    def minimise(
        self, start: Array, held: NDArray[np.bool_], iterations: int = ITERATIONS, rooted: bool = True
    ) -> tuple[Array, Array]:
        """(z (M, k), L (M,)): least squares from each row of ``start`` over what is not ``held`` (k,) or (M, k).

        Without ``rooted`` a single free parameter stays as good as the loss tells: to the root of its round-off.
        """
        held = np.broadcast_to(held, start.shape)
        low, high = self.chart.limits
        start = np.where(held, start, np.clip(start, low, high))
        if np.all(held):
            return start, self.loss(start)
        low, high = np.minimum(low, np.min(start, axis=0)), np.maximum(high, np.max(start, axis=0))
        z, size = descend(self.batch, start, (low, high), iterations, held)
        single = np.flatnonzero((np.sum(~held, axis=1) == 1) & np.isfinite(size))
        if rooted and single.size:
            z[single], size[single] = self._rooted(z[single], size[single], np.argmin(held[single], axis=1))
        return z, size

    def _rooted(self, z: Array, norm: Array, free: NDArray[np.intp]) -> tuple[Array, Array]:
        """Zeros of the slope J_f^T r in the one free parameter f (M,), by the secant method from a near minimum.

        A descent stops when the loss stops falling, and there the parameter is only good to the root of that.
        """
        rows = np.arange(len(z))

        def slope(at: Array) -> tuple[Array, Array]:
            r, j = self.batch(at)
            return np.sum(j[rows, :, free] * r, axis=1), np.linalg.norm(r, axis=1)

        size = np.maximum(np.abs(z[rows, free]), 1e-2)
        old, new = z.copy(), z.copy()
        new[rows, free] += PROBE * size
        g, _ = slope(old)
        best, least, flattest = z.copy(), norm.copy(), np.abs(g)
        for _ in range(SECANTS):
            h, length = slope(new)
            # Losses near a minimum differ by round-off only: the slope tells which point is nearer.
            take = (length <= norm * (1 + NOT_HIGHER)) & (np.abs(h) < flattest)
            best[take], least[take], flattest[take] = new[take], length[take], np.abs(h[take])
            with np.errstate(all="ignore"):
                step = -h * (new[rows, free] - old[rows, free]) / (h - g)
            step = np.where(np.isfinite(step), np.clip(step, -0.1 * size, 0.1 * size), 0.0)
            if np.all(np.abs(step) <= ROUND_OFF * size):
                break
            old, g, new = new, h, new.copy()
            new[rows, free] += step
        return best, least
