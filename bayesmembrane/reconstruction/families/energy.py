"""A curve of one strain energy, of whose form and of whose rig not everything is known."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Self

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.special import ndtr, ndtri

from bayesmembrane.ground.parameters import Array
from bayesmembrane.ground.symmetric import eigh
from bayesmembrane.physics.materials.base import Material
from bayesmembrane.reconstruction.families.base import CurveFamily
from bayesmembrane.reconstruction.families.displaced import OFFSET, SHIFT
from bayesmembrane.reconstruction.simulations import NEAREST, Simulate

COMPLIANCE = 3e-4  # m/N, half-normal scale of the frame's compliance
LENGTH = 0.015  # m, over which the form error forgets
MODES = 16  # of the form error: the next one is below 1e-3 of the first
NODES = 90  # at which the film is solved, even in the logarithm of the deflection
STEP = 0.01  # of the differences, in standard deviations of the prior
HALVINGS = 6
TRUST = 0.3  # change of ln F up to which an expansion is believed
ROUNDS = 2  # steps before a family is expanded anew
PLACING = 16  # times that a family is expanded anew, at most
SETTLED = 0.02  # such a change: an expansion as near as this need not be made anew
NEWTON = 2  # steps that balance the frame


class NoFilmError(Exception):
    """There is no film with these parameters over the whole range."""


@dataclass(frozen=True, eq=False)
class Expansion:
    """ln F of a film to first order in its coordinates, in standard deviations z (k,) of their priors, about ``at``.

    ln F(d; z) = terms(ln d) . (1, z - at). The error of the form takes up what is left where z is poorly known.
    """

    at: Array
    terms: CubicSpline

    def of(self, z: Array, d: Array) -> tuple[Array, Array, Array]:
        """Film force f (B, N), df/dd, and d ln f / dz (B, N, k) at d (B, N); below 0.05 mm as at 0.05 mm."""
        log_d, weight = np.log(np.maximum(d, NEAREST)), (z - self.at)[:, :, None]
        terms, rates = self.terms(log_d), self.terms(log_d, 1)
        force = np.exp(terms[:, :, 0] + (terms[:, :, 1:] @ weight)[:, :, 0])
        slope = force * (rates[:, :, 0] + (rates[:, :, 1:] @ weight)[:, :, 0]) / np.exp(log_d)
        return force, np.where(d > NEAREST, slope, 0.0), terms[:, :, 1:]


class EnergyCurve(CurveFamily):
    """g = F(x - shift - compliance F; parameters) exp(e(x)) + offset.

    F is the film of one energy with the priors of its coordinates; e, the error of its form, is a stationary Gaussian
    process (Matern 5/2, `LENGTH`). The size is the standard deviation of e.
    """

    def __init__(self, material: type[Material], simulate: Simulate, top: float, at: Array) -> None:
        self.material, self.simulate, self.top = material, simulate, top
        self.name, self.title = material.name, f"{material.title}, with effects of the rig and an error of its form"
        self.expansion = self._expanded(at)

    def about(self, z: Array) -> Self:
        """The same family, expanded about z (k,), or about the last point on the way there that has a film.

        No step is longer than what changes a force by `TRUST` of itself as the present expansion has it.
        """
        step = z - self.expansion.at
        step = step * min(1.0, TRUST / max(self.distance(z), 1e-12))
        for _ in range(HALVINGS):
            try:
                return type(self)(self.material, self.simulate, self.top, self.expansion.at + step)
            except NoFilmError:
                step = 0.5 * step
        return self

    def placed(self, x: Array, force: Array) -> tuple[CurveFamily, Array]:
        family, c = self, np.zeros(self.size)
        for _ in range(PLACING):
            c = family.nearest(x, force, c, ROUNDS)
            there = family.about(c[: self.parameters])
            moved = family.distance(there.expansion.at)
            family, c = there, np.concatenate([there.expansion.at, c[self.parameters :]])
            if moved < SETTLED:
                break
        return family, c

    def settled(self, c: Array) -> tuple[CurveFamily, bool]:
        z = c[: self.parameters]
        return (self, True) if self.distance(z) < SETTLED else (self.about(z), False)

    def distance(self, z: Array) -> float:
        """Largest change of ln F, by the linear part of the expansion, from where it is made to z (k,)."""
        first = self.expansion.terms(self.expansion.terms.x)[:, 1 : 1 + z.size]
        return float(np.max(np.abs(first @ (z - self.expansion.at))))

    @property
    def parameters(self) -> int:
        """k, the number of coordinates of the energy."""
        return int(self.expansion.at.size)

    @property
    def sizes(self) -> tuple[float, ...]:
        return (0.01, 0.02, 0.04, 0.08)

    @property
    def middle(self) -> float:
        return 0.04

    @property
    def ready(self) -> bool:
        return False

    @property
    def size(self) -> int:
        return self.parameters + 3 + MODES

    @property
    def free(self) -> slice:
        return slice(self.parameters + 3, self.size)

    @cached_property
    def _form(self) -> CubicSpline:
        return matern_basis(self.top)

    def force(self, c: Array, size: Array, x: Array) -> tuple[Array, Array, Array]:
        k = self.parameters
        z, shift = c[:, :k], SHIFT * c[:, k : k + 1]
        compliance, dcompliance = half_normal(c[:, k + 1 : k + 2])
        taut = x - shift
        d = taut
        for _ in range(NEWTON):
            f, slope, _ = self.expansion.of(z, d)
            d = d - (d + compliance * COMPLIANCE * f - taut) / (1 + compliance * COMPLIANCE * slope)
        f, slope, dz = self.expansion.of(z, d)
        yields = 1 + COMPLIANCE * compliance * slope
        shape, e = self._form(x) * size[:, None, None], c[:, k + 3 :]
        factor = np.exp(np.einsum("bnj,bj->bn", shape, e))
        rate = np.einsum("bnj,bj->bn", self._form(x, 1) * size[:, None, None], e)
        film = f * factor
        moving = slope * factor / yields
        derivatives = np.concatenate(
            [
                dz * (film / yields)[:, :, None],
                -SHIFT * moving[:, :, None],
                -(COMPLIANCE * dcompliance * f * moving)[:, :, None],
                np.full((*x.shape, 1), OFFSET),
                film[:, :, None] * shape,
            ],
            axis=2,
        )
        return film + OFFSET * c[:, k + 2 : k + 3], moving + film * rate, derivatives

    # ---- the film ----------------------------------------------------------------------------------------------------

    def _expanded(self, at: Array) -> Expansion:
        """Raises `NoFilmError` where there is no film."""
        x = np.geomspace(NEAREST, 1.1 * self.top, NODES)
        k = at.size
        base = self._logs(at, x)
        pairs = [self._either_side(at, i, x) for i in range(k)]
        step = np.array([h for h, _, _ in pairs])
        up, down = np.array([u for _, u, _ in pairs]), np.array([d for _, _, d in pairs])
        first = (up - down) / (2 * step[:, None])
        return Expansion(at, CubicSpline(np.log(x), np.vstack([base, first]).T))

    def _either_side(self, at: Array, i: int, x: Array) -> tuple[float, Array, Array]:
        """The step along coordinate i, and ln F (N,) one step up and down."""
        step = STEP * (np.arange(at.size) == i)
        for _ in range(HALVINGS):
            try:
                return float(step[i]), self._logs(at + step, x), self._logs(at - step, x)
            except NoFilmError:
                step = step / 2
        raise NoFilmError(self.material.name)

    def _logs(self, z: Array, x: Array) -> Array:
        parameters = natural(self.material, z)
        if not np.all(np.isfinite(parameters)):
            raise NoFilmError(self.material.name)
        force = self.simulate(self.material.name, tuple(parameters.tolist()), x)
        if not np.all(np.isfinite(force) & (force > 0)):
            raise NoFilmError(self.material.name)
        return np.log(force)


def natural(material: type[Material], z: Array) -> Array:
    """Membrane parameters of coordinates given as standard normal numbers z (k,): Phi(z) is the prior's quantile."""
    x = [p.prior.quantile(ndtr(v)) for p, v in zip(material.coordinates, z.tolist(), strict=True)]
    return material.from_coordinates(np.array(x, dtype=float))


def standard(material: type[Material], parameters: Array) -> Array:
    """The inverse of `natural`: z (k,)."""
    x = material.to_coordinates(parameters)
    return np.array([ndtri(p.prior.cdf(v)) for p, v in zip(material.coordinates, x.tolist(), strict=True)])


def half_normal(z: Array) -> tuple[Array, Array]:
    """h >= 0 with P(H <= h) = Phi(z) for a half-normal H of scale 1, and dh/dz; shapes of ``z``."""
    upper = ndtr(-z)
    h = -ndtri(0.5 * upper)
    return h, np.exp((h * h - z * z) / 2) / 2


@lru_cache
def matern_basis(top: float) -> CubicSpline:
    """Functions on [0, top] (m) that span a Gaussian process of standard deviation 1: Matern 5/2."""
    x = np.linspace(0.0, top, 601)
    r = np.sqrt(5.0) * np.abs(x[:, None] - x) / LENGTH
    sizes, modes = eigh((1 + r + r**2 / 3) * np.exp(-r))
    modes = modes[:, ::-1][:, :MODES] * np.sqrt(sizes[::-1][:MODES])
    return CubicSpline(x, modes * np.sign(modes[-1]))
