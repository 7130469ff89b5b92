"""The clamped film by finite elements: quadratic in the reference radius, Newton on the stored energy.

E = 2 pi int W(l1, l2) R dR with l1^2 = f'^2 + h'^2 and l2 = f/R; f and h are given at both edges, and the force is the
reaction dE/dh at the inner one. Lengths in m, forces in N, energies per area in N/m.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.interpolate import CubicSpline, RectBivariateSpline
from scipy.linalg import solve_banded

from tests.generator.energies import FAMILIES, Array, Family, InadmissibleStateError, relaxed

ELEMENTS = 28
KNOTS = 44
_POINTS, _WEIGHTS = np.polynomial.legendre.leggauss(3)


class NoSolutionError(ValueError):
    """The film has no state there, or Newton did not find it."""


@dataclass(frozen=True)
class Edges:
    """What holds the film: reference radii of the film's edges, and where the rig puts them (m)."""

    inner_film: float
    outer_film: float
    inner_rig: float
    outer_rig: float


class Mesh:
    """Quadratic elements between two reference radii, graded geometrically, three Gauss points each."""

    def __init__(self, inner: float, outer: float, elements: int = ELEMENTS) -> None:
        ends = np.geomspace(inner, outer, elements + 1)
        self.nodes = np.empty(2 * elements + 1)
        self.nodes[::2], self.nodes[1::2] = ends, 0.5 * (ends[1:] + ends[:-1])
        half = 0.5 * np.diff(ends)
        radius = self.nodes[1::2, None] + half[:, None] * _POINTS
        x = _POINTS
        value = np.stack([x * (x - 1) / 2, 1 - x**2, x * (x + 1) / 2], axis=-1)
        slope = np.stack([x - 0.5, -2 * x, x + 0.5], axis=-1)[None] / half[:, None, None]
        # Maps the six unknowns of an element (f, h by turns) to (f', h', l2) at its points: (elements, 3 points, 3, 6).
        to_strain = np.zeros((elements, 3, 3, 6))
        to_strain[:, :, 0, 0::2] = slope
        to_strain[:, :, 1, 1::2] = slope
        to_strain[:, :, 2, 0::2] = value[None] / radius[:, :, None]
        self.to_strain = to_strain
        self.flat = to_strain.reshape(elements, 9, 6)
        self.flat_t = np.ascontiguousarray(self.flat.transpose(0, 2, 1))
        self.weight = 2 * np.pi * radius * half[:, None] * _WEIGHTS
        self.size = 2 * self.nodes.size
        self.unknowns = 4 * np.arange(elements)[:, None] + np.arange(6)
        rows, columns = self.unknowns[:, :, None], self.unknowns[:, None, :]
        self.band = ((5 + rows - columns) * self.size + columns).ravel()

    def energy(self, family: Family, p: Array, x: Array) -> tuple[float, Array, Array]:
        """E, its gradient (size,) and its Hessian in bands (11, size) at the unknowns ``x``."""
        strain = (self.flat @ x[self.unknowns][:, :, None]).reshape(-1, 3, 3)
        fp, hp, hoop = strain[..., 0], strain[..., 1], strain[..., 2]
        l1 = np.hypot(fp, hp)
        if np.min(hoop) <= 0 or np.min(l1) <= 0:
            raise InadmissibleStateError("a stretch is not positive")
        with np.errstate(over="ignore", invalid="ignore"):
            w, p1, p2, p11, p12, p22 = relaxed(family, p, l1, hoop)
        if not np.all(np.isfinite(p11 + p22)):
            raise InadmissibleStateError("the energy overflows")
        c, s = fp / l1, hp / l1
        tension = np.stack([p1 * c, p1 * s, p2], axis=-1) * self.weight[..., None]
        turn = p1 / l1
        d = np.empty((*l1.shape, 3, 3))
        d[..., 0, 0] = p11 * c * c + turn * s * s
        d[..., 1, 1] = p11 * s * s + turn * c * c
        d[..., 0, 1] = d[..., 1, 0] = (p11 - turn) * c * s
        d[..., 0, 2] = d[..., 2, 0] = p12 * c
        d[..., 1, 2] = d[..., 2, 1] = p12 * s
        d[..., 2, 2] = p22
        d *= self.weight[..., None, None]
        gradient = (self.flat_t @ tension.reshape(-1, 9, 1)).ravel()
        stiffness = self.flat_t @ (d @ self.to_strain).reshape(-1, 9, 6)
        return (
            float(np.sum(w * self.weight)),
            np.bincount(self.unknowns.ravel(), gradient, self.size),
            np.bincount(self.band, stiffness.ravel(), 11 * self.size).reshape(11, self.size),
        )


