"""The film as a law F(delta): solved at a few deflections, known everywhere, with slope and sensitivities.

    F = exp(g(u)) F_s(delta),    u = asinh(delta / (1.6 L)),    L = R2 - R1,

where F_s is the force of a neo-Hookean strip on the slope that spans the gap: it starts like delta^3 without
pre-stretch and like delta with it, as the film does, so that g is smooth and even in u. Between knots g is a quintic
that meets value, slope (from the solver) and second derivative (from neighbours, to fourth order).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache, lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bayesmembrane.ground.compiling import compiled, for_kernel
from bayesmembrane.ground.parameters import Array
from bayesmembrane.physics.materials.neo_hookean import NeoHookean
from bayesmembrane.physics.mechanics.api import Request, Solve, request, solve
from bayesmembrane.physics.mechanics.solution import Curves, Status

WIDTH = 1.6  # of the gap: knots are dense below, and logarithmic above
KNOTS = (24, 48, 96)
FAR = 2.5
"""Of the gap: a film that is lifted further begins with the second of `KNOTS`. The first were too few for 19 of 20 of
the films that a diagnosis asked for up to 3.7 gaps, and for one of four up to 1.4.
"""
ROOM = 1e-4  # beyond the last knot, relative to u: differences may look a little further
TOLERANCE = 1e-6
# A third of the step gains 729 where quintics are exact to sixth order; a part of that is counted on.
GAIN = 100.0
WORST = 1e-4
LIMIT, LOST = int(Status.ITERATION_LIMIT), int(Status.INDEFINITE)
SMALL = 1e-3  # of the largest force: smaller ones are known to that part of the tolerance


@dataclass(frozen=True)
class Gap:
    """The rig as a strip sees it: radii and the free length L = R2 - R1, m."""

    inner_radius: float
    outer_radius: float

    @property
    def tautness(self) -> float:
        """What pre-stretch weighs against deflection in the film, relative to the strip.

        Film: F = 2 pi T delta / ln(R2/R1) under the tension T alone and c G d delta^3 without any; strip: T delta / L
        and 2 G d delta^3 / L^3, both times its width.
        """
        return _tautness(self)

    @property
    def length(self) -> float:
        return self.outer_radius - self.inner_radius


@lru_cache(maxsize=64)
def _tautness(gap: Gap) -> float:
    small = np.array([1e-2 * gap.inner_radius])
    curve = solve(request(NeoHookean, [0.5], small, gap.inner_radius, gap.outer_radius))
    cubic = float(curve.force[0, 0] / small[0] ** 3)
    return float(2 * np.pi / np.log(gap.outer_radius / gap.inner_radius) * 2 / (cubic * gap.length**2))


@dataclass(frozen=True)
class FilmLaw:
    """F(delta) of B films.

    Attributes
    ----------
    gap : the rig
    prestretch : (B,)
    step : (B,) distance of knots in u; knots lie at (j + 1/2) step
    pieces : (B, J, 6) coefficients of g between knots j - 1 and j in powers of (u - u_(j-1)) / step
    last : (B,) number of knots that have a force, from the first
    status : (B,) `Status` beyond these
    tangents : (B, J, 6, n) d pieces / d (parameter i), or None
    """

    gap: Gap
    prestretch: Array
    step: Array
    pieces: Array
    last: NDArray[np.int64]
    status: NDArray[np.int8]
    tangents: Array | None = None

    def __call__(self, deflection: Array, excess: Array | None = None) -> tuple[Array, Array]:
        """((B, N) N, (B, N) N/m): force and dF/d(delta) at deflections (B, N) m; nan beyond the last force.

        With ``excess`` e (B, N) the film is longer than its gap: it is stretched as much as at delta_e with
        (L^2 + delta^2) / (1 + e)^2 = L^2 + delta_e^2, and by virtual work F = F(delta_e) (delta / delta_e) / (1 + e).
        Zero where it is slack, and below rest, but for films with a pre-stretch: taut there, they pull the disc back,
        F(-delta) = -F(delta).
        """
        force, slope = np.empty(deflection.shape), np.empty(deflection.shape)
        given = np.zeros((1, 1)) if excess is None else for_kernel(excess)
        d, gap = for_kernel(deflection), self.gap
        _evaluate(self.pieces, self.step, self.last, self.prestretch, gap.length, gap.tautness, d, given, force, slope)
        return force, slope

    def varied(self, change: Array) -> FilmLaw:
        """The law, to first order, of films whose parameters differ by ``change`` (B, n)."""
        assert self.tangents is not None
        return replace(self, pieces=self.pieces + np.einsum("bjcn,bn->bjc", self.tangents, change), tangents=None)

    def of(self, rows: NDArray[np.intp] | slice) -> FilmLaw:
        """The law of some of the films."""
        return FilmLaw(
            self.gap,
            self.prestretch[rows],
            self.step[rows],
            self.pieces[rows],
            self.last[rows],
            self.status[rows],
            None if self.tangents is None else self.tangents[rows],
        )

    @staticmethod
    def stack(laws: Sequence[FilmLaw]) -> FilmLaw:
        """The films of all laws, one after the other; tangents are left out."""
        most = max(law.pieces.shape[1] for law in laws)
        pieces = [_widened(law.pieces, most) for law in laws]
        rest = {n: np.concatenate([getattr(w, n) for w in laws]) for n in ("prestretch", "step", "last", "status")}
        return FilmLaw(laws[0].gap, pieces=np.concatenate(pieces), **rest)

    def replaced(self, rows: NDArray[np.int64], other: FilmLaw) -> FilmLaw:
        """This law with the films at ``rows`` from another one, whose knots are at least as many."""
        count = other.pieces.shape[1]
        wide: dict[str, Any] = {"pieces": _widened(self.pieces, count).copy()}
        if self.tangents is not None:
            wide["tangents"] = _widened(self.tangents, count).copy()
        for name in ("prestretch", "step", "last", "status"):
            wide[name] = getattr(self, name).copy()
        for name, values in wide.items():
            values[rows] = getattr(other, name)
        return replace(self, **wide)


def _widened(pieces: Array, count: int) -> Array:
    """Pieces (B, J, ...) as (B, ``count``, ...), with zeros; they themselves if they are as many."""
    if pieces.shape[1] == count:
        return pieces
    wide = np.zeros((len(pieces), count, *pieces.shape[2:]))
    wide[:, : pieces.shape[1]] = pieces
    return wide


def film_law(asked: Request, end: Array, solver: Solve = solve) -> tuple[FilmLaw, Curves]:
    """The law of the B films of ``asked`` up to deflections ``end`` (B,) m, with as many knots as 1e-6 asks for.

    The curves are those at the first knots and at the deflections of ``asked``, none or more, which show whether the
    films are convex. A film that no number of knots describes to `WORST` has no force from there on.
    """
    gap = Gap(asked.inner_radius, asked.outer_radius)
    rows = np.arange(len(asked.parameters))
    found = shown = None
    counts = KNOTS if np.max(end) <= FAR * gap.length else KNOTS[1:]
    for count in counts:
        some = asked.of(rows)
        at, l0 = knots(gap, end[rows], count), some.prestretch
        every = np.hstack([at, some.deflection]) if shown is None else at
        # Of what was asked for, beside the knots, no force is read.
        curves = solver(replace(some, deflection=every, read=None if some.read is None else count))
        shown = curves if shown is None else shown
        force, slope = curves.force[:, :count], curves.slope[:, :count]
        part = _tested(law(gap, l0, at, force, slope, curves.status[:, :count]))
        wrong = error(part, force, slope, at)
        known = np.where(np.isfinite(force), force, 0.0)
        wrong /= np.where(known > 0, known, 1.0) + SMALL * np.max(known, axis=1)[:, None]
        if count == KNOTS[-1]:
            part = _cut(part, wrong > WORST)
        if curves.sensitivity is not None:
            part = replace(part, tangents=tangent(part, force, curves.sensitivity[:, :count]))
        found = part if found is None else found.replaced(rows, part)
        rows = rows[np.max(wrong, axis=1) > TOLERANCE]
        if not rows.size:
            break
    assert found is not None
    assert shown is not None
    return found, shown


def _tested(found: FilmLaw) -> FilmLaw:
    """The law without the knots next to a film's end that `error` does not see: the force may soar there."""
    count = found.pieces.shape[1]
    return replace(found, last=np.where(found.last < count, np.maximum((found.last + 1) // 3 * 3 - 1, 0), found.last))


def _cut(found: FilmLaw, bad: NDArray[np.bool_]) -> FilmLaw:
    """The law up to the first knot (B, J) that is ``bad``; what follows is unresolved, unless the film ends there."""
    count = bad.shape[1]
    first = np.where(np.any(bad, axis=1), np.argmax(bad, axis=1), count)
    status = np.where((first < found.last) & (found.last == count), Status.UNRESOLVED, found.status)
    return replace(found, last=np.minimum(first, found.last), status=status.astype(np.int8))


def knots(gap: Gap, end: Array, count: int) -> Array:
    """(B, count) m: knots from next to zero to ``end`` (B,) m."""
    u = np.arcsinh(end / (WIDTH * gap.length)) / (count - 0.5)
    return np.asarray(WIDTH * gap.length * np.sinh(u[:, None] * (np.arange(count) + 0.5)))


def law(
    gap: Gap, prestretch: Array, deflection: Array, force: Array, slope: Array, status: NDArray[np.int8]
) -> FilmLaw:
    """The law through forces and slopes (B, J) at `knots`; what follows the first knot without a force is left out."""
    rows, count = force.shape
    step, pieces = np.empty(rows), np.zeros((rows, count, 6))
    last, beyond = np.empty(rows, np.int64), np.empty(rows, np.int8)
    bent = np.empty((3, count))
    of = (np.ascontiguousarray(v) for v in (prestretch, deflection, force, slope, status))
    _assemble(gap.length, gap.tautness, *of, _one_sided(), bent, step, pieces, last, beyond)
    return FilmLaw(gap, np.ascontiguousarray(prestretch), step, pieces, last, beyond)


def tangent(found: FilmLaw, force: Array, change: Array) -> Array:
    """(B, J, 6, m): d pieces for changes dF (B, J, m) of the forces at the knots.

    Slopes follow from the changes themselves, by a quintic spline through dF/F, even in u.
    """
    keep = np.arange(force.shape[1]) < found.last[:, None]
    with np.errstate(all="ignore"):
        q = np.where(keep[:, :, None], change / force[:, :, None], 0.0)
    out = np.zeros((*found.pieces.shape, q.shape[2]))
    for last in np.unique(found.last):
        if last < 3:
            continue
        rows = np.flatnonzero(found.last == last)
        pieces = _pieces_of_values(int(last)) @ q[rows, :last]
        out[rows, :last] = pieces.reshape(rows.size, last, 6, q.shape[2])
    return out


def error(found: FilmLaw, force: Array, slope: Array, deflection: Array) -> Array:
    """(B, J) N: error of the force to be expected near each knot, from the law through every third one.

    Knots 1, 4, 7, ... lie at (j + 1/2) times three steps: they are the knots of a coarser law.
    """
    third = slice(1, None, 3)
    ok = np.arange(force.shape[1]) < found.last[:, None]
    status = np.where(ok[:, third], Status.OK, Status.UNRESOLVED).astype(np.int8)
    coarse = law(found.gap, found.prestretch, deflection[:, third], force[:, third], slope[:, third], status)
    guess, _ = coarse(deflection)
    with np.errstate(invalid="ignore"):
        return np.where(ok & np.isfinite(guess), np.abs(guess - force) / GAIN, 0.0)


@cache
def _spline_slopes(count: int) -> tuple[Array, Array]:
    """Matrices (count, count) from values at j + 1/2 of an even function to its first two derivatives there."""
    from scipy.interpolate import make_interp_spline  # as in `locking`: on demand

    at = np.arange(count) + 0.5
    both = np.concatenate([-at[::-1], at])
    unit = np.eye(count)
    spline = make_interp_spline(both, np.concatenate([unit[::-1], unit]), k=5 if count > 2 else 3)
    return spline(at, 1), spline(at, 2)


@cache
def _pieces_of_values(count: int) -> Array:
    """(6 count, count) from values at j + 1/2 of an even function to the coefficients of the quintics through them."""
    first, second = _spline_slopes(count)
    return np.ascontiguousarray(_between(np.eye(count), first.T, second.T).reshape(count, -1).T)


@cache
def _one_sided() -> tuple[Array, Array]:
    """Weights (3,), (3,) of values and slopes at 0, -1, -2 that give the second derivative at 0 of any quintic."""
    x = np.array([0.0, -1.0, -2.0])
    powers = np.arange(6)
    rows = [x[:, None] ** powers, powers * x[:, None] ** np.maximum(powers - 1, 0)]
    a = np.concatenate(rows)
    w = 2.0 * np.linalg.inv(a)[2]
    return w[:3], w[3:]


def _between(g: Array, dg: Array, ddg: Array) -> Array:
    """(B, J, 6) quintics from knot j - 1 to knot j (the first from the mirror image of knot 0), in t in [0, 1]."""
    a, da, dda = (np.concatenate([s * v[:, :1], v[:, :-1]], 1) for s, v in ((1, g), (-1, dg), (1, ddg)))
    p, q, r = g - a - da - dda / 2, dg - da - dda, ddg - dda
    return np.ascontiguousarray(
        np.stack([a, da, dda / 2, 10 * p - 4 * q + r / 2, -15 * p + 7 * q - r, 6 * p - 3 * q + r / 2], axis=-1)
    )


@compiled(error_model="numpy")
def _assemble(length, tautness, prestretch, deflection, force, slope, status, edge, bent, step, pieces, last, beyond):  # type: ignore[no-untyped-def]
    """g = ln(F / F_s) at the knots (B, J) and its first two derivatives per step, and from them the quintics.

    F_s = delta (1 - l0^-6 L^4 / (L^2 + delta^2)^2) with 1 - l0^-6 weighted by the tautness of the gap. The second
    derivative follows from neighbours to fourth order, at the last knot from the three up to there.
    """
    rows, count = force.shape
    wide = WIDTH * length
    for b in range(rows):
        step[b] = 2.0 * np.arcsinh(deflection[b, 0] / wide)
        ratio = 1.0 - tautness * (1.0 - prestretch[b] ** -6.0)
        end = count
        for j in range(count):
            if status[b, j] != 0 or not force[b, j] > 0.0:
                end = j
                break
        last[b] = end
        if end == count:
            beyond[b] = LIMIT
        else:
            beyond[b] = status[b, end] if status[b, end] != 0 else LOST
        g, dg, ddg = bent[0], bent[1], bent[2]
        for j in range(count):
            g[j] = dg[j] = 0.0
            if j < end:
                x = deflection[b, j]
                reach = 1.0 + (x / length) ** 2
                kappa = ((reach - 1.0) * (reach + 1.0) + 1.0 - ratio) / (reach * reach)
                rise = kappa + 4.0 * ratio / (reach * reach * reach) * (x / length) ** 2
                g[j] = np.log(force[b, j] / (kappa * x))
                turn = np.sqrt(x * x + wide * wide) * step[b]
                dg[j] = (slope[b, j] / force[b, j] - rise / (kappa * x)) * turn
        for j in range(count):
            left, dleft = (g[j - 1], dg[j - 1]) if j > 0 else (g[0], -dg[0])
            right, dright = (g[j + 1], dg[j + 1]) if j < count - 1 else (g[j], dg[j])
            ddg[j] = 2.0 * (left - 2.0 * g[j] + right) - 0.5 * (dright - dleft)
        k = max(end - 1, 0)
        ddg[k] = 0.0
        if end >= 3:
            for i in range(3):
                ddg[k] += edge[0][i] * g[k - i] + edge[1][i] * dg[k - i]
        for j in range(count):
            # From knot j - 1, the first from the mirror image of knot 0, in t in [0, 1].
            a, da, dda = (g[j - 1], dg[j - 1], ddg[j - 1]) if j > 0 else (g[0], -dg[0], ddg[0])
            p, q, r = g[j] - a - da - 0.5 * dda, dg[j] - da - dda, ddg[j] - dda
            c = pieces[b, j]
            c[0], c[1], c[2] = a, da, 0.5 * dda
            c[3] = 10.0 * p - 4.0 * q + 0.5 * r
            c[4] = -15.0 * p + 7.0 * q - r
            c[5] = 6.0 * p - 3.0 * q + 0.5 * r


@compiled(error_model="numpy")
def _evaluate(pieces, step, last, prestretch, length, tautness, deflection, excess, force, slope):  # type: ignore[no-untyped-def]
    rows, points = deflection.shape
    longer = excess.size > 1
    # Divisions are what it costs: there are as few as can be.
    over_wide, over_square = 1.0 / (WIDTH * length), 1.0 / (length * length)
    for b in range(rows):
        taut = tautness * (1.0 - prestretch[b] ** -6.0)
        inverse = 1.0 / step[b]
        end = (last[b] - 0.5) * (1.0 + ROOM)
        for n in range(points):
            x, sign = deflection[b, n], 1.0
            if taut > 0.0 and x <= 0.0:
                x, sign = -x, (-1.0 if x < 0.0 else 1.0)
            elif not x > 0.0:
                force[b, n] = 0.0
                slope[b, n] = 0.0
                if not x <= 0.0:
                    force[b, n] = np.nan
                    slope[b, n] = np.nan
                continue
            shorter, q = 1.0, x * x
            if longer and excess[b, n] > 0.0:
                shorter = 1.0 / (1.0 + excess[b, n])
                q = (length * length + q) * (shorter * shorter) - length * length
            above = q * over_square
            less = 1.0 / (1.0 + above)
            kappa = (above * (above + 2.0) + taut) * (less * less)
            if not kappa > 0.0:
                force[b, n] = 0.0
                slope[b, n] = 0.0
                continue
            rise = 2.0 * (1.0 - taut) * over_square * (less * less * less)
            y = np.sqrt(max(q, 0.0)) * over_wide
            root = np.sqrt(1.0 + y * y)
            t = np.log(y + root) * inverse  # asinh, to round-off of one: t is compared with whole numbers
            if t > end:
                force[b, n] = np.nan
                slope[b, n] = np.nan
                continue
            i = min(int(t + 0.5), last[b] - 1)
            z = t + 0.5 - i
            c = pieces[b, i]
            g = c[0] + z * (c[1] + z * (c[2] + z * (c[3] + z * (c[4] + z * c[5]))))
            dg = c[1] + z * (2.0 * c[2] + z * (3.0 * c[3] + z * (4.0 * c[4] + z * 5.0 * c[5])))
            bend = 0.0
            if y > 1e-9:
                bend = dg * inverse * (over_wide * over_wide) / (2.0 * y * root)
            k = np.exp(g) * shorter
            force[b, n] = sign * (k * kappa * x)
            slope[b, n] = k * (kappa + 2.0 * (x * x * shorter * shorter) * (rise + kappa * bend))
