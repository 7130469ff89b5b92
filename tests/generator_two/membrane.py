"""The clamped film by collocation: both balances of force at Chebyshev points of ln R, Newton with complex steps.

With t = ln R, radius f and height h: d(R P1 cos)/dt = R P2 and d(R P1 sin)/dt = 0 inside, edges given. The force is
-2 pi times the mean of R P1 sin, since h falls outwards.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.interpolate import PchipInterpolator, make_interp_spline

from tests.generator_two.elastic import ELASTIC

POINTS, KNOTS = 33, 60
TINY = 1e-30


class LockedError(ValueError):
    """The film cannot be pulled so far."""


def chebyshev(points: int) -> tuple[Any, Any]:
    """(places in [-1, 1], differentiation matrix)."""
    n = points - 1
    x = -np.cos(np.pi * np.arange(points) / n)
    weight = np.where((np.arange(points) == 0) | (np.arange(points) == n), 0.5, 1.0) * (-1.0) ** np.arange(points)
    gap = x[:, None] - x + np.eye(points)
    d = weight / weight[:, None] / gap
    d -= np.diag(d.sum(axis=1))
    return x, d


@dataclass(frozen=True)
class Membrane:
    """A film of an energy on a rig of two radii (m), stretched by ``stretch`` alike before it was clamped."""

    family: str
    constants: tuple[float, ...]
    inner: float
    outer: float
    reach: float
    stretch: float = 1.0
    points: int = POINTS

    @property
    def length(self) -> float:
        """Free length (m)."""
        return self.outer - self.inner

    @cached_property
    def _grid(self) -> tuple[Any, Any]:
        """(R, d/dR as a matrix) of the film at rest."""
        x, d = chebyshev(self.points)
        span = np.log(self.outer / self.inner)
        radius = self.inner / self.stretch * np.exp(0.5 * (x + 1) * span)
        return radius, (2 / span) * d / radius[:, None]

    def _balance(self, strain: Any) -> tuple[Any, Any, Any]:
        """R P1 cos, R P1 sin and P2 of (f', h', f / R), each (points,)."""
        radius = self._grid[0]
        l1 = np.sqrt(strain[0] ** 2 + strain[1] ** 2)
        p1, p2 = ELASTIC[self.family].tensions(self.constants, l1, strain[2])
        return radius * p1 * strain[0] / l1, radius * p1 * strain[1] / l1, p2

    def _newton(self, f: Any, h: Any, rounds: int = 40) -> tuple[Any, Any, float]:
        """(f, h, force) from a guess whose edges are right."""
        radius, slope = self._grid
        n = radius.size
        inside = slice(1, n - 1)
        for _ in range(rounds):
            strain = np.stack([slope @ f, slope @ h, f / radius])
            along, up, hoop = self._balance(strain)
            found = np.concatenate([(slope @ along - hoop)[inside], (slope @ up)[inside]])
            if not np.all(np.isfinite(found)):
                raise LockedError("the energy has no value here")
            blocks = np.zeros((2, 2, n, n))
            for k in range(3):
                step = strain.astype(complex)
                step[k] += 1j * TINY
                a, u, p = (np.imag(v) / TINY for v in self._balance(step))
                by = np.eye(n) / radius[:, None] if k == 2 else slope
                blocks[0, k % 2] += slope @ (a[:, None] * by) - p[:, None] * by
                blocks[1, k % 2] += slope @ (u[:, None] * by)
            matrix = np.block([[blocks[i, j][inside, inside] for j in (0, 1)] for i in (0, 1)])
            move = np.linalg.solve(matrix, -found)
            part = min(1.0, 0.3 * (self.inner + float(np.max(np.abs(h)))) / float(np.max(np.abs(move))))
            f, h = f.copy(), h.copy()
            f[inside] += part * move[: n - 2]
            h[inside] += part * move[n - 2 :]
            if part == 1.0 and np.max(np.abs(move)) < 1e-9 * self.length:
                strain = np.stack([slope @ f, slope @ h, f / radius])
                if np.min(strain[2]) <= 0 or np.max(strain[1]) > 1e-9:
                    raise LockedError("the state is none of a lifted film")
                force = -2 * np.pi * float(np.mean(self._balance(strain)[1]))
                if force <= 0:
                    raise LockedError("beyond the pole of the energy")
                return f, h, force
        raise LockedError("no balance was found")

    def forces(self, deflections: Any) -> Any:
        """(N,) N at rising positive deflections (N,) m, each from the two before."""
        radius, _ = self._grid
        flat = radius * self.stretch
        shape = (np.log(self.outer) - np.log(flat)) / np.log(self.outer / self.inner)
        first = np.asarray(deflections, dtype=float)
        begin = int(np.argmin(np.abs(first - 0.5 * self.length)))
        found: dict[int, tuple[Any, Any, float]] = {}
        # A cone whose middle lies a little inwards.
        inwards = 0.15 * self.length * shape * (1 - shape) * (first[begin] / self.length) ** 2
        found[begin] = self._newton(flat - inwards, first[begin] * (1 - (flat - self.inner) / self.length))
        for order in (range(begin + 1, first.size), range(begin - 1, -1, -1)):
            last = earlier = begin
            for k in order:
                ratio = first[k] / first[last]
                f, h, _ = found[last]
                f, h = flat + (f - flat) * min(ratio, 1.0) ** 2, h * ratio
                if earlier != last:
                    away = (first[k] - first[last]) / (first[last] - first[earlier])
                    back = first[last] / first[earlier]
                    f = f + away * (found[last][0] - flat - (found[earlier][0] - flat) * min(back, 1.0) ** 2)
                    h = h + away * (found[last][1] - found[earlier][1] * back)
                f[[0, -1]], h[[0, -1]] = flat[[0, -1]], (first[k], 0.0)
                found[k] = self._newton(f, h)
                earlier, last = last, k
        return np.array([found[k][2] for k in range(first.size)])

    @cached_property
    def _law(self) -> Any:
        """Spline of F / sin of the mean slope, over the chord: what the film pulls along itself."""
        knots = self.reach * (np.arange(1, KNOTS + 1) / KNOTS) ** 1.3
        chord = np.hypot(self.length, knots)
        pull = self.forces(knots) * chord / knots
        if self.stretch > 1:
            return make_interp_spline(chord - self.length, pull, k=3)
        return make_interp_spline(np.append(0.0, chord - self.length), np.append(0.0, pull), k=3)

    def pull(self, excess: Any) -> Any:
        """N along the chord, (N,), at what the chord is longer than the film at rest, (N,) m; 0 where it is slack."""
        end = np.hypot(self.length, self.reach) - self.length
        taut = np.clip(excess, 0.0, end)
        return np.where(excess > 0, self._law(taut), 0.0) if self.stretch == 1 else self._law(taut)

    def force(self, deflection: Any, longer: Any = 0.0) -> Any:
        """(N,) N at deflections (N,) m of a film that has become ``longer`` (N,) m; nothing below zero."""
        up = np.maximum(deflection, 0.0)
        chord = np.hypot(self.length, up)
        return self.pull(chord - self.length - longer) * up / chord

    @cached_property
    def _work(self) -> Any:
        at = np.linspace(0.0, self.reach, 600)
        work = np.concatenate([[0.0], np.cumsum(0.5 * np.diff(at) * (self.force(at)[1:] + self.force(at)[:-1]))])
        return PchipInterpolator(at, work)

    def work(self, deflection: Any) -> Any:
        """(N,) J to pull it there."""
        return self._work(np.clip(deflection, 0.0, self.reach))

    def slopes(self, deflection: Any) -> Any:
        """(N, constants) N for a change of each constant by its own size."""
        at = self.reach * (np.arange(1, 19) / 18) ** 1.3
        whole, out = self.forces(at), []
        for i, c in enumerate(self.constants):
            two = []
            for change in (1.001, 0.999):
                other = tuple(c * change if k == i else v for k, v in enumerate(self.constants))
                two.append(Membrane(self.family, other, self.inner, self.outer, self.reach, self.stretch).forces(at))
            # As a part of the force it hardly bends.
            part = make_interp_spline(at, (two[0] - two[1]) / 0.002 / whole, k=3)
            out.append(part(np.clip(deflection, at[0], self.reach)) * self.force(deflection))
        return np.stack(out, axis=1)
