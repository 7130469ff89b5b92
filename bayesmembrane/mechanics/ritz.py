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
from bayesmembrane.mechanics.problem import Problem
from bayesmembrane.mechanics.solution import Curves, Note, Status
from bayesmembrane.parameters import Array

LANES = kernels.LANES
# Elements x bubbles per element, tried in this order until R P1 sin(theta) is even enough.
LEVELS = ((1, 6), (2, 6), (4, 7), (8, 8), (24, 8))
VARIATION_LIMIT = 1e-4
TOLERANCE = 1e-11
MOST_ITERATIONS = 40
# Largest step of the continuation in asinh(d), and the first deflection reached from the flat film.
STRIDE = 0.8
FIRST = 0.4


@dataclass(frozen=True)
class Basis:
    """Shape functions on t in [0, T], sampled at G Gauss points and, last, at the two edges."""

    tables: tuple[Any, ...]
    points: Array

    @property
    def functions(self) -> int:
        return int(self.tables[0].shape[0])


@cache
def basis(ratio: float, elements: int, bubbles: int) -> Basis:
    """Hats and integrated Legendre bubbles over equal elements in t = ln(R/R1), for R2/R1 = ``ratio``."""
    span = np.log(ratio)
    nodes, weights = legendre.leggauss(bubbles + 3)
    local = np.concatenate([nodes, [-1.0, 1.0]])
    length = span / elements
    per, n = bubbles + 1, elements * (bubbles + 1) - 1
    gauss = elements * nodes.size
    points, weight = np.empty(gauss + 2), np.empty(gauss)
    phi, slope = np.zeros((n, gauss + 2)), np.zeros((n, gauss + 2))
    first, last = np.zeros(gauss + 2, np.int64), np.zeros(gauss + 2, np.int64)
    value, rate = _bubbles(local, bubbles)
    hat = 0.5 * (1 + local)
    for e in range(elements):
        columns = list(range(e * nodes.size, (e + 1) * nodes.size))
        rows = [-1] * len(columns)
        if e == 0:
            columns.append(gauss)
            rows.append(local.size - 2)
        if e == elements - 1:
            columns.append(gauss + 1)
            rows.append(local.size - 1)
        pick = np.array([*range(nodes.size), *(r for r in rows if r >= 0)])
        points[columns] = (e + 0.5 * (1 + local[pick])) * length
        weight[e * nodes.size : (e + 1) * nodes.size] = weights * length / 2
        start = e * per
        phi[start : start + bubbles, columns] = value[:, pick]
        slope[start : start + bubbles, columns] = rate[:, pick] * 2 / length
        if e > 0:
            phi[start - 1, columns] = 1 - hat[pick]
            slope[start - 1, columns] = -1 / length
        if e < elements - 1:
            phi[start + bubbles, columns] = hat[pick]
            slope[start + bubbles, columns] = 1 / length
        first[columns] = max(start - 1, 0)
        last[columns] = min(start + bubbles + 1, n)
    low = np.arange(2 * n)
    for a, b in zip(first, last, strict=True):
        low[2 * a : 2 * b] = np.minimum(low[2 * a : 2 * b], 2 * a)
    growth = np.exp(points)
    weight = weight * growth[:gauss] ** 2
    active = (first[None, :gauss] <= np.arange(n)[:, None]) & (np.arange(n)[:, None] < last[None, :gauss])
    start, stop = active.argmax(1), gauss - active[:, ::-1].argmax(1)
    width = int(np.max(np.arange(2 * n) - low)) + 1
    floats = (phi, phi + slope, slope / growth, 1 / (span * growth), growth, weight)
    return Basis((*(np.ascontiguousarray(x) for x in floats), first, last, start, stop, low, width), points)


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
    chain = (k.states, k.assemble, k.factorise, k.backsolve, k.predict, k.examine, k.force_sensitivity, k.decide, k.follow)
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
    material, count = problem.material, problem.parameters.shape[0]
    shape = basis(problem.ratio, *LEVELS[level])
    path = _path(d, stride)
    blocks = -(-count // LANES)
    pad = np.minimum(np.arange(blocks * LANES), count - 1)
    p, l0, grid = problem.parameters[pad].T, problem.prestretch[pad], path.grid[:, pad]
    gd = np.broadcast_to(np.asarray(material.shear_modulus(p), dtype=float), l0.shape)
    fields, m, wanted = p.shape[0], path.grid.shape[0], int(path.keep.sum())
    result = np.empty((wanted, 12, blocks * LANES))
    sens = np.empty((wanted if sensitivities else 0, fields, blocks * LANES))
    states = np.empty((wanted if trace else 0, 2 * shape.functions, blocks * LANES))
    run = compiled(material).follow
    out, out_sens = np.empty((12 * m, LANES)), np.empty((fields * m if sensitivities else 0, LANES))
    out_trace = np.empty((2 * shape.functions * m if trace else 0, LANES))
    for block in range(blocks):
        at = slice(block * LANES, (block + 1) * LANES)
        rows = (np.ascontiguousarray(v) for v in (p[:, at], gd[None, at], l0[None, at], grid[:, at]))
        q = np.zeros((2 * shape.functions, LANES))
        run(*rows, q, shape.tables, MOST_ITERATIONS, TOLERANCE, sensitivities, path.keep, out, out_sens, out_trace)
        result[..., at] = out.reshape(m, 12, LANES)[path.keep]
        if sensitivities:
            sens[..., at] = out_sens.reshape(m, fields, LANES)[path.keep]
        if trace:
            states[..., at] = out_trace.reshape(m, -1, LANES)[path.keep]
    return result[..., :count], sens[..., :count], states[..., :count]


def judge(result: Array) -> NDArray[np.int8]:
    """Status codes (N, B) from kernel results (N, 12, B): what converged is tested, what did not is explained."""
    k = kernels
    status = result[:, k.STATUS].astype(np.int8)
    bent = ~(result[:, k.ELLIPTIC] > 0)
    status[bent & (status != Status.LOCKED)] = Status.NOT_ELLIPTIC
    rough = ~(result[:, k.VARIATION] <= VARIATION_LIMIT)
    status[(status == Status.OK) & rough] = Status.UNRESOLVED
    return status


def solve(problem: Problem, sensitivities: bool = False) -> Curves:
    """Force curves from the minimum of the stored energy,

        F = dE/d(delta),  E(delta) = min over the deformation of 2 pi int R^2 W dt.

    Every film is first tried with six polynomials over the whole width; films in which R P1 sin(theta) varies by more
    than `VARIATION_LIMIT`, or that did not converge, are tried again with more and shorter elements and shorter
    continuation steps. What is left is flagged.
    """
    sign = np.sign(problem.deflection)
    d, back = _ascending(np.where(sign == 0, 1e-4, problem.scaled))
    locked = d >= locking_deflection(_extensibility(problem), problem.prestretch, problem.ratio)[:, None]
    # A locked deflection is replaced by the last one that can be reached; its answer is not used.
    reach = np.max(np.where(locked, 0.0, d), axis=1, keepdims=True)
    stop = np.where(locked, np.where(reach > 0, reach, 1e-3), d)
    count, n = d.shape
    result = np.full((n, 12, count), np.nan)
    sens = np.full((n, problem.parameters.shape[1], count), np.nan) if sensitivities else np.empty((0, 0, count))
    status = np.full((n, count), Status.ITERATION_LIMIT, np.int8)
    todo = np.arange(count)
    for level in range(len(LEVELS)):
        part = replace(problem, parameters=problem.parameters[todo], prestretch=problem.prestretch[todo])
        new, new_sens, _ = follow(part, stop[todo], level, STRIDE / 2**level, sensitivities)
        verdict = judge(new)
        better = ~np.isin(status[:, todo], (Status.OK,))
        result[:, :, todo] = np.where(better[:, None], new, result[:, :, todo])
        if sensitivities:
            sens[..., todo] = np.where(better[:, None], new_sens, sens[..., todo])
        status[:, todo] = np.where(better, verdict, status[:, todo])
        again = np.any((status[:, todo] != Status.OK) & ~locked[todo].T, axis=0)
        todo = todo[again]
        if todo.size == 0:
            break
    status[locked.T] = Status.LOCKED
    return _curves(problem, result, sens if sensitivities else None, status, back, sign)


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


def _extensibility(problem: Problem) -> Array:
    bound = problem.material.extensibility(problem.parameters.T)
    return np.broadcast_to(np.asarray(bound, dtype=float), problem.prestretch.shape)


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