@dataclass(frozen=True)
class State:
    """One solved film: unknowns, force (N), Hessian in bands, deflection (m)."""

    x: Array
    force: float
    bands: Array
    deflection: float


def relax(mesh: Mesh, family: Family, p: Array, x: Array, deflection: float, iterations: int = 60) -> State:
    """Newton with backtracking on the energy from ``x``, whose edge values stay; raises `NoSolutionError`."""
    try:
        energy, gradient, bands = mesh.energy(family, p, x)
    except InadmissibleStateError as error:
        raise NoSolutionError(str(error)) from None
    for _ in range(iterations):
        step, exact = _downhill(bands, gradient, energy)
        decrement = -float(gradient @ step)
        length = 1.0
        while True:
            try:
                new = mesh.energy(family, p, x + length * step)
                if decrement < 1e-9 * energy or new[0] <= energy * (1 + 1e-13):
                    break
            except InadmissibleStateError:
                pass
            length /= 2
            if length < 1e-6:
                raise NoSolutionError("Newton found no lower energy")
        x = x + length * step
        energy, gradient, bands = new
        if exact and length == 1 and decrement < 1e-9 * energy:
            return State(x, float(gradient[1]), bands, deflection)
    raise NoSolutionError("Newton did not converge")


def _downhill(bands: Array, gradient: Array, energy: float) -> tuple[Array, bool]:
    """(Newton's step, True), or one with a stiffened diagonal and False where elements are slack."""
    step = np.zeros_like(gradient)
    for shift in (0.0, 1e-6, 1e-4, 1e-2, 1.0):
        stiff = bands[:, 2:-2]
        if shift:
            stiff = stiff.copy()
            stiff[5] += shift * np.max(np.abs(stiff[5]))
        try:
            step[2:-2] = solve_banded((5, 5), stiff, -gradient[2:-2], check_finite=False)
        except np.linalg.LinAlgError:
            continue
        decrement = -float(gradient @ step)
        if np.isfinite(decrement) and decrement >= -1e-9 * energy:
            return step, shift == 0
    raise NoSolutionError("the energy has no minimum here")


def states(family: Family, p: Array, edges: Edges, deflections: Array, elements: int = ELEMENTS) -> list[State]:
    """Solved films at increasing positive ``deflections`` (m); starts amid them and continues both ways."""
    mesh = Mesh(edges.inner_film, edges.outer_film, elements)
    share = (mesh.nodes - edges.inner_film) / (edges.outer_film - edges.inner_film)
    flat = edges.inner_rig + share * (edges.outer_rig - edges.inner_rig)
    start = int(np.searchsorted(deflections, 0.5 * deflections[-1]))
    start = min(start, deflections.size - 1)
    x = np.empty(mesh.size)
    x[0::2], x[1::2] = flat, deflections[start] * (1 - share)
    found = {start: relax(mesh, family, p, x, deflections[start])}
    for order in (range(start + 1, deflections.size), range(start - 1, -1, -1)):
        last = before = found[start]
        for k in order:
            x = _predicted(before, last, deflections[k], flat)
            try:
                state = relax(mesh, family, p, x, deflections[k])
            except NoSolutionError:
                state = relax(mesh, family, p, _scaled(last, deflections[k], flat), deflections[k])
            before, last = last, state
            found[k] = state
    return [found[k] for k in range(deflections.size)]


