"""The slow reference: shooting as a textbook writes it, with nothing but SciPy."""

from __future__ import annotations

import itertools
from typing import Literal

import numpy as np
from scipy.integrate import solve_bvp, solve_ivp
from scipy.optimize import root

from bayesmembrane.ground.parameters import Array
from bayesmembrane.physics.materials.base import Material

# Longest step of the continuation, in units of R1.
LONGEST = 0.7
MOST_CALLS = 5000


def rates(t: float | Array, y: Array, material: Material) -> Array:
    """d/dt of (l2, l1, th, h), t = ln(R/R1), lengths in units of R1; shapes (4,) or (4, M)."""
    l2, l1, th = y[0], y[1], y[2]
    _, p1, p2, p11, p12, _ = material.derivatives(material.vector, l1, l2)
    along = l1 * np.cos(th) - l2
    bend = (p2 * np.cos(th) - p1 - p12 * along) / p11
    return np.stack([along, bend, -np.sin(th) * p2 / p1, np.exp(t) * l1 * np.sin(th)])


def force_curve(
    material: Material,
    deflection: Array,
    inner_radius: float,
    outer_radius: float,
    rtol: float = 1e-10,
    method: Literal["DOP853", "RK45", "LSODA", "Radau"] = "DOP853",
) -> Array:
    """Forces (N,) in N at ascending deflections (N,) in m of a film without pre-stretch; nan from where it fails.

    ``scipy.integrate.solve_ivp`` from the disc and ``scipy.optimize.root`` on (l2 - 1, h - delta) at the ring, each
    point started from an extrapolation of the two before. Slow, and without safeguards: for comparison only.
    """
    span, forces = float(np.log(outer_radius / inner_radius)), np.full(len(deflection), np.nan)
    known: list[tuple[float, Array]] = []
    grid = np.asarray(deflection, dtype=float) / inner_radius
    path = [np.geomspace(min(0.3, grid[0]), grid[0], max(1, int(np.ceil(grid[0] / 0.4)))), grid]
    path += [np.linspace(a, b, int(np.ceil((b - a) / LONGEST)) + 1) for a, b in itertools.pairwise(grid)]

    def miss(x: Array, d: float) -> Array:
        calls = itertools.count()

        def across(t: float, y: Array) -> Array:
            slope = rates(t, y, material)
            # Where the film cannot go, `solve_ivp` would shorten its steps for ever.
            if next(calls) > MOST_CALLS or not np.all(np.isfinite(slope)):
                raise ArithmeticError
            return slope

        start = np.array([1.0, 1.0 + x[0] * d * d / (1 + d), x[1], 0.0])
        try:
            with np.errstate(all="ignore"):
                y = solve_ivp(across, (0.0, span), start, method=method, rtol=rtol, atol=rtol * 1e-3).y[:, -1]
        except ArithmeticError:
            return np.full(2, 1e3)
        return np.array([(y[0] - 1) / min(1.0, d * d), y[3] / d - 1])

    for d in np.unique(np.concatenate(path)):
        if len(known) < 2:
            guess = np.array([0.13, 0.56 * d]) if not known else known[-1][1] * [1.0, d / known[-1][0]]
        else:
            (d0, x0), (d1, x1) = known[-2:]
            guess = x1 + (x1 - x0) * (d - d1) / (d1 - d0)
        found = root(miss, guess, args=(d,), tol=rtol * 10)
        if np.max(np.abs(found.fun)) > 1e3 * rtol:
            break
        known.append((d, found.x))
        at = np.flatnonzero(grid == d)
        if at.size:
            l1, th = 1 + found.x[0] * d * d / (1 + d), found.x[1]
            p1 = material.tension(l1, 1.0)[0]
            forces[at] = 2 * np.pi * inner_radius * p1 * np.sin(th)
    return forces


def force_curve_bvp(
    material: Material, deflection: Array, inner_radius: float, outer_radius: float, tol: float = 1e-6
) -> Array:
    """The same forces by collocation (``scipy.integrate.solve_bvp``), each point started from the one before."""
    span, forces = np.log(outer_radius / inner_radius), np.full(len(deflection), np.nan)
    t = np.linspace(0, span, 21)
    y = np.stack([np.ones_like(t), 1.05 + 0.0 * t, 0.3 + 0.0 * t, 0.3 * np.expm1(t)])

    def across(t: Array, y: Array) -> Array:
        return rates(t, y, material)

    for i, d in enumerate(np.asarray(deflection, dtype=float) / inner_radius):

        def edges(a: Array, b: Array, d: float = d) -> Array:
            return np.array([a[0] - 1, b[0] - 1, a[3], b[3] - d])

        with np.errstate(all="ignore"):
            found = solve_bvp(across, edges, t, y, tol=tol, max_nodes=20000)
        if not found.success:
            break
        t, y = found.x, found.y
        p1 = material.tension(y[1, 0], 1.0)[0]
        forces[i] = 2 * np.pi * inner_radius * p1 * np.sin(y[2, 0])
    return forces


def contour(
    material: Material, lift: float, inner_radius: float, outer_radius: float, tol: float = 1e-7
) -> tuple[Array, Array]:
    """(radius, height above the ring) in m along the film whose disc is lifted by ``lift`` (m), by collocation.

    The lift grows in steps, each started from the one before. Raises `ArithmeticError` where it fails.
    """
    span = float(np.log(outer_radius / inner_radius))
    t, d = np.linspace(0, span, 41), lift / inner_radius
    first = min(0.5, d)
    y = np.stack([1.0 + 0.0 * t, 1.0 + 0.1 * first**2 + 0.0 * t, first / span * np.exp(-t), first * t / span])
    for step in np.linspace(first, d, max(1, int(np.ceil(d / 0.4)))):

        def edges(a: Array, b: Array, step: float = step) -> Array:
            return np.array([a[0] - 1, b[0] - 1, a[3], b[3] - step])

        with np.errstate(all="ignore"):
            found = solve_bvp(lambda s, v: rates(s, v, material), edges, t, y, tol=tol, max_nodes=20000)
        if not found.success:
            raise ArithmeticError(f"no shape at {1e3 * step * inner_radius:.3g} mm")
        t, y = found.x, found.y
    fine = np.linspace(0, span, 2001)
    l2, _, _, fallen = found.sol(fine)
    return inner_radius * np.exp(fine) * l2, lift - inner_radius * fallen
