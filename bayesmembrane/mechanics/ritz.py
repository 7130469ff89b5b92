"""Spectral Ritz solver: forces of many films at once from the minimum of the stored energy."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray

from bayesmembrane.materials.base import Material
from bayesmembrane.mechanics import ritz_kernels as kernels
from bayesmembrane.mechanics.compiled import bind
from bayesmembrane.mechanics.locking import locking_deflection
from bayesmembrane.mechanics.problem import Problem, extensibility
from bayesmembrane.mechanics.solution import Curves, Note, Status
from bayesmembrane.parameters import Array

LANES = kernels.LANES
# Elements x bubbles per element, tried in this order until R P1 sin(theta) is even enough.
LEVELS = ((1, 6), (2, 6), (4, 7), (8, 8), (24, 8))
# A force is exact to 1e-6 while the next bubbles would release less than this part of F delta (measured: the error is
# at most a hundred times the gain, over draws from the priors of all materials), and the first integral is even.
GAIN_LIMIT = 2e-9
VARIATION_LIMIT = 5e-4
TOLERANCE = 1e-11
MOST_ITERATIONS = 40
# Largest step of the continuation in asinh(d), and the first deflection reached from the flat film.
STRIDE = 0.8
FIRST = 0.4
# The end of a path is searched in two sweeps of this many deflections, and believed if two bases agree to this part.
SEARCH = 16
SAME_END = 0.02
# A path that ends with less than this of P11 / (G d) ends because ellipticity is about to be lost there.
NEARLY_BENT = 0.1


@dataclass(frozen=True)
class Basis:
    """Shape functions on t in [0, T], sampled at G Gauss points and, last, at the two edges."""

    tables: tuple[Any, ...]
    functions: int


@cache
def basis(ratio: float, elements: int, bubbles: int) -> Basis:
    """Hats and integrated Legendre bubbles over elements in t = ln(R/R1) in [0, T], for R2/R1 = ``ratio``.

    Sampled at bubbles + 3 Gauss points per element and then at the two edges.
    """
    span, ends = np.log(ratio), _ends(ratio, elements)
    nodes, weights = legendre.leggauss(bubbles + 3)
    size, per, n = nodes.size, bubbles + 1, elements * (bubbles + 1) - 1
    lengths = np.diff(ends)
    points = np.append((ends[:-1, None] + 0.5 * (1 + nodes) * lengths[:, None]).ravel(), [0.0, span])
    phi, slope = _shape_functions(ratio, elements, bubbles, points)
    home = np.append(np.repeat(np.arange(elements), size), [0, elements - 1])
    first = np.maximum(home * per - 1, 0)
    last = np.minimum((home + 1) * per, n)
    gauss = elements * size
    growth = np.exp(points)
    weight = (weights * lengths[:, None] / 2).ravel() * growth[:gauss] ** 2
    low = np.arange(2 * n)
    for a, b in zip(first, last, strict=True):
        low[2 * a : 2 * b] = np.minimum(low[2 * a : 2 * b], 2 * a)
    active = (first[None, :gauss] <= np.arange(n)[:, None]) & (np.arange(n)[:, None] < last[None, :gauss])
    start, stop = active.argmax(1), gauss - active[:, ::-1].argmax(1)
    width = int(np.max(np.arange(2 * n) - low)) + 1
    floats = (np.ascontiguousarray(v) for v in (phi, phi + slope, slope / growth, 1 / (span * growth), growth, weight))
    return Basis((*floats, first, last, start, stop, low, width, _next_bubbles(lengths, nodes, bubbles, growth)), n)


def _next_bubbles(lengths: Array, nodes: Array, bubbles: int, growth: Array) -> Array:
    """The two bubbles after the last of every element at its Gauss points: (phi + phi', phi, exp(-t) phi')."""
    value, rate = (v[bubbles:] for v in _bubbles(nodes, bubbles + 2))
    extra = np.empty((3, 2, nodes.size, lengths.size))
    for e, length in enumerate(lengths):
        steep = rate * 2 / length
        extra[..., e] = value + steep, value, steep / growth[e * nodes.size : (e + 1) * nodes.size]
    return extra


def shape(problem: Problem, t: Array) -> tuple[Array, Array, Array, Array]:
    """(l2, u, w, h) of the first film at its first deflection, at t = ln(R/R1) (M,).

    u = l1 cos(theta), w = l1 sin(theta), and the rise h from the disc outwards in units of R1/l0. nan if unresolved.
    """
    one = replace(problem, parameters=problem.parameters[:1], prestretch=problem.prestretch[:1])
    d = np.maximum(problem.scaled[:1, :1], 1e-4)
    for level, (elements, bubbles) in enumerate(LEVELS):
        result, _, trace = follow(one, d, level, STRIDE / 2**level, False, trace=True)
        if judge(result, d.T)[0, 0] == Status.OK:
            span, l0 = np.log(problem.ratio), problem.prestretch[0]
            phi, slope = _shape_functions(problem.ratio, elements, bubbles, t)
            a, b = trace[0, 0::2, 0], trace[0, 1::2, 0]
            l2 = l0 + a @ phi
            return l2, l2 + a @ slope, np.exp(-t) * (d[0, 0] / span + b @ slope), d[0, 0] * t / span + b @ phi
    gap = np.full(t.shape, np.nan)
    return gap, gap, gap, gap


def _shape_functions(ratio: float, elements: int, bubbles: int, t: Array) -> tuple[Array, Array]:
    """phi and d phi/dt, each (n, M), at t (M,) in [0, ln ratio]."""
    ends = _ends(ratio, elements)
    n = elements * (bubbles + 1) - 1
    phi, slope = np.zeros((n, t.size)), np.zeros((n, t.size))
    home = np.clip(np.searchsorted(ends, t, side="right") - 1, 0, elements - 1)
    for e in range(elements):
        at = np.flatnonzero(home == e)
        length, start = ends[e + 1] - ends[e], e * (bubbles + 1)
        x = 2 * (t[at] - ends[e]) / length - 1
        value, rate = _bubbles(x, bubbles)
        phi[start : start + bubbles, at], slope[start : start + bubbles, at] = value, rate * 2 / length
        if e > 0:
            phi[start - 1, at], slope[start - 1, at] = 0.5 * (1 - x), -1 / length
        if e < elements - 1:
            phi[start + bubbles, at], slope[start + bubbles, at] = 0.5 * (1 + x), 1 / length
    return phi, slope


def _ends(ratio: float, elements: int) -> Array:
    """Element ends in t: shorter elements towards the edges, where soft films form boundary layers."""
    return np.asarray(np.log(ratio) * (1 - np.cos(np.pi * np.arange(elements + 1) / elements)) / 2)


def _bubbles(x: Array, count: int) -> tuple[Array, Array]:
    """Integrated Legendre polynomials N_i = int_-1^x P_i, i = 1..count, scaled to unit slope norm, and slopes."""
    value, rate = np.empty((count, x.size)), np.empty((count, x.size))
    for i in range(1, count + 1):
        c = np.zeros(i + 1)
        c[i] = np.sqrt((2 * i + 1) / 2)
        rate[i - 1] = legendre.legval(x, c)
        value[i - 1] = legendre.legval(x, legendre.legint(c, lbnd=-1))
    return value, rate


@cache
def compiled(material: type[Material]) -> Any:
    """The kernels of one material."""
    k = kernels
    chain = (k.states, k.assemble, k.factorise, k.backsolve, k.predict, k.examine, k.energy_gain, k.force_sensitivity, k.decide, k.follow)
    return bind(chain, material, FIELDS=(0.0,) * len(material.field_names()))


@dataclass(frozen=True)
class _Path:
    """Continuation of B films: the deflections asked for, in ascending order, and helpers in between.

    grid : (M, B) ascending scaled deflections
    keep : (M,) True for those that were asked for
    """

    grid: Array
    keep: NDArray[np.bool_]


def _path(d: Array, stride: float) -> _Path:
    """From the flat film through the sorted scaled deflections d (B, N) > 0, in steps of ``stride`` in asinh(d)."""
    x = np.arcsinh(d)
    rows, keep = [], []
    previous = np.minimum(np.arcsinh(FIRST), x[:, 0])
    if np.any(previous < x[:, 0]):
        rows.append(previous)
        keep.append(False)
    for i in range(x.shape[1]):
        gap = x[:, i] - previous
        steps = max(1, int(np.ceil(np.max(gap) / stride))) if rows else 1
        for s in range(1, steps + 1):
            rows.append(previous + gap * s / steps)
            keep.append(s == steps)
        previous = x[:, i]
    return _Path(np.sinh(np.array(rows)), np.array(keep))


def follow(
    problem: Problem, d: Array, level: int, stride: float, sensitivities: bool, trace: bool = False
) -> tuple[Array, Array, Array]:
    """Run the kernels over all films in blocks of `LANES`.

    d (B, N) are ascending scaled deflections. Returns results (N, 12, B), sensitivities (N, n, B) and unknowns
    (N, 2 functions, B), all scaled; the last two are empty if not asked for.
    """
    k, material, count = kernels, problem.material, problem.parameters.shape[0]
    shape = basis(problem.ratio, *LEVELS[level])
    path = _path(d, stride)
    blocks = -(-count // LANES)
    pad = np.minimum(np.arange(blocks * LANES), count - 1)
    p, l0, grid = problem.parameters[pad].T, problem.prestretch[pad], path.grid[:, pad]
    gd = np.broadcast_to(np.asarray(material.shear_modulus(p), dtype=float), l0.shape)
    fields, m, wanted = p.shape[0], path.grid.shape[0], int(path.keep.sum())
    result = np.empty((wanted, k.RESULTS, blocks * LANES))
    sens = np.empty((wanted if sensitivities else 0, fields, blocks * LANES))
    states = np.empty((wanted if trace else 0, 2 * shape.functions, blocks * LANES))
    run = compiled(material).follow
    out, out_sens = np.empty((k.RESULTS * m, LANES)), np.empty((fields * m if sensitivities else 0, LANES))
    out_trace = np.empty((2 * shape.functions * m if trace else 0, LANES))
    for block in range(blocks):
        at = slice(block * LANES, (block + 1) * LANES)
        rows = (np.ascontiguousarray(v) for v in (p[:, at], gd[None, at], l0[None, at], grid[:, at]))
        q = np.zeros((2 * shape.functions, LANES))
        run(*rows, q, shape.tables, MOST_ITERATIONS, TOLERANCE, sensitivities, path.keep, out, out_sens, out_trace)
        result[..., at] = out.reshape(m, k.RESULTS, LANES)[path.keep]
        if sensitivities:
            sens[..., at] = out_sens.reshape(m, fields, LANES)[path.keep]
        if trace:
            states[..., at] = out_trace.reshape(m, -1, LANES)[path.keep]
    return result[..., :count], sens[..., :count], states[..., :count]


def judge(result: Array, d: Array) -> NDArray[np.int8]:
    """Status codes (N, B) of kernel results (N, rows, B) at ascending scaled deflections d (N, B)."""
    k = kernels
    status = result[:, k.STATUS].astype(np.int8)
    # Bubbles judge each on its own; where the film is about to soften without bound they see less of what is missing.
    strict = np.clip(result[:, k.ELLIPTIC], 1e-3, 1.0)
    rough = ~(result[:, k.GAIN] <= GAIN_LIMIT * strict * np.abs(result[:, k.FORCE] * d))
    rough |= ~(result[:, k.VARIATION] <= VARIATION_LIMIT)
    status[(status == Status.OK) & rough] = Status.UNRESOLVED
    converged = status != Status.ITERATION_LIMIT
    status[converged & ~(result[:, k.LEAST_P11] > 0)] = Status.NOT_ELLIPTIC
    return status


def solve(problem: Problem, sensitivities: bool = False) -> Curves:
    """Force curves from the minimum of the stored energy,

        F = dE/d(delta),  E(delta) = min over the deformation of 2 pi int R^2 W dt.

    Every film is first tried with six polynomials over the whole width; films whose next polynomials would still
    release energy, or that did not converge, are tried again with more and shorter elements and shorter continuation
    steps. A path that ends at the same deflection for two bases ends physically, and is given its reason; what is left
    is flagged.
    """
    sign = np.sign(problem.deflection)
    d, back = _ascending(np.where(sign == 0, 1e-4, problem.scaled))
    locked = d >= locking_deflection(extensibility(problem), problem.prestretch, problem.ratio)[:, None]
    # A locked deflection is replaced by the last one that can be reached; its answer is not used.
    reach = np.max(np.where(locked, 0.0, d), axis=1, keepdims=True)
    d = np.where(locked, np.where(reach > 0, reach, 1e-3), d)
    count, n = d.shape
    result = np.full((n, kernels.RESULTS, count), np.nan)
    sens = np.full((n, problem.parameters.shape[1], count), np.nan) if sensitivities else np.empty((0, 0, count))
    status = np.full((n, count), Status.ITERATION_LIMIT, np.int8)
    ends, todo = np.full(count, np.nan), np.arange(count)
    for level in range(len(LEVELS)):
        part = replace(problem, parameters=problem.parameters[todo], prestretch=problem.prestretch[todo])
        new, new_sens, _ = follow(part, d[todo], level, STRIDE / 2**level, sensitivities)
        verdict, before = judge(new, d[todo].T), status[:, todo]
        ends[todo] = _explain_lost(part, d[todo], verdict, ends[todo], level)
        better = (before != Status.OK) & ~(_named(before) & ~_named(verdict) & (verdict != Status.OK))
        result[:, :, todo] = np.where(better[:, None], new, result[:, :, todo])
        if sensitivities:
            sens[..., todo] = np.where(better[:, None], new_sens, sens[..., todo])
        status[:, todo] = np.where(better, verdict, before)
        # The loss of ellipticity is believed when a finer basis confirms it.
        unsettled = (status[:, todo] != Status.OK) & (~_named(status[:, todo]) | (level == 0))
        todo = todo[np.any(unsettled & ~locked[todo].T, axis=0)]
        if todo.size == 0:
            break
    _pass_on(status)
    status[locked.T] = Status.LOCKED
    return _curves(problem, result, sens if sensitivities else None, status, back, sign)


def _named(status: NDArray[np.int8]) -> NDArray[np.bool_]:
    return np.isin(status, (Status.NOT_ELLIPTIC, Status.INDEFINITE, Status.LOCKED))


def _pass_on(status: NDArray[np.int8]) -> None:
    """What could not be solved beyond a loss of stability, in ascending deflection (N, B), is given that reason."""
    for reason in (Status.NOT_ELLIPTIC, Status.INDEFINITE):
        passed = np.logical_or.accumulate(status == reason, axis=0)
        status[passed & np.isin(status, (Status.UNRESOLVED, Status.ITERATION_LIMIT))] = reason


def _explain_lost(problem: Problem, d: Array, verdict: NDArray[np.int8], before: Array, level: int) -> Array:
    """Name the reason, in ``verdict`` (N, B), of paths that end where they ended with the basis before.

    before (B,) : scaled deflection at which the path ended with the last basis, nan if it did not. Returns the same
    for this basis.
    """
    ends = np.full(before.shape, np.nan)
    lost = verdict == Status.ITERATION_LIMIT
    films = np.flatnonzero(np.any(lost, axis=0))
    if films.size == 0:
        return ends
    some = replace(problem, parameters=problem.parameters[films], prestretch=problem.prestretch[films])
    first = np.argmax(lost[:, films], axis=0)
    high = d[films, first]
    low = np.where(first > 0, d[films, np.maximum(first - 1, 0)], high * 0.01)
    ends[films], bent = _path_end(some, low, high, level)
    reason = np.where(bent, Status.NOT_ELLIPTIC, Status.INDEFINITE)
    # Chains that lock end the path by stiffening: that is no loss of stability.
    same = (np.abs(ends[films] - before[films]) < SAME_END * ends[films]) & np.isinf(extensibility(some))
    for i in np.flatnonzero(same):
        verdict[lost[:, films[i]], films[i]] = reason[i]
    return ends


def _path_end(problem: Problem, low: Array, high: Array, level: int) -> tuple[Array, NDArray[np.bool_]]:
    """Where between the scaled deflections low and high (B,) the path ends, and whether P11 falls to zero there.

    P11 then goes like the root of the distance: over the last sweep it falls by more than half, or is small already.
    """
    rows, bent = np.arange(low.size), np.zeros(low.size, np.bool_)
    gd = np.broadcast_to(np.asarray(problem.material.shear_modulus(problem.parameters.T), dtype=float), low.shape)
    for _ in range(2):
        fine = low[:, None] + (high - low)[:, None] * np.arange(SEARCH) / (SEARCH - 1)
        result, _, _ = follow(problem, fine, level, STRIDE / 2**level, False)
        last = np.sum(np.cumprod(result[:, kernels.STATUS] != Status.ITERATION_LIMIT, axis=0), axis=0) - 1
        good, at = last >= 0, np.maximum(last, 0)
        p11 = result[at, kernels.LEAST_P11, rows]
        bent |= good & ((p11 < NEARLY_BENT * gd) | (p11 < 0.5 * result[0, kernels.LEAST_P11]))
        high = np.where(good, fine[rows, np.minimum(last + 1, SEARCH - 1)], high)
        low = np.where(good, fine[rows, at], low)
    return low, bent


def _ascending(d: Array) -> tuple[Array, NDArray[np.intp]]:
    """Sorted distinct columns of d (B, N), and for each original column the place of its value.

    Columns are sorted by their first row: every film sees the same order, since films differ by small shifts at most.
    """
    order = np.argsort(d[0], kind="stable")
    gap = np.any(np.diff(d[:, order], axis=1) > 0, axis=0)
    place = np.concatenate([[0], np.cumsum(gap)])
    back = np.empty(order.size, np.intp)
    back[order] = place
    firsts = order[np.concatenate([[True], gap])]
    return d[:, firsts], back


def _curves(
    problem: Problem, result: Array, sens: Array | None, status: NDArray[np.int8], back: NDArray[np.intp], sign: Array
) -> Curves:
    """Undo the scaling and the sorting."""
    k = kernels
    result, status = result[back], status[back].T
    rho = problem.inner_radius / problem.prestretch[:, None]
    ok = status == Status.OK
    note = np.where(result[:, k.LEAST_P2].T < 0, Note.WRINKLED, 0) | np.where(result[:, k.SLACK].T <= 0, Note.SLACK, 0)

    def row(index: int, factor: Any = 1.0) -> Array:
        return np.where(ok, result[:, index].T * factor, np.nan)

    flat = sign == 0
    force = np.where(flat & ok, 0.0, row(k.FORCE, 2 * np.pi * rho) * sign)
    return Curves(
        deflection=problem.deflection,
        force=force,
        status=status,
        note=np.where(ok, note, 0).astype(np.int8),
        slope=row(k.SLOPE, 2 * np.pi),
        sensitivity=None if sens is None else np.moveaxis(sens[back], 2, 0) * (2 * np.pi * rho * sign)[:, :, None],
        variation=row(k.VARIATION),
        max_stretch=row(k.STRETCH),
        ellipticity=row(k.ELLIPTIC),
        convexity=row(k.CONVEX),
        energy=row(k.STORED, 2 * np.pi * rho**2),
    )