def _scaled(last: State, deflection: float, flat: Array) -> Array:
    """``last`` with h in proportion to the deflection, and f - flat to its square."""
    ratio = deflection / last.deflection
    x = np.empty_like(last.x)
    x[1::2] = last.x[1::2] * ratio
    x[0::2] = flat + (last.x[0::2] - flat) * min(ratio, 1.0) ** 2
    return x


def _predicted(before: State, last: State, deflection: float, flat: Array) -> Array:
    a = _scaled(last, deflection, flat)
    if before.deflection == last.deflection:
        return a
    b = _scaled(before, deflection, flat)
    weight = (deflection - last.deflection) / (last.deflection - before.deflection)
    x = a + weight * (a - b)
    x[-2:], x[:2] = a[-2:], a[:2]
    return x


def forces(family: Family, p: Array, edges: Edges, deflections: Array, elements: int = ELEMENTS) -> Array:
    """(N,) N at increasing positive ``deflections`` (m)."""
    return np.array([s.force for s in states(family, p, edges, deflections, elements)])


# Dense near zero, where wrinkles and slack begin (m); the second part is solved for those who slip that far. These are
# for a film of this length, and in proportion for others.
USUAL_SPAN = 0.035 - 0.010
SLIPS = np.array([0.0, 0.05, 0.1, 0.2, 0.4, 0.7]) * 1e-3, np.array([1.0, 1.3, 1.65, 2.0]) * 1e-3
LARGEST_SLIP = float(SLIPS[1][-1])


