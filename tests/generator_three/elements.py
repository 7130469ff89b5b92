"""The clamped film by straight elements on its meridian: sum of 2 pi R dR W(l1, l2), least by Newton's method.

An element has l1 = its length over its length at rest, and l2 = its middle radius over that at rest. Unknowns are
radius and height of each node; the edges are held, and the force is what the inner one takes. The states of many
deflections are solved at once, as blocks of one band matrix.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.linalg import solve_banded

from tests.generator_three.energies import derivatives

ELEMENTS, CROWDED = 160, 1.15
ROUNDS, HALVINGS = 30, 12
DIAGONALS = 3  # above and below the middle one: two unknowns a node, and nodes that know their neighbours


class NoBalanceError(ValueError):
    """No state of the film was found."""


@dataclass(frozen=True)
class Rubber:
    """What the film is: an energy, its parameters, and how it was mounted.

    stretch : alike in all directions before it was clamped; longer : mm by which its outer radius at rest is greater.
    """

    energy: str
    parameters: tuple[float, ...]
    stretch: float = 1.0
    longer: float = 0.0


@dataclass(frozen=True, eq=False)
class Solution:
    """force : (M,) N; most : (M,) largest stretch along; nodes : (M, nodes, 2) mm."""

    force: Any
    most: Any
    nodes: Any


@dataclass(frozen=True)
class ElementFilm:
    """A film between two radii (mm)."""

    inner: float
    outer: float
    elements: int = ELEMENTS

    @cached_property
    def radius(self) -> Any:
        """(nodes,) mm, as clamped; closer at the disc."""
        return self.inner * (self.outer / self.inner) ** np.linspace(0, 1, self.elements + 1) ** CROWDED

    def guess(self, deflections: Any) -> Any:
        """(M, nodes, 2) mm: heights of a soap film of small slope, radii as they were."""
        height = deflections[:, None] * np.log(self.outer / self.radius) / np.log(self.outer / self.inner)
        return np.stack([np.repeat(self.radius[None], len(deflections), 0), height], 2)

    def scaled(self, nodes: Any, ratio: float) -> Any:
        """Nodes for so many times the deflection: heights in proportion, radii as the square for less."""
        out = nodes.copy()
        out[..., 1] *= ratio
        inwards = ratio * ratio if ratio < 1 else ratio
        out[..., 0] = self.radius + (out[..., 0] - self.radius) * inwards
        return out

    def solve(self, deflections: Any, rubber: Rubber, nodes: Any = None) -> Solution:
        """The states at deflections (M,) mm, from those of ``nodes``. Raises `NoBalanceError`."""
        d = np.atleast_1d(np.asarray(deflections, float))
        x = self.guess(d) if nodes is None else nodes.copy()
        x[:, 0, 0], x[:, -1, 0], x[:, 0, 1], x[:, -1, 1] = self.inner, self.outer, d, 0
        error: Any = np.inf
        with np.errstate(all="ignore"):
            for turn in range(ROUNDS):
                state = _Elements(self, rubber, x)
                residual, stiffness = state.residual(), state.stiffness()
                if not np.all(np.isfinite(stiffness)):
                    raise NoBalanceError("the energy has no value here")
                scale = np.abs(residual[:, 0]).max(1) + 1e-300
                before, error = error, np.abs(residual[:, 1:-1]).max((1, 2)) / np.maximum(scale, 1e-3 * scale.max())
                rounding = turn > 3 and error.max() < 1e-7 and error.max() > 0.3 * np.max(before)
                if error.max() < 1e-9 or rounding:
                    return Solution(residual[:, 0, 1], state.along.max(1), x)
                x = self._moved(rubber, x, _newton_step(residual, stiffness), residual, scale)
        raise NoBalanceError(f"Newton's method ends at {error.max():g}")

    def _moved(self, rubber: Rubber, x: Any, step: Any, residual: Any, scale: Any) -> Any:
        """Nodes after the step, halved where the residual would grow."""
        before, part = np.abs(residual[:, 1:-1]).max((1, 2)), np.ones(len(x))
        for _ in range(HALVINGS):
            new = x + part[:, None, None] * step
            found = _Elements(self, rubber, new).residual()
            after = np.abs(found[:, 1:-1]).max((1, 2))
            grown = (after > 1.5 * before) & (after > 1e-12 * scale)
            bad = ~np.isfinite(after) | grown | ~np.isfinite(found).all((1, 2))
            if not bad.any():
                break
            part[bad] *= 0.5
        return new


class _Elements:
    """Elements of films with nodes (M, nodes, 2) mm: stretches, tensions and what they make of nodes."""

    def __init__(self, film: ElementFilm, rubber: Rubber, nodes: Any) -> None:
        rest = film.radius / rubber.stretch
        if rubber.longer:
            rest = rest + rubber.longer * (rest - rest[0]) / (rest[-1] - rest[0])
        self.nodes, self.rest_length, self.rest_radius = nodes, np.diff(rest), (rest[1:] + rest[:-1]) / 2
        self.area = 2 * np.pi * self.rest_radius * self.rest_length
        out, up = np.diff(nodes[:, :, 0], axis=1), np.diff(nodes[:, :, 1], axis=1)
        self.length = np.hypot(out, up)
        self.cosine, self.sine = out / self.length, up / self.length
        self.along = self.length / self.rest_length
        around = (nodes[:, 1:, 0] + nodes[:, :-1, 0]) / 2 / self.rest_radius
        self.tensions = derivatives(rubber.energy, rubber.parameters, self.along, around)
        # Slopes of the two stretches by the four unknowns of an element.
        c, s = self.cosine, self.sine
        self.by_along = np.stack([-c, -s, c, s], -1) / self.rest_length[None, :, None]
        self.by_around = np.zeros_like(self.by_along)
        self.by_around[..., 0] = self.by_around[..., 2] = 0.5 / self.rest_radius

    def residual(self) -> Any:
        """(M, nodes, 2) N: slope of the energy by the nodes."""
        P1, P2 = self.tensions[:2]
        each = self.area[None, :, None] * (P1[..., None] * self.by_along + P2[..., None] * self.by_around)
        out = np.zeros(self.nodes.shape)
        out[:, :-1] += each[..., :2]
        out[:, 1:] += each[..., 2:]
        return out

    def stiffness(self) -> Any:
        """(M, elements, 4, 4) N/mm: the energy's second derivatives, with the curvature of the length itself."""
        P1, _, P11, P12, P22 = self.tensions
        one, two = self.by_along, self.by_around
        out = self._weighed(P11) * _outer(one, one) + self._weighed(P12) * (_outer(one, two) + _outer(two, one))
        out = out + self._weighed(P22) * _outer(two, two)
        across = np.stack([self.sine, -self.cosine, -self.sine, self.cosine], -1)
        out += self._weighed(P1 / self.length / self.rest_length) * _outer(across, across)
        return out

    def _weighed(self, values: Any) -> Any:
        return (self.area * values)[..., None, None]


def _outer(u: Any, v: Any) -> Any:
    return u[..., :, None] * v[..., None, :]


def _newton_step(residual: Any, stiffness: Any) -> Any:
    """(M, nodes, 2) mm, with the edges held."""
    films, elements = stiffness.shape[:2]
    size, middle = 2 * (elements + 1), DIAGONALS
    band, right = np.zeros((2 * middle + 1, films, size)), -residual.reshape(films, size).copy()
    for i in range(4):
        for j in range(4):
            band[middle + i - j, :, j : j + 2 * elements : 2] += stiffness[:, :, i, j]
    for held in (0, 1, size - 2, size - 1):
        for off in range(-middle, middle + 1):
            if 0 <= held + off < size:
                band[middle + off, :, held] = 0
                band[middle - off, :, held + off] = 0
        band[middle, :, held] = 1
        right[:, held] = 0
    flat = band.reshape(2 * middle + 1, films * size)
    step = solve_banded((middle, middle), flat, right.ravel(), check_finite=False, overwrite_ab=True)
    return step.reshape(residual.shape)
