"""Ritz solver: forces of many films at once from the minimum of the stored energy over elements."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from bayesmembrane.ground.parameters import Array
from bayesmembrane.physics.materials.base import Material
from bayesmembrane.physics.mechanics.compiled import bind
from bayesmembrane.physics.mechanics.locking import locking_deflection
from bayesmembrane.physics.mechanics.request import Request, Spared, extensibility
from bayesmembrane.physics.mechanics.ritz import kernels
from bayesmembrane.physics.mechanics.ritz.elements import basis, evaluate, graded, replaced, unknowns
from bayesmembrane.physics.mechanics.ritz.simd import LANES
from bayesmembrane.physics.mechanics.solution import Curves, Note, Status

# Elements x bubbles per element.
LEVELS = ((1, 6), (2, 6), (4, 7), (8, 8), (8, 8), (12, 8))
# A force is exact to 1e-6 while the next bubbles would release less than this part of F delta (measured: the error is
# at most a hundred times the gain, over draws from the priors of all materials), and the first integral is even.
GAIN_LIMIT = 2e-10
VARIATION_LIMIT = 5e-4
TOLERANCE = 1e-11
MOST_ITERATIONS = 40
LIMITS = (MOST_ITERATIONS, TOLERANCE, GAIN_LIMIT, VARIATION_LIMIT)
# Largest step of the continuation in asinh(d), and the first deflection reached from the flat film.
STRIDE = 0.8
FIRST = 0.4
# A film that is not deflected has a stiffness: it is looked at this far up (scaled).
SMALLEST = 1e-4
# The end of a path is searched in two sweeps of this many deflections, and believed if two bases agree to this part.
SEARCH = 16
SAME_END = 0.02
# A path that ends with less than this of P11 / (G d) ends because ellipticity is about to be lost there.
NEARLY_BENT = 0.1
# A margin of convexity or ellipticity below minus this rules a film out, whatever finer bases would say.
RULED_OUT = 1e-6
LOOSE_GAIN, LOOSE_VARIATION = 1e-5, 2e-2
RULED_OUT_ON_THE_WAY = 1e-3


@dataclass(frozen=True)
class Shapes:
    """Solutions at K states: unknowns (K, 2n) on elements with ends (K, E+1), and what each gains from more (K, E)."""

    unknowns: Array
    ends: Array
    gains: Array
    bubbles: int

    def of(self, rows: Any) -> Self:
        return replace(self, unknowns=self.unknowns[rows], ends=self.ends[rows], gains=self.gains[rows])

    def and_(self, other: Shapes) -> Shapes:
        """Both, one after the other; they have as many elements and bubbles."""
        pairs = ((getattr(self, name), getattr(other, name)) for name in ("unknowns", "ends", "gains"))
        return Shapes(*(np.concatenate(pair) for pair in pairs), self.bubbles)


def shape(request: Request, t: Array) -> tuple[Array, Array, Array, Array]:
    """(l2, u, w, h) of the first film at its first deflection, at t = ln(R/R1) (M,).

    u = l1 cos(theta), w = l1 sin(theta), and the rise h from the disc outwards in units of R1/l0. nan if unresolved.
    """
    one = replace(request, parameters=request.parameters[:1], prestretch=request.prestretch[:1])
    d = np.where(request.deflection[:1, :1] == 0, SMALLEST, request.scaled[:1, :1])
    search = _Search(one, d, np.ones((1, 1), np.bool_))
    for level in range(1, len(LEVELS)):
        if not search.improve(level):
            break
    if search.status[0, 0] != Status.OK:
        gap = np.full(t.shape, np.nan)
        return gap, gap, gap, gap
    found, span, l0 = search.found, np.log(request.ratio), request.prestretch[0]
    (a, b), (a_slope, b_slope) = evaluate(found.unknowns[0], found.ends[0], found.bubbles, t)
    l2 = l0 + a
    return l2, l2 + a_slope, np.exp(-t) * (d[0, 0] / span + b_slope), d[0, 0] * t / span + b


@cache
def compiled(material: type[Material]) -> Any:
    """The kernels of one material."""
    return bind(kernels.KERNELS, material, FIELDS=(0.0,) * len(material.field_names()))


def _path(d: Array, stride: float) -> tuple[Array, NDArray[np.bool_]]:
    """From the flat film through ascending scaled deflections d (B, N) > 0, in steps of ``stride`` in asinh(d).

    Returns deflections (M, B), and a mask (M,) of those that were asked for.
    """
    x = np.arcsinh(d.T)
    start = np.minimum(np.arcsinh(FIRST), x[:1])
    before = np.concatenate([start, x[:-1]])
    gap = x - before
    steps = np.maximum(np.ceil(np.max(gap, axis=1) / stride), 1).astype(int)
    lead = bool(np.any(gap[0] > 0))
    if not lead:
        steps[0] = 1
    home = np.repeat(np.arange(len(x)), steps)
    part = np.arange(home.size) - np.repeat(np.cumsum(steps) - steps, steps) + 1
    keep = part == steps[home]
    grid = d.T[home]
    grid[~keep] = np.sinh(before[home] + gap[home] * (part / steps[home])[:, None])[~keep]
    if lead:
        return np.concatenate([np.sinh(start), grid]), np.concatenate([[False], keep])
    return grid, keep


def follow(request: Request, d: Array, level: int, sensitivities: bool = False) -> tuple[Array, Array]:
    """Continue B films from the flat film through ascending scaled deflections d (B, N), on `graded` elements.

    Returns results (B, rows, N) and traces (B, 2n + E, N), see `kernels.follow`.
    """
    elements, bubbles = LEVELS[level]
    grid, keep = _path(d, STRIDE / 2**level)
    ends = np.broadcast_to(graded(request.ratio, elements), (len(d), elements + 1))
    return _run(request, grid, keep, np.zeros((len(d), unknowns(elements, bubbles))), ends, level, sensitivities)


def _run(
    request: Request,
    grid: Array,
    keep: NDArray[np.bool_],
    start: Array,
    ends: Array,
    level: int,
    sensitivities: bool,
) -> tuple[Array, Array]:
    """`kernels.follow` over deflections grid (M, B) from unknowns start (B, 2n) on elements with ends (B, E+1)."""
    count, fields = grid.shape[1], request.parameters.shape[1]
    blocks, n = -(-count // LANES), int(np.count_nonzero(keep))
    pad = np.minimum(np.arange(blocks * LANES), count - 1)

    def blocked(rows: Array) -> Array:
        """(R, B) -> (blocks, R, LANES), the last film repeated."""
        return np.ascontiguousarray(rows[:, pad].reshape(len(rows), blocks, LANES).transpose(1, 0, 2))

    gd = np.broadcast_to(_shear_modulus(request), (1, count))
    result = np.empty((blocks, LANES, kernels.RESULTS + (fields if sensitivities else 0), n))
    trace = np.empty((blocks, LANES, start.shape[1] + ends.shape[1] - 1, n))
    rows = (blocked(v) for v in (request.parameters.T, gd, request.prestretch[None], grid, start.T, ends.T))
    tables = basis(*LEVELS[level])
    compiled(request.material).follow(*rows, tables, LIMITS, keep, sensitivities, result, trace)
    padded = blocks * LANES
    return result.reshape(padded, *result.shape[2:])[:count], trace.reshape(padded, *trace.shape[2:])[:count]


def _shapes(trace: Array, ends: Array, level: int) -> Shapes:
    """The solutions in a trace (K, 2n + E)."""
    size = unknowns(*LEVELS[level])
    return Shapes(trace[:, :size], ends, trace[:, size:], LEVELS[level][1])


def _shear_modulus(request: Request) -> Array:
    return np.asarray(request.material.shear_modulus(request.parameters.T), dtype=float)


def _films(request: Request, films: NDArray[np.intp]) -> Request:
    return replace(request, parameters=request.parameters[films], prestretch=request.prestretch[films])


def solve(request: Request) -> Curves:
    """Force curves from the minimum of the stored energy,

        F = dE/d(delta),  E(delta) = min over the deformation of 2 pi int R^2 W dt.

    Every film is first followed with six polynomials over the whole width. States whose next polynomials would still
    release energy are refined, each from its own solution, with more and shorter elements; films whose path was lost
    are followed again with these and with shorter steps. A path that ends at the same deflection for two bases ends
    physically, and is given its reason; what is left is flagged.

    Of a film that is spared (a prior rules it out whatever its other forces are) what is not resolved at first stays
    flagged. Beyond the deflection ``exact_up_to`` states only show whether the film stays stable and convex.
    """
    d, back = _ascending(np.where(request.deflection == 0, SMALLEST, request.scaled))
    bound = extensibility(request)
    locked = np.zeros(d.shape, np.bool_)
    if np.any(bound < np.inf):
        locked = d >= locking_deflection(bound, request.prestretch, request.ratio)[:, None]
        # A locked deflection is replaced by the last one that can be reached; its answer is not used.
        reach = np.max(np.where(locked, 0.0, d), axis=1, keepdims=True)
        d = np.where(locked, np.where(reach > 0, reach, 1e-3), d)
    loose = d > request.exact_up_to * (1 + 1e-9) * request.prestretch[:, None] / request.inner_radius
    search = _Search(request, d, ~locked, loose)
    if np.any(search.status) or np.any(locked):
        for level in range(1, len(LEVELS)):
            if not search.improve(level):
                break
        _pass_on(search.status)
        search.status[locked] = Status.LOCKED
    return _curves(request, search, back)


def _nearly_resolved(result: Array, d: Array) -> NDArray[np.bool_]:
    """(B, N) True where the next bubbles would change the force by less than 1e-3 or so."""
    even = result[:, kernels.VARIATION] < LOOSE_VARIATION
    return np.asarray(even & (result[:, kernels.GAIN] < LOOSE_GAIN * np.abs(result[:, kernels.FORCE] * d)))


def _ruled_out(result: Array, status: NDArray[np.int8], spare: Spared) -> NDArray[np.bool_]:
    """(B,) True for films with a resolved state that shows them to be such as are spared."""
    if spare is Spared.NONE:
        return np.zeros(len(result), np.bool_)
    margin = result[:, kernels.CONVEX if spare is Spared.NOT_CONVEX else kernels.ELLIPTIC]
    return np.asarray(np.any((status == Status.OK) & (margin < -RULED_OUT), axis=1))


class _Search:
    """What is known of B films at N ascending scaled deflections d (B, N), and how to know more.

    Attributes
    ----------
    wanted : (B, N) True where an answer is wanted
    result, status : (B, rows, N) and (B, N) `Status` codes
    film, column, shapes : (K,), (K,) and `Shapes` of the states that are to be refined
    ends : (B,) scaled deflection at which the path was lost with the last basis, nan if it was not
    """

    def __init__(
        self,
        request: Request,
        d: Array,
        wanted: NDArray[np.bool_],
        loose: NDArray[np.bool_] | None = None,
    ) -> None:
        self.request, self.d = request, d
        self.result, trace = follow(request, d, 0, request.sensitivities)
        self.status = self.result[:, kernels.STATUS].astype(np.int8)
        self.loose = np.zeros(d.shape, np.bool_) if loose is None else loose
        enough = self.loose & (self.status == Status.UNRESOLVED) & _nearly_resolved(self.result, d)
        self.status[enough] = Status.OK
        self.wanted = wanted & ~_ruled_out(self.result, self.status, request.spare)[:, None]
        self.ends = np.full(len(d), np.nan)
        self.film = self.column = np.empty(0, np.intp)
        if np.any(self.status):
            films = np.flatnonzero(np.any(self.wanted, axis=1))
            verdict = self.status[films]
            self._explain(films, verdict, 0)
            self.status[films] = verdict
            self.film, self.column = np.nonzero((self.status == Status.UNRESOLVED) & self.wanted)
        self.shapes = self._from_trace(trace, self.film, self.column, 0)

    def improve(self, level: int) -> bool:
        """One level up: refine the rough states, and follow again the films whose path was lost. False if none is."""
        if level == 1:
            # The loss of stability is believed when a finer basis confirms it.
            lost = (self.status == Status.NOT_ELLIPTIC) | (self.status == Status.INDEFINITE)
            self.status[lost & self.wanted] = Status.ITERATION_LIMIT
        if self.film.size:
            self._refine(level)
        films = np.flatnonzero(np.any((self.status == Status.ITERATION_LIMIT) & self.wanted, axis=1))
        if films.size:
            self._follow(level, films)
        return bool(self.film.size or films.size)

    def _refine(self, level: int) -> None:
        """Each rough state from its own solution, all side by side, on new elements; those still rough remain."""
        film, column, old = self.film, self.column, self.shapes
        d = self.d[film, column]
        ends, start = replaced(old.unknowns, old.ends, old.gains, d, old.bubbles, LEVELS[level])
        one, films = np.ones(1, np.bool_), _films(self.request, film)
        result, trace = _run(films, d[None], one, start, ends, level, self.request.sensitivities)
        verdict = result[:, kernels.STATUS, 0].astype(np.int8)
        still = verdict == Status.UNRESOLVED
        # A rough state that leads to no stable one lay astray: its film is followed again.
        verdict[(verdict != Status.OK) & ~still] = Status.ITERATION_LIMIT
        self.result[film, :, column], self.status[film, column] = result[..., 0], verdict
        self.film, self.column, self.shapes = film[still], column[still], _shapes(trace[still, :, 0], ends[still], level)

    def _follow(self, level: int, films: NDArray[np.intp]) -> None:
        """Whole films from the start, for the sake of their doubtful columns; those rough now join the others."""
        doubtful = (self.status[films] == Status.ITERATION_LIMIT) & self.wanted[films]
        result, trace = follow(_films(self.request, films), self.d[films], level, self.request.sensitivities)
        verdict = result[:, kernels.STATUS].astype(np.int8)
        self._explain(films, verdict, level)
        at, column = np.nonzero(doubtful)
        self.result[films[at], :, column] = result[at, :, column]
        self.status[films[at], column] = verdict[at, column]
        at, column = np.nonzero(doubtful & (verdict == Status.UNRESOLVED))
        more = self._from_trace(trace, at, column, level)
        self.shapes = self.shapes.and_(more) if self.film.size else more
        self.film, self.column = np.append(self.film, films[at]), np.append(self.column, column)

    def _from_trace(self, trace: Array, film: NDArray[np.intp], column: NDArray[np.intp], level: int) -> Shapes:
        elements = LEVELS[level][0]
        ends = np.broadcast_to(graded(self.request.ratio, elements), (film.size, elements + 1))
        return _shapes(trace[film, :, column], ends, level)

    def _explain(self, films: NDArray[np.intp], verdict: NDArray[np.int8], level: int) -> None:
        """Name the reason, in ``verdict`` (K, N) of K films, of paths that end where they did with the basis before."""
        lost = verdict == Status.ITERATION_LIMIT
        some = np.flatnonzero(np.any(lost, axis=1))
        before = self.ends[films[some]]
        self.ends[films] = np.nan
        if not some.size:
            return
        if self.request.spare is not Spared.NONE and level > 1:
            # Lost by several bases: such a film is worth no more effort where a prior is about to judge it.
            verdict[lost] = Status.INDEFINITE
            return
        request, d = _films(self.request, films[some]), self.d[films[some]]
        first, rows = np.argmax(lost[some], axis=1), np.arange(some.size)
        high = d[rows, first]
        low = np.where(first > 0, d[rows, np.maximum(first - 1, 0)], high * 0.01)
        ends, bent, convex, elliptic = _path_end(request, low, high, level)
        self.ends[films[some]] = ends
        # Chains that lock end the path by stiffening: that is no loss of stability.
        same = (np.abs(ends - before) < SAME_END * ends) & np.isinf(extensibility(request))
        reason = np.where(bent, Status.NOT_ELLIPTIC, Status.INDEFINITE).astype(np.int8)
        if self.request.spare is not Spared.NONE and level > 0:
            # What lies beyond is reached, if at all, through states that rule the film out.
            passed = (convex if self.request.spare is Spared.NOT_CONVEX else elliptic) < -RULED_OUT_ON_THE_WAY
            same, reason = same | passed, np.where(passed, Status.NOT_ELLIPTIC, reason)
        for i in np.flatnonzero(same):
            verdict[some[i], lost[some[i]]] = reason[i]


def _pass_on(status: NDArray[np.int8]) -> None:
    """What has no state beyond a loss of stability, in ascending deflection (B, N), is given the first such reason."""
    named = (status == Status.NOT_ELLIPTIC) | (status == Status.INDEFINITE)
    films = np.flatnonzero(np.any(named, axis=1))
    first = status[films, np.argmax(named[films], axis=1)]
    passed = np.logical_or.accumulate(named[films], axis=1) & (status[films] != Status.OK)
    status[films] = np.where(passed, first[:, None], status[films])


def _path_end(request: Request, low: Array, high: Array, level: int) -> tuple[Array, NDArray[np.bool_], Array, Array]:
    """Where between the scaled deflections low and high (B,) the path ends, and whether P11 falls to zero there.

    P11 then goes like the root of the distance: over the last sweep it falls by more than half, or is small already.
    Returned as well: the least margins of convexity and ellipticity of the states met, whether resolved or not.
    """
    rows, bent = np.arange(low.size), np.zeros(low.size, np.bool_)
    margins = np.full((2, low.size), np.inf)
    for _ in range(2):
        fine = low[:, None] + (high - low)[:, None] * np.arange(SEARCH) / (SEARCH - 1)
        result, _ = follow(request, fine, level)
        found = result[:, kernels.STATUS] != Status.ITERATION_LIMIT
        last = np.sum(np.logical_and.accumulate(found, axis=1), axis=1) - 1
        good, at = last >= 0, np.maximum(last, 0)
        met = np.where(found[:, None], result[:, (kernels.CONVEX, kernels.ELLIPTIC)], np.inf)
        margins = np.minimum(margins, np.min(met, axis=2).T)
        p11 = result[rows, kernels.LEAST_P11, at]
        bent |= good & ((p11 < NEARLY_BENT * _shear_modulus(request)) | (p11 < 0.5 * result[:, kernels.LEAST_P11, 0]))
        high = np.where(good, fine[rows, np.minimum(last + 1, SEARCH - 1)], high)
        low = np.where(good, fine[rows, at], low)
    return low, bent, margins[0], margins[1]


def _ascending(d: Array) -> tuple[Array, NDArray[np.intp] | None]:
    """d (B, N) sorted film by film, and the place (B, N) of each original value; None if they were sorted."""
    if np.all(d[:, 1:] >= d[:, :-1]):
        return d, None
    order = np.argsort(d, axis=1, kind="stable")
    return np.take_along_axis(d, order, axis=1), np.argsort(order, axis=1)


def _curves(request: Request, search: _Search, back: NDArray[np.intp] | None) -> Curves:
    """Undo the scaling and the sorting."""
    k, result, status = kernels, search.result, search.status
    if back is not None:
        result = np.take_along_axis(result, back[:, None], axis=2)
        status = np.take_along_axis(status, back, axis=1)
    ok, sign = status == Status.OK, np.sign(request.deflection)
    length = request.inner_radius / request.prestretch[:, None]
    note = np.where(result[:, k.LEAST_P2] < 0, Note.WRINKLED, 0) | np.where(result[:, k.SLACK] <= 0, Note.SLACK, 0)
    factor = 2 * np.pi * length

    def row(index: int | slice, scale: Any = 1.0) -> Array:
        # Where it is not ok anything may stand, infinity too.
        with np.errstate(invalid="ignore", over="ignore"):
            return np.where(ok if isinstance(index, int) else ok[:, None], result[:, index] * scale, np.nan)

    sensitivity = None
    if request.sensitivities:
        rows = row(slice(k.RESULTS, None), (factor * sign)[:, None])
        sensitivity = np.ascontiguousarray(np.moveaxis(rows, 1, 2))
    return Curves(
        deflection=request.deflection,
        force=row(k.FORCE, factor * sign),
        status=status,
        note=np.where(ok, note, 0).astype(np.int8),
        slope=row(k.SLOPE, 2 * np.pi),
        sensitivity=sensitivity,
        variation=row(k.VARIATION),
        max_stretch=row(k.STRETCH),
        ellipticity=row(k.ELLIPTIC),
        convexity=row(k.CONVEX),
        energy=row(k.STORED, factor * length),
    )