class Film:
    """Force law of one film on one rig, tabulated on first use and interpolated by cubic splines.

    What is tabulated is T = F chord / deflection against the chord's excess over the film's length, which stays smooth
    where the film goes slack; negative deflections are the mirror image. ``reach`` is the largest deflection (m).
    """

    def __init__(
        self, family: str, parameters: tuple[float, ...], inner: float, outer: float, reach: float, coarse: bool = False
    ) -> None:
        self.family, self.p = FAMILIES[family], np.array(parameters)
        self.elements, knots = (ELEMENTS // 2, KNOTS // 2) if coarse else (ELEMENTS, KNOTS)
        self.inner, self.outer, self.reach = inner, outer, reach
        self.span = outer - inner
        self.slips = tuple(self.span / USUAL_SPAN * s for s in SLIPS)
        self.grid = reach * (np.arange(1, knots + 1) / knots) ** 1.2
        self._laws: dict[tuple[float, float], CubicSpline] = {}
        self._tables: dict[tuple[float, bool], RectBivariateSpline] = {}
        self._slopes: list[CubicSpline] | None = None

    def force(self, deflection: Array, prestretch: float = 1.0, slip: Array | None = None) -> Array:
        """(N,) N at deflections (N,) m of a film stretched by ``prestretch``, slipped inwards by ``slip`` (N,) m."""
        size, chord = np.abs(deflection), np.hypot(self.span, deflection)
        if slip is None or not np.any(slip):
            return self._law(prestretch, 0.0)(np.minimum(chord - self.span, self._end())) * deflection / chord
        if np.max(slip) > self.slips[1][-1] or np.max(size) > self.reach:
            raise NoSolutionError("beyond the table")
        excess = chord - self.span - (slip if prestretch == 1 else 0.0)
        total = self._slipped(prestretch, bool(np.max(slip) > self.slips[0][-1]))(
            np.maximum(excess, 0.0), slip, grid=False
        )
        return np.where(excess > 0, total, 0.0) * deflection / chord

    def sensitivities(self, deflection: Array) -> Array:
        """(N, parameters): dF/dp of the film as clamped, from the gradient's differences and one linear solve."""
        if self._slopes is None:
            self._law(1.0, 0.0)
            self._slopes = self._parameter_slopes(*self._virgin)
        chord = np.hypot(self.span, deflection)
        excess = np.minimum(chord - self.span, self._end())
        return np.stack([s(excess) * deflection / chord for s in self._slopes], axis=1)

    def stored(self, deflection: Array) -> Array:
        """(N,) J: work of the virgin film up to deflections (N,) m."""
        grid = np.linspace(0, self.reach, 400)
        return np.asarray(CubicSpline(grid, self.force(grid)).antiderivative()(np.clip(deflection, 0, self.reach)))

    def _slipped(self, prestretch: float, far: bool) -> RectBivariateSpline:
        """T against excess and slip."""
        if (prestretch, far) not in self._tables:
            slips = np.concatenate(self.slips) if far else self.slips[0]
            laws = [self._law(prestretch, float(s)) for s in slips]
            knots = laws[0].x
            self._tables[prestretch, far] = RectBivariateSpline(knots, slips, np.stack([g(knots) for g in laws], 1))
        return self._tables[prestretch, far]

    def _end(self) -> float:
        return float(np.hypot(self.span, self.reach)) - self.span

    def _law(self, prestretch: float, slip: float) -> CubicSpline:
        key = (prestretch, slip)
        if key not in self._laws:
            length = self.span + slip
            grid = self.grid
            if prestretch == 1:
                # The same excess for every slip: y = chord - length.
                grid = np.sqrt((np.hypot(self.span, self.grid) - self.span + length) ** 2 - self.span**2)
            edges = Edges(self.inner / prestretch, (self.outer + slip) / prestretch, self.inner, self.outer)
            chord = np.hypot(self.span, grid)
            taut = np.ones(grid.size, dtype=bool)
            if prestretch > 1:
                grid = np.concatenate([[1e-4], grid])  # for the finite stiffness of a stretched film at rest
                chord = np.hypot(self.span, grid)
                taut = chord > length / prestretch * (1 + 1e-4)
            solved = states(self.family, self.p, edges, grid[taut], self.elements)
            t = np.zeros(grid.size)
            t[taut] = [s.force for s in solved] * chord[taut] / grid[taut]
            excess = np.hypot(self.span, self.grid) - self.span
            if prestretch > 1:
                knots, values = chord - self.span, t
            else:
                knots, values = np.concatenate([[0.0], excess]), np.concatenate([[0.0], t])
            self._laws[key] = CubicSpline(knots, values)
            if key == (1.0, 0.0):
                self._virgin = (edges, solved, chord / grid, knots)
        return self._laws[key]

    def _parameter_slopes(self, edges: Edges, solved: list[State], ratio: Array, knots: Array) -> list[CubicSpline]:
        """Splines of dT/dp: with G the gradient of E, dF/dp = G_p[0] - K[0, free] K[free, free]^-1 G_p[free]."""
        mesh = Mesh(edges.inner_film, edges.outer_film, self.elements)
        slopes = np.zeros((len(solved) + 1, self.p.size))
        for k, state in enumerate(solved):
            change = np.empty((mesh.size, self.p.size))
            for j, value in enumerate(self.p):
                step = 1e-5 * max(abs(value), 1e-3)
                up, down = self.p.copy(), self.p.copy()
                up[j], down[j] = value + step, value - step
                difference = mesh.energy(self.family, up, state.x)[1] - mesh.energy(self.family, down, state.x)[1]
                change[:, j] = difference / (2 * step)
            free = solve_banded((5, 5), state.bands[:, 2:-2], change[2:-2], check_finite=False)
            row = state.bands[6:11, 1]  # K[2..6, 1]
            slopes[k + 1] = (change[1] - row @ free[:5]) * ratio[k]
        return [CubicSpline(knots, column) for column in slopes.T]


@lru_cache(maxsize=64)
def film(
    family: str, parameters: tuple[float, ...], inner: float, outer: float, reach: float, coarse: bool = False
) -> Film:
    """The film's force law, kept for the life of the process."""
    return Film(family, parameters, inner, outer, reach, coarse)
